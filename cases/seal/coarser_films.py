"""Films of a mesh from those of a coarser one, at the same speeds, without a path of their own.

What the coarser mesh says is how its film changes: from its contact state to a film, and from one
film to the next. The finer mesh makes these changes along its arc, and the section below it follows
(`SchurCorrector.moved`). Equations and solution are those
of the path in `cases.seal.film`; only the start of the iterations is another one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from softehl.cases.seal.equations import SealSystem
from softehl.cases.seal.system import ROTATION
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.rules import lagrange, pressure_nodes


@dataclass(frozen=True, eq=False)
class CoarserFilms:
    """Films of a stroke on a coarser mesh of the same layout, and on their way to a finer one.

    contact: unknowns (n,) that the films began at. films, thicknesses: |U| in mm/s -> unknowns (n,)
    and h*, mm; they are filled as the films are found.
    """

    coarse: SealSystem
    fine: SealSystem
    contact: Array
    films: dict[float, Array] = field(default_factory=dict)
    thicknesses: dict[float, float] = field(default_factory=dict)

    def built(self, speed: float) -> Array:
        """Change (n,) from contact to the film at a speed."""
        return self._change(self.contact, self.films[speed])

    def next(self, before: float, speed: float) -> Array:
        """Change (n,) from the film at a speed to that at another one."""
        return self._change(self.films[before], self.films[speed])

    def _change(self, start: Array, end: Array) -> Array:
        """Change (n,) on the finer mesh from two states (n,) of the coarser one."""
        y, change = self.fine.at_rest(), end - start
        moved = self.coarse.displacements(change)[self.coarse.mesh.arc_nodes]
        self.fine.displacements(y)[self.fine.mesh.arc_nodes] = self._along_arc(moved)
        y[self.fine.layout.part(ROTATION)] = change[self.coarse.layout.part(ROTATION)]
        for film in self.fine.film_fields():
            rows = change[self.coarse.pressure_dofs(film.name)]
            segment, weights = self._places
            values = np.einsum("skm,skm->sk", weights, rows[segment])
            y[self.fine.pressure_dofs(film.name)] = values
        return y

    def _along_arc(self, values: Array) -> Array:
        """Values (n', 2) at the arc nodes of the finer mesh from those, (n, 2), of the coarser."""
        before = self.coarse.section.places
        number = np.arange(float(len(before)))
        at = PchipInterpolator(before, number)(self._relative(self.fine.section.places))
        return np.asarray(make_interp_spline(number, values, k=3)(at))

    @cached_property
    def _places(self) -> tuple[Integers, Array]:
        """Of the pressures (s, m) of the finer segments: the coarser segment, its modes there."""
        before, after = self.coarse.section.places, self.fine.section.places
        nodes = pressure_nodes(self.fine.parameters.pressure_order)
        share = 0.5 * (1.0 + nodes)
        at = self._relative(after[:-1, None] + np.diff(after)[:, None] * share)
        segment = np.clip(np.searchsorted(before, at, side="right") - 1, 0, len(before) - 2)
        local = 2.0 * (at - before[segment]) / np.diff(before)[segment] - 1.0
        modes = lagrange(nodes, np.clip(local.ravel(), -1.0, 1.0))[:, :, 0]
        return segment, modes.reshape(*segment.shape, -1)

    def _relative(self, places: Array) -> Array:
        """Places on the arc of the coarser mesh from those on that of the finer one, mm."""
        before, after = self.coarse.section.places, self.fine.section.places
        return np.asarray(places * (before[-1] / after[-1]))
