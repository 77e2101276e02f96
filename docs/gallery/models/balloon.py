"""A thick sphere of incompressible Mooney-Rivlin rubber that stays a sphere, and gas in it."""

import sympy as sp

from softehl import Definition, Model, element, kinematics, quadrature


def balloon() -> Definition:
    """W = c1 (I1 - 3) + c2 (I2 - 3) + p (J - 1): u quadratic, p linear along the radius."""
    cell, ends = element("line3"), element("line2")
    m = Model("balloon", nodes=3, rule=quadrature.gauss(3, 1))
    X = m.coordinates("R")
    (u,) = m.nodal_unknowns("u")
    (p,) = m.nodal_unknowns("p", nodes=2)
    c1, c2 = m.parameters(c1="Mooney's first constant [MPa]", c2="his second [MPa]")
    (xi,) = m.point()
    e = kinematics.isoparametric(m, X, cell.gradient(xi))
    R, at = (sp.Matrix(cell.shape(xi)).dot(sp.Matrix(nodal)) for nodal in (X[0], u))
    around = m.define("around", 1 + at / R)
    along = m.define("along", 1 + sp.Matrix(e.dN).dot(sp.Matrix(u)))
    pressure = sp.Matrix(ends.shape(xi)).dot(sp.Matrix(p))
    I1 = along**2 + 2 * around**2
    I2 = around**4 + 2 * along**2 * around**2
    W = c1 * (I1 - 3) + c2 * (I2 - 3) + pressure * (along * around**2 - 1)
    m.potential(m.integral("Pi", 4 * sp.pi * R**2 * W * e.detJ))
    return m.finish()


def gas() -> Definition:
    """Its pressure times the volume that it has gained."""
    m = Model("gas", nodes=1, rule=quadrature.point_rule())
    ((R,),) = m.coordinates("R")
    ((u,),) = m.nodal_unknowns("u")
    (pressure,) = m.parameters(pressure="of the gas [MPa]")
    m.potential(-pressure * 4 * sp.pi / 3 * ((R + u) ** 3 - R**3))
    return m.finish()
