"""Quick check of a kernel before its first use: a few calls, compared with differences.

`softehl generate` compares kernels with their models in 90 digits (`verification`), which takes
seconds.  Here a kernel is compared with itself, at ordinary states: all tasks are numbers, the
residual is the slope of the energy, the tangent is that of the residual.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from softehl.codegen.abi import BuildError, Task
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.language.definition import Definition
from softehl.codegen.verify.kernel_batch import Batch
from softehl.codegen.verify.random_states import NoStateError, admissible_states
from softehl.codegen.verify.verification import undefined_expression

STATES, POINTS = 5, 150
"""States of a check, and points of them all together: large elements have fewer, but one."""
LENGTHS = (1e-4, 1e-6)
"""Of a difference, in sizes of the unknowns."""
BOUND = 1e-3
"""Of a slope by differences: their error is 1e-8 or less in smooth functions, and 1e-4 where a
local iteration ends at 1e-10."""

Vector = list[float]


class WrongKernelError(BuildError):
    """A compiled kernel contradicts itself; the message says where."""


def check(d: Definition, tasks: Sequence[str], library: Path) -> None:
    """Raise `WrongKernelError` where a kernel contradicts itself at ordinary states.

    Models without such a state, and those that give derivatives of their own, are left out.
    """
    try:
        states = [] if d.prescribed else admissible_states(d, _count(d))
    except NoStateError:
        return
    called = ctypes.CDLL(str(library))
    for state in states:
        direction = _direction(states)
        moved = [_moved(state, s * h, direction) for h in LENGTHS for s in (1, -1)]
        batch = Batch(d, called, [state, *moved], [direction] * (1 + len(moved)))
        if any(batch.silent(t) for t in tasks):
            continue
        for task in tasks:
            values, tangents = batch.call(task)
            if not all(map(math.isfinite, [*values[0], *(tangents[0] if tangents else ())])):
                raise WrongKernelError(
                    f"{d.name}: {task} is not a number where energy and fields are: "
                    f"{undefined_expression(d, task) or 'a value'} has none"
                )
        for task in _contradictions(batch, tasks, direction):
            raise WrongKernelError(
                f"{d.name}: its {task} contradicts differences; do not use this kernel, and report "
                "its page as an error of softehl"
            )


def _count(d: Definition) -> int:
    return max(1, min(STATES, POINTS // len(d.rule.points)))


def _direction(states: Sequence[EvaluationState]) -> Vector:
    """Direction that changes every unknown by about its size."""
    sizes = [
        max(map(abs, map(float, u))) or 1.0 for u in zip(*(s.dofs for s in states), strict=True)
    ]
    return [(-1) ** k * (1 + k % 3 / 4) * size for k, size in enumerate(sizes)]


def _moved(state: EvaluationState, h: float, direction: Vector) -> EvaluationState:
    return replace(
        state, dofs=[float(u) + h * w for u, w in zip(state.dofs, direction, strict=True)]
    )


def _contradictions(batch: Batch, tasks: Sequence[str], direction: Vector) -> Iterator[str]:
    """Tasks that disagree with the differences of others."""
    n = len(direction)
    if Task.ENERGY in tasks and Task.RESIDUAL in tasks:
        rows = [batch.call(Task.RESIDUAL)[0][0]]
        if _differs([v[0:1] for v in batch.call(Task.ENERGY)[0]], rows, direction):
            yield Task.RESIDUAL
    if Task.TANGENT in tasks:
        residual, tangent = batch.call(Task.TANGENT)
        rows = [tangent[0][n * i : n * (i + 1)] for i in range(n)]
        if _differs(residual, rows, direction):
            yield Task.TANGENT


def _differs(values: Sequence[Vector], rows: Sequence[Vector], direction: Vector) -> bool:
    """True if `rows` are not the slopes of values along a way.

    Two differences that agree say so; rounding and kinks make them different.
    """
    terms = [[a * w for a, w in zip(row, direction, strict=True)] for row in rows]
    sizes = [math.fsum(map(abs, t)) for t in terms]
    errors = []
    for h, plus, minus in zip(LENGTHS, values[1::2], values[2::2], strict=True):
        differences = [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]
        errors.append([f - math.fsum(t) for f, t in zip(differences, terms, strict=True)])
    coarse, fine = errors
    allowed = [BOUND * (s + BOUND * max(sizes)) for s in sizes]
    return any(
        min(abs(one), abs(two)) > a and abs(one - two) < abs(one) / 10
        for one, two, a in zip(coarse, fine, allowed, strict=True)
    )
