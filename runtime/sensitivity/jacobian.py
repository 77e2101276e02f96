"""Derivatives of quantities of results: direct or adjoint, whichever takes fewer solutions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.adjoint import gradient
from softehl.runtime.sensitivity.direct import along_path
from softehl.runtime.sensitivity.inputs import Input, Key
from softehl.runtime.sensitivity.linearised_step import LinearisedStep
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.sensitivity.tape import Tape, blocks_with_history, time_couplings

Entry = tuple[Tape, Quantity]
"""A quantity of a converged step."""


def jacobian(entries: Sequence[Entry], inputs: Sequence[Input]) -> Array:
    """Derivatives (m, k) of m quantities by all components of the inputs."""
    k = sum(len(item.value) for item in inputs)
    if _direct_is_cheaper(entries, k):
        return _direct_jacobian(entries, inputs, k)
    rows = [np.concatenate(gradient(t.chain(), q, inputs)) for t, q in entries]
    return np.stack(rows)


def sensitivity(
    tape: Tape, quantity: Quantity, inputs: Sequence[Input]
) -> dict[Key, float | Array]:
    """Derivatives of a quantity by each input: a number, or an array of its components."""
    row = jacobian([(tape, quantity)], inputs)[0]
    return by_key(row, inputs)


def by_key(row: Array, inputs: Sequence[Input]) -> dict[Key, float | Array]:
    """Values of all components, (k,), input by input."""
    values: dict[Key, float | Array] = {}
    start = 0
    for item in inputs:
        size = len(item.value)
        part = row[start : start + size]
        values[item.key] = float(part[0]) if item.scalar else part.copy()
        start += size
    return values


def derivative(tape: Tape, inputs: Sequence[Input]) -> Array:
    """Derivatives (n, k) of all unknowns by all components of the inputs."""
    *_, last = along_path(tape.chain(), inputs)
    return last.unknowns


def _direct_jacobian(entries: Sequence[Entry], inputs: Sequence[Input], k: int) -> Array:
    """One solution a step for each component; entries of one path share them."""
    rows = np.empty((len(entries), k))
    waiting = dict(enumerate(entries))
    while waiting:
        # the longest path has the others in it
        chain = max((entry[0].chain() for entry in waiting.values()), key=len)
        for rates in along_path(chain, inputs):
            finished = [n for n, (tape, _) in waiting.items() if tape is rates.tape]
            for n in finished:
                rows[n] = _row(waiting.pop(n)[1], rates.step, rates.unknowns, rates.forces)
    return rows


def _row(quantity: Quantity, step: LinearisedStep, unknowns: Array, forces: Array) -> Array:
    slope, weights = quantity.slope(step), quantity.weights(step)
    return np.asarray(slope @ unknowns + weights @ forces)


def _direct_is_cheaper(entries: Sequence[Entry], k: int) -> bool:
    """By the number of linear solutions; calls of kernels count as much where a path is long."""
    tape = entries[0][0]
    calls = len(list(time_couplings(tape)))
    for name in blocks_with_history(tape):
        block = tape.system.blocks[name]
        points = len(block.kernel.default_rule.weights)
        calls += (points + 1) * len(block.kernel.point_data) + len(block.slots)
    return 2 * k <= len(entries) * (2 + calls)
