"""The interface between a study and its engine, and the engines by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias

from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.communicator import Communicator
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import symmetric
from softehl.runtime.equations.system import System
from softehl.runtime.parallel.linear_solver_choice import Linear, linear_solver, modes_by_multigrid
from softehl.runtime.solve.linear.amg import NearNullspace
from softehl.runtime.solve.linear.factorisation_cache import FactorisationCache
from softehl.runtime.solve.linear.lobpcg import lowest_modes
from softehl.runtime.solve.newton import Newton


@dataclass(eq=False)
class MultigridModesCommunicator(Communicator):
    """Communicator of one process, with modes by multigrid. nullspace: near null space."""

    nullspace: NearNullspace

    def lowest_modes(
        self, problem: Problem, K: csc_array, M: csc_array, count: int
    ) -> tuple[Array, Array]:
        """See `Communicator`."""
        return lowest_modes(symmetric(problem.eliminated(K)), symmetric(M), self.nullspace, count)


class Engine(Protocol):
    """Distributes the equations of a study, and provides their linear solver."""

    def distribute(self, system: System) -> System:
        """The part of the equations that this process has; see `Communicator`."""
        ...

    def newton(self, system: System, requested: Newton | None) -> Newton:
        """Newton's method with the linear solver of the distributed equations."""
        ...


AnyEngine: TypeAlias = "str | Engine | None"
"""An engine, or the name of one; None is "serial"."""


@dataclass(eq=False)
class Serial:
    """Engine of one process, with the requested linear solver.

    note: says which one, where the size of the problem decides.
    """

    linear: Linear = "auto"
    note: Callable[[], str] = str

    def distribute(self, system: System) -> System:
        """See `Engine`."""
        system.mesh.require_whole('engine = "serial"')
        nullspace = modes_by_multigrid(system, self.linear)
        return (
            system
            if nullspace is None
            else replace(system, comm=MultigridModesCommunicator(nullspace))
        )

    def newton(self, system: System, requested: Newton | None) -> Newton:
        """See `Engine`."""
        if requested is not None and self.linear != "auto":
            raise StudyError("newton and linear: give one of them, newton has a linear solver")
        if requested is not None:
            return requested
        solver, self.note = linear_solver(system, self.linear)
        return Newton(linear=FactorisationCache(solver))


def engine_of(engine: AnyEngine, linear: Linear = "auto", device: str | None = None) -> Engine:
    """The engine of that name, or of a linear solver that is an engine by itself.

    Raises StudyError for an unknown one, MissingPetsc.
    """
    if linear == "matrix-free":
        return _matrix_free(engine, device)
    if device is not None:
        raise StudyError(f'device = {device!r}: a device needs linear = "matrix-free"')
    if engine is None or engine == "serial":
        return Serial(linear)
    if linear != "auto":
        raise StudyError(f'linear = {linear!r}: for engine = "serial" only')
    if engine == "petsc":
        from softehl.runtime.parallel.petsc import Petsc

        return Petsc()
    if isinstance(engine, str):
        raise StudyError(f'engine = {engine!r}: allowed are "serial" and "petsc"')
    return engine


def _matrix_free(engine: AnyEngine, device: str | None) -> Engine:
    """Without matrices, alone or by PETSc.  Raises StudyError, MissingPetsc."""
    if engine == "petsc" and device is not None:
        raise StudyError(f'device = {device!r}: leave engine = "petsc" out')
    if engine == "petsc":
        from softehl.runtime.parallel.petsc import Petsc

        return Petsc(matrix_free=True)
    if engine is not None:
        raise StudyError('linear = "matrix-free": engine = "petsc" is allowed, or leave engine out')
    from softehl.runtime.parallel.matrix_free import MatrixFree

    return MatrixFree(device=device)


def note_of(engine: Engine) -> Callable[[], str]:
    """Message on the linear solver that `Serial` chose; empty for other engines."""
    return engine.note if isinstance(engine, Serial) else str
