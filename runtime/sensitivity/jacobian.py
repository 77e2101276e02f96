"""Derivatives of what results say, directly or by adjoints, whichever takes fewer steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.adjoint import gradient
from softehl.runtime.sensitivity.direct import along_path
from softehl.runtime.sensitivity.inputs import Input, Key
from softehl.runtime.sensitivity.linearised_step import Linear
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.sensitivity.tape import Trail, carried, remembering

Entry = tuple[Trail, Quantity]
"""A quantity of a converged step."""


def jacobian(entries: Sequence[Entry], inputs: Sequence[Input]) -> Array:
    """Derivatives (m, k) of m quantities by all components of the inputs."""
    k = sum(len(item.value) for item in inputs)
    if _direct_is_cheaper(entries, k):
        return _directly(entries, inputs, k)
    rows = [np.concatenate(gradient(t.chain(), q, inputs)) for t, q in entries]
    return np.stack(rows)


def sensitivity(
    trail: Trail, quantity: Quantity, inputs: Sequence[Input]
) -> dict[Key, float | Array]:
    """Derivatives of a quantity by each input: a number, or an array of its components."""
    row = jacobian([(trail, quantity)], inputs)[0]
    return by_key(row, inputs)


def by_key(row: Array, inputs: Sequence[Input]) -> dict[Key, float | Array]:
    """Values of all components, (k,), input by input."""
    found: dict[Key, float | Array] = {}
    start = 0
    for item in inputs:
        size = len(item.value)
        part = row[start : start + size]
        found[item.key] = float(part[0]) if item.scalar else part.copy()
        start += size
    return found


def derivative(trail: Trail, inputs: Sequence[Input]) -> Array:
    """Derivatives (n, k) of all unknowns by all components of the inputs."""
    *_, last = along_path(trail.chain(), inputs)
    return last.unknowns


def _directly(entries: Sequence[Entry], inputs: Sequence[Input], k: int) -> Array:
    """One solution a step for each component; entries of one path share them."""
    found = np.empty((len(entries), k))
    waiting = dict(enumerate(entries))
    while waiting:
        # the longest path has the others in it
        chain = max((entry[0].chain() for entry in waiting.values()), key=len)
        for rates in along_path(chain, inputs):
            here = [n for n, (trail, _) in waiting.items() if trail is rates.trail]
            for n in here:
                found[n] = _row(waiting.pop(n)[1], rates.linear, rates.unknowns, rates.forces)
    return found


def _row(quantity: Quantity, linear: Linear, unknowns: Array, forces: Array) -> Array:
    slope, weights = quantity.slope(linear), quantity.weights(linear)
    return np.asarray(slope @ unknowns + weights @ forces)


def _direct_is_cheaper(entries: Sequence[Entry], k: int) -> bool:
    """By the number of linear solutions; calls of kernels count as much where a path is long."""
    trail = entries[0][0]
    calls = len(list(carried(trail)))
    for name in remembering(trail):
        block = trail.system.blocks[name]
        points = len(block.kernel.default_rule.weights)
        calls += (points + 1) * len(block.kernel.point_data) + len(block.slots)
    return 2 * k <= len(entries) * (2 + calls)
