"""Cahn and Hilliard's equation of a mixture that separates, 4 nodes."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def cahn_hilliard() -> Definition:
    """dc/dt = div(grad mu), mu = c^3 - c - eps^2 div(grad c)."""
    cell = element("quad4")
    m = Model("cahn_hilliard", nodes=4, rule=cell.rule)
    X = m.coordinates("X", "Y")
    c, mu = m.nodal_unknowns("c", "mu")
    (eps,) = m.parameters(eps="width of the interface")
    (rate,) = m.rates("c")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    N, dN = sp.Matrix(cell.shape(*m.point())), sp.Matrix(e.dN)
    here, potential = (m.define(n, N.dot(sp.Matrix(v))) for n, v in (("c_x", c), ("mu_x", mu)))
    slope, push = (m.define(n, dN.T * sp.Matrix(v)) for n, v in (("dc", c), ("dmu", mu)))
    terms = [(N.dot(sp.Matrix(rate)), potential), (potential + here - here**3, here)]
    terms += [(push[i], push[i]) for i in (0, 1)]
    terms += [(-(eps**2) * slope[i], slope[i]) for i in (0, 1)]
    m.weak_form([(factor * e.detJ, varied) for factor, varied in terms])
    energy = (here**2 - 1) ** 2 / 4 + eps**2 / 2 * slope.dot(slope)
    m.fields(mass=here * e.detJ, energy=energy * e.detJ)
    return m.finish()
