"""Compressible Mooney-Rivlin solid, equations (2)-(6), and other isochoric terms.

A deformation gradient of axial symmetry is the tuple (F_zz, F_zr, F_rz, F_rr, F_tt).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

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


def _first_isochoric(F: Sequence[Number]) -> Number:
    zz, rr, tt, _ = left_cauchy_green(F)
    return (zz + rr + tt) / mp.cbrt(third_invariant(F))


def yeoh(F: Sequence[Number], c_1: Number, c_2: Number, c_3: Number) -> Number:
    """Cubic in the first isochoric invariant, MPa."""
    x = _first_isochoric(F) - 3
    return x * (c_1 + x * (c_2 + x * c_3))


def arruda_boyce(F: Sequence[Number], mu: Number, lambda_m: Number) -> Number:
    """Eight chains, five terms of the series in the squared chain stretch over lambda_m^2, MPa."""
    first, locking = _first_isochoric(F), lambda_m**2
    series = ((1, 2), (1, 20), (11, 1050), (19, 7000), (519, 673750))
    return mu * mp.fsum(
        mp.mpf(a) / b * (first**k - 3**k) / locking ** (k - 1)
        for k, (a, b) in enumerate(series, start=1)
    )


def gent(F: Sequence[Number], mu: Number, J_m: Number) -> Number:
    """Logarithm that grows without bound as the first isochoric invariant nears 3 + J_m, MPa."""
    return mu * J_m / 2 * mp.log(J_m / (J_m + 3 - _first_isochoric(F)))


def ogden(F: Sequence[Number], *pairs: Number) -> Number:
    """Powers of the isochoric principal stretches, pairs mu_p, alpha_p, MPa."""
    zz, rr, tt, zr = left_cauchy_green(F)
    mean, radius = (zz + rr) / 2, mp.sqrt(((zz - rr) / 2) ** 2 + zr**2)
    scale = mp.cbrt(third_invariant(F))
    logs = [mp.log(square / scale) / 2 for square in (mean + radius, mean - radius, tt)]
    terms = zip(pairs[::2], pairs[1::2], strict=True)
    return mp.fsum(mu / a * (mp.fsum(mp.exp(a * e) for e in logs) - 3) for mu, a in terms)


LAWS: dict[str, Callable[..., Number]] = {
    "mooney_rivlin": isochoric,
    "yeoh": yeoh,
    "ogden": ogden,
    "arruda_boyce": arruda_boyce,
    "gent": gent,
}
"""Isochoric terms by name."""


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
