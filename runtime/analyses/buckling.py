"""Linear buckling: load factors at which the linearly extrapolated tangent is singular."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.log import warn
from softehl.runtime.analyses.initial_state import initial_state
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.arrays import Array, read_only
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.eigenproblems import SymmetricTangent, require_count
from softehl.runtime.equations.rigid_body_modes import require_supported
from softehl.runtime.equations.system import System
from softehl.runtime.results.result import ModeShape, Result
from softehl.runtime.solve.eigen import NoModes
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point
from softehl.runtime.suggestions import short_list

_LENGTH = 1e-4
"""Of the size of the mesh: how far the difference of tangents of `buckling` goes. Its error is
about the square of that."""


_LEFT_OVER = 0.02
"""Stiffness of the first mode that may be left at its factor. A column that is pressed along its
axis leaves 1e-4; one that a hundredth of the load bends leaves as much as it had."""


@dataclass(frozen=True, eq=False)
class Buckling:
    """Result of linear buckling.

    Attributes
    ----------
    factors : array (k,)
        Critical load factors, rising.
    shapes : tuple of ModeShape
        A Result for each, whose unknowns are the mode, 1 at its largest.
    """

    factors: Array
    shapes: tuple[ModeShape, ...]

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Buckling: factors {short_list(f'{f:.6g}' for f in self.factors)}>"


def buckling(
    definition: ProblemDefinition,
    count: int = 1,
    *,
    start: Result | None = None,
    options: SolverOptions,
) -> Buckling:
    """Return the smallest load factors of linear buckling; see `Study.buckling`."""
    prepared = options.prepare(definition)
    system, newton = prepared.system, prepared.newton
    initial = initial_state(system, start)

    def problem_at(factor: float) -> Problem:
        return system.problem(system.quasi_static_step(factor, initial.x, initial.histories))

    with np.errstate(all="ignore"):
        problem = problem_at(initial.t)
        require_supported(system, problem, initial.x)
        solution = newton.solve(problem, initial.x)
    if not solution.converged:
        raise NotConverged(solution)
    point = Point(initial.t, solution)
    state = Result(system, problem, point, initial.histories)
    factors, modes = _buckling_modes(system, problem_at, point, count, newton)
    return Buckling(read_only(factors), tuple(ModeShape.of(state, mode) for mode in modes))


def _buckling_modes(
    system: System, problem_at: Callable[[float], Any], state: Point, count: int, newton: Newton
) -> tuple[Array, Array]:
    """Load factors (k,) and modes (k, n) of linear buckling from a state x at load factor t.

    newton: whose linear solver finds the response.

    The tangent K changes by K' along the linear response to a load that grows by 1:
    (K + (f - t) K') mode = 0.
    """
    context = f"buckling({count})"
    require_count(context, count)
    comm, t, x = system.comm, state.parameter, state.solution.x
    tangent = SymmetricTangent.at(system, problem_at(t), x, context)
    r, K = problem_at(t + 1.0).linearise(x)
    try:
        response = -newton.linear.factorise(K).solve(r)
    except SingularMatrix as error:
        raise StudyError(f"{context}: {error}") from None
    largest = comm.max(float(np.abs(response).max(initial=0.0)))
    if not largest > 0.0:
        raise StudyError(f"{context}: nothing changes with the load factor; give loads or fix(...)")
    h = _LENGTH * comm.max(float(np.ptp(system.mesh.points, axis=0).max())) / largest
    ahead = SymmetricTangent.at(system, problem_at(t + h), x + h * response, context).K
    backward = SymmetricTangent.at(system, problem_at(t - h), x - h * response, context).K
    change = csc_array((ahead - backward) / (2.0 * h))
    try:
        factors, modes = comm.buckling(tangent.problem, tangent.K, change, count)
    except (NoModes, SingularMatrix) as error:
        raise StudyError(f"{context}: {error}") from None
    if len(factors):
        factor = t + float(factors[0])
        left = _left_over(system, problem_at(factor), x + factors[0] * response, modes[0], tangent)
        if not left < _LEFT_OVER:
            warn(
                f"{context}: at the factor {factor:.4g} the body has deformed so much that "
                f"{left:.0%} of the stiffness of the mode is left, not 0 %: take a start nearer to "
                "it, buckling(start=result), or follow the path",
                RuntimeWarning,
                stacklevel=5,
            )
    return t + factors, modes


def _left_over(
    system: System, distributed: Any, x: Array, mode: Array, initial: SymmetricTangent
) -> float:
    """Stiffness of a mode by the true tangent at x, by that of the initial state; inf if none."""
    try:
        K = SymmetricTangent.at(system, distributed, x, "").K
    except StudyError:
        return np.inf
    stiffness = np.array([mode @ (K @ mode), mode @ (initial.K @ mode)])
    total, local_norm = system.comm.sum(stiffness)
    return float(abs(total / local_norm)) if local_norm else np.inf
