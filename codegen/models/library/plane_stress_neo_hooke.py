"""Neo-Hooke in plane stress: the stretch across the sheet is a local unknown of every point.

Cells: tri3, tri6, quad4, quad8, quad9
Source: Holzapfel (2000), Nonlinear Solid Mechanics, chapter 6.
Benchmark: strip pulled between wide clamps, force (Treloar's pure shear).
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def plane_stress_neo_hooke(m: Fields) -> None:
    """mu / 2 (J^(-2/3) I1 - 3) + kappa / 4 (J^2 - 1 - 2 ln J), no stress across."""
    if m.geometry == "axisymmetric":
        raise ModelError("plane_stress_neo_hooke has no hoop strain: it is for bodies in the plane")
    u = m.vector("u")
    mu, kappa, t = m.parameters(
        mu="shear modulus [MPa]", kappa="bulk modulus [MPa]", t="undeformed thickness [mm]"
    )
    m.require(mu > 0, kappa > 0, t > 0)
    F = m.deformation_gradient(u)[:2, :2]
    area = m.define("area", F.det())
    square = m.define("square", (F.T * F).trace())

    def energy(s: sp.Expr) -> sp.Expr:
        J = area * s
        W = mu / 2 * ((square + s**2) * J ** sp.Rational(-2, 3) - 3)
        return W + kappa / 4 * (J**2 - 1 - 2 * sp.log(J))

    s = m.implicit("s", lambda s: m.derivative("across", energy(s), s), start=1 / area)
    m.minimise(t * energy(s))
    J = area * s
    deviator = F * F.T - (square + s**2) / 3 * sp.eye(2)
    stress = mu * J ** sp.Rational(-5, 3) * deviator + kappa / 2 * (J - 1 / J) * sp.eye(2)
    sigma = {"sigma_xx": stress[0, 0], "sigma_yy": stress[1, 1], "sigma_xy": stress[0, 1]}
    m.fields(stretch_across=s, J=J, **sigma, sigma_zz=0)
