"""Plasticity of von Mises at small strain, with linear isotropic and kinematic hardening.

Source: Simo and Hughes (1998), Computational Inelasticity, box 3.2.
Benchmark: tension and reversed loading, stress on the straight lines of hardening.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


def tensor(v: list[sp.Expr]) -> sp.Matrix:
    """Symmetric matrix of its components in the order of NAMES."""
    return sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])


@material
def j2(m: Material) -> None:
    """Radial return, in closed form."""
    E, nu, sy, H, H_kin = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        sy="yield stress [MPa]",
        H="isotropic hardening modulus [MPa]",
        H_kin="kinematic hardening modulus [MPa]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), sy > 0, H >= 0, H_kin >= 0)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    old = m.point_data(**{f"p_{n}": "plastic strain" for n in NAMES}, alpha="equivalent one")
    p, alpha = tensor(old[:6]), old[6]
    volume = m.strain.trace()
    e = m.strain - volume / 3 * sp.eye(3) - p
    # deviatoric stress less the back stress, 2 H_kin / 3 times the plastic strain
    xi = m.define("xi", 2 * G * e - 2 * H_kin / 3 * p)
    q = m.define("q", m.norm(list(xi)) * sp.sqrt(sp.Rational(3, 2)))
    excess = m.define("excess", q - sy - H * alpha)
    yields = excess > 0
    dg = m.define("dg", sp.Piecewise((excess / (3 * G + H + H_kin), yields), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), yields), (0, True)))
    m.stress(K * volume * sp.eye(3) + 2 * G * (e - flow * xi))
    new = p + flow * xi
    parts = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.fields(plastic_strain=alpha + dg)
    m.history(**{f"p_{n}": v for n, v in zip(NAMES, parts, strict=True)}, alpha=alpha + dg)
