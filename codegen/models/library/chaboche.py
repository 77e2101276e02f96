"""Plasticity of von Mises at small strain with two back stresses of Armstrong and Frederick.

Source: Chaboche (1986), International Journal of Plasticity 2, 149-188.
Benchmark: saturated cycle, stress amplitude sy + C / g tanh(g dep / 2).
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


def tensor(v: list[sp.Expr]) -> sp.Matrix:
    """Symmetric matrix of its components in the order of NAMES."""
    return sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])


@material
def chaboche(m: Material) -> None:
    """One scalar equation for the plastic strain of the step, implicit in time."""
    E, nu, sy, Q, b = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        sy="yield stress [MPa]",
        Q="saturated isotropic hardening [MPa]",
        b="rate of its saturation",
    )
    C1, g1, C2, g2 = m.parameters(
        C1="modulus of back stress 1 [MPa]",
        g1="its recall",
        C2="modulus of back stress 2 [MPa]",
        g2="its recall",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), sy > 0, g1 >= 0, g2 >= 0)
    G, K = E / (2 + 2 * nu), E / (3 - 6 * nu)
    names = [f"{a}_{n}" for a in ("p", "X1", "X2") for n in NAMES]
    old = m.point_data(**dict.fromkeys(names, "plastic strain or back stress"), alpha="amount")
    p, X1, X2, alpha = tensor(old[:6]), tensor(old[6:12]), tensor(old[12:18]), old[18]
    volume = m.strain.trace()
    s = m.define("s", 2 * G * (m.strain - volume / 3 * sp.eye(3) - p))

    def length(a: sp.Matrix) -> sp.Expr:
        return m.norm(list(a)) * sp.sqrt(sp.Rational(3, 2))

    def limit(a: sp.Expr) -> sp.Expr:
        return sy + Q * (1 - sp.exp(-b * a))

    yields = m.define("excess", length(s - X1 - X2) - limit(alpha)) > 0

    def balance(d: sp.Expr) -> sp.Expr:
        """Effective stress on the limit, after an amount d of flow."""
        t1, t2 = 1 / (1 + g1 * d), 1 / (1 + g2 * d)
        reduced = sp.sqrt(sp.Rational(3, 2) * sum(x**2 for x in s - t1 * X1 - t2 * X2))
        return sp.Piecewise(
            (reduced - (3 * G + C1 * t1 + C2 * t2) * d - limit(alpha + d), yields), (d, True)
        )

    d = m.implicit("d", balance, start=sp.Integer(0))
    t1, t2 = 1 / (1 + g1 * d), 1 / (1 + g2 * d)
    xi = m.define("direction", s - t1 * X1 - t2 * X2)
    flow = m.define("flow", sp.Piecewise((3 * d / (2 * length(xi)), yields), (0, True)))
    m.stress(K * volume * sp.eye(3) + s - 2 * G * flow * xi)
    new = [p + flow * xi, t1 * (X1 + 2 * C1 / 3 * flow * xi), t2 * (X2 + 2 * C2 / 3 * flow * xi)]
    ij = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    parts = [a[k] for a in new for k in ij]
    m.fields(plastic_strain=alpha + d)
    m.history(**dict(zip(names, parts, strict=True)), alpha=alpha + d)
