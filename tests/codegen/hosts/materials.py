"""Materials as pages write them."""

from __future__ import annotations

import sympy as sp

import softehl
from softehl.codegen.language.material import Material


@softehl.material
def neo(m: Material) -> None:
    """Compressible neo-Hooke."""
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    J = m.define("J", m.F.det())
    m.energy(mu / 2 * ((m.F.T * m.F).trace() - 3 - 2 * sp.log(J)))
    m.energy(K / 2 * (J - 1) ** 2)


@softehl.material
def ogden_1(m: Material) -> None:
    """Ogden's rubber with one term."""
    mu, alpha, K = m.parameters(mu="modulus [MPa]", alpha="exponent", K="bulk modulus [MPa]")
    J = m.define("J", m.F.det())
    m.energy(m.principal("W", lambda a, b, c: mu / alpha * (a**alpha + b**alpha + c**alpha - 3)))
    m.energy(K / 2 * (J - 1) ** 2 - mu * sp.log(J))


@softehl.material
def fluid(m: Material) -> None:
    """A law without energy: its modulus is not symmetric."""
    k, a = m.parameters(k="stiffness [MPa]", a="anisotropy")
    J = m.define("J", m.F.det())
    inverse = m.define("inverse", m.F.adjugate() / J)
    B = m.F * m.F.T
    tau = k * (B - sp.eye(3)) + a * J * B
    m.stress(tau * inverse.T)


@softehl.material
def hooke(m: Material) -> None:
    """Linear elasticity."""
    G, lame = m.parameters(G="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    m.energy(G * (m.strain * m.strain).trace() + lame / 2 * m.strain.trace() ** 2)


@softehl.material
def turned(m: Material) -> None:
    """An energy that changes when the body rotates."""
    (k,) = m.parameters(k="stiffness [MPa]")
    m.energy(k * (m.F[0, 1] ** 2 + m.F.trace() ** 2))
