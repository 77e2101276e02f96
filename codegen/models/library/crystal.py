"""Crystal plasticity, face-centred cubic: 12 slip systems, rate dependent, small strain.

Source: Asaro and Needleman (1985), Acta Metallurgica 33, 923-953; Bunge (1982) for the angles.
Benchmark: tension along [001] and [111], where 8 and 6 systems slip alike.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")
IJ = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
NORMALS = ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1))
DIRECTIONS = ((0, 1, -1), (1, 0, -1), (1, -1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0))


def tensor(v: list[sp.Expr]) -> sp.Matrix:
    """Symmetric matrix of its components in the order of NAMES."""
    return sp.Matrix([[v[0], v[3], v[5]], [v[3], v[1], v[4]], [v[5], v[4], v[2]]])


def systems() -> list[sp.Matrix]:
    """Symmetric parts of direction times normal of {111}<110>, in the axes of the crystal."""
    pairs = [(sp.Matrix(n), sp.Matrix(d)) for n in NORMALS for d in DIRECTIONS]
    return [(d * n.T + n * d.T) / (2 * sp.sqrt(6)) for n, d in pairs if n.dot(d) == 0]


@material
def crystal(m: Material) -> None:
    """Slip rate_0 |tau / g|^n sign(tau), implicit; g = tau_0 + h times slip before the step."""
    C11, C12, C44, tau_0, h, n, rate_0, dt = m.parameters(
        C11="cubic stiffness [MPa]",
        C12="cubic stiffness [MPa]",
        C44="cubic stiffness [MPa]",
        tau_0="strength of a system [MPa]",
        h="its hardening by the sum of all slip [MPa]",
        n="exponent of the rate",
        rate_0="slip rate at the strength [1/s]",
        dt="step [s]",
    )
    angles = m.parameters(
        phi_1="first angle of Bunge, to the crystal [rad]", Phi="second [rad]", phi_2="third [rad]"
    )
    m.require(C11 > 0, C44 > 0, tau_0 > 0, h >= 0, n >= 1, rate_0 > 0)
    old = m.point_data(
        **{f"p_{a}": "plastic strain, axes of the crystal" for a in NAMES},
        **{f"t_{a}": "stress, axes of the crystal [MPa]" for a in NAMES},
        slip="sum of all slip",
    )
    p, t_old, slip_old = tensor(old[:6]), old[6:12], old[12]
    turns = [sp.Matrix([[sp.cos(a), sp.sin(a)], [-sp.sin(a), sp.cos(a)]]) for a in angles]
    about_z = [sp.diag(turns[k], 1) for k in (0, 2)]
    R = m.define("R", about_z[1] * sp.diag(1, turns[1]) * about_z[0])  # sample -> crystal
    e = m.define("e", R * m.strain * R.T - p)

    g = m.define("g", tau_0 + h * slip_old)

    def flow(t: list[sp.Expr]) -> tuple[sp.Matrix, sp.Expr]:
        """Plastic strain and slip of the step at stresses t by g."""
        strain, total = sp.zeros(3), sp.Integer(0)
        for P in systems():
            tau = sum(a * b for a, b in zip(tensor(t), P, strict=True))
            amount = dt * rate_0 * sp.Abs(tau) ** (n - 1)
            strain, total = strain + amount * tau * P, total + amount * sp.Abs(tau)
        return strain, total

    def balance(t: list[sp.Expr]) -> list[sp.Expr]:
        a = e - flow(t)[0]
        normal = [(C11 - C12) * a[k, k] + C12 * a.trace() for k in range(3)]
        shear = [2 * C44 * a[i, j] for i, j in IJ[3:]]
        residual = [b - s / g for b, s in zip(t, (*normal, *shear), strict=True)]
        return [r + sum(residual) for r in residual]  # zero stresses up to rounding of all

    t = m.implicit("t", balance, start=[a / g for a in t_old], size=1, iterations=100)
    strain, total = flow(t)
    m.stress(g * R.T * tensor(t) * R)
    m.fields(slip=slip_old + total)
    strains = {f"p_{a}": (p + strain)[i, j] for a, (i, j) in zip(NAMES, IJ, strict=True)}
    new = {f"t_{a}": g * s for a, s in zip(NAMES, t, strict=True)}
    m.history(**strains, **new, slip=slip_old + total)
