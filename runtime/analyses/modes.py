"""Natural modes of a study at rest, or about a state in equilibrium."""

from __future__ import annotations

import numpy as np

from softehl.runtime.analyses.initial_state import initial_state
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.results.modes import Modes
from softehl.runtime.results.result import Result
from softehl.runtime.solve.solution import Point, Solution, Status

_BALANCED = 1e-6
"""Of the forces: a state whose residuals are smaller is one of equilibrium."""


def modes(
    definition: ProblemDefinition,
    count: int = 6,
    *,
    mass: Masses | None = None,
    start: Result | None = None,
    options: SolverOptions,
) -> Modes:
    """Return the lowest natural modes; see `Study.modes`."""
    system = options.prepare(definition).system
    initial = initial_state(system, start)
    problem = system.problem(system.quasi_static_step(initial.t, initial.x, initial.histories))
    with np.errstate(all="ignore"):
        tangent = problem.linearise(initial.x)[1]
        residual = problem.measure(initial.x, tangent, rounded=True)
    if not residual <= _BALANCED:
        raise StudyError(
            f"modes({count}): loads or prescribed values are not zero at load factor "
            f"{initial.t:g}; solve for the state first, study.solve(until=...).modes(...)"
        )
    solution = Solution(initial.x, Status.CONVERGED, "", (), 0, 0)
    state = Result(system, problem, Point(initial.t, solution), initial.histories)
    return state.modes(count, mass=mass)
