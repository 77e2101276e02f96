"""Linear elasticity in plane stress.

Cells: tri3, tri6, quad4, quad8, quad9
Source: Timoshenko and Goodier (1970), Theory of Elasticity, chapter 2.
Benchmark: ring under inner pressure, displacement of its inner side (Lame).
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def plane_stress(m: Fields) -> None:
    """Energy of an area: t E / (2 (1 - nu^2)) ((1 - nu) strain : strain + nu (tr strain)^2)."""
    if m.geometry == "axisymmetric":
        raise ModelError("plane_stress has no hoop strain: it is for bodies in the plane")
    u = m.vector("u")
    E, nu, t = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio", t="thickness [mm]")
    m.require(E > 0, nu > -1, nu <= sp.Rational(1, 2), t > 0)
    gradient = m.grad(u)[:2, :2]
    strain = (gradient + gradient.T) / 2
    stiffness = E / (1 - nu**2)
    m.minimise(t * stiffness / 2 * ((1 - nu) * (strain**2).trace() + nu * strain.trace() ** 2))
    stress = stiffness * ((1 - nu) * strain + nu * strain.trace() * sp.eye(2))
    across = -nu / E * stress.trace()
    sigma = {"sigma_xx": stress[0, 0], "sigma_yy": stress[1, 1], "sigma_xy": stress[0, 1]}
    m.fields(**sigma, sigma_zz=0, strain_across=across)
