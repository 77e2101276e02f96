"""Natural modes about a state, and linear buckling: the equations of a study as eigenproblems."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, count_of
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.constraints import is_symmetric_where_free
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.contact_setup import contact_blocks
from softehl.runtime.equations.mass_matrix import Masses, mass_matrix
from softehl.runtime.equations.system import System
from softehl.runtime.solve.eigen import NoModes
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point

_LENGTH = 1e-4
"""Of the size of the mesh: how far the difference of tangents of `buckling` goes. Its error is
about the square of that."""


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent (n, n) of a problem at a state before supports are eliminated.

    Both are of the elements of this process.
    """

    problem: Problem
    K: csc_array

    @classmethod
    def at(cls, system: System, posed: Any, x: Array, words: str) -> Tangent:
        """Raises StudyError where it is not finite or not symmetric.

        That of a contact without friction is symmetric but for the error of its mesh, which changes
        eigenvalues in the second order.
        """
        share = system.share
        problem = share.part(posed).at(x)
        with np.errstate(all="ignore"):
            K = problem.assembler.linearise(x, problem.parameters)[1]
        if share.largest(float(not np.isfinite(K.data).all())):
            raise StudyError(f"{words}: the tangent is not finite")
        smooth = [name for name, friction in contact_blocks(system).items() if friction == 0.0]
        whole = K
        if smooth:
            rest = {n: v for n, v in problem.parameters.items() if n not in smooth}
            whole = problem.assembler.linearise(x, rest)[1]
        if share.largest(float(not is_symmetric_where_free(problem, whole))):
            raise StudyError(
                f"{words}: the tangent is not symmetric (friction, pressure that follows an open "
                "side, or a page without a potential), and frequencies are those of a potential"
            )
        return cls(problem, K)


def natural(
    system: System, posed: Any, x: Array, count: int, mass: Masses | None
) -> tuple[Array, Array]:
    """Squares of angular frequencies (k,) and modes (k, n) about a state x, the lowest first."""
    words = f"modes({count})"
    _require_count(words, count)
    here = Tangent.at(system, posed, x, words)
    M = mass_matrix(system, here.problem, x, mass)
    try:
        return system.share.lowest(here.problem, here.K, M, count)
    except (NoModes, SingularMatrix) as error:
        raise StudyError(f"{words}: {error}") from None


def buckled(
    system: System, problem_at: Callable[[float], Any], state: Point, count: int, newton: Newton
) -> tuple[Array, Array]:
    """Load factors (k,) and modes (k, n) of linear buckling from a state x at load factor t.

    newton: whose linear solver finds the response.

    The tangent K changes by K' along the linear response to a load that grows by 1:
    (K + (f - t) K') mode = 0.
    """
    words = f"buckling({count})"
    _require_count(words, count)
    share, t, x = system.share, state.parameter, state.solution.x
    here = Tangent.at(system, problem_at(t), x, words)
    r, K = problem_at(t + 1.0).linearise(x)
    try:
        response = -newton.linear.factorise(K).solve(r)
    except SingularMatrix as error:
        raise StudyError(f"{words}: {error}") from None
    most = share.largest(float(np.abs(response).max(initial=0.0)))
    if not most > 0.0:
        raise StudyError(f"{words}: nothing changes with the load factor; give loads or fix(...)")
    h = _LENGTH * share.largest(float(np.ptp(system.mesh.points, axis=0).max())) / most
    ahead = Tangent.at(system, problem_at(t + h), x + h * response, words).K
    behind = Tangent.at(system, problem_at(t - h), x - h * response, words).K
    change = csc_array((ahead - behind) / (2.0 * h))
    try:
        factors, found = share.buckling(here.problem, here.K, change, count)
    except (NoModes, SingularMatrix) as error:
        raise StudyError(f"{words}: {error}") from None
    return t + factors, found


def _require_count(words: str, count: int) -> None:
    if count_of(count) is None:
        raise StudyError(f"{words}: a whole number of at least 1 is needed")
