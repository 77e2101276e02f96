"""Gradient of one quantity by inputs: one adjoint solution a step, last to first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.element_derivatives import Elements
from softehl.runtime.sensitivity.inputs import Input
from softehl.runtime.sensitivity.linearised_step import LinearisedStep
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.sensitivity.tape import Tape, blocks_with_history, time_couplings


@dataclass(eq=False)
class _Back:
    """Derivatives of the quantity by what a step leaves behind.

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
    back = _Back([quantity.slope(last), np.zeros(n)])
    for tape in reversed(chain):
        linear = last if tape is chain[-1] else LinearisedStep(tape)
        first = tape is chain[0]
        back = _step(linear, back, weights, inputs, gradients, first=first)
        weights = np.zeros(n)
    return gradients


def _step(
    linear: LinearisedStep,
    back: _Back,
    weights: Array,
    inputs: Sequence[Input],
    gradients: list[Array],
    *,
    first: bool,
) -> _Back:
    """Go one step back; what the inputs do in it is added to what was found.

    weights: (n,) of the forces that make reactions, in the quantity.
    """
    slope = back.states[0].copy()
    for name, mu in back.histories.items():
        _by_unknowns(slope, linear.blocks[name], mu)
    adjoint = linear.adjoint(slope)
    acting = linear.reacting()
    pulls = {
        name: _Pull(
            elements,
            (weights - adjoint if name in acting else -adjoint)[elements.block.dofs],
            back.histories.get(name),
        )
        for name, elements in linear.blocks.items()
    }
    held_slope = slope - linear.transposed_times(adjoint)
    for item, total in zip(inputs, gradients, strict=True):
        moves = item.seeds(linear.tape)
        for column in moves.columns:
            if column.block in pulls:
                column.pull(total, pulls[column.block].by(column.column))
        for prescribed in moves.prescribed:
            mask = prescribed.target >= 0
            rates = prescribed.factor[mask] * held_slope[prescribed.numbers[mask]]
            np.add.at(total, prescribed.target[mask], rates)
    return _Back([]) if first else _previous_step(linear, back, pulls)


def _previous_step(linear: LinearisedStep, back: _Back, pulls: dict[str, _Pull]) -> _Back:
    """Derivatives by what the step before leaves behind."""
    earlier = [back.states[1], np.zeros(len(linear.tape.x))]
    for c in time_couplings(linear.tape):
        gradient = pulls[c.block].by(c.column)
        for weight, state in zip(c.weights, earlier, strict=False):
            np.add.at(state, c.numbers, weight * gradient)
    histories = {}
    for name in blocks_with_history(linear.tape):
        mu = pulls[name].by_history()
        kernel = linear.tape.system.blocks[name].kernel
        for column, datum in enumerate(kernel.point_data):
            after = back.histories.get(name)
            if datum not in kernel.history and after is not None:
                mu[:, :, column] += after[:, :, column]
        histories[name] = mu
    return _Back(earlier, histories)


def _by_unknowns(slope: Array, elements: Elements, mu: Array) -> None:
    """Add the derivative by the unknowns of mu times the history after the step."""
    if not mu.any():
        return
    zero_rows, dofs = elements.zero_rows(), elements.block.dofs
    for k in range(dofs.shape[1]):
        moved = np.zeros(dofs.shape)
        moved[:, k] = 1.0
        np.add.at(slope, dofs[:, k], _dot(mu, elements.history(zero_rows, moved)))


@dataclass(frozen=True, eq=False)
class _Pull:
    """Derivatives by the arguments of the elements of a block, of left (n, ndof) times their
    residuals plus mu times their history after the step.
    """

    elements: Elements
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

    def by_history(self) -> Array:
        """By the point data before the step, (n, points, k)."""
        block = self.elements.block
        assert block.point_data is not None
        gradient: Array = np.zeros_like(block.point_data)
        zero_rows, (_, points, count) = self.elements.zero_rows(), block.point_data.shape
        for k in range(count):
            for q in range(points):
                moved = np.zeros(gradient.shape)
                moved[:, q, k] = 1.0
                gradient[:, q, k] = (self.left * self.elements.residual(zero_rows, moved)).sum(
                    axis=1
                )
            if self.mu is not None and self.mu.any():
                moved = np.zeros(gradient.shape)
                moved[:, :, k] = 1.0
                after = self.elements.history(zero_rows, None, moved)
                gradient[:, :, k] += (self.mu * after).sum(axis=2)
        return gradient

    def _along(self, rows: Array, history: Array | None) -> Array:
        gradient = (self.left * self.elements.residual(rows, history)).sum(axis=1)
        if self.mu is not None and self.mu.any():
            gradient += _dot(self.mu, self.elements.history(rows, None, history))
        return np.asarray(gradient)


def _dot(mu: Array, after: Array) -> Array:
    return np.asarray((mu * after).sum(axis=(1, 2)))
