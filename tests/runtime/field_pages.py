"""Pages of fields that several tests of the runtime stand on."""

from __future__ import annotations

from typing import Any

import sympy as sp

import softehl


@softehl.page
def rubber(m: Any) -> None:
    """Compressible neo-Hooke, its volume by (J - 1)^2."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)
    m.fields(J=J)


@softehl.page
def rubber_by_log(m: Any) -> None:
    """Compressible neo-Hooke, its volume by log(J)^2."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus", lame="Lame's first")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2)


@softehl.page
def mixed(m: Any) -> None:
    """Neo-Hooke with a pressure of its own, of lower order and without mass."""
    u, p = m.vector("u"), m.scalar("p", order=1)
    mu, K = m.parameters(mu="shear modulus", K="bulk modulus")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    W = mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J))
    m.minimise(W + p * (J - 1) - p**2 / (2 * K))
