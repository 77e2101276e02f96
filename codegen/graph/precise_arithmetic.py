"""Operations in many digits, for the passes (the oracle has a separate table)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import mpmath

from softehl.codegen.graph.graph import Node, Op

Number = Any


def arctangent(y: Number, x: Number) -> Number:
    """Angle of (x, y); mpmath gives no message for complex operands."""
    if isinstance(x, mpmath.mpc) or isinstance(y, mpmath.mpc):
        raise ValueError("atan2 of a complex number")
    return mpmath.atan2(y, x)


_OPERATIONS: dict[Op, Callable[..., Number]] = {
    Op.NAME: lambda a: a,
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.NEG: lambda a: -a,
    Op.RECIP: lambda a: 1 / a,
    Op.SQRT: mpmath.sqrt,
    Op.CBRT: mpmath.cbrt,
    Op.RCBRT: lambda a: 1 / mpmath.cbrt(a),
    Op.LOG: mpmath.log,
    Op.EXP: mpmath.exp,
    Op.SIN: mpmath.sin,
    Op.COS: mpmath.cos,
    Op.TAN: mpmath.tan,
    Op.ASIN: mpmath.asin,
    Op.ACOS: mpmath.acos,
    Op.ATAN: mpmath.atan,
    Op.SINH: mpmath.sinh,
    Op.COSH: mpmath.cosh,
    Op.TANH: mpmath.tanh,
    Op.ASINH: mpmath.asinh,
    Op.ACOSH: mpmath.acosh,
    Op.ATANH: mpmath.atanh,
    Op.ERF: mpmath.erf,
    Op.ERFC: mpmath.erfc,
    Op.ATAN2: arctangent,
    Op.POWER: lambda a, e: a**e,
    Op.LT: lambda a, b: a < b,
    Op.LE: lambda a, b: a <= b,
    Op.EQ: lambda a, b: a == b,
    Op.AND: lambda a, b: a and b,
    Op.OR: lambda a, b: a or b,
    Op.NOT: lambda a: not a,
    Op.BRANCH: lambda c, a, b: a if c else b,
}


def number(n: Node, args: Sequence[Number]) -> Number:
    """Value of a node from those of its operands, in the working precision of mpmath."""
    match n.op:
        case Op.CONST:
            return mpmath.mpf(n.value.numerator) / n.value.denominator
        case Op.PI:
            return +mpmath.pi
        case Op.POW:
            assert isinstance(n.payload, Fraction)
            return args[0] ** (mpmath.mpf(n.payload.numerator) / n.payload.denominator)
    return _OPERATIONS[n.op](*args)
