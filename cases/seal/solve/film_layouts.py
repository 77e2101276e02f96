"""Layouts of meshes by where films are, or will be: contact itself holds the rod farther off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.drag import dragged, pushed
from softehl.cases.seal.solve.grading import (
    MOST_SEGMENTS,
    placed_layout,
    reaches_wall,
    slowest_films,
    sweeps,
)
from softehl.cases.seal.solve.nearing import NearRod, without_rounding
from softehl.cases.seal.solve.path import StageFailed
from softehl.cases.seal.states.contacts import Edge, contact_edges
from softehl.cases.seal.states.film_edges import between
from softehl.runtime.arrays import Array


@dataclass(frozen=True)
class FilmLayouts:
    """From a contact state x (n,) on another mesh.

    rod: brings the rod to where slow films have it.
    """

    rod: NearRod

    def slow(self, system: SealSystem, x: Array, p: ORing) -> Layout | None:
        """Fine where the slowest films of a case are; None where their inlets are long enough for
        the mesh there is, or the rod cannot come near.
        """
        near = self.rod.states(system, x) if self.rod.needed(system, x) else None
        if near is None or isinstance(near, StageFailed):
            return None
        also = [edge for y in near[1:] for edge in contact_edges(system, y)]
        return placed_layout(system, near[0], p, also=also)

    def film(self, system: SealSystem, x: Array, edges: Sequence[Edge]) -> Layout:
        """Fine at the edges of a film, too."""
        states = self.rod.states_or_here(system, x)
        others = [edge for y in states[1:] for edge in contact_edges(system, y)]
        more = between(edges, contact_edges(system, states[0]))
        also, most = [*others, *edges, *more], 2 * MOST_SEGMENTS
        return placed_layout(system, states[0], system.parameters, most, also)

    def instroke(self, system: SealSystem, x: Array) -> Layout | None:
        """Fine where films of the instroke have their inlet, many of its lengths from contact's;
        None where they do not move it far.
        """
        settings, linear = self.rod.settings, self.rod.newton.linear
        y = self.rod.states_or_here(system, x)[0]
        offset = settings.offset if y is x else slowest_films(system, x)[0]
        y = without_rounding(system, y)
        moved = dragged(system, settings, offset, y, linear)
        if not sweeps(system, y, moved):
            return None
        return placed_layout(system, y, system.parameters, dragged=moved, upward=True)

    def outstroke(self, system: SealSystem, x: Array) -> Layout | None:
        """With an arc that goes up the wall of the air side, against which the films of the
        outstroke push its end; None where they do not.
        """
        push = pushed(system, self.rod.settings, x, self.rod.newton.linear)
        if not reaches_wall(system, x, push):
            return None
        return placed_layout(system, x, system.parameters, upward=True)
