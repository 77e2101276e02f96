"""Gradient of one quantity by inputs: one adjoint solution a step, last to first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.element_derivatives import Elements
from softehl.runtime.sensitivity.inputs import Input
from softehl.runtime.sensitivity.linearised_step import Linear
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.sensitivity.tape import Trail, carried, remembering


@dataclass(eq=False)
class _Back:
    """Derivatives of the quantity by what a step leaves behind.

    states: by the unknowns after it, and after the step before it, (n,) each. histories: by the
    point data after it.
    """

    states: list[Array]
    histories: dict[str, Array] = field(default_factory=dict)


def gradient(chain: Sequence[Trail], quantity: Quantity, inputs: Sequence[Input]) -> list[Array]:
    """Derivatives of a quantity of the last step by each input, (k,) each."""
    found = [np.zeros(len(item.value)) for item in inputs]
    last = Linear(chain[-1])
    weights = quantity.weights(last)
    n = len(chain[-1].x)
    back = _Back([quantity.slope(last), np.zeros(n)])
    for trail in reversed(chain):
        linear = last if trail is chain[-1] else Linear(trail)
        first = trail is chain[0]
        back = _step(linear, back, weights, inputs, found, first=first)
        weights = np.zeros(n)
    return found


def _step(
    linear: Linear,
    back: _Back,
    weights: Array,
    inputs: Sequence[Input],
    found: list[Array],
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
    for item, total in zip(inputs, found, strict=True):
        moves = item.moves(linear.trail)
        for column in moves.columns:
            if column.block in pulls:
                column.pull(total, pulls[column.block].by(column.column))
        for held in moves.held:
            there = held.target >= 0
            rates = held.factor[there] * held_slope[held.numbers[there]]
            np.add.at(total, held.target[there], rates)
    return _Back([]) if first else _before(linear, back, pulls)


def _before(linear: Linear, back: _Back, pulls: dict[str, _Pull]) -> _Back:
    """Derivatives by what the step before leaves behind."""
    earlier = [back.states[1], np.zeros(len(linear.trail.x))]
    for c in carried(linear.trail):
        slopes = pulls[c.block].by(c.column)
        for weight, state in zip(c.weights, earlier, strict=False):
            np.add.at(state, c.numbers, weight * slopes)
    histories = {}
    for name in remembering(linear.trail):
        mu = pulls[name].by_history()
        kernel = linear.trail.system.blocks[name].kernel
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
    still, dofs = elements.still(), elements.block.dofs
    for k in range(dofs.shape[1]):
        moved = np.zeros(dofs.shape)
        moved[:, k] = 1.0
        np.add.at(slope, dofs[:, k], _dot(mu, elements.history(still, moved)))


@dataclass(frozen=True, eq=False)
class _Pull:
    """Derivatives by the arguments of the elements of a block, of left (n, ndof) times their
    residuals plus mu times their history after the step.
    """

    elements: Elements
    left: Array
    mu: Array | None
    _known: dict[int, Array] = field(default_factory=dict)

    def by(self, column: int) -> Array:
        """By one argument, (n,)."""
        if column not in self._known:
            rows = self.elements.still()
            rows[:, column] = 1.0
            self._known[column] = self._along(rows, None)
        return self._known[column]

    def by_history(self) -> Array:
        """By the point data before the step, (n, points, k)."""
        block = self.elements.block
        assert block.point_data is not None
        found: Array = np.zeros_like(block.point_data)
        still, (_, points, count) = self.elements.still(), block.point_data.shape
        for k in range(count):
            for q in range(points):
                moved = np.zeros(found.shape)
                moved[:, q, k] = 1.0
                found[:, q, k] = (self.left * self.elements.residual(still, moved)).sum(axis=1)
            if self.mu is not None and self.mu.any():
                moved = np.zeros(found.shape)
                moved[:, :, k] = 1.0
                after = self.elements.history(still, None, moved)
                found[:, :, k] += (self.mu * after).sum(axis=2)
        return found

    def _along(self, rows: Array, history: Array | None) -> Array:
        slopes = (self.left * self.elements.residual(rows, history)).sum(axis=1)
        if self.mu is not None and self.mu.any():
            slopes += _dot(self.mu, self.elements.history(rows, None, history))
        return np.asarray(slopes)


def _dot(mu: Array, after: Array) -> Array:
    return np.asarray((mu * after).sum(axis=(1, 2)))
