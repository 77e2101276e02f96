"""Linear elasticity with eighteen assumed stresses (Pian and Tong), hexahedron.

Cells: hex8
Source: Pian and Tong (1986), IJNME 22, 173-181; Pian and Sumihara (1984), IJNME 20, 1685-1695.
Benchmark: pure bending of one layer of cells, exact.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def pian_tong(m: Fields) -> None:
    """Hellinger and Reissner: stress : strain less the complementary energy."""
    if m.dimension < 3:
        raise ModelError("pian_tong is for hexahedra; in the plane take pian_sumihara")
    u, b = m.vector("u"), m.internal("b", 18)
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio")
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2))
    J = m.centroid(m.jacobian)
    x, y, z = m.parent
    stress = sp.Matrix([[b[0], b[3], b[5]], [b[3], b[1], b[4]], [b[5], b[4], b[2]]])
    along = (
        b[6] * y + b[7] * z + b[8] * y * z,
        b[9] * x + b[10] * z + b[11] * x * z,
        b[12] * x + b[13] * y + b[14] * x * y,
    )
    xy, yz, xz = b[15] * z, b[16] * x, b[17] * y
    natural = sp.Matrix([[along[0], xy, xz], [xy, along[1], yz], [xz, yz, along[2]]])
    stress += J * natural * J.T
    gradient = m.grad(u)
    strain = (gradient + gradient.T) / 2
    complementary = (1 + nu) / (2 * E) * (stress * stress).trace()
    complementary -= nu / (2 * E) * stress.trace() ** 2
    m.minimise((stress * strain).trace() - complementary)
    parts = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
    m.fields(**{f"sigma_{name}": stress[position] for name, position in parts.items()})
