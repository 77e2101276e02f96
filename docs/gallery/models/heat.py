"""Heat in a bar, 2 nodes, and what its end radiates."""

import sympy as sp

from softehl import Definition, Model, element, kinematics, quadrature


def bar() -> Definition:
    """Capacity times dT/dt = d/dx (conductivity dT/dx)."""
    cell = element("line2")
    m = Model("bar", nodes=2, rule=quadrature.gauss(2, 1))
    X = m.coordinates("X")
    (T,) = m.nodal_unknowns("T")
    k, c = m.parameters(k="conductivity [W/(m K)]", c="capacity [J/(m^3 K)]")
    rate = m.rates("T")[0]
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    N = sp.Matrix(cell.shape(*m.point()))
    slope = m.define("slope", sp.Matrix(e.dN).dot(sp.Matrix(T)))
    here = m.define("here", N.dot(sp.Matrix(T)))
    m.weak_form([(k * slope * e.detJ, slope), (c * N.dot(sp.Matrix(rate)) * e.detJ, here)])
    return m.finish()


def radiation() -> Definition:
    """Stefan and Boltzmann: the end loses emissivity * 5.67e-8 * (T^4 - ambient^4)."""
    m = Model("radiation", nodes=1, rule=quadrature.point_rule())
    ((T,),) = m.nodal_unknowns("T")
    emissivity, ambient = m.parameters(emissivity="[1]", ambient="[K]")
    m.potential(emissivity * sp.Rational("5.67e-8") * (T**5 / 5 - ambient**4 * T))
    return m.finish()
