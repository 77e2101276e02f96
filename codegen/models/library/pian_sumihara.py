"""Linear plane stress with five assumed stresses (Pian and Sumihara), four nodes.

Cells: quad4
Source: Pian and Sumihara (1984), IJNME 20, 1685-1695.
Benchmark: Cook's membrane, deflection of its corner for four meshes.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def pian_sumihara(m: Fields) -> None:
    """Hellinger and Reissner: stress : strain less the complementary energy, times t."""
    if m.geometry == "axisymmetric":
        raise ModelError("pian_sumihara has no hoop strain: it is for bodies in the plane")
    u, b = m.vector("u"), m.internal("b", 5)
    E, nu, t = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio", t="thickness [mm]")
    m.require(E > 0, nu > -1, nu <= sp.Rational(1, 2), t > 0)
    J = m.centroid(m.jacobian)
    xi, eta = m.parent
    along, across = J[:, 0] * J[:, 0].T, J[:, 1] * J[:, 1].T  # g_1 g_1, g_2 g_2
    constant = sp.Matrix([[b[0], b[2]], [b[2], b[1]]])
    stress = constant + b[3] * eta * along + b[4] * xi * across
    gradient = m.grad(u)[:2, :2]
    strain = (gradient + gradient.T) / 2
    complementary = (1 + nu) / (2 * E) * (stress * stress).trace()
    complementary -= nu / (2 * E) * stress.trace() ** 2
    m.minimise(t * ((stress * strain).trace() - complementary))
    m.fields(sigma_xx=stress[0, 0], sigma_yy=stress[1, 1], sigma_zz=0, sigma_xy=stress[0, 1])
