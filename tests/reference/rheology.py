"""Oils that thin under shear, by stresses at the walls and by rates (docs/oils.md).

Parameters: none for a Newtonian oil, critical_stress for Eyring's, critical_stress
thinning_exponent thinning_plateau for Carreau's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from tests.reference.differentiate import Number, mp, mpf
from tests.reference.rules import gauss

ACROSS = 6
"""Points of Gauss' rule across a film of Carreau's oil."""


def thinned(
    U: Number, h: Number, eta: Number, slope: Number, how: Sequence[Number]
) -> tuple[Number, Number]:
    """Shear stress in the middle of the film; dp/dx of the same flux without thinning."""
    if not how:
        return eta * U / h, slope
    return eyring(U, h, eta, slope, how[0]) if len(how) == 1 else carreau(U, h, eta, slope, how)


def eyring(
    U: Number, h: Number, eta: Number, slope: Number, tau_0: Number
) -> tuple[Number, Number]:
    """By antiderivatives between the stresses b - a and b + a at the walls, in units of tau_0."""
    a = h * slope / (2 * tau_0)
    sheared = eta * U / (h * tau_0)
    if slope == 0:
        return tau_0 * mp.asinh(sheared), mpf(0)

    def excess(b: Number) -> Number:
        return (mp.cosh(b + a) - mp.cosh(b - a)) / (2 * a) - sheared

    b = mp.findroot(excess, (mp.asinh(sheared), mp.asinh(sheared) / 2 + mpf(1) / 1000))
    # mean of y sinh(b - a y) over y from -1 to 1, by parts
    first = -(mp.cosh(b - a) + mp.cosh(b + a)) / (2 * a)
    driven = first + (mp.sinh(b + a) - mp.sinh(b - a)) / (2 * a**2)
    return tau_0 * b, -6 * tau_0 / h * driven


def carreau(
    U: Number, h: Number, eta: Number, slope: Number, how: Sequence[Number]
) -> tuple[Number, Number]:
    """By the rates at the points of the rule, found together with the stress in the middle."""
    tau_c, n, c = how
    S, sheared = h * slope / (2 * tau_c), eta * U / (h * tau_c)
    places, weights = gauss(ACROSS)
    rates = [mpf(x) for x in _started(float(S), float(sheared), (float(n), float(c)))]
    for _ in range(60):
        bases = [1 + x * x for x in rates]
        slopes = [
            c + (1 - c) * b ** ((n - 3) / 2) * (1 + n * x * x)
            for b, x in zip(bases, rates, strict=True)
        ]
        stresses = [
            x * (c + (1 - c) * b ** ((n - 1) / 2)) for b, x in zip(bases, rates, strict=True)
        ]
        known = [
            x - (S * y + f) / d for x, y, f, d in zip(rates, places, stresses, slopes, strict=True)
        ]
        free = sum(w / d for w, d in zip(weights, slopes, strict=True))
        middle = (2 * sheared - mp.fdot(weights, known)) / free
        new = [k + middle / d for k, d in zip(known, slopes, strict=True)]
        change = max(abs(a - b) for a, b in zip(new, rates, strict=True))
        rates = new
        if change <= mpf(10) ** (5 - mp.dps) * max(map(abs, rates)):
            driven = sum(w * y * x for w, y, x in zip(weights, places, rates, strict=True)) / 2
            return tau_c * middle, -6 * tau_c / h * driven
    raise AssertionError("the rates of a Carreau oil were not found")


def _started(S: float, sheared: float, law: tuple[float, float]) -> list[float]:
    """Rates to a few digits, by bisection: the stress in the middle rises with U, they with it."""
    places, weights = ([float(v) for v in values] for values in gauss(ACROSS))

    def rate(t: float) -> float:
        size = abs(t)
        found = _bisected(lambda x: stress(x, law) - size, 4 * (size + size ** (1 / law[0])))
        return math.copysign(found, t)

    def excess(b: float) -> float:
        moved = (w * rate(b - S * y) for y, w in zip(places, weights, strict=True))
        return sum(moved) - 2 * abs(sheared)

    middle = math.copysign(_bisected(excess, 2 * abs(sheared)), sheared)
    return [rate(middle - S * y) for y in places]


def _bisected(rising: Callable[[float], float], high: float) -> float:
    low = 0.0
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < 0 else (low, middle)
    return (low + high) / 2


def stress(x: Any, law: Sequence[Any]) -> Any:
    """Carreau's law in units of the critical stress and its rate; law: n, c."""
    n, c = law
    return x * (c + (1 - c) * (1 + x * x) ** ((n - 1) / 2))
