"""An elastic block in plane strain, small strains: 4 nodes, one volume change a cell."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def block() -> Definition:
    """W = G dev e : dev e + K / 2 (mean of tr e over the cell)^2."""
    cell = element("quad4")
    m = Model("block", nodes=4, rule=cell.rule)
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    grad = kinematics.deformation_gradient(m, e.dN, u) - sp.eye(2)
    strain = sp.diag((grad + grad.T) / 2, 0)
    area = m.integral("area", e.detJ)
    mean = m.integral("change", strain.trace() * e.detJ) / area
    s = strain - strain.trace() / 3 * sp.eye(3)
    m.potential(m.integral("shear", G * (s * s).trace() * e.detJ) + K / 2 * mean**2 * area)
    return m.finish()
