"""The interface between a study and its engine, and the engines by name."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias

from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.newton import Newton
from softehl.runtime.statement.records import StudyError
from softehl.runtime.system import System


class Engine(Protocol):
    """Spreads the equations of a study, and knows the linear solver that goes with that."""

    def spread(self, system: System) -> System:
        """The part of the equations that this process has; see `runtime.share`."""
        ...

    def newton(self, given: Newton | None) -> Newton:
        """Newton's method as it was asked for, on the engine's linear solver."""
        ...


AnyEngine: TypeAlias = "str | Engine | None"
"""An engine, or the name of one; None is "serial"."""
Linear: TypeAlias = Literal["matrix-free"]
"""Linear solvers that `Study.solve` names; without one the engine's own."""


class Serial:
    """Everything in this process, with the linear solver that is asked for."""

    def spread(self, system: System) -> System:
        """See `Engine`."""
        return system

    def newton(self, given: Newton | None) -> Newton:
        """See `Engine`."""
        return given or Newton(linear=choose("auto"))


def engine_of(engine: AnyEngine, linear: Linear | None = None) -> Engine:
    """The engine of that name, or of a linear solver, which is an engine too.

    Raises StudyError for an unknown one, MissingPetsc.
    """
    if linear is not None:
        if linear != "matrix-free":
            raise StudyError(f'linear = {linear!r}: allowed is "matrix-free"')
        if engine is not None:
            raise StudyError('linear = "matrix-free" is an engine by itself: leave engine out')
        from softehl.runtime.engines.matrix_free import MatrixFree

        return MatrixFree()
    if engine is None or engine == "serial":
        return Serial()
    if engine == "petsc":
        from softehl.runtime.engines.petsc import Petsc

        return Petsc()
    if isinstance(engine, str):
        raise StudyError(f'engine = {engine!r}: allowed are "serial" and "petsc"')
    return engine
