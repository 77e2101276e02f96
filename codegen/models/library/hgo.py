"""Arteries: neo-Hooke with two families of fibres that are dispersed.

Source: Gasser, Ogden and Holzapfel (2006), J. Royal Society Interface 3, 15-35.
Benchmark: equibiaxial stretch of an incompressible sheet, stress.
"""

import sympy as sp

from softehl import Material, material


@material
def hgo(m: Material) -> None:
    """Fibres in the x-y plane at +- angle to x; they carry tension alone."""
    mu, kappa, k1, k2, d, angle = m.parameters(
        mu="shear modulus of the matrix [MPa]",
        kappa="bulk modulus [MPa]",
        k1="stiffness of the fibres [MPa]",
        k2="their exponent",
        dispersion="0: all fibres along the angle, 1/3: none preferred",
        angle="angle of the families to x [rad]",
    )
    m.require(mu > 0, kappa > 0, k1 >= 0, k2 > 0, d >= 0, d <= sp.Rational(1, 3))
    J = m.define("J", m.F.det())
    C = m.define("C", J ** sp.Rational(-2, 3) * m.F.T * m.F)
    I1 = m.define("I1", C.trace())
    W = mu / 2 * (I1 - 3) + kappa / 4 * (J**2 - 1 - 2 * sp.log(J))
    for k, sign in enumerate((1, -1)):
        a = sp.Matrix([sp.cos(angle), sign * sp.sin(angle), 0])
        stretch = (a.T * C * a)[0, 0]
        strain = m.define(f"strain_{k}", d * (I1 - 3) + (1 - 3 * d) * (stretch - 1))
        taut = k1 / (2 * k2) * (sp.exp(k2 * strain**2) - 1)
        W += sp.Piecewise((taut, strain > 0), (0, True))
    m.energy(W)
