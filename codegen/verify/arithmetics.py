"""Three arithmetics for the evaluation of a model: exact, rounded as doubles are, and doubles.

`Exact` has 90 digits: sums, products and quotients are decimals, functions those of mpmath.
`Rounded` is the same where every operation is off by a relative error of the size that a double
has, always the same one, and where the range of doubles ends: what it changes shows how much of a
value rounding may change. `Doubles` is fast, for the search of states. A value that is not real
raises an ArithmeticError, a ValueError or a TypeError.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, DivisionByZero, InvalidOperation, Overflow
from fractions import Fraction
from typing import Any

import mpmath

DIGITS = 90
CONTEXT = Context(
    prec=DIGITS,
    Emax=MAX_EMAX,
    Emin=MIN_EMIN,
    traps=[InvalidOperation, DivisionByZero, Overflow],
)
Number = Any
Function = Callable[..., Number]

UNIT = 2.0**-53
"""Largest relative error of one rounding of a double."""
LARGEST = 100
"""Decimal exponent above which a product of three such values leaves the range of doubles."""
SMALLEST = -300
"""Decimal exponent below which a double is zero, or nearly so."""


class DomainError(ValueError):
    """A function has no real value."""


def _inside(holds: bool) -> None:
    if not holds:
        raise DomainError


def _guarded(functions: Any, wrap: Callable[[Function], Function]) -> dict[str, Function]:
    """The functions of one variable of mpmath or math, where they are real."""
    domains: dict[str, Callable[[Number], bool]] = {
        "log": lambda a: a > 0,
        "asin": lambda a: -1 <= a <= 1,
        "acos": lambda a: -1 <= a <= 1,
        "acosh": lambda a: a >= 1,
        "atanh": lambda a: -1 < a < 1,
    }
    names = "log exp sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh erf erfc"

    def guarded(name: str) -> Function:
        function, domain = wrap(getattr(functions, name)), domains.get(name)
        if domain is None:
            return function

        def checked(a: Number) -> Number:
            _inside(domain(a))
            return function(a)

        return checked

    return {name: guarded(name) for name in names.split()}


class Exact:
    """Decimals of 90 digits; use it in `decimal.localcontext(CONTEXT)` and `workdps(DIGITS)`."""

    step: Number = Decimal(10) ** -20
    """Of central differences."""
    coarse: Number = Decimal(10) ** -30
    """Of the slopes of a local iteration, which need not be exact."""
    close: Number = Decimal(10) ** -8
    """Relative change from which on the slopes of a local iteration are kept."""
    step_tolerance: Number = Decimal(10) ** -80
    """Relative change at which a local iteration has ended."""

    def __init__(self) -> None:
        self.functions = _guarded(mpmath, _by_mpmath)
        self.functions["sqrt"] = _root

    def number(self, value: Any) -> Number:
        """A float, fraction or decimal text, exactly."""
        if isinstance(value, Fraction):
            return Decimal(value.numerator) / value.denominator
        return Decimal(value)

    def pi(self) -> Number:
        """The constant."""
        return _decimal(+mpmath.pi)

    def arctangent(self, y: Number, x: Number) -> Number:
        """Angle of (x, y)."""
        _inside(x != 0 or y != 0)
        return _decimal(mpmath.atan2(_mpf(y), _mpf(x)))

    def power(self, a: Number, e: Number) -> Number:
        """Real power."""
        if e == int(e):
            return a ** int(e)
        _inside(a > 0 or (a == 0 and e > 0))
        return a if a == 0 else _decimal(mpmath.power(_mpf(a), _mpf(e)))

    def eigenvalues(self, a: Sequence[Number]) -> list[Number]:
        """Of a symmetric 3 x 3 matrix, row by row."""
        m = mpmath.matrix([[_mpf(v) for v in a[3 * i : 3 * i + 3]] for i in range(3)])
        return [_decimal(v) for v in mpmath.eigsy(m, eigvals_only=True)]

    def disturbed(self, values: list[Number]) -> list[Number]:
        """Eigenvalues as they are computed."""
        return values

    def settled(self, slot: int, function: Function) -> Function:
        """The function of one operation of a program."""
        return function

    def sum(self, slot: int, count: int) -> Function:
        """Sum of `count` terms as one operation of a program."""
        return _total

    def product(self, slot: int, count: int) -> Function:
        """Product of `count` factors as one operation of a program."""
        return _product


class Rounded(Exact):
    """As `Exact`, with a rounding error in every operation and the range of doubles."""

    def settled(self, slot: int, function: Function) -> Function:
        """The function with a relative rounding error."""
        error = _error(slot, 0)
        return lambda *args: _in_range(function(*args) * error)

    def eigenvalues(self, a: Sequence[Number]) -> list[Number]:
        """Eigenvalues with separate rounding errors, which matter where they are nearly equal."""
        return self.disturbed(super().eigenvalues(a))

    def disturbed(self, values: list[Number]) -> list[Number]:
        """Eigenvalues with separate rounding errors."""
        return [v * _error(k, 3) for k, v in enumerate(values)]

    def sum(self, slot: int, count: int) -> Function:
        """Sum with an error of every partial sum."""
        errors = [_error(slot, k) for k in range(count)]

        def rounded(*args: Number) -> Number:
            total = Decimal(0)
            for a, e in zip(args, errors, strict=True):
                total = (total + a) * e
            return _in_range(total)

        return rounded

    def product(self, slot: int, count: int) -> Function:
        """Product with an error."""
        return self.settled(slot, _product)


def _error(slot: int, k: int) -> Number:
    rng = random.Random(f"{slot} {k}")
    return 1 + Decimal(rng.choice((-1, 1)) * rng.uniform(0.5, 1) * UNIT)


def _in_range(v: Number) -> Number:
    size = v.adjusted()
    if size > LARGEST:
        raise OverflowError
    return Decimal(0) if size < SMALLEST else v


def _root(a: Number) -> Number:
    _inside(a >= 0)
    return a.sqrt()


def _total(*args: Number) -> Number:
    return sum(args)


def _product(*args: Number) -> Number:
    return math.prod(args)


def _mpf(a: Number) -> Any:
    return mpmath.mpf(str(a))


def _decimal(a: Any) -> Number:
    if not isinstance(a, mpmath.mpf) or not mpmath.isfinite(a):
        raise DomainError
    return Decimal(str(a))


def _by_mpmath(function: Function) -> Function:
    return lambda a: _decimal(function(_mpf(a)))


class Doubles(Exact):
    """Floats."""

    step = 1e-5
    coarse = 1e-6
    close = 1e-8
    step_tolerance = 1e-12

    def __init__(self) -> None:
        self.functions = _guarded(math, lambda f: f)
        self.functions["sqrt"] = math.sqrt

    def number(self, value: Any) -> Number:
        """A float."""
        return float(value)

    def pi(self) -> Number:
        """The constant."""
        return math.pi

    def arctangent(self, y: Number, x: Number) -> Number:
        """Angle of (x, y)."""
        _inside(x != 0 or y != 0)
        return math.atan2(y, x)

    def power(self, a: Number, e: Number) -> Number:
        """Real power."""
        _inside(a >= 0 or e == int(e))
        return a**e

    def eigenvalues(self, a: Sequence[Number]) -> list[Number]:
        """Of a symmetric 3 x 3 matrix: roots of its characteristic cubic."""
        mean = (a[0] + a[4] + a[8]) / 3
        b = [v - mean * (i % 4 == 0) for i, v in enumerate(a)]
        size = math.sqrt(sum(v * v for v in b) / 6)
        if size == 0:
            return [mean] * 3
        b = [v / size for v in b]
        det = (
            b[0] * (b[4] * b[8] - b[5] * b[7])
            - b[1] * (b[3] * b[8] - b[5] * b[6])
            + b[2] * (b[3] * b[7] - b[4] * b[6])
        )
        angle = math.acos(max(-1.0, min(1.0, det / 2))) / 3
        return [mean + 2 * size * math.cos(angle + 2 * math.pi * k / 3) for k in range(3)]

    def settled(self, slot: int, function: Function) -> Function:
        """The function where its value is finite."""

        def finite(*args: Number) -> Number:
            v = function(*args)
            if not -1e300 < v < 1e300:
                raise OverflowError
            return v

        return finite
