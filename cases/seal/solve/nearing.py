"""The rod comes from where contact holds it to where a film is, by a modified Newton method.

Its edges move over many nodes on the way, which touch or part one after the other: with each of
them Newton's method factorises the section anew, and often ends between two of them. With the
contact of the arc as the layer these changes concern a small matrix only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.layers import contact_layer
from softehl.cases.seal.equations.system import ROD
from softehl.cases.seal.solve.contact import along, approach_stage, lies_in_corner, stalls
from softehl.cases.seal.solve.grading import inlet_length, slowest_films
from softehl.cases.seal.solve.path import Followed, PathSettings, Stage, StageFailed, laborious
from softehl.cases.seal.solve.pressure_newton import roughly
from softehl.cases.seal.states.contacts import contact_edges
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.propped import Propped
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.schur import SchurCorrector
from softehl.runtime.solve.steps import StepRule

_NEAR = 0.3
_TOLERANCE = 1e-6  # by which gaps are right to hundredths of a micrometre
_LOOSE = 1e-3  # on the way
_TOUCHES = 1e-9  # of the largest pressure: what is less is rounding
SHORT_INLET = 0.5
"""Of the rod's offset: an inlet that is shorter moves by about its length as the rod comes near."""

_STEPS = StepRule(0.5, 0.02, 5.0, target_iterations=8)  # of the logarithm of the offset


def nearing_stage(
    system: SealSystem, settings: PathSettings, offset: float, x: Array, linear: Condenser
) -> Stage:
    """`approach_stage` from the contact state x (n,) to an offset, mm."""
    stage, layer = approach_stage(system, settings, offset), contact_layer(system, x)
    finish, stalled = Newton(max_iterations=1, linear=linear), stalls(system)
    corrector = SchurCorrector(linear, near=_NEAR, finish=finish, stalled=stalled)
    lacking = np.asarray(system.layout.dofs(ROD))

    def problem_at(t: float) -> Propped:
        problem = stage.problem_at(t)
        assert isinstance(problem, Problem)
        return Propped(problem, layer, lacking=lacking)

    corrector = corrector.with_tolerance(_TOLERANCE)
    return replace(stage, problem_at=problem_at, steps=_STEPS, corrector=corrector)


def neared(stage: Stage, x: Array, follow: Callable[[Stage, Array], Followed]) -> Followed:
    """The contact state at the end of a `nearing_stage` from x (n,), roughly followed.

    follow: solves a stage from a start.
    """
    assert isinstance(stage.corrector, SchurCorrector)
    y = follow(replace(stage, corrector=stage.corrector.with_tolerance(_LOOSE)), x)
    if isinstance(y, StageFailed):
        return y
    return follow(replace(stage, start=stage.stop), y)


def rod_brought_near(
    system: SealSystem,
    settings: PathSettings,
    offset: float,
    x: Array,
    newton: Newton,
    follow: Callable[[Stage, Array], Followed],
    *,
    quick: bool,
    laboriously: bool = False,
) -> Followed:
    """From the contact state x (n,) to that with the rod at an offset, mm.

    quick: whether modified Newton iterations are to be tried, where the linear solver condenses.
    laboriously: whether Newton's method follows where they fail and the section lies in a corner.
    """
    stage = approach_stage(system, settings, offset)
    if quick and isinstance(newton.linear, Condenser):
        y = neared(nearing_stage(system, settings, offset, x, newton.linear), x, follow)
        if not (laboriously and isinstance(y, StageFailed) and lies_in_corner(system)):
            return y
        way = laborious(replace(stage, steps=_STEPS), along(system, roughly(newton)))
        y = follow(way, x)
        if isinstance(y, StageFailed):
            return y
        return follow(replace(stage, start=stage.stop, corrector=along(system, newton)), y)
    return follow(replace(stage, corrector=along(system, newton)), x)


@dataclass
class LastNear:
    """The contact state that was last asked for its states near the rod, and these."""

    system: SealSystem | None = None
    x: Array | None = None
    states: list[Array] | StageFailed = field(default_factory=list)


@dataclass(frozen=True)
class NearRod:
    """Contact states with the rod where slow films have it, for the meshes of these films.

    follow: solves a stage from a start. last: what was found last, or why nothing was: the meshes
    of both strokes begin with what the one before them ended with.
    """

    settings: PathSettings
    follow: Callable[[Stage, Array], Followed]
    newton: Newton
    last: LastNear = field(default_factory=LastNear)

    def needed(self, system: SealSystem, x: Array) -> bool:
        """Whether the edges of the contact x (n,) move by inlets when the rod comes nearer."""
        p, edges = system.parameters, contact_edges(system, x)
        if p.mesh == "uniform" or p.rubs or p.rough or not edges:
            return False
        length = inlet_length(p, max(edge.rise for edge in edges))
        return length < SHORT_INLET * self.settings.offset

    def states(self, system: SealSystem, x: Array) -> list[Array] | StageFailed:
        """From the contact state x (n,), that of the thinnest film first."""
        last = self.last
        if last.system is not system or last.x is None or not np.array_equal(last.x, x):
            last.system, last.x, last.states = system, x, self._states(system, x)
        return last.states

    def _states(self, system: SealSystem, x: Array) -> list[Array] | StageFailed:
        """See `states`."""
        found = list[Array]()
        for offset in slowest_films(system, x):
            near = self._neared(system, offset, x)
            if isinstance(near, StageFailed):
                return near
            found.append(without_rounding(system, near))
        return found

    def states_or_here(self, system: SealSystem, x: Array) -> list[Array]:
        """The same; the contact state x itself where its edges stay or no such state is found."""
        near = self.states(system, x) if self.needed(system, x) else [x]
        return [x] if isinstance(near, StageFailed) else near

    def _neared(self, system: SealSystem, offset: float, x: Array) -> Followed:
        """With the rod at an offset, mm, from the contact state x (n,)."""
        return rod_brought_near(
            system,
            self.settings,
            offset,
            x,
            self.newton,
            self.follow,
            quick=system.parameters.solver == "auto",
            laboriously=True,
        )


def without_rounding(system: SealSystem, x: Array) -> Array:
    """The contact state x (n,) with pressures of exactly zero where nothing touches the rod.

    Edges of the contact are where they begin, and modified iterations leave traces of them.
    """
    y = x.copy()
    pressures = system.rod_multipliers(y)
    pressures[pressures > -_TOUCHES * np.abs(pressures).max()] = 0.0
    return y
