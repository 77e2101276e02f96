"""The slow oracle: walks the *unoptimised* graph of a model in arbitrary precision.

It shares nothing with differentiation, passes, schedule or emission.  Derivatives are central
differences in so many digits that their error is far below double precision: the residual is
the derivative of the potential with the frozen quantities held at their values in the base state,
the tangent is the derivative of that residual.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mpmath

from softehl.codegen.graph.evaluate_routines import results
from softehl.codegen.graph.graph import Input, Node, Op, Place, Routine, reachable
from softehl.codegen.language.model import Definition

Number = Any
Vector = list[Number]
Rows = Sequence[Sequence[Number]] | None

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
    Op.NOT: lambda a: not a,
}
_BINARY: dict[Op, Callable[[Number, Number], Number]] = {
    Op.ATAN2: mpmath.atan2,
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

    `rule` holds rows (coordinates..., weight); `basis` [point][mode] = (value, xi-derivative);
    `point_data` [point][entry].
    """

    coordinates: Sequence[Number]
    dofs: Sequence[Number]
    data: Sequence[Number] = ()
    parameters: Sequence[Number] = ()
    rule: Sequence[Sequence[Number]] = ((1,),)
    basis: Sequence[Sequence[tuple[Number, Number]]] = ()
    point_data: Sequence[Sequence[Number]] = ()


@dataclass(frozen=True)
class Oracle:
    """Values and derivatives of one model, with `digits` digits of working precision."""

    definition: Definition
    digits: int = 90
    step: int = 20

    def potential(self, state: State) -> Number:
        """Value of the (pseudo-)potential."""
        with mpmath.workdps(self.digits):
            return Walk(state, {}).value(self.definition.potential)

    def fields(self, state: State) -> list[Vector]:
        """Field values, [point][field]."""
        with mpmath.workdps(self.digits):
            walk = Walk(state, {})
            nodes = [n for _, n in self.definition.fields]
            return [[walk.at(n, q) for n in nodes] for q in range(len(state.rule))]

    def residual(self, state: State, along: Rows = None) -> Vector:
        """Derivative of the potential with the constants frozen at `state`.

        Every component; with `along` the products of these vectors with it, which are cheaper
        where they are fewer (so in `product` and `derivative`).
        """
        with mpmath.workdps(self.digits):
            return self._residual(state, _mpf(state.dofs), along)

    def tangent(self, state: State) -> list[Vector]:
        """Rows dR_i/du_j, derivative of `residual` (constants follow the state here)."""
        with mpmath.workdps(self.digits):
            h = mpmath.mpf(10) ** -self.step
            base = _mpf(state.dofs)
            columns = []
            for j in range(len(base)):
                plus, minus = (self._residual(state, _moved(base, j, s * h)) for s in (1, -1))
                columns.append([(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)])
            return [list(row) for row in zip(*columns, strict=True)]

    def product(self, state: State, direction: Sequence[Number], along: Rows = None) -> Vector:
        """Tangent times `direction`: one difference of the residual, where `tangent` takes ndof."""
        with mpmath.workdps(self.digits):
            return self._rate(state, "dofs", _mpf(direction), along)

    def derivative(self, state: State, array: str, index: int, along: Rows = None) -> Vector:
        """Derivative of the residual by one entry of `coordinates`, `data` or `parameters`."""
        with mpmath.workdps(self.digits):
            size = len(getattr(state, array))
            unit = [mpmath.mpf(k == index) for k in range(size)]
            return self._rate(state, array, unit, along)

    def _rate(self, state: State, array: str, direction: Vector, along: Rows) -> Vector:
        h = mpmath.mpf(10) ** -self.step
        base = _mpf(getattr(state, array))
        moved = (replace(state, **{array: _along(base, s * h, direction)}) for s in (1, -1))
        plus, minus = (self._residual(at, _mpf(at.dofs), along) for at in moved)
        return [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]

    def _residual(self, state: State, dofs: Vector, along: Rows = None) -> Vector:
        h = mpmath.mpf(10) ** -self.step
        frozen = self._frozen(state, dofs)
        size = range(len(dofs))
        vectors = [[int(i == j) for i in size] for j in size] if along is None else along
        out = []
        for v in vectors:
            plus, minus = (
                Walk(state, frozen, _along(dofs, s * h, v)).value(self.definition.potential)
                for s in (1, -1)
            )
            out.append((plus - minus) / (2 * h))
        return out

    def _frozen(self, state: State, dofs: Vector) -> dict[tuple[Node, int], Number]:
        walk = Walk(state, {}, dofs)
        return {
            (n, q): walk.at(n, q) for n in self.definition.constant for q in range(len(state.rule))
        }


def _mpf(values: Sequence[Number]) -> Vector:
    return [mpmath.mpf(v) for v in values]


def _along(values: Vector, step: Number, direction: Sequence[Number]) -> Vector:
    return [v + step * d for v, d in zip(values, direction, strict=True)]


def _moved(values: Vector, j: int, by: Number) -> Vector:
    return [v + by if i == j else v for i, v in enumerate(values)]


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
            "coordinates": _mpf(state.coordinates),
            "dofs": _mpf(state.dofs) if dofs is None else dofs,
            "data": _mpf(state.data),
            "parameters": _mpf(state.parameters),
        }
        self.known: dict[tuple[Node, int], Number] = {}

    def value(self, n: Node) -> Number:
        """Value of a node that does not vary with the point."""
        return self.at(n, 0)

    def at(self, n: Node, q: int) -> Number:
        """Value of a node at point `q`."""
        q = q if n.varying else 0
        key = (n, q)
        if key in self.frozen:
            return self.frozen[key]
        if key not in self.known:
            self.known[key] = self._compute(n, q)
        return self.known[key]

    def _compute(self, n: Node, q: int) -> Number:
        match n.op:
            case Op.CONST:
                return mpmath.mpf(n.value.numerator) / n.value.denominator
            case Op.PI:
                return +mpmath.pi
            case Op.INPUT:
                assert isinstance(n.payload, Input)
                return self._input(n.payload, q)
            case Op.SUM:
                return mpmath.fsum(self.at(n.args[0], k) for k in range(len(self.state.rule)))
            case Op.BRANCH:
                return self.at(n.args[1 if self.at(n.args[0], q) else 2], q)
            case Op.CALL:
                assert isinstance(n.payload, Routine)
                return results(n.payload, [self.at(a, q) for a in n.args], _local)
            case Op.ITEM:
                assert isinstance(n.payload, Place)
                return self.at(n.args[0], q)[n.payload.index]
            case Op.POW:
                e: Any = n.payload
                return self.at(n.args[0], q) ** (mpmath.mpf(e.numerator) / e.denominator)
        args = [self.at(a, q) for a in n.args]
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
        walk.arrays = {k: _mpf(v) for k, v in arrays.items()}
        return walk.value(root)
