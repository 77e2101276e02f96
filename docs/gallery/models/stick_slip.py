"""A block in plane strain, and Coulomb's friction on a rigid floor below it."""

import sympy as sp

from softehl import Definition, Model, element, kinematics, quadrature


def block() -> Definition:
    """Hooke's law at small strain, 4 nodes."""
    cell = element("quad4")
    m = Model("block", nodes=4, rule=cell.rule)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    G, lame = m.parameters(G="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    grad = kinematics.deformation_gradient(m, e.dN, u) - sp.eye(2)
    strain = (grad + grad.T) / 2
    W = G * (strain * strain).trace() + lame / 2 * strain.trace() ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    return m.finish()


def floor() -> Definition:
    """Springs k against the floor; a tangential one whose foot slips at mu times the pressure."""
    m = Model("floor", nodes=2, rule=quadrature.gauss(2, 1))
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    k, mu = m.parameters(k="stiffness of the floor [MPa/mm]", mu="coefficient of friction")
    (foot,) = m.point_data(foot="where the tangential spring stands [mm]")
    (xi,) = m.point()
    N = element("line2").shape(xi)
    ux, uy = (m.define(f"at_{i}", sum(n * v for n, v in zip(N, u[i], strict=True))) for i in (0, 1))
    gap = -uy
    pressure = m.define("pressure", k * sp.Max(gap, 0))
    trial = m.define("trial", k * (ux - foot))
    traction = m.define("traction", sp.Max(-mu * pressure, sp.Min(trial, mu * pressure)))
    half = m.define("half", (X[0][1] - X[0][0]) / 2)
    m.weak_form([(-pressure * half, uy), (traction * half, ux)])
    m.fields(pressure=pressure, traction=traction, slip=foot)
    m.history(foot=ux - traction / k)
    return m.finish()


MODELS = [block, floor]
