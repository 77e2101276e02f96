"""Viscoplasticity of Perzyna with the yield function of von Mises, small strain.

Source: Perzyna (1966), Advances in Applied Mechanics 9, 243-377.
Benchmark: tension at a constant rate, sy (1 + (rate / rate_0)^(1 / n)).
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def perzyna(m: Material) -> None:
    """Rate of the plastic strain rate_0 <q / limit - 1>^n; implicit in time."""
    E, nu, sy, H, n, rate_0, dt = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        sy="yield stress [MPa]",
        H="hardening modulus [MPa]",
        n="exponent",
        rate_0="rate at twice the limit [1/s]",
        dt="step [s]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), sy > 0, n >= 1, rate_0 > 0)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    old = m.point_data(**{f"p_{name}": "plastic strain" for name in NAMES}, alpha="amount")
    v, alpha = old[:6], old[6]
    p = sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])
    volume = m.strain.trace()
    s = m.define("s", 2 * G * (m.strain - volume / 3 * sp.eye(3) - p))
    q = m.define("q", m.norm(list(s)) * sp.sqrt(sp.Rational(3, 2)))
    yields = m.define("excess", q - sy - H * alpha) > 0

    # unknown: the overstress x = q / limit - 1 after the step, with amount rate_0 dt x^n
    def balance(x: sp.Expr) -> sp.Expr:
        d = rate_0 * dt * x**n
        stress = q - 3 * G * d - (1 + x) * (sy + H * (alpha + d))
        return sp.Piecewise((stress / sy, yields), (x, True))

    start = sp.Piecewise((q / (sy + H * alpha) - 1, yields), (0, True))
    x = m.implicit("x", balance, start=start, iterations=50)
    d = m.define("d", sp.Piecewise((rate_0 * dt * x**n, yields), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * d / (2 * q), yields), (0, True)))
    m.stress(K * volume * sp.eye(3) + (1 - 2 * G * flow) * s)
    new = p + flow * s
    parts = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.fields(plastic_strain=alpha + d)
    m.history(**{f"p_{name}": a for name, a in zip(NAMES, parts, strict=True)}, alpha=alpha + d)
