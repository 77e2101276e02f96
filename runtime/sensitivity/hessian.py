"""Second derivatives of quantities by inputs: adjoints of second order.

The gradient is g = Q_p + L_p, with the Lagrangian L of all steps, whose adjoints are those of
`adjoint`. Its rate along a direction of the inputs needs the rates of the unknowns along it (one
linear solution a step, first to last) and the rates of the adjoints (another one, last to first).
All solutions have the tangents of the path. Exact to rounding; nothing is differenced but functions
of places.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.sensitivity.direct import (
    DirectState,
    argument_rates,
    initial_rates,
    tangent_step,
)
from softehl.runtime.sensitivity.element_curvatures import Adjoints, ElementCurvatures, Variation
from softehl.runtime.sensitivity.inputs import Input, InputSeeds, Key, Move
from softehl.runtime.sensitivity.linearised_step import LinearisedStep
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.sensitivity.tape import Tape, blocks_with_history, time_couplings


@dataclass(frozen=True, eq=False)
class HessianTerm:
    """A term of a sum whose second derivatives are computed: weight times quantity of a step."""

    tape: Tape
    quantity: Quantity
    weight: float = 1.0


def hessian_products(
    terms: Sequence[HessianTerm], inputs: Sequence[Input], directions: Array
) -> Array:
    """Hessian of a sum of quantities times directions (k, m), all components of the inputs.

    Raises StudyError where second derivatives do not exist.
    """
    products, waiting = np.zeros(np.shape(directions)), list(terms)
    while waiting:
        # the longest path has the others in it
        chain = max((term.tape.chain() for term in waiting), key=len)
        on_path = [term for term in waiting if any(term.tape is tape for tape in chain)]
        waiting = [term for term in waiting if term not in on_path]
        products += _Path(chain, on_path, inputs).products(directions)
    return products


def hessian_by_key(matrix: Array, inputs: Sequence[Input]) -> dict[tuple[Key, Key], float | Array]:
    """Entries (k, k) by pairs of inputs: a number, or an array of the components of each."""
    stops = np.cumsum([len(item.value) for item in inputs]).tolist()
    starts = [0, *stops[:-1]]
    entries: dict[tuple[Key, Key], float | Array] = {}
    for a, first, last in zip(inputs, starts, stops, strict=True):
        for b, left, right in zip(inputs, starts, stops, strict=True):
            part = matrix[first:last, left:right]
            part = part[0] if a.scalar else part
            part = part[..., 0] if b.scalar else part
            entries[a.key, b.key] = float(part) if np.ndim(part) == 0 else part.copy()
    return entries


@dataclass(eq=False)
class _CurvatureState:
    """Derivatives of the sum by the state after a step, or their rates along a direction.

    states: by the unknowns after it, and after the step before it, (n,) each. histories: by the
    point data after it.
    """

    states: list[Array]
    histories: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Record:
    """State before a step along a direction, and the rates of the unknowns in it, (n,)."""

    previous: DirectState
    unknowns: Array


@dataclass(frozen=True, eq=False)
class _Path:
    """The steps of a path, first to last, and the terms of the sum at them."""

    chain: Sequence[Tape]
    terms: Sequence[HessianTerm]
    inputs: Sequence[Input]

    def __post_init__(self) -> None:
        if self.chain[-1].system.contacts:
            raise StudyError(
                "second derivatives through contact of bodies do not exist: first ones do, "
                "result.sensitivity(...)"
            )

    def products(self, directions: Array) -> Array:
        """The Hessian of the sum times directions (k, m)."""
        products = np.zeros(np.shape(directions))
        records, n = self._forward(directions), len(self.chain[-1].x)
        adjoint = _CurvatureState([np.zeros(n), np.zeros(n)])
        rates = [replace(adjoint) for _ in directions.T]
        for tape, row in zip(reversed(self.chain), reversed(records), strict=True):
            back = _Back(self, LinearisedStep(tape))
            back.solve(adjoint)
            for m, record in enumerate(row):
                rates[m] = back.rate(rates[m], record, directions[:, m], products[:, m])
            adjoint = back.previous(adjoint, back.gradients)
        for points in self.moves(self.chain[0]).points:
            for m, state in enumerate(rates):
                points.pull(products[:, m], state.histories)
        return products

    def _forward(self, directions: Array) -> list[list[_Record]]:
        """Rates along all directions, step after step."""
        at_start = self.moves(self.chain[0])
        states = [initial_rates(at_start, seed) for seed in directions.T]
        records = []
        for tape in self.chain:
            step, moves, row = LinearisedStep(tape), self.moves(tape), []
            for seed, state in zip(directions.T, states, strict=True):
                previous = DirectState(list(state.states), dict(state.histories))
                row.append(_Record(previous, tangent_step(step, moves, seed, state)[0]))
            records.append(row)
        return records

    def moves(self, tape: Tape) -> InputSeeds:
        """All that moves with the inputs in a step; targets count all components."""
        columns, prescribed, points = [], [], []
        for start, item in zip(self._starts, self.inputs, strict=True):
            seeds = item.seeds(tape)
            if seeds.arrays:
                raise StudyError(
                    f"second derivatives by {item.key!r} do not exist: it has a run-time number of "
                    "values; first ones do, result.sensitivity(...)"
                )
            columns += [replace(c, target=_shifted(c.target, start)) for c in seeds.columns]
            prescribed += [replace(h, target=_shifted(h.target, start)) for h in seeds.prescribed]
            points += [replace(p, first=p.first + start) for p in seeds.points]
        return InputSeeds(columns, prescribed, points=points)

    def bends(self, tape: Tape, direction: Array) -> InputSeeds:
        """Rates of the factors of prescribed values."""
        parts = np.split(direction, self._starts[1:])
        moved = [Move(item, seed) for item, seed in zip(self.inputs, parts, strict=True)]
        curvatures = []
        for start, item in zip(self._starts, self.inputs, strict=True):
            for h in item.prescribed_curvatures(tape, moved):
                curvatures.append(replace(h, target=_shifted(h.target, start)))
        return InputSeeds(prescribed=curvatures)

    @property
    def _starts(self) -> list[int]:
        sizes = [len(item.value) for item in self.inputs]
        return [sum(sizes[:k]) for k in range(len(sizes))]


class _Back:
    """A step on the way from the last one to the first: adjoints, and their rates."""

    def __init__(self, path: _Path, step: LinearisedStep) -> None:
        self.path, self.step = path, step
        self._terms = [term for term in path.terms if term.tape is step.tape]
        self._moves = path.moves(step.tape)
        columns: dict[str, set[int]] = {}
        for c in self._moves.columns:
            columns.setdefault(c.block, set()).add(c.column)
        self._curvatures = {
            name: ElementCurvatures(elements, columns.get(name, ()))
            for name, elements in step.blocks.items()
        }

    def solve(self, state: _CurvatureState) -> None:
        """Compute the adjoints of this step, and the derivatives by all arguments of elements."""
        step, n = self.step, len(self.step.tape.x)
        slope, weights = state.states[0].copy(), np.zeros(n)
        for term in self._terms:
            slope += term.weight * term.quantity.slope(step)
            weights += term.weight * term.quantity.weights(step)
        of_history = {name: self._adjoints(np.zeros(n), name, state) for name in state.histories}
        gradients = {name: self._curvatures[name].gradient(a) for name, a in of_history.items()}
        slope += self._by_unknowns(gradients)
        adjoint = step.adjoint(slope)
        self._at_supports = slope - step.transposed_times(adjoint)
        acting = step.reacting()
        self.adjoints = {
            name: self._adjoints(weights - adjoint if name in acting else -adjoint, name, state)
            for name in step.blocks
        }
        self.gradients = {
            name: self._curvatures[name].gradient(a) for name, a in self.adjoints.items()
        }

    def rate(
        self, state: _CurvatureState, record: _Record, direction: Array, product: Array
    ) -> _CurvatureState:
        """Add the part of this step to the product (k,); return the rates before the step."""
        step, dx, none = self.step, record.unknowns, np.zeros(len(record.unknowns))
        rows = argument_rates(step, self._moves, direction, record.previous)
        along = {
            name: Variation(
                rows.get(name, elements.zero_rows()),
                dx[elements.block.dofs],
                record.previous.histories.get(name),
            )
            for name, elements in step.blocks.items()
        }
        slope = state.states[0] + self._by_unknowns(self._rates(along, none, state))
        for term in self._terms:
            slope += term.weight * term.quantity.curvature(step, dx)
        adjoint = step.adjoint(slope)
        at_supports = slope - step.transposed_times(adjoint)
        rates = self._rates(along, -adjoint, state)
        for column in self._moves.columns:
            if column.block in rates:
                column.pull(product, rates[column.block].rows[:, column.column])
        self._moves.pull_prescribed(product, at_supports)
        self.path.bends(step.tape, direction).pull_prescribed(product, self._at_supports)
        return self.previous(state, rates)

    def previous(
        self, state: _CurvatureState, gradients: Mapping[str, Variation]
    ) -> _CurvatureState:
        """Derivatives by the state after the previous step, or their rates."""
        tape = self.step.tape
        earlier = [state.states[1].copy(), np.zeros(len(tape.x))]
        for c in time_couplings(tape):
            for weight, total in zip(c.weights, earlier, strict=False):
                np.add.at(total, c.dofs, weight * gradients[c.block].rows[:, c.column])
        histories = {}
        for name in blocks_with_history(tape):
            by_history, after = gradients[name].history, state.histories.get(name)
            assert by_history is not None
            kernel = tape.system.blocks[name].kernel
            for column, datum in enumerate(kernel.point_data):
                if datum not in kernel.history and after is not None:
                    by_history[:, :, column] += after[:, :, column]
            histories[name] = by_history
        return _CurvatureState(earlier, histories)

    def _rates(
        self, along: Mapping[str, Variation], adjoint_rate: Array, state: _CurvatureState
    ) -> dict[str, Variation]:
        """Rates of the derivatives by all arguments of elements. adjoint_rate: (n,)."""
        return {
            name: curvatures.rates(
                self.adjoints[name], along[name], self._adjoints(adjoint_rate, name, state)
            )
            for name, curvatures in self._curvatures.items()
        }

    def _adjoints(self, values: Array, name: str, state: _CurvatureState) -> Adjoints:
        """Of a block, of values (n,) at all unknowns."""
        return Adjoints(values[self.step.blocks[name].block.dofs], state.histories.get(name))

    def _by_unknowns(self, gradients: Mapping[str, Variation]) -> Array:
        return self.step.summed({name: g.dofs for name, g in gradients.items()})


def _shifted(target: Integers, start: int) -> Integers:
    shifted: Integers = np.where(target >= 0, target + start, -1)
    return shifted
