"""Ideal dielectric elastomer: neo-Hooke with an electric potential.

Cells: hex8, hex27, tet10, quad9
Source: Suo (2010), Acta Mechanica Solida Sinica 23, 549-578; Zhao and Suo (2007).
Benchmark: pull-in of a free film, nominal field 0.6874 sqrt(mu / permittivity).
"""

import sympy as sp

from softehl import Fields, page


@page
def dielectric(m: Fields) -> None:
    """Elastic energy less permittivity / 2 J E . E of the true field E = -F^-T grad phi."""
    u, phi = m.vector("u"), m.scalar("phi")
    mu, kappa, permittivity = m.parameters(
        mu="shear modulus [MPa]", kappa="bulk modulus [MPa]", permittivity="[N/V2]"
    )
    m.require(mu > 0, kappa > 0, permittivity > 0)
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    gradient = sp.zeros(3, 1)
    gradient[: len(u), 0] = m.grad(phi)
    field = -(F.adjugate() / J).T * gradient
    W = mu / 2 * (J ** sp.Rational(-2, 3) * (F.T * F).trace() - 3)
    W += kappa / 4 * (J**2 - 1 - 2 * sp.log(J))
    m.minimise(W - permittivity / 2 * J * field.dot(field))
    m.fields(J=J)
