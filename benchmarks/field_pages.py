"""Pages of fields whose two forms are compared: rubber, plasticity, viscosity, crystals."""

from __future__ import annotations

from typing import Any

import sympy as sp

import softehl
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.material import Material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


def symmetric(v: Any) -> sp.Matrix:
    """Matrix (3, 3) of six entries in the order of `NAMES`."""
    xx, yy, zz, xy, yz, xz = v
    return sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def entries(a: sp.Matrix) -> list[Any]:
    """The six entries of a symmetric matrix."""
    return [a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[1, 2], a[0, 2]]


@softehl.material
def neo_hooke(m: Material) -> None:
    """Compressible neo-Hooke."""
    mu, K = m.parameters(mu="shear modulus", K="bulk modulus")
    J = m.define("J", m.F.det())
    m.energy(mu / 2 * ((m.F.T * m.F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)


@softehl.material
def plastic(m: Material) -> None:
    """J2 plasticity of small strains with linear hardening, by radial return."""
    G, K, H, limit = m.parameters(G="shear modulus", K="bulk modulus", H="hardening", limit="yield")
    old = m.point_data(**{f"p_{name}": "plastic strain" for name in NAMES}, a_old="hardening")
    strain = m.define("elastic", m.strain - symmetric(old[:6]))
    trial = m.define("trial", 2 * G * (strain - sp.eye(3) * strain.trace() / 3))
    size = m.define("size", m.norm(trial))
    root = sp.sqrt(sp.Rational(2, 3))
    excess = m.define("excess", size - root * (limit + H * old[6]))
    flow = sp.Piecewise((excess / (2 * G + 2 * H / 3), excess > 0), (0, True))
    flow = m.define("flow", flow)
    normal = trial / sp.Piecewise((size, size > 0), (1, True))
    m.stress(K * strain.trace() * sp.eye(3) + trial - 2 * G * flow * normal)
    new = entries(symmetric(old[:6]) + flow * normal)
    m.history(**{f"p_{n}": v for n, v in zip(NAMES, new, strict=True)}, a_old=old[6] + root * flow)


@softehl.material
def viscous(m: Material) -> None:
    """Finite viscoelasticity with six local unknowns."""
    mu, K, G, tau, dt = m.parameters(
        mu="shear modulus", K="bulk modulus", G="second modulus", tau="time", dt="step"
    )
    old = m.point_data(**{f"V_{name}": "internal strain" for name in NAMES})
    C, J = m.define("C", m.F.T * m.F), m.define("J", m.F.det())

    def inverse(v: Any) -> sp.Matrix:
        V = sp.eye(3) + symmetric(v)
        return V.adjugate() / V.det()

    def flow(v: Any) -> list[Any]:
        change = C - (C * inverse(v)).trace() / 3 * (sp.eye(3) + symmetric(v))
        rows = zip(v, old, entries(change), strict=True)
        return [a - b - dt / tau * c for a, b, c in rows]

    v = m.implicit("V", flow, start=list(old), size=1e-3)
    V_inverse, C_inverse = m.define("Vi", inverse(v)), m.define("Ci", C.adjugate() / J**2)
    S = mu * (sp.eye(3) - C_inverse) + K * J * (J - 1) * C_inverse
    m.second_stress(S + G * (V_inverse - C_inverse))
    m.history(**{f"V_{n}": a for n, a in zip(NAMES, v, strict=True)})


PLANES = ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1))
LINES = ((0, 1, -1), (1, 0, -1), (1, -1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0))
SYSTEMS = [
    (s, n) for n in PLANES for s in LINES if sum(a * b for a, b in zip(s, n, strict=True)) == 0
]
"""The twelve slip systems of a cubic crystal: direction and normal."""


@softehl.material
def crystal(m: Material) -> None:
    """Viscous slip on twelve systems, twelve local unknowns."""
    mu, K, rate, limit, dt = m.parameters(
        mu="shear modulus", K="bulk modulus", rate="of slip", limit="slip resistance", dt="step"
    )
    old = m.point_data(**{f"g_{k}": "slip" for k in range(12)})
    schmid = [
        sp.Matrix(3, 3, lambda i, j, s=s, n=n: s[i] * n[j] + s[j] * n[i]) / (2 * sp.sqrt(6))
        for s, n in SYSTEMS
    ]

    def elastic(v: Any) -> sp.Matrix:
        return m.green - sum((a * P for a, P in zip(v, schmid, strict=True)), sp.zeros(3, 3))

    def flow(v: Any) -> list[Any]:
        T = 2 * mu * elastic(v)
        resolved = [sum(a * b for a, b in zip(T, P, strict=True)) for P in schmid]
        rows = zip(v, old, resolved, strict=True)
        return [a - b - dt * rate * (c / limit) ** 5 for a, b, c in rows]

    v = m.implicit("slip", flow, start=list(old), size=1e-6)
    E = m.define("Ee", elastic(v))
    m.second_stress(2 * mu * E + K * E.trace() * sp.eye(3))
    m.history(**{f"g_{k}": a for k, a in enumerate(v)})


@softehl.page
def fbar(m: Fields) -> None:
    """F-bar after de Souza Neto et al., 1996, neo-Hooke: the volume is that of the centroid."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus", K="bulk modulus")
    F = m.deformation_gradient(u)
    J, cofactor = m.define("J", F.det()), F.adjugate().T
    J0 = m.centroid(J)
    a = m.define("a", (J0 / J) ** sp.Rational(1, 3))
    m.weak(mu / a * (F - cofactor / (J * a**2)) + K * (J0 - 1) * cofactor, F)


MATERIALS = {law.name: law for law in (neo_hooke, plastic, viscous, crystal)}
PAGES = {name: law.page() for name, law in MATERIALS.items()} | {"fbar": fbar}
EXAMPLES = {
    "neo_hooke": (0.4, 0.9),
    "plastic": (0.4, 0.9, 0.1, 0.01),
    "viscous": (0.4, 0.9, 0.6, 2.0, 0.1),
    "crystal": (0.4, 0.9, 0.1, 0.05, 0.1),
    "fbar": (0.4, 0.9),
}
"""Values of the parameters."""
