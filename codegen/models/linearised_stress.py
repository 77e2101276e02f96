"""Body whose stress and moduli are data of its points: the macroscopic scale of unit cells."""

from itertools import product

import sympy as sp

from softehl import Fields, page


@page
def linearised_stress(m: Fields) -> None:
    """P = P_0 + A : (grad u - H_0), first Piola-Kirchhoff stress with its tangent A at H_0."""
    u = m.vector("u")
    H = m.grad(u)
    axes = "xyz"[: H.shape[0]]
    pairs = ["".join(ij) for ij in product(axes, axes)]
    P_0 = m.point_data(**{f"P_0_{ij}": "stress [MPa]" for ij in pairs})
    H_0 = m.point_data(**{f"H_0_{ij}": "displacement gradient" for ij in pairs})
    A = m.point_data(**{f"A_{ij}{kl}": "moduli [MPa]" for ij, kl in product(pairs, pairs)})
    change = [H[k] - h for k, h in enumerate(H_0)]
    rows = [A[len(pairs) * k : len(pairs) * (k + 1)] for k in range(len(pairs))]
    P = [
        p + sum(a * h for a, h in zip(row, change, strict=True))
        for p, row in zip(P_0, rows, strict=True)
    ]
    m.weak(sp.Matrix(*H.shape, P), H)
    m.fields(**{f"P_{ij}": p for ij, p in zip(pairs, P, strict=True)})
    m.fields(**{f"F_{ij}": h + int(ij[0] == ij[1]) for ij, h in zip(pairs, H, strict=True)})
