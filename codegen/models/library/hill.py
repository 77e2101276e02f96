"""Plasticity of Hill at small strain: orthotropic along the axes, linear hardening.

Source: Hill (1948), Proc. Royal Society A 193, 281-297.
Benchmark: yield stresses along two axes, and in shear.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def hill(m: Material) -> None:
    """Seven local unknowns: stress after the step and amount of flow."""
    E, nu, sy, H = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        sy="yield stress that the ratios refer to [MPa]",
        H="hardening modulus [MPa]",
    )
    r = m.parameters(
        r_xx="yield stress along x by sy",
        r_yy="yield stress along y by sy",
        r_zz="yield stress along z by sy",
        r_xy="shear yield stress by sy / sqrt(3)",
        r_yz="shear yield stress by sy / sqrt(3)",
        r_xz="shear yield stress by sy / sqrt(3)",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), sy > 0, H >= 0, *(x > 0 for x in r))
    G, lame = E / (2 + 2 * nu), E * nu / ((1 + nu) * (1 - 2 * nu))
    old = m.point_data(**{f"p_{n}": "plastic strain" for n in NAMES}, alpha="amount")
    p, alpha = old[:6], old[6]
    xx, yy, zz = (1 / x**2 for x in r[:3])
    f, g, h = (yy + zz - xx) / 2, (zz + xx - yy) / 2, (xx + yy - zz) / 2
    e = [m.strain[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))]

    def elastic(strain: list[sp.Expr]) -> list[sp.Expr]:
        volume = lame * sum(strain[:3])
        return [2 * G * x + (volume if k < 3 else 0) for k, x in enumerate(strain)]

    def square(t: list[sp.Expr]) -> sp.Expr:
        normal = f * (t[1] - t[2]) ** 2 + g * (t[2] - t[0]) ** 2 + h * (t[0] - t[1]) ** 2
        return normal + sum(3 * x**2 / ratio**2 for x, ratio in zip(t[3:], r[3:], strict=True))

    trial = [
        m.define(f"trial_{n}", t)
        for n, t in zip(NAMES, elastic([a - b for a, b in zip(e, p, strict=True)]), strict=True)
    ]
    yields = m.define("excess", square(trial) - (sy + H * alpha) ** 2) > 0

    def flow(t: list[sp.Expr]) -> list[sp.Expr]:
        """Half the derivatives of the square by the stresses; shears count twice."""
        d = [g * (t[0] - t[2]) + h * (t[0] - t[1]), f * (t[1] - t[2]) + h * (t[1] - t[0])]
        d += [f * (t[2] - t[1]) + g * (t[2] - t[0])]
        return d + [sp.Rational(3, 2) * x / y**2 for x, y in zip(t[3:], r[3:], strict=True)]

    def balance(s: list[sp.Expr]) -> list[sp.Expr]:
        t, d = list(s[:6]), s[6]
        limit = sy + H * (alpha + d)
        back = elastic([d / limit * x for x in flow(t)])
        stress = [(a - b + c) / sy for a, b, c in zip(t, trial, back, strict=True)]
        rows = [*stress, square(t) / limit**2 - 1]
        below_yield = [*((a - b) / sy for a, b in zip(t, trial, strict=True)), d]
        return [
            sp.Piecewise((a, yields), (b, True)) for a, b in zip(rows, below_yield, strict=True)
        ]

    *t, d = m.implicit("s", balance, start=[*trial, sp.Integer(0)])
    m.stress(sp.Matrix([[t[0], t[3], t[5]], [t[3], t[1], t[4]], [t[5], t[4], t[2]]]))
    limit = sy + H * (alpha + d)
    new = [a + d / limit * x for a, x in zip(p, flow(t), strict=True)]
    m.history(**{f"p_{n}": v for n, v in zip(NAMES, new, strict=True)}, alpha=alpha + d)
