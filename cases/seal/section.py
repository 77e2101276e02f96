"""The cross-section of a seal: its mesh, the parts of its boundary, and where pressure acts.

Boundary counterclockwise: the lubricated arc (bottom, sealed to air side), then the air side, the
crown and the sealed side. Sealed pressure acts from the sealed end of the arc round to the crown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import pi, radians

import numpy as np

from softehl.cases.seal.parameters import ORing
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.sections import Disc, SectionMesh, disc_mesh
from softehl.runtime.mesh.spacing import Spacing, Spot, graded


@dataclass(frozen=True, eq=False)
class SealSection:
    """A meshed section in its reference configuration; lengths in mm.

    disc: how the mesh is laid out. placed: whether its arc was placed by the contact; then every
    boundary node may touch the walls of the groove, else (the paper's scheme) those off the arc.
    """

    disc: Disc
    mesh: SectionMesh
    placed: bool = False

    @cached_property
    def elements(self) -> Mapping[str, Integers]:
        """The sets of elements that blocks stand on, name -> node numbers (n, k).

        facets: the interior nodes of the arc, each between its two neighbours. arc_nodes and
        outer_nodes: single nodes. sealed_arc: the part of the arc that p_s reaches without a film.
        """
        mesh, arc = self.mesh, self.mesh.arc_nodes
        return {
            "cells": mesh.quads,
            "arc": mesh.arc_segments,
            "facets": np.stack([arc[:-2], arc[1:-1], arc[2:]], axis=1),
            "sealed_side": self._sealed_side(),
            "sealed_arc": mesh.arc_segments[: self.lowest],
            "arc_nodes": arc[:, None],
            "outer_nodes": mesh.outer_nodes[:, None],
            "wall_nodes": self.chains["wall_nodes"][0][:, None],
        }

    @property
    def chains(self) -> Mapping[str, tuple[Integers, Integers]]:
        """Nodes (n,) and segments (m, 2) of what may meet the rod, the housing, a wall."""
        mesh = self.mesh
        outer = mesh.outer_nodes, mesh.outer_segments
        return {
            "arc_nodes": (mesh.arc_nodes, mesh.arc_segments),
            "outer_nodes": outer,
            "wall_nodes": (mesh.boundary, mesh.segments) if self.placed else outer,
        }

    @property
    def lowest(self) -> int:
        """Index of the arc node nearest to the rod."""
        return int(np.argmin(self.mesh.points[self.mesh.arc_nodes, 1]))

    @property
    def pressed_ends(self) -> tuple[int, int]:
        """Nodes at which the sealed pressure of the contact ends: on the arc, at the crown."""
        return int(self.mesh.arc_nodes[self.lowest]), int(self._sealed_side()[0, 0])

    @property
    def area(self) -> float:
        """Area of the section, mm^2."""
        return pi * self.disc.radius**2

    @property
    def polar_moment(self) -> float:
        """Polar moment of area about the centre, mm^4."""
        return 0.5 * pi * self.disc.radius**4

    def coordinates(self, elements: str) -> Array:
        """Coordinates (n, 2 k) in (z, r) of a set of elements, node by node."""
        nodes = self.elements[elements]
        return np.ascontiguousarray(self.mesh.points[nodes].reshape(len(nodes), -1))

    def _sealed_side(self) -> Integers:
        """Segments from the crown to the sealed end of the arc."""
        outer = self.mesh.outer_segments
        middle = self.mesh.points[outer].mean(axis=1)
        return outer[int(np.flatnonzero(middle[:, 0] < 0.0)[0]) :]


GUIDE_ARC, GUIDE_TOP = 75.0, 118.0
"""Half the angle of the arc on which contact is first looked for, and where the top begins."""

EDGE_ANGLES = range(27, 70, 3)
"""Where a section meets the edge of the gap under pressure, degrees from the bottom."""

LONG_OPEN = 42
"""The same where the edge of an open gap is to be resolved too."""

LONG_PLACED = 33
"""Segments at density 1 of an arc that the contact has placed."""


def uniform_disc(p: ORing) -> Disc:
    """The circular section with equal segments on its arc, the given one or a wide guide."""
    radius = 0.5 * p.section_diameter
    centre = 0.0, 0.5 * p.inner_diameter + radius
    if p.given_arc:
        return Disc(*centre, radius, *p.given_arc)
    long = LONG_OPEN if p.opens else LONG_PLACED
    guide = Disc(*centre, radius, -GUIDE_ARC, GUIDE_ARC, top=GUIDE_TOP, long=long)
    return replace(guide, spacing=_fine_at_edge(guide)) if p.opens else guide


def _fine_at_edge(guide: Disc) -> Spacing:
    """Of a guide: fine where the section may meet the edge of an open gap, wherever that is."""
    degree = radians(1.0) * guide.radius
    spots = [Spot((GUIDE_ARC + angle) * degree) for angle in EDGE_ANGLES]
    length = 2.0 * GUIDE_ARC * degree
    return graded(length, spots, 2 * guide.long, coarsest=0.05 * length, rate=0.3)


def disc_section(
    p: ORing, disc: Disc | None = None, density: Fraction | None = None
) -> SealSection:
    """The circular section of a case.

    disc: how the mesh is laid out, with equal segments if left out. density: instead of the case's.
    """
    disc = disc or uniform_disc(p)
    return SealSection(disc, disc_mesh(disc, density or p.density), placed=p.given_arc is None)
