"""The sealed pressure rises on a mesh, or a state under it is carried there from another mesh.

Where the loaded state cannot be carried one of less pressure is, and the path is taken up there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.contact import along, load_stage, released
from softehl.cases.seal.solve.path import Followed, PathSettings, Stage, StageFailed
from softehl.cases.seal.solve.pressure_newton import patient, roughly
from softehl.cases.seal.solve.refinement import carried_contact
from softehl.cases.seal.solve.trail import Trail
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point

State: TypeAlias = tuple[SealSystem, Array]

_CARRIED, _EASED = 14, 10
"""Iterations that a state may need that was carried to another mesh; one under less pressure."""

_JUMPS = (0.003, 0.006, 0.015, 0.04)
"""Steps of the pressure over a kink of the path, one after the other, in shear moduli."""


@dataclass(frozen=True)
class Loading:
    """Ways to a contact state under the sealed pressure; settings as of `ContactRoute`."""

    settings: PathSettings
    follow: Callable[[Stage, Array], Followed]
    newton: Newton
    trail: Trail

    def followed(
        self, system: SealSystem, x: Array, *, force: float = 0.0, begin: float = 0.0
    ) -> Followed:
        """From the section x (n,) to the sealed pressure; states on the way are kept.

        force, begin: see `load_stage`; states are kept once no force holds the section.
        """
        self.trail.begin(begin)
        free = released(system.parameters, force)

        def keep(point: Point) -> None:
            if point.parameter >= free:
                self.trail.keep(system, point)

        stage = load_stage(system, self.settings, force=force, begin=begin)
        rough = along(system, roughly(self.newton))
        end = self._over_kinks(system, replace(stage, corrector=rough, on_point=keep), x)
        if rough is None or isinstance(end, StageFailed):
            return end
        last = along(system, self.newton)
        return self.follow(replace(stage, start=stage.stop, corrector=last), end)

    def _over_kinks(self, system: SealSystem, stage: Stage, x: Array) -> Followed:
        """To the end of a stage in which nodes slide round the edge of an open gap.

        Where no step is small enough a longer one may be: a node that slides from fillet to bore
        makes a kink in the path, and Newton's method alternates between its sides.
        """
        found, mu = self.follow(stage, x), system.parameters.shear_modulus
        jumps = list(_JUMPS) if system.parameters.opens else []
        while jumps and isinstance(found, StageFailed) and found.branch.points:
            start = found.reached + jumps.pop(0) * mu
            if start >= stage.stop:
                break
            beyond = self.follow(replace(stage, start=start), found.branch.last.x)
            if not isinstance(beyond, StageFailed) or beyond.branch.points:
                found, jumps = beyond, list(_JUMPS)
        return found

    def carried(
        self, old: SealSystem, x: Array, new: SealSystem, name: str = "", *, alone: bool = False
    ) -> State | StageFailed:
        """The contact state x of one mesh on another.

        alone: the state itself, not by way of one under less pressure.
        """
        stage, start = carried_contact(old, new, self.settings, x, name)
        if not new.section.placed:
            found = self.follow(stage, start)
            return found if isinstance(found, StageFailed) else (new, found)
        quick = replace(self.newton, max_iterations=_CARRIED)
        found = self.follow(replace(stage, corrector=quick), start)
        if isinstance(found, StageFailed) and not alone:
            found = self._reloaded(new, found)
        if isinstance(found, StageFailed) and not alone:
            found = self.follow(replace(stage, corrector=patient(self.newton)), start)
        return found if isinstance(found, StageFailed) else (new, found)

    def _reloaded(self, new: SealSystem, failed: StageFailed) -> Followed:
        """A contact state on a mesh from one under less pressure on the last path.

        failed: what is said where there is no such state.
        """
        found: Followed = failed
        quick = replace(roughly(self.newton), max_iterations=_EASED)
        for old, p_s, x in self.trail.eased(new.parameters):
            name = f"contact at {p_s:.4g} MPa"
            stage, start = carried_contact(old, new, self.settings, x, name, p_s)
            found = self.follow(replace(stage, corrector=quick), start)
            if isinstance(found, StageFailed):
                continue
            found = self.followed(new, found, begin=p_s)
            if not isinstance(found, StageFailed):
                break
        return found
