"""Visco-hyperelastic rubber: neo-Hooke with a Prony series of any number of branches.

Source: Simo (1987), CMAME 60, 153-173; Holzapfel (2000), Nonlinear Solid Mechanics, chapter 6.
Benchmark: relaxation after a ramp of simple shear, stress by the hereditary integral.
"""

import sympy as sp

from softehl import Material, material

NAMES = ("xx", "yy", "zz", "xy", "yz", "xz")


@material
def prony(m: Material) -> None:
    """S = S_volume + S_shape + sum of Q, dQ/dt + Q / tau = beta dS_shape/dt."""
    mu, kappa, dt = m.parameters(
        mu="shear modulus after relaxation [MPa]", kappa="bulk modulus [MPa]", dt="step [s]"
    )
    m.require(mu > 0, kappa > 0)
    beta = m.array("beta", "moduli of the branches by mu")
    tau = m.array("tau", "their times of relaxation [s]")
    previous = list(m.point_data(**{f"S_{n}": "second stress of the shape, old" for n in NAMES}))
    Q = [m.point_array(f"Q_{n}", beta, "overstress") for n in NAMES]
    J = m.define("J", m.F.det())
    C = m.define("C", m.F.T * m.F)
    inverse = m.define("inverse", C.adjugate() / J**2)
    S = m.define("S", mu * J ** sp.Rational(-2, 3) * (sp.eye(3) - C.trace() / 3 * inverse))
    now = [S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2]]

    def renewed(beta: sp.Expr, tau: sp.Expr, *Q: sp.Expr) -> list[sp.Expr]:
        """Overstress after the step: the stress of the shape changes at its middle."""
        half = sp.exp(-dt / (2 * tau))
        return [
            half * (half * q + beta * (s - b)) for q, s, b in zip(Q, now, previous, strict=True)
        ]

    new = m.each(beta, tau, *Q, renewed)
    xx, yy, zz, xy, yz, xz = m.sum(beta, tau, *Q, renewed)
    over = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    m.second_stress(kappa / 2 * (J**2 - 1) * inverse + S + over)
    branches = {f"Q_{n}": q for n, q in zip(NAMES, new, strict=True)}
    m.history(**branches, **{f"S_{n}": s for n, s in zip(NAMES, now, strict=True)})
