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
    C = m.define("C", m.F.T * m.F)
    m.energy(m.principal("W", C, lambda a, b, c: mu / alpha * (a**alpha + b**alpha + c**alpha - 3)))
    m.energy(K / 2 * (J - 1) ** 2 - mu * sp.log(J))


@softehl.material
def hencky(m: Material) -> None:
    """Hencky's energy of the logarithmic strain."""
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    e = m.define("e", m.log(m.F.T * m.F) / 2)
    m.energy(mu * (e * e).trace() + K / 2 * e.trace() ** 2)


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
def j2(m: Material) -> None:
    """Von Mises plasticity with isotropic hardening, small strains: radial return."""
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    sy, H = m.parameters(sy="yield stress [MPa]", H="hardening modulus [MPa]")
    names = ("xx", "yy", "xy", "xz", "yz")
    old = m.point_data(**{f"p_{name}": "plastic strain" for name in names})
    (alpha,) = m.point_data(alpha="equivalent plastic strain")
    m.example(G=80, K=170, sy=0.5, H=10, alpha=0.01, **{f"p_{name}": 0.005 for name in names})
    xx, yy, xy, xz, yz = old
    p = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]])
    volume = m.strain.trace()
    s = m.define("s", 2 * G * (m.strain - volume / 3 * sp.eye(3) - p))
    q = m.define("q", sp.sqrt(sp.Rational(3, 2)) * m.norm(s))
    excess = m.define("excess", q - sy - H * alpha)
    dg = m.define("dg", sp.Piecewise((excess / (3 * G + H), excess > 0), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), excess > 0), (0, True)))
    m.stress(K * volume * sp.eye(3) + (1 - 2 * G * flow) * s)
    m.fields(mises=q - 3 * G * dg)
    new = p + flow * s
    places = ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))
    m.history(alpha=alpha + dg)
    m.history(**{f"p_{name}": new[k] for name, k in zip(names, places, strict=True)})


@softehl.material
def turned(m: Material) -> None:
    """An energy that changes when the body rotates."""
    (k,) = m.parameters(k="stiffness [MPa]")
    m.energy(k * (m.F[0, 1] ** 2 + m.F.trace() ** 2))
