"""Plasticity of von Mises at large strain: logarithmic strain, Voce's and linear hardening.

Source: Simo (1992), CMAME 99, 61-112; de Souza Neto et al. (2008), chapter 14.
Benchmark: tension to 1.2 times the length, Kirchhoff stress on the hardening curve.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def hencky_j2(m: Material) -> None:
    """Trial state by C_p^-1; flow by the exponential map, which keeps the plastic volume."""
    E, nu, sy, Q, b, H = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        sy="yield stress [MPa]",
        Q="saturated part of the hardening [MPa]",
        b="rate of its saturation",
        H="linear hardening modulus [MPa]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), sy > 0, Q >= 0, b >= 0, H >= 0)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    old = m.point_data(**{f"c_{n}": "C_p^-1 less 1" for n in NAMES}, alpha="plastic strain")
    v, alpha = old[:6], old[6]
    c = sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]]) + sp.eye(3)
    trial = m.define("b_trial", m.F * c * m.F.T)
    e = m.define("e", m.log(trial) / 2)
    volume = m.define("volume", e.trace())
    s = m.define("s", 2 * G * (e - volume / 3 * sp.eye(3)))
    q = m.define("q", m.norm(list(s)) * sp.sqrt(sp.Rational(3, 2)))

    def limit(a: sp.Expr) -> sp.Expr:
        return sy + Q * (1 - sp.exp(-b * a)) + H * a

    yields = m.define("excess", q - limit(alpha)) > 0
    dg = m.implicit(
        "dg",
        lambda g: sp.Piecewise((q - 3 * G * g - limit(alpha + g), yields), (g, True)),
        start=sp.Integer(0),
    )
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), yields), (0, True)))
    tau = K * volume * sp.eye(3) + (1 - 2 * G * flow) * s
    back = m.F.adjugate() / m.define("J", m.F.det())
    m.stress(tau * back.T)
    new = back * m.exp(-2 * flow * s) * trial * back.T - sp.eye(3)
    parts = (new[0, 0], new[1, 1], new[2, 2], new[0, 1], new[1, 2], new[0, 2])
    m.fields(plastic_strain=alpha + dg)
    m.history(**{f"c_{n}": v for n, v in zip(NAMES, parts, strict=True)}, alpha=alpha + dg)
