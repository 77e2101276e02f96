"""Films of a mesh from those of another one, at the same speeds, without a path of their own.

What the other mesh says is how film and section change: from its contact state to a film, and from
one film to the next. These changes are smooth and small, unlike the states themselves, and ours
makes them as they are. Equations and solution are those of the path in `cases.seal.solve.film`;
only the start of the iterations is another one.

Interpolation leaves volumes that are wrong by little, which a large bulk modulus makes useless
pressures of. Above three shear moduli, where the corners of the section slide in those of the
groove, no iteration with their tangent leads anywhere, and four with the pressures that are carried
like the displacements (`runtime.fem.lagged_pressure`) do.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.carried import carry_pressures, modes_at
from softehl.cases.seal.solve.contact import lies_in_corner
from softehl.cases.seal.solve.path import Stage
from softehl.cases.seal.solve.pressure_newton import lagged, patient
from softehl.cases.seal.solve.refinement import carried_elements, carried_unknowns
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.lagged_pressure import element_pressures
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.rules import pressure_nodes
from softehl.runtime.solve.newton import Newton

_ITERATIONS, _PATIENT, _IN_CORNER = 8, 30, 80
"""A start that needs more leads nowhere, or takes the second with each reducing the residual; the
third where a section lies in a corner."""


@dataclass(frozen=True, eq=False)
class CoarserFilms:
    """Films of a stroke on another mesh of the same layout, and on their way to ours.

    contact: unknowns (n,) that the films began at. films, numbers: |U| in mm/s -> unknowns (n,)
    and what they mean; they are filled as the films are found.
    """

    other: SealSystem
    ours: SealSystem
    contact: Array
    films: dict[float, Array] = field(default_factory=dict)
    numbers: dict[float, FilmNumbers] = field(default_factory=dict)

    def built(self, speed: float) -> Array:
        """Change (n,) from contact to the film at a speed."""
        return self._change(self.contact, self.films[speed])

    def next(self, before: float, speed: float) -> Array:
        """Change (n,) from the film at a speed to that at another one."""
        return self._change(self.films[before], self.films[speed])

    def change(self, before: float | None, speed: float) -> Array:
        """Change (n,) to the film at a speed from that at another one, None: from contact."""
        return self.built(speed) if before is None else self.next(before, speed)

    def lagged(
        self,
        stage: Stage,
        newton: Newton,
        before: float | None,
        x: Array,
        *,
        patiently: bool = False,
    ) -> tuple[Stage, Array]:
        """The film where a stage of falling speed begins, with pressures that lag; and its start.

        x: (n,) our film at the speed before, see `change`.
        """
        quick = replace(newton, max_iterations=_ITERATIONS)
        speed, problem = abs(stage.shown(stage.start)), stage.problem_at(stage.start)
        assert isinstance(problem, Problem)
        start = self.contact if before is None else self.films[before]
        change = _pressures(self.other, self.films[speed]) - _pressures(self.other, start)
        carried = carried_elements(self.other, self.ours, change)
        held = lagged(self.ours, problem, _pressures(self.ours, x) + carried)
        most = _IN_CORNER if lies_in_corner(self.ours) else _PATIENT
        stage = replace(
            stage,
            name="film of another mesh",
            problem_at=lambda _: held,
            stop=stage.start,
            waypoints=(),
            method="newton, carried from another mesh",
            corrector=patient(newton, most) if patiently else quick,
        )
        return stage, x + self.change(before, speed)

    def _change(self, start: Array, end: Array) -> Array:
        """Change (n,) on the mesh of ours from two states (n,) of the other one."""
        change = end - start
        y = carried_unknowns(self.other, self.ours, change)
        moved = self.other.displacements(change)[self.other.mesh.arc_nodes]
        self.ours.displacements(y)[self.ours.mesh.arc_nodes] = self._along_arc(moved)
        carry_pressures(self.other, self.ours, change, y, self._places)
        return y

    def _along_arc(self, values: Array) -> Array:
        """Values (n', 2) at the arc nodes of the mesh of ours from those, (n, 2), of the other."""
        before = self.other.section.places
        number = np.arange(float(len(before)))
        at = PchipInterpolator(before, number)(self._relative(self.ours.section.places))
        return np.asarray(make_interp_spline(number, values, k=3)(at))

    @cached_property
    def _places(self) -> tuple[Integers, Array]:
        """Of our pressures (s, m): the segment of the other mesh they are in, its modes there."""
        before, after = self.other.section.places, self.ours.section.places
        nodes = pressure_nodes(self.ours.parameters.pressure_order)
        share = 0.5 * (1.0 + nodes)
        at = self._relative(after[:-1, None] + np.diff(after)[:, None] * share)
        return modes_at(before, nodes, at)

    def _relative(self, places: Array) -> Array:
        """Places on the arc of the other mesh from those on that of ours, mm."""
        before, after = self.other.section.places, self.ours.section.places
        return np.asarray(places * (before[-1] / after[-1]))


def _pressures(system: SealSystem, x: Array) -> Array:
    """Mean stress (Q,) of the elements of the section x (n,)."""
    return element_pressures(system.problem, system.solids, x)
