"""Derivatives of all unknowns by inputs, step after step: one linear solution for each input."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.sensitivity.inputs import Input, InputSeeds
from softehl.runtime.sensitivity.linearised_step import LinearisedStep
from softehl.runtime.sensitivity.tape import Tape, blocks_with_history, time_couplings


@dataclass(eq=False)
class DirectState:
    """Rates along one input after the steps so far, latest first: unknowns (n,), point data."""

    states: list[Array] = field(default_factory=list)
    histories: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Rates:
    """Derivatives at one step: of the unknowns (n, k), and of the forces that make reactions at
    unknowns that do not move, (n, k).
    """

    tape: Tape
    step: LinearisedStep
    unknowns: Array
    forces: Array


def along_path(chain: Sequence[Tape], inputs: Sequence[Input]) -> Iterator[Rates]:
    """Derivatives after each step of a chain by all components of the inputs."""
    seeds = [(k, j) for k, item in enumerate(inputs) for j in range(len(item.value))]
    sizes = [len(item.value) for item in inputs]
    at_start = [item.seeds(chain[0]) for item in inputs]
    fronts = [initial_rates(at_start[k], _unit(sizes[k], j)) for k, j in seeds]
    for tape in chain:
        step = LinearisedStep(tape)
        moves = [item.seeds(tape) for item in inputs]
        rates = []
        for (k, j), state in zip(seeds, fronts, strict=True):
            seed = _unit(sizes[k], j)
            rates.append(tangent_step(step, moves[k], seed, state))
        unknowns, forces = (np.stack(part, axis=1) for part in zip(*rates, strict=True))
        yield Rates(tape, step, unknowns, forces)


def _unit(size: int, number: int) -> Array:
    """Unit vector (size,)."""
    seed = np.zeros(size)
    seed[number] = 1.0
    return seed


def initial_rates(moves: InputSeeds, seed: Array) -> DirectState:
    """Rates before the first step along one component of an input."""
    state = DirectState()
    for points in moves.points:
        points.push(state.histories, seed)
    return state


def tangent_step(
    step: LinearisedStep, moves: InputSeeds, seed: Array, state: DirectState
) -> tuple[Array, Array]:
    """Go one step on along one component of an input."""
    rows = argument_rates(step, moves, seed, state)
    arrays = _array_rates(step, moves, seed)
    parts: dict[str, Array] = {}
    for name, elements in step.blocks.items():
        history, moving = state.histories.get(name), arrays.get(name)
        if rows.get(name) is not None or moving or (history is not None and history.any()):
            block_rows = rows.get(name, elements.zero_rows())
            parts[name] = elements.residual(block_rows, history, moving)
    prescribed = np.zeros(len(step.tape.x))
    for h in moves.prescribed:
        mask = h.target >= 0
        np.add.at(prescribed, h.dofs[mask], h.factor[mask] * seed[h.target[mask]])
    dx = step.solve(-step.summed(parts), prescribed)
    for name in blocks_with_history(step.tape):
        elements = step.blocks[name]
        direction = dx[elements.block.dofs]
        block_rows = rows.get(name, elements.zero_rows())
        previous = state.histories.get(name)
        after = elements.history(block_rows, direction, previous, arrays.get(name))
        _keep_still(step, name, after, previous)
        state.histories[name] = after
    state.states = [dx, *state.states][:2]
    acting = step.reacting()
    forces = step.summed({n: v for n, v in parts.items() if n in acting})
    return dx, forces


def _keep_still(step: LinearisedStep, name: str, after: Array, previous: Array | None) -> None:
    """Leave point data that are no history as they are."""
    kernel = step.tape.system.blocks[name].kernel
    for column, datum in enumerate(kernel.point_data):
        if datum not in kernel.history and previous is not None:
            after[:, :, column] = previous[:, :, column]


def _array_rates(
    step: LinearisedStep, moves: InputSeeds, seed: Array
) -> dict[str, dict[str, Array]]:
    """Rates of the run-time arrays that move, by block and name."""
    rates: dict[str, dict[str, Array]] = {}
    for move in moves.arrays:
        if move.block in step.blocks:
            rates.setdefault(move.block, {})[move.name] = move.rate(seed)
    return rates


def argument_rates(
    step: LinearisedStep, moves: InputSeeds, seed: Array, front: DirectState
) -> Mapping[str, Array]:
    """Rates of the arguments of all blocks that move."""
    rows: dict[str, Array] = {}
    for column in moves.columns:
        if column.block in step.blocks:
            into = rows.setdefault(column.block, step.blocks[column.block].zero_rows())
            column.push(into, seed)
    if front.states:
        for c in time_couplings(step.tape):
            into = rows.setdefault(c.block, step.blocks[c.block].zero_rows())
            for weight, state in zip(c.weights, front.states, strict=False):
                into[:, c.column] += weight * state[c.dofs]
    return rows
