"""Gradient of one quantity by inputs: one adjoint solution a step, last to first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.element_derivatives import ArrayRates, ElementDerivatives
from softehl.runtime.sensitivity.inputs import ArraySeeds, Input, InputSeeds
from softehl.runtime.sensitivity.linearised_step import LinearisedStep
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.sensitivity.tape import Tape, blocks_with_history, time_couplings


@dataclass(eq=False)
class _AdjointState:
    """Derivatives of the quantity by the state after a step.

    states: by the unknowns after it, and after the step before it, (n,) each. histories: by the
    point data after it.
    """

    states: list[Array]
    histories: dict[str, Array] = field(default_factory=dict)


def gradient(chain: Sequence[Tape], quantity: Quantity, inputs: Sequence[Input]) -> list[Array]:
    """Derivatives of a quantity of the last step by each input, (k,) each."""
    gradients = [np.zeros(len(item.value)) for item in inputs]
    last = LinearisedStep(chain[-1])
    weights = quantity.weights(last)
    n = len(chain[-1].x)
    state = _AdjointState([quantity.slope(last), np.zeros(n)])
    for tape in reversed(chain):
        step = last if tape is chain[-1] else LinearisedStep(tape)
        moves = [item.seeds(tape) for item in inputs]
        first = tape is chain[0] and not any(move.points for move in moves)
        state = _step(step, state, weights, moves, gradients, first=first)
        weights = np.zeros(n)
    for item, total in zip(inputs, gradients, strict=True):
        for points in item.seeds(chain[0]).points:
            points.pull(total, state.histories)
    return gradients


def _step(
    step: LinearisedStep,
    state: _AdjointState,
    weights: Array,
    inputs: Sequence[InputSeeds],
    gradients: list[Array],
    *,
    first: bool,
) -> _AdjointState:
    """Go one step back, and add the derivatives by the inputs in it to the gradients.

    weights: (n,) of the forces that make reactions, in the quantity.
    """
    slope = state.states[0].copy()
    for name, mu in state.histories.items():
        _by_unknowns(slope, step.blocks[name], mu)
    adjoint = step.adjoint(slope)
    acting = step.reacting()
    element_gradients = {
        name: _ElementGradient(
            elements,
            (weights - adjoint if name in acting else -adjoint)[elements.block.dofs],
            state.histories.get(name),
        )
        for name, elements in step.blocks.items()
    }
    held_slope = slope - step.transposed_times(adjoint)
    for moves, total in zip(inputs, gradients, strict=True):
        for column in moves.columns:
            if column.block in element_gradients:
                column.pull(total, element_gradients[column.block].by(column.column))
        for move in moves.arrays:
            if move.block in element_gradients:
                total += element_gradients[move.block].by_array(move, len(total))
        for prescribed in moves.prescribed:
            mask = prescribed.target >= 0
            rates = prescribed.factor[mask] * held_slope[prescribed.dofs[mask]]
            np.add.at(total, prescribed.target[mask], rates)
    return _AdjointState([]) if first else _previous_step(step, state, element_gradients)


def _previous_step(
    step: LinearisedStep, back: _AdjointState, element_gradients: dict[str, _ElementGradient]
) -> _AdjointState:
    """Derivatives of the quantity by the state after the previous step."""
    earlier = [back.states[1], np.zeros(len(step.tape.x))]
    for c in time_couplings(step.tape):
        gradient = element_gradients[c.block].by(c.column)
        for weight, state in zip(c.weights, earlier, strict=False):
            np.add.at(state, c.dofs, weight * gradient)
    histories = {}
    for name in blocks_with_history(step.tape):
        mu = element_gradients[name].by_history()
        kernel = step.tape.system.blocks[name].kernel
        for column, datum in enumerate(kernel.point_data):
            after = back.histories.get(name)
            if datum not in kernel.history and after is not None:
                mu[:, :, column] += after[:, :, column]
        histories[name] = mu
    return _AdjointState(earlier, histories)


def _by_unknowns(slope: Array, elements: ElementDerivatives, mu: Array) -> None:
    """Add the derivative by the unknowns of mu times the history after the step."""
    if not mu.any():
        return
    zero_rows, dofs = elements.zero_rows(), elements.block.dofs
    for k in range(dofs.shape[1]):
        direction = np.zeros(dofs.shape)
        direction[:, k] = 1.0
        np.add.at(slope, dofs[:, k], _dot(mu, elements.history(zero_rows, direction)))


@dataclass(frozen=True, eq=False)
class _ElementGradient:
    """Derivatives by the arguments of the elements of a block, of left (n, ndof) times their
    residuals plus mu times their history after the step.
    """

    elements: ElementDerivatives
    left: Array
    mu: Array | None
    _cached: dict[int, Array] = field(default_factory=dict)

    def by(self, column: int) -> Array:
        """By one argument, (n,)."""
        if column not in self._cached:
            rows = self.elements.zero_rows()
            rows[:, column] = 1.0
            self._cached[column] = self._along(rows, None)
        return self._cached[column]

    def by_array(self, move: ArraySeeds, count: int) -> Array:
        """By the components of an input with which a run-time array moves, (count,)."""
        zero_rows, gradient = self.elements.zero_rows(), np.zeros(count)
        for k, seed in enumerate(np.eye(count)):
            gradient[k] = self._along(zero_rows, None, {move.name: move.rate(seed)}).sum()
        return gradient

    def by_history(self) -> Array:
        """By the point data before the step, (n, points, k)."""
        block = self.elements.block
        assert block.point_data is not None
        gradient: Array = np.zeros_like(block.point_data)
        zero_rows, (_, points, count) = self.elements.zero_rows(), block.point_data.shape
        for k in range(count):
            for q in range(points):
                direction = np.zeros(gradient.shape)
                direction[:, q, k] = 1.0
                gradient[:, q, k] = (self.left * self.elements.residual(zero_rows, direction)).sum(
                    axis=1
                )
            if self.mu is not None and self.mu.any():
                direction = np.zeros(gradient.shape)
                direction[:, :, k] = 1.0
                after = self.elements.history(zero_rows, None, direction)
                gradient[:, :, k] += (self.mu * after).sum(axis=2)
        return gradient

    def _along(self, rows: Array, history: Array | None, arrays: ArrayRates | None = None) -> Array:
        gradient = (self.left * self.elements.residual(rows, history, arrays)).sum(axis=1)
        if self.mu is not None and self.mu.any():
            gradient += _dot(self.mu, self.elements.history(rows, None, history, arrays))
        return np.asarray(gradient)


def _dot(mu: Array, after: Array) -> Array:
    return np.asarray((mu * after).sum(axis=(1, 2)))
