"""Ductile damage of Lemaitre with plasticity of von Mises, small strain, local.

Source: Lemaitre (1985), J. Engineering Materials and Technology 107, 83-89.
Benchmark: tension with linear hardening, damage by the integral of (Y / S)^s over the flow.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def damage(m: Material) -> None:
    """Radial return of the effective stress; dD = (Y / S)^s dp, implicit in time."""
    E, nu, sy, H, S, s_, D_c = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        sy="yield stress [MPa]",
        H="isotropic hardening modulus [MPa]",
        S="strength of damage [MPa]",
        s="exponent of damage",
        D_c="largest damage, below 1",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), sy > 0, H >= 0, S > 0, D_c < 1)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    old = m.point_data(
        **{f"p_{n}": "plastic strain" for n in NAMES}, alpha="its amount", D="damage"
    )
    v, alpha, D_old = old[:6], old[6], old[7]
    p = sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])
    volume = m.strain.trace()
    trial = m.define("trial", 2 * G * (m.strain - volume / 3 * sp.eye(3) - p))
    q = m.define("q", m.norm(list(trial)) * sp.sqrt(sp.Rational(3, 2)))
    excess = m.define("excess", q - sy - H * alpha)
    yields = excess > 0
    dp = m.define("dp", sp.Piecewise((excess / (3 * G + H), yields), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dp / (2 * q), yields), (0, True)))
    # energy release rate of the effective stress after the step
    Y = m.define("Y", (sy + H * (alpha + dp)) ** 2 / (6 * G) + K * volume**2 / 2)
    more = sp.Piecewise((dp * (Y / S) ** s_, yields), (0, True))
    D = m.define("D_new", sp.Min(D_old + more, D_c))
    m.stress((1 - D) * (K * volume * sp.eye(3) + (1 - 2 * G * flow) * trial))
    new = p + flow * trial
    parts = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.fields(damage=D, plastic_strain=alpha + dp)
    m.history(**{f"p_{n}": a for n, a in zip(NAMES, parts, strict=True)}, alpha=alpha + dp, D=D)
