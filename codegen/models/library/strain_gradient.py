"""Linear elasticity of the strain and its gradient (Aifantis) in the plane, mixed.

Cells: quad9
Source: Altan and Aifantis (1997), J. Mech. Behavior of Materials 8; Shu et al. (1999), IJNME 44.
Benchmark: layer in shear whose sides do not strain, shear stress.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def strain_gradient(m: Fields) -> None:
    """W(strain) + length^2 W(d strain / dx_k) of a strain e of its own, equal to that of u.

    e has unknowns at the corners, the multipliers l are constant in a cell (QU34L4).
    """
    if m.geometry == "axisymmetric":
        raise ModelError("strain_gradient has no hoop strain: it is for bodies in the plane")
    u = m.vector("u")
    names = ("xx", "yy", "xy")
    e = [m.scalar(f"e_{n}", order=1) for n in names]
    multipliers = [m.scalar(f"l_{n}", order=0) for n in names]
    E, nu, length = m.parameters(
        E="Young's modulus [MPa]", nu="Poisson's ratio", length="internal length [mm]"
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), length > 0)
    mu, lame = E / (2 + 2 * nu), E * nu / ((1 + nu) * (1 - 2 * nu))

    def energy(xx: sp.Expr, yy: sp.Expr, xy: sp.Expr) -> sp.Expr:
        return lame / 2 * (xx + yy) ** 2 + mu * (xx**2 + yy**2 + 2 * xy**2)

    H = m.grad(u)
    strain = [H[0, 0], H[1, 1], (H[0, 1] + H[1, 0]) / 2]
    gradients = [m.grad(v) for v in e]
    W = energy(*strain) + length**2 * sum(energy(*(s[k] for s in gradients)) for k in (0, 1))
    weights = (1, 1, 2)
    m.minimise(W + sum(
        w * p * (a - b) for w, p, a, b in zip(weights, multipliers, strain, e, strict=True)
    ))  # fmt: skip
