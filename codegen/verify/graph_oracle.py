"""The slow oracle: walks the *unoptimised* graph of a model in arbitrary precision.

It shares nothing with differentiation, passes, schedule or emission.  Derivatives are central
differences in so many digits that their error is far below double precision: the residual is
the derivative of the potential with the frozen quantities held at their values in the base state,
the tangent is the derivative of that residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mpmath

from softehl.codegen.graph.evaluation import EvaluationState, Number, Vector, Walk, exact
from softehl.codegen.graph.graph import Node
from softehl.codegen.language.definition import Definition

Rows = Sequence[Sequence[Number]] | None


@dataclass(frozen=True)
class Oracle:
    """Values and derivatives of one model, with `digits` digits of working precision."""

    definition: Definition
    digits: int = 90
    step: int = 20

    def potential(self, state: EvaluationState) -> Number:
        """Value of the (pseudo-)potential."""
        with mpmath.workdps(self.digits):
            return Walk(state, {}).value(self.definition.potential)

    def fields(self, state: EvaluationState) -> list[Vector]:
        """Field values, [point][field]."""
        with mpmath.workdps(self.digits):
            walk = Walk(state, {})
            nodes = [n for _, n in self.definition.fields]
            return [[walk.at(n, q) for n in nodes] for q in range(len(state.rule))]

    def residual(self, state: EvaluationState, along: Rows = None) -> Vector:
        """Derivative of the potential with the constants frozen at `state`.

        Every component; with `along` the products of these vectors with it, which are cheaper
        where they are fewer (so in `product` and `derivative`).
        """
        with mpmath.workdps(self.digits):
            return self._residual(state, exact(state.dofs), along)

    def tangent(self, state: EvaluationState) -> list[Vector]:
        """Rows dR_i/du_j, derivative of `residual` (constants follow the state here)."""
        with mpmath.workdps(self.digits):
            h = mpmath.mpf(10) ** -self.step
            base = exact(state.dofs)
            columns = []
            for j in range(len(base)):
                plus, minus = (self._residual(state, _moved(base, j, s * h)) for s in (1, -1))
                columns.append([(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)])
            return [list(row) for row in zip(*columns, strict=True)]

    def product(
        self, state: EvaluationState, direction: Sequence[Number], along: Rows = None
    ) -> Vector:
        """Tangent times `direction`: one difference of the residual, where `tangent` takes ndof."""
        with mpmath.workdps(self.digits):
            return self._rate(state, "dofs", exact(direction), along)

    def derivative(
        self, state: EvaluationState, array: str, index: int, along: Rows = None
    ) -> Vector:
        """Derivative of the residual by one entry of `coordinates`, `data` or `parameters`."""
        with mpmath.workdps(self.digits):
            size = len(getattr(state, array))
            unit = [mpmath.mpf(k == index) for k in range(size)]
            return self._rate(state, array, unit, along)

    def pseudo_load(
        self, state: EvaluationState, direction: Sequence[Number], along: Rows = None
    ) -> Vector:
        """Derivative of the residual along a variation of coordinates, data and parameters."""
        with mpmath.workdps(self.digits):
            h = mpmath.mpf(10) ** -self.step
            moved = (_varied(state, s * h, direction) for s in (1, -1))
            plus, minus = (self._residual(at, exact(at.dofs), along) for at in moved)
            return [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]

    def fields_rate(self, state: EvaluationState, direction: Sequence[Number]) -> list[Vector]:
        """Derivative of the fields, [point][field], along a variation that ends with the dofs."""
        h = mpmath.mpf(10) ** -self.step
        with mpmath.workdps(self.digits):
            plus, minus = (self.fields(_varied(state, s * h, direction)) for s in (1, -1))
            return [
                [(a - b) / (2 * h) for a, b in zip(*rows, strict=True)]
                for rows in zip(plus, minus, strict=True)
            ]

    def _rate(self, state: EvaluationState, array: str, direction: Vector, along: Rows) -> Vector:
        h = mpmath.mpf(10) ** -self.step
        base = exact(getattr(state, array))
        moved = (replace(state, **{array: _along(base, s * h, direction)}) for s in (1, -1))
        plus, minus = (self._residual(at, exact(at.dofs), along) for at in moved)
        return [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]

    def _residual(self, state: EvaluationState, dofs: Vector, along: Rows = None) -> Vector:
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

    def _frozen(self, state: EvaluationState, dofs: Vector) -> dict[tuple[Node, int], Number]:
        walk = Walk(state, {}, dofs)
        return {
            (n, q): walk.at(n, q) for n in self.definition.constant for q in range(len(state.rule))
        }


def _varied(state: EvaluationState, step: Number, direction: Sequence[Number]) -> EvaluationState:
    """State displaced along a direction of coordinates, data, parameters and optionally dofs."""
    moved, entries = {}, list(direction)
    for array in ("coordinates", "data", "parameters", "dofs"):
        values = exact(getattr(state, array))
        along = (entries[: len(values)] + [0] * len(values))[: len(values)]
        moved[array], entries = _along(values, step, along), entries[len(values) :]
    return replace(state, **moved)


def _along(values: Vector, step: Number, direction: Sequence[Number]) -> Vector:
    return [v + step * d for v, d in zip(values, direction, strict=True)]


def _moved(values: Vector, j: int, by: Number) -> Vector:
    return [v + by if i == j else v for i, v in enumerate(values)]
