"""The cross-section of a seal: its mesh, the parts of its boundary, and where pressure acts.

Boundary counterclockwise: the lubricated arc (bottom, sealed to air side), then the air side, the
crown and the sealed side. Sealed pressure acts from the sealed end of the arc round to the crown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import pi

import numpy as np

from softehl.cases.seal.parameters import ORing
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.sections import Disc, SectionMesh, disc_mesh


@dataclass(frozen=True, eq=False)
class SealSection:
    """A meshed section in its reference configuration; lengths in mm.

    disc: how the mesh is laid out.
    """

    disc: Disc
    mesh: SectionMesh

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
        }

    @property
    def chains(self) -> Mapping[str, tuple[Integers, Integers]]:
        """Nodes (n,) and segments (m, 2) of the two parts of the boundary."""
        mesh = self.mesh
        return {
            "arc_nodes": (mesh.arc_nodes, mesh.arc_segments),
            "outer_nodes": (mesh.outer_nodes, mesh.outer_segments),
        }

    @property
    def lowest(self) -> int:
        """Index of the arc node nearest to the rod."""
        return int(np.argmin(self.mesh.points[self.mesh.arc_nodes, 1]))

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


def uniform_disc(p: ORing) -> Disc:
    """The circular section with equal segments on its arc."""
    radius = 0.5 * p.section_diameter
    return Disc(0.0, 0.5 * p.inner_diameter + radius, radius, p.arc_start, p.arc_end)


def disc_section(
    p: ORing, disc: Disc | None = None, density: Fraction | None = None
) -> SealSection:
    """The circular section of a case.

    disc: how the mesh is laid out, with equal segments if left out. density: instead of the case's.
    """
    disc = disc or uniform_disc(p)
    return SealSection(disc, disc_mesh(disc, density or p.density))
