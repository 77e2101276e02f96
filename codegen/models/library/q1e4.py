"""Linear elasticity with enhanced strains: 4 modes in the plane, 9 in space (Q1E4, Q1E9).

Cells: quad4, hex8
Source: Simo and Rifai (1990), IJNME 29, 1595-1638.
Benchmark: pure bending of one layer of cells, exact.
"""

import sympy as sp

from softehl import Fields, ModelError, page

ENTRIES = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("yz", 1, 2), ("xz", 0, 2))


@page
def q1e4(m: Fields) -> None:
    """The gradient has modes of the cell beside those of u; they are condensed."""
    if m.geometry == "axisymmetric":
        raise ModelError("q1e4 has no hoop strain: it is for plane strain and space")
    u = m.vector("u")
    size = len(u)
    a = sp.Matrix(size, size, m.internal("a", size**2))
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio")
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2))
    J, centre = m.jacobian, m.centroid(m.jacobian)
    added = centre.det() / J.det() * a * sp.diag(*m.parent) * centre.inv()
    gradient = m.grad(u)[:size, :size] + added
    strain = (gradient + gradient.T) / 2
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    m.minimise(lame / 2 * strain.trace() ** 2 + mu * (strain.T * strain).trace())
    stress = lame * strain.trace() * sp.eye(3)
    stress[:size, :size] += 2 * mu * strain
    m.fields(**{f"sigma_{n}": stress[i, j] for n, i, j in ENTRIES})
