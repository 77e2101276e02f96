"""Plane solids for the tests of studies: pages as a user would write them."""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes


def solid() -> Definition:
    """Compressible neo-Hookean solid in plane strain, 4 nodes."""
    m = Model("solid", nodes=4, rule=quadrature.gauss(2, 2), unroll=True)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    (thickness,) = m.data(thickness="thickness [mm]")
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    W = mu / 2 * ((F.T * F).trace() - 2 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2
    m.potential(m.integral("Pi", thickness * W * e.detJ))
    P = m.derivative("P", W, F)
    sigma = P * F.T / J
    m.fields(J=J, sigma_xx=sigma[0, 0], sigma_yy=sigma[1, 1], sigma_xy=sigma[0, 1])
    return m.finish()


def follower() -> Definition:
    """Pressure on the deformed side, 2 nodes, the solid on the left of its direction."""
    m = Model("follower", nodes=2, rule=quadrature.gauss(1, 1), unroll=True)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    (pressure,) = m.parameters(pressure="[MPa]")
    x = [[a + b for a, b in zip(X[c], u[c], strict=True)] for c in (0, 1)]
    dx, dy = x[0][1] - x[0][0], x[1][1] - x[1][0]
    mean = [(u[c][0] + u[c][1]) / 2 for c in (0, 1)]
    m.weak_form([(pressure * dy / 2, mean[0]), (-pressure * dx / 2, mean[1])])  # weight 2
    return m.finish()


def floor() -> Definition:
    """A node on a penalty floor at Y = 0."""
    m = Model("floor", nodes=1, rule=quadrature.point_rule(), unroll=True)
    ((_x,), (Y,)) = m.coordinates("X", "Y")
    ((_u,), (v,)) = m.nodal_unknowns("u_x", "u_y", idle=["u_x"])
    (k,) = m.parameters(k="stiffness [N/mm]")
    gap = m.define("gap", Y + v)
    m.potential(sp.Piecewise((k / 2 * gap**2, gap < 0), (0, True)))
    return m.finish()


def mean_pressure() -> Definition:
    """The solid's volume by a pressure of the cell: an unknown without a node."""
    m = Model("mean_pressure", nodes=4, rule=quadrature.gauss(2, 2), unroll=True)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    p = m.unknown("p")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    W = mu / 2 * ((F.T * F).trace() - 2 - 2 * sp.log(J)) + p * (J - 1) - p**2 / (2 * kappa)
    m.potential(m.integral("Pi", W * e.detJ))
    return m.finish()
