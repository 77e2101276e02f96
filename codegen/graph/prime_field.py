"""Numbers of a prime field, in which two formulas are compared without rounding.

`PRIME` = 2 q + 1 with q prime: every element has one root of each odd order, as every positive
number has.  It is chosen so that the square roots of 2, 3, 5, 7, 11 and 13 exist as well, which
the points of Gauss rules are made of.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import sympy as sp

PRIME = 2**127 - 225609
DENOMINATOR = 10**100
"""Of `close_rational`, which is off by less than PRIME / DENOMINATOR, two units of digit 62."""


def image(value: Fraction) -> int | None:
    """Image of a rational number in the field; None if its denominator is zero there."""
    if value.denominator % PRIME == 0:
        return None
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME


def root(value: int, order: int) -> int:
    """The one root of an odd order."""
    return pow(value, pow(order, -1, PRIME - 1), PRIME)


def close_rational(number: Any) -> Fraction:
    """A rational number next to an exact SymPy number, with the same image in the field.

    1 / sqrt(3) becomes a fraction r with 61 right digits and 3 r^2 = 1 in the field, so that sums
    and products of such numbers are compared exactly there.  A number that is neither rational
    nor made of square roots has only the digits.
    """
    if number.is_Rational:
        return Fraction(int(number.p), int(number.q))
    if number.is_negative:
        return -close_rational(-number)
    numerator = int(sp.floor(number.evalf(120) * DENOMINATOR))
    exact = _image(number)
    if exact is not None:
        numerator += (exact * DENOMINATOR - numerator) % PRIME
    return Fraction(numerator, DENOMINATOR)


def _image(e: Any) -> int | None:
    if e.is_Rational:
        return image(Fraction(int(e.p), int(e.q)))
    if e.is_Pow and e.base.is_Rational and e.base > 0 and (2 * e.exp).is_Integer:
        power = _square_root(int(e.base.p)), _square_root(int(e.base.q))
        if None in power:
            return None
        value = power[0] * pow(power[1], -1, PRIME) % PRIME  # type: ignore[operator, arg-type]
        return pow(value, int(2 * e.exp), PRIME)
    if e.is_Add or e.is_Mul:
        total = 0 if e.is_Add else 1
        for part in map(_image, e.args):
            if part is None:
                return None
            total = (total + part if e.is_Add else total * part) % PRIME
        return total
    return None


def _square_root(n: int) -> int | None:
    """The product of the roots of its prime factors, so that roots multiply as numbers do."""
    result = 1
    for factor, power in sp.factorint(n).items():
        if power % 2 and pow(factor, (PRIME - 1) // 2, PRIME) != 1:
            return None
        half = pow(factor, (PRIME + 1) // 4, PRIME) if power % 2 else 1
        result = result * pow(factor, power // 2, PRIME) * half % PRIME
    return result
