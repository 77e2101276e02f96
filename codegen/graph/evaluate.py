"""Values of an unoptimised graph in arbitrary precision: the walk of the oracle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mpmath

from softehl.codegen.graph.arithmetic import arctangent
from softehl.codegen.graph.evaluate_routines import results
from softehl.codegen.graph.graph import Input, Node, Op, Place, Routine
from softehl.codegen.graph.traverse import Recursion, reachable, recursion

Number = Any
Vector = list[Number]

_UNARY: dict[Op, Callable[[Number], Number]] = {
    Op.NAME: lambda a: a,
    Op.NEG: lambda a: -a,
    Op.RECIP: lambda a: 1 / a,
    Op.SQRT: mpmath.sqrt,
    Op.CBRT: mpmath.cbrt,
    Op.RCBRT: lambda a: 1 / mpmath.cbrt(a),
    Op.LOG: mpmath.log,
    Op.EXP: mpmath.exp,
    Op.SIN: mpmath.sin,
    Op.COS: mpmath.cos,
    Op.TAN: lambda a: mpmath.sin(a) / mpmath.cos(a),
    Op.ASIN: mpmath.asin,
    Op.ACOS: mpmath.acos,
    Op.ATAN: mpmath.atan,
    Op.SINH: lambda a: (mpmath.exp(a) - mpmath.exp(-a)) / 2,
    Op.COSH: lambda a: (mpmath.exp(a) + mpmath.exp(-a)) / 2,
    Op.TANH: mpmath.tanh,
    Op.ASINH: mpmath.asinh,
    Op.ACOSH: mpmath.acosh,
    Op.ATANH: mpmath.atanh,
    Op.ERF: mpmath.erf,
    Op.ERFC: mpmath.erfc,
    Op.NOT: lambda a: not a,
}
_BINARY: dict[Op, Callable[[Number, Number], Number]] = {
    Op.ATAN2: arctangent,
    Op.POWER: lambda a, e: a**e,
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.LT: lambda a, b: a < b,
    Op.LE: lambda a, b: a <= b,
    Op.EQ: lambda a, b: a == b,
    Op.AND: lambda a, b: a and b,
    Op.OR: lambda a, b: a or b,
}


@dataclass(frozen=True)
class State:
    """Arguments of one element: exact numbers, as doubles or mpmath values.

    `rule` holds rows (coordinates..., weight); `basis` [point][mode] = (value, xi-derivative)
    of each field; `point_data` [point][entry].
    """

    coordinates: Sequence[Number]
    dofs: Sequence[Number]
    data: Sequence[Number] = ()
    parameters: Sequence[Number] = ()
    rule: Sequence[Sequence[Number]] = ((1,),)
    basis: Sequence[Sequence[Sequence[Number]]] = ()
    point_data: Sequence[Sequence[Number]] = ()


class Walk:
    """One evaluation; values are remembered per node and point."""

    def __init__(
        self,
        state: State,
        frozen: Mapping[tuple[Node, int], Number],
        dofs: Vector | None = None,
    ) -> None:
        self.state = state
        self.frozen = frozen
        self.arrays: dict[str, Vector] = {
            "coordinates": exact(state.coordinates),
            "dofs": exact(state.dofs) if dofs is None else dofs,
            "data": exact(state.data),
            "parameters": exact(state.parameters),
        }
        self.known: dict[tuple[Node, int], Number] = {}

    def value(self, n: Node) -> Number:
        """Value of a node that does not vary with the point."""
        return self.at(n, 0)

    def at(self, n: Node, q: int) -> Number:
        """Value of a node at point `q`."""
        return recursion(self._at(n, q))

    def _at(self, n: Node, q: int) -> Recursion[Number]:
        q = q if n.varying else 0
        key = (n, q)
        if key in self.frozen:
            return self.frozen[key]
        if key not in self.known:
            self.known[key] = yield self._compute(n, q)
        return self.known[key]

    def _compute(self, n: Node, q: int) -> Recursion[Number]:
        match n.op:
            case Op.CONST:
                return mpmath.mpf(n.value.numerator) / n.value.denominator
            case Op.PI:
                return +mpmath.pi
            case Op.INPUT:
                assert isinstance(n.payload, Input)
                return self._input(n.payload, q)
            case Op.SUM:
                terms = []
                for k in range(len(self.state.rule)):
                    terms.append((yield self._at(n.args[0], k)))
                return mpmath.fsum(terms)
            case Op.BRANCH:
                taken = yield self._at(n.args[0], q)
                return (yield self._at(n.args[1 if taken else 2], q))
            case Op.CALL:
                assert isinstance(n.payload, Routine)
                operands = []
                for a in n.args:
                    operands.append((yield self._at(a, q)))
                return results(n.payload, operands, _local)
            case Op.ITEM:
                assert isinstance(n.payload, Place)
                return (yield self._at(n.args[0], q))[n.payload.index]
            case Op.POW:
                e: Any = n.payload
                return (yield self._at(n.args[0], q)) ** (mpmath.mpf(e.numerator) / e.denominator)
        args = []
        for a in n.args:
            args.append((yield self._at(a, q)))
        return _UNARY[n.op](*args) if len(args) == 1 else _BINARY[n.op](*args)

    def _input(self, source: Input, q: int) -> Number:
        if source.array == "rule":
            return mpmath.mpf(self.state.rule[q][source.index])
        if source.array == "point data":
            return mpmath.mpf(self.state.point_data[q][source.index])
        if source.array == "interpolated":
            modes = self.state.basis[q]
            unknowns = self.arrays["dofs"][-len(modes) :]
            return mpmath.fsum(
                mpmath.mpf(b[source.index]) * p for b, p in zip(modes, unknowns, strict=True)
            )
        return self.arrays[source.array][source.index]


def exact(values: Sequence[Number]) -> Vector:
    """Numbers of the working precision."""
    return [mpmath.mpf(v) for v in values]


def _local(values: Sequence[Node], local: Vector, external: Vector) -> Vector:
    """Localised values of a routine."""
    walk = Walk(State((), ()), {})
    walk.arrays = {"local": local, "external": external}
    return [walk.value(n) for n in values]


def evaluate(root: Node, inputs: Mapping[tuple[str, int], Number], digits: int = 50) -> Number:
    """Value of a graph without loops, for the tests of passes and derivatives."""
    arrays: dict[str, Vector] = {}
    for n in reachable([root]):
        if isinstance(n.payload, Input):
            column = arrays.setdefault(n.payload.array, [])
            column += [0] * (n.payload.index + 1 - len(column))
            column[n.payload.index] = inputs[n.payload.array, n.payload.index]
    with mpmath.workdps(digits):
        walk = Walk(State((), ()), {})
        walk.arrays = {k: exact(v) for k, v in arrays.items()}
        return walk.value(root)
