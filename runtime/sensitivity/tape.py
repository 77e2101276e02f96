"""Tape of a path: its converged steps, values that pass between them, for derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import Step, System
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.solve.linear.linear_solver import LinearSolver
from softehl.runtime.solve.singularity_check import LastFactorisation


@runtime_checkable
class WithoutMatrix(Protocol):
    """Equations in this process whose tangent is known by its products."""

    @property
    def equations(self) -> Problem:
        """With a matrix."""
        ...

    def linearise(self, x: Array) -> tuple[Array, Any]:
        """The residual and the tangent at x, (n,)."""
        ...


@dataclass(frozen=True, eq=False)
class Tape:
    """A converged step: its equations, its unknowns x (n,), and the step before it.

    previous: None at the beginning, and if the path was not recorded. last_factors: the linear
    solver of the path with the factors of its latest step, None if it was not recorded. linear: the
    solver of the path if it iterates. memo: factors that may be needed again. Both save time only.
    """

    system: System
    step: Step
    distributed_problem: Any
    x: Array
    previous: Tape | None = None
    last_factors: LastFactorisation | None = None
    linear: LinearSolver | None = None
    memo: dict[str, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Trail at t = {self.step.t:.6g}: {self.system!r}>"

    def __getstate__(self) -> dict[str, Any]:
        """For `copy` and `pickle`: this step alone, without what only saves time."""
        return {**vars(self), "previous": None, "last_factors": None, "linear": None, "memo": {}}

    @property
    def problem(self) -> Problem:
        """Its equations, with a matrix."""
        problem = (
            self.distributed_problem.equations
            if isinstance(self.distributed_problem, WithoutMatrix)
            else self.distributed_problem
        )
        assert isinstance(problem, Problem)
        return problem

    def chain(self) -> list[Tape]:
        """The steps on which the unknowns depend, first to last.

        One alone where nothing remembers the step before. Raises StudyError where a step is missing
        or the study was changed.
        """
        system = self.system
        for block in system.blocks.values():
            if isinstance(block.kernel, ModelKernel):
                raise StudyError(
                    f"derivatives, fits and gradients: {block.name!r} has unit cells, through "
                    "which nothing is differentiated; take differences of results"
                )
        if not isinstance(self.distributed_problem, Problem | WithoutMatrix):
            raise StudyError(
                'derivatives need engine="serial": this result is of several processes'
            )
        if system.definition is None or system.definition.size != system.definition_size:
            raise StudyError("the study was changed after this result: solve it again")
        rubbing = any(contact.friction for contact in system.definition.contacts)
        if rubbing and not np.array_equal(self.step.old, system.at_rest()):
            raise StudyError(
                "friction between bodies is not followed through several steps, nor is a law of "
                "contact without an energy of the present state: derivatives need solve(steps=1) "
                "from rest, or contacts without friction"
            )
        if not depends_on_previous(system):
            return [self]
        steps: list[Tape] = []
        step: Tape | None = self
        while step is not None:
            steps.append(step)
            step = step.previous
        if not _at_rest(steps[-1]):
            raise StudyError(
                "the result depends on the steps before it, which were not recorded: give "
                "record=True to solve or march, and to what it began with; copies and pickles of "
                "results are without them"
            )
        return steps[::-1]


def depends_on_previous(system: System) -> bool:
    """True if a step depends on the steps before it."""
    blocks = system.blocks.values()
    return any(b.previous or b.rates or b.kernel.history for b in blocks)


def continued_tape(system: System, start: Tape | None) -> Tape | None:
    """Tape of a start that a path continues; None if it is of another study."""
    if start is None or start.system.definition is not system.definition:
        return None
    return start if start.system.definition_size == system.definition_size else None


def is_load_step(tape: Tape) -> bool:
    """True if the step is one of a path in the load factor, not of one in time."""
    return tape.step.factor == tape.step.t and tape.step.dt == 0.0


def _at_rest(first: Tape) -> bool:
    """True if a step begins with the values that the study says of the start."""
    initial = first.system.histories()
    same = [np.array_equal(first.step.histories[name], values) for name, values in initial.items()]
    return all(same) and np.array_equal(first.step.old, first.system.at_rest())


@dataclass(frozen=True, eq=False)
class TimeCoupling:
    """Data of a block that are values of steps before.

    column: among coordinates, data and parameters. dofs: (n,) unknowns whose values they are.
    weights: of the step before, of that before it.
    """

    block: str
    column: int
    dofs: Integers
    weights: tuple[float, ...]


def time_couplings(tape: Tape) -> Iterator[TimeCoupling]:
    """Values from steps before in the data of a step."""
    nodal = tape.system.numbering.nodal
    for block in tape.system.blocks.values():
        first = block.kernel.nodes * len(block.kernel.coordinates)
        for slots, weights in ((block.previous, (1.0,)), (block.rates, tape.step.weights)):
            for name, slot in slots.items():
                dofs = nodal[slot.name][block.nodes[:, slot.node or 0]]
                column = first + block.kernel.data.index(name)
                yield TimeCoupling(block.name, column, dofs, weights)


def blocks_with_history(tape: Tape) -> list[str]:
    """Blocks whose points have data of their own."""
    return [b.name for b in tape.system.blocks.values() if b.initial is not None]
