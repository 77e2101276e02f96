"""Derivatives of all unknowns by inputs, step after step: one linear solution for each input."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.inputs import Input, Moves
from softehl.runtime.sensitivity.linearised_step import Linear
from softehl.runtime.sensitivity.tape import Trail, carried, remembering


@dataclass(eq=False)
class _Front:
    """Rates along one input after the steps so far, latest first: unknowns (n,), point data."""

    states: list[Array] = field(default_factory=list)
    histories: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Rates:
    """Derivatives at one step: of the unknowns (n, k), and of the forces that make reactions at
    unknowns that do not move, (n, k).
    """

    trail: Trail
    linear: Linear
    unknowns: Array
    forces: Array


def along_path(chain: Sequence[Trail], inputs: Sequence[Input]) -> Iterator[Rates]:
    """Derivatives after each step of a chain by all components of the inputs."""
    seeds = [(k, j) for k, item in enumerate(inputs) for j in range(len(item.value))]
    sizes = [len(item.value) for item in inputs]
    fronts = [_Front() for _ in seeds]
    for trail in chain:
        linear = Linear(trail)
        moves = [item.moves(trail) for item in inputs]
        found = []
        for (k, j), front in zip(seeds, fronts, strict=True):
            seed = np.zeros(sizes[k])
            seed[j] = 1.0
            found.append(_step(linear, moves[k], seed, front))
        unknowns, forces = (np.stack(part, axis=1) for part in zip(*found, strict=True))
        yield Rates(trail, linear, unknowns, forces)


def _step(linear: Linear, moves: Moves, seed: Array, front: _Front) -> tuple[Array, Array]:
    """Go one step on along one component of an input."""
    rows = _rows(linear, moves, seed, front)
    parts: dict[str, Array] = {}
    for name, elements in linear.blocks.items():
        history = front.histories.get(name)
        if rows.get(name) is not None or (history is not None and history.any()):
            parts[name] = elements.residual(rows.get(name, elements.still()), history)
    held = np.zeros(len(linear.trail.x))
    for h in moves.held:
        there = h.target >= 0
        held[h.numbers[there]] = h.factor[there] * seed[h.target[there]]
    dx = linear.solve(-linear.summed(parts), held)
    for name in remembering(linear.trail):
        elements = linear.blocks[name]
        moved = dx[elements.block.dofs]
        given = rows.get(name, elements.still())
        before = front.histories.get(name)
        after = elements.history(given, moved, before)
        _keep_still(linear, name, after, before)
        front.histories[name] = after
    front.states = [dx, *front.states][:2]
    acting = linear.reacting()
    forces = linear.summed({n: v for n, v in parts.items() if n in acting})
    return dx, forces


def _keep_still(linear: Linear, name: str, after: Array, before: Array | None) -> None:
    """Leave point data that are no history as they are."""
    kernel = linear.trail.system.blocks[name].kernel
    for column, datum in enumerate(kernel.point_data):
        if datum not in kernel.history and before is not None:
            after[:, :, column] = before[:, :, column]


def _rows(linear: Linear, moves: Moves, seed: Array, front: _Front) -> Mapping[str, Array]:
    """Rates of the arguments of all blocks that move."""
    rows: dict[str, Array] = {}
    for column in moves.columns:
        if column.block in linear.blocks:
            into = rows.setdefault(column.block, linear.blocks[column.block].still())
            column.push(into, seed)
    if front.states:
        for c in carried(linear.trail):
            into = rows.setdefault(c.block, linear.blocks[c.block].still())
            for weight, state in zip(c.weights, front.states, strict=False):
                into[:, c.column] += weight * state[c.numbers]
    return rows
