"""The dry contact on one mesh: by its path from rest, or from the state of another mesh.

A loaded state of another mesh is carried over and corrected by Newton's method. If that fails, the
path is taken up at a checkpoint under less pressure, carried in the same way; if that does not lead
on either, at rest, which is the same on every mesh. From the end of a path of the pressure the
section creeps on (`solve.contact_relaxation`).

Above two or three shear moduli the section fills the corners of its groove but for pockets of a few
elements. Newton's method does not correct the errors that interpolation leaves there. Under half of
the pressure the pockets are wide.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeAlias

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.contact import (
    approach_stage,
    at_air_wall,
    contact_problem,
    correction_stage,
    held_place,
    load_stage,
    release_stage,
)
from softehl.cases.seal.solve.contact_relaxation import CreepCorrector
from softehl.cases.seal.solve.correctors import PressureNewton
from softehl.cases.seal.solve.path import PathDriver, Stage, StageError
from softehl.cases.seal.solve.transfer import carried_contact
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Point

State: TypeAlias = tuple[SealSystem, Array]

_SHARE = 0.5
"""Of the sealed pressure; going back to rest at once takes 1.4 times the work."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A contact state x (n,) on the mesh of a system, under a sealed pressure, MPa."""

    system: SealSystem
    pressure: float
    x: Array


@dataclass(eq=False)
class ContactSolver:
    """Finds contact states.

    driver: follows their paths. checkpoint: where the last path may be taken up again, under at
    most half of the sealed pressure, None where there is nothing but rest; it changes with a path.
    """

    driver: PathDriver
    checkpoint: Checkpoint | None = None

    def from_rest(self, system: SealSystem) -> Array:
        """The contact state (n,) by its path: rod approach, then the sealed pressure.

        Raises StageError.
        """
        x, place = self._follow(system, approach_stage(system), system.at_rest()), None
        if held_place(system.parameters) is not None:
            return x
        if system.parameters.sealed_pressure > 0.0:
            x, place = at_air_wall(system, x)
        if system.parameters.rubs:
            x, place = self._follow(system, release_stage(system, x), x), None
        return self._loaded(system, x, place=place)

    def from_mesh(self, old: SealSystem, x: Array, new: SealSystem, name: str = "") -> State:
        """The contact state x (n,) of one mesh on another; name: of the stage.

        Raises StageError.
        """
        p_s, before = new.parameters.sealed_pressure, self.checkpoint
        with suppress(StageError):
            return new, self._corrected(Checkpoint(old, p_s, x), new, name)
        if before:
            with suppress(StageError):
                start = self._corrected(before, new, f"contact at {before.pressure:.4g} MPa")
                return new, self._loaded(new, start, before.pressure)
        return new, self.from_rest(new)

    def _corrected(self, state: Checkpoint, new: SealSystem, name: str) -> Array:
        """A state of another mesh on ours, (n,), under the same pressure."""
        stage, start = carried_contact(state.system, new, state.x, state.pressure, name)
        return self.driver.follow(stage, start)

    def _loaded(
        self, system: SealSystem, x: Array, begin: float = 0.0, place: float | None = None
    ) -> Array:
        """From the section x (n,) to the sealed pressure; begin, place: as of `load_stage`."""
        if not begin:
            self.checkpoint = None
        stage = load_stage(system, begin, place)
        stage = replace(stage, on_point=lambda point: self.keep(system, point))
        try:
            return self._follow(system, stage, x)
        except StageError as failed:
            if not system.parameters.rubs:  # friction remembers its path
                last = failed.branch.last.x if failed.branch.points else x
                with suppress(StageError):
                    return self.driver.follow(self._creep(system), last)
            raise

    def keep(self, system: SealSystem, point: Point) -> None:
        """A state of a path of the pressure. With friction none: what slips remembers its path."""
        p = system.parameters
        if 0.0 < point.parameter <= _SHARE * p.sealed_pressure and not p.rubs:
            self.checkpoint = Checkpoint(system, point.parameter, point.solution.x)

    def _creep(self, system: SealSystem) -> Stage:
        """From a state under any pressure to the sealed pressure."""
        problem = contact_problem(system, system.parameters.sealed_pressure)
        method, name = "pseudo-transient continuation", "creep to the contact"
        stage = correction_stage(system, problem, method, name)
        return replace(stage, corrector=CreepCorrector(system, self.driver.newton))

    def _follow(self, system: SealSystem, stage: Stage, x: Array) -> Array:
        """To the end of a stage, by the corrector of paths."""
        p = system.parameters
        if p.solver == "auto" and not p.rubs:
            stage = replace(stage, corrector=PressureNewton(self.driver.newton, system))
        return self.driver.follow(stage, x)
