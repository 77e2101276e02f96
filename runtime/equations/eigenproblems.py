"""Eigenproblem of natural modes about a state, and the symmetric tangent that it needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, count_of
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import is_symmetric_where_free
from softehl.runtime.equations.contact_setup import contact_blocks
from softehl.runtime.equations.mass_matrix import Masses, mass_matrix
from softehl.runtime.equations.system import System
from softehl.runtime.solve.eigen import NoModes
from softehl.runtime.solve.linear.linear_solver import SingularMatrix


@dataclass(frozen=True, eq=False)
class SymmetricTangent:
    """The tangent (n, n) of a problem at a state before supports are eliminated.

    Both are of the elements of this process.
    """

    problem: Problem
    K: csc_array

    @classmethod
    def at(cls, system: System, distributed: Any, x: Array, context: str) -> SymmetricTangent:
        """Raises StudyError where it is not finite or not symmetric.

        The tangent of a contact without friction is unsymmetric by the error of its mesh only; that
        changes eigenvalues in the second order.
        """
        comm = system.comm
        problem = comm.local_problem(distributed).at(x)
        with np.errstate(all="ignore"):
            K = problem.assembler.linearise(x, problem.parameters)[1]
        if comm.max(float(not np.isfinite(K.data).all())):
            raise StudyError(f"{context}: the tangent is not finite")
        smooth = [name for name, friction in contact_blocks(system).items() if friction == 0.0]
        frictional = K
        if smooth:
            other_parameters = {n: v for n, v in problem.parameters.items() if n not in smooth}
            frictional = problem.assembler.linearise(x, other_parameters)[1]
        if comm.max(float(not is_symmetric_where_free(problem, frictional))):
            raise StudyError(
                f"{context}: the tangent is not symmetric (friction, pressure that follows an open "
                "side, or a page without a potential), and frequencies are those of a potential"
            )
        return cls(problem, K)


def natural_modes(
    system: System, distributed: Any, x: Array, count: int, mass: Masses | None
) -> tuple[Array, Array]:
    """Squares of angular frequencies (k,) and modes (k, n) about a state x, the lowest first."""
    context = f"modes({count})"
    require_count(context, count)
    tangent = SymmetricTangent.at(system, distributed, x, context)
    M = mass_matrix(system, tangent.problem, x, mass)
    try:
        return system.comm.lowest_modes(tangent.problem, tangent.K, M, count)
    except (NoModes, SingularMatrix) as error:
        raise StudyError(f"{context}: {error}") from None


def require_count(context: str, count: int) -> None:
    """Raise StudyError where a number of modes is none."""
    if count_of(count) is None:
        raise StudyError(f"{context}: a whole number of at least 1 is needed")
