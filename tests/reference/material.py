"""Compressible Mooney-Rivlin solid, equations (2)-(6).

A deformation gradient of axial symmetry is the tuple (F_zz, F_zr, F_rz, F_rr, F_tt).
"""

from __future__ import annotations

from collections.abc import Sequence

from tests.reference.differentiate import Number, Vector, gradient, mp


def left_cauchy_green(F: Sequence[Number]) -> tuple[Number, Number, Number, Number]:
    """B = F F^T of (5): components zz, rr, tt, zr."""
    zz, zr, rz, rr, tt = F
    return zz * zz + zr * zr, rz * rz + rr * rr, tt * tt, zz * rz + zr * rr


def determinant(F: Sequence[Number]) -> Number:
    """J = det F."""
    zz, zr, rz, rr, tt = F
    return (zz * rr - zr * rz) * tt


def third_invariant(F: Sequence[Number]) -> Number:
    """I_3 = det B of (4)."""
    zz, rr, tt, zr = left_cauchy_green(F)
    return (zz * rr - zr * zr) * tt


def isochoric(F: Sequence[Number], mu_1: Number, mu_2: Number) -> Number:
    """First two terms of (3), MPa."""
    scale = mp.exp(-mp.log(third_invariant(F)) / 3)
    zz, rr, tt, zr = (scale * entry for entry in left_cauchy_green(F))
    first = zz + rr + tt
    second = (first**2 - (zz**2 + rr**2 + tt**2 + 2 * zr**2)) / 2
    return mu_1 * (first - 3) / 2 + mu_2 * (second - 3) / 2


def volumetric(I3: Number, kappa: Number) -> Number:
    """W_v of (6), MPa."""
    return kappa * ((I3 - 1) / 2 - mp.log(I3) / 2) / 2


def energy(F: Sequence[Number], mu_1: Number, mu_2: Number, kappa: Number) -> Number:
    """W(F) of (3), MPa."""
    return isochoric(F, mu_1, mu_2) + volumetric(third_invariant(F), kappa)


def first_piola(F: Sequence[Number], mu_1: Number, mu_2: Number, kappa: Number) -> Vector:
    """P = dW/dF of (2) in the order of F, MPa."""
    return gradient(lambda G: energy(G, mu_1, mu_2, kappa), list(F))


def cauchy(
    F: Sequence[Number], mu_1: Number, mu_2: Number, kappa: Number
) -> tuple[Number, Number, Number, Number]:
    """sigma = P F^T / J: components zz, rr, tt, zr, MPa."""
    zz, zr, rz, rr, tt = F
    P = first_piola(F, mu_1, mu_2, kappa)
    J = determinant(F)
    return (
        (P[0] * zz + P[1] * zr) / J,
        (P[2] * rz + P[3] * rr) / J,
        P[4] * tt / J,
        (P[0] * rz + P[1] * rr) / J,
    )
