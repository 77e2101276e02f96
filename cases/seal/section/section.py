"""The cross-section of a seal: its mesh, the parts of its boundary, and where pressure acts.

Boundary counterclockwise: the lubricated arc (bottom, sealed to air side), then the air side, the
crown and the sealed side. Sealed pressure acts from the sealed end of the arc round to the crown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Solid
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.section.layout import Layout, uniform_layout
from softehl.runtime.arrays import Array, Integers

BODY = "body"
"""The elements without a material of their own: all of them, or what is left."""


@dataclass(frozen=True, eq=False)
class SealSection:
    """A meshed section in its reference configuration; lengths in mm.

    layout: of the mesh. placed: whether its arc was placed by the contact; then every
    boundary node may touch the walls of the groove, else (the paper's scheme) those off the arc.
    own_regions: regions with materials of their own, whose elements come first, in this order.
    density: of the mesh.
    """

    layout: Layout
    mesh: SectionMesh
    density: Fraction
    placed: bool = False
    own_regions: tuple[str, ...] = ()

    @cached_property
    def elements(self) -> Mapping[str, Integers]:
        """The sets of elements that blocks stand on, name -> node numbers (n, k).

        facets: the interior nodes of the arc, each between its two neighbours. arc_nodes and
        outer_nodes: single nodes. sealed_arc: the part of the arc that p_s reaches without a film.
        """
        mesh, arc = self.mesh, self.mesh.arc_nodes
        return {
            "cells": mesh.quads,
            **self._solids(),
            "arc": mesh.arc_segments,
            "facets": np.stack([arc[:-2], arc[1:-1], arc[2:]], axis=1),
            "sealed_side": self._sealed_side(),
            "sealed_arc": mesh.arc_segments[: self.lowest],
            "arc_nodes": arc[:, None],
            "outer_nodes": mesh.outer_nodes[:, None],
            "wall_nodes": self.chains["wall_nodes"][0][:, None],
        }

    @cached_property
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
        """Index of the arc node at which the sealed pressure of the contact ends: see `Layout`."""
        return self.layout.lowest(self.mesh)

    @property
    def crown(self) -> int:
        """Index in the boundary of the node at which the sealed pressure of the housing ends."""
        return self.mesh.arc + self.layout.pressed(self.mesh)

    @property
    def pressed_ends(self) -> tuple[int, int]:
        """Nodes at which the sealed pressure of the contact ends: on the arc, at the crown."""
        return int(self.mesh.arc_nodes[self.lowest]), int(self._sealed_side()[0, 0])

    @cached_property
    def moments(self) -> tuple[float, Array, float]:
        """Area, mm^2; centroid (2,) in (z, r), mm; polar moment about it, mm^4.

        Of the section as it is meshed, so that what holds its mean rotation is a pure couple.
        """
        corner = self.mesh.points[self.mesh.boundary]
        relative = corner - corner[0]
        after = np.roll(relative, -1, axis=0)
        cross = relative[:, 0] * after[:, 1] - after[:, 0] * relative[:, 1]
        area = 0.5 * float(cross.sum())
        centre = cross @ (relative + after) / (6.0 * area)
        squares = (relative**2 + relative * after + after**2).sum(axis=1)
        polar = float(cross @ squares) / 12.0 - area * float(centre @ centre)
        return area, corner[0] + centre, polar

    @property
    def positions(self) -> Array:
        """Lengths (arc nodes,) along the undeformed arc from its sealed end, mm."""
        return self.mesh.arc_places

    def coordinates(self, elements: str) -> Array:
        """Coordinates (n, 2 k) in (z, r) of a set of elements, node by node."""
        nodes = self.elements[elements]
        return np.ascontiguousarray(self.mesh.points[nodes].reshape(len(nodes), -1))

    def node_moduli(self, p: Solid) -> Array:
        """Shear modulus (nodes,) of the stiffest material at a node, MPa."""
        moduli = np.full(len(self.mesh.points), p.shear_modulus)
        for name in self.own_regions:
            nodes = self.elements[name]
            moduli[nodes] = np.maximum(moduli[nodes], p.rubber(name).shear_modulus)
        return moduli

    def _solids(self) -> dict[str, Integers]:
        """Elements of each region with a material of its own, and BODY, the others behind them."""
        mesh, done = self.mesh, 0
        solids = {}
        for name in self.own_regions:
            cells = mesh.regions[name]
            assert np.array_equal(cells, np.arange(done, done + len(cells)))
            solids[name], done = mesh.quads[cells], done + len(cells)
        return {**solids, BODY: mesh.quads[done:]} if done < len(mesh.quads) else solids

    def _sealed_side(self) -> Integers:
        """Segments from the crown to the sealed end of the arc."""
        return self.mesh.outer_segments[self.layout.pressed(self.mesh) :]


def seal_section(
    p: Seal, layout: Layout | None = None, density: Fraction | None = None
) -> SealSection:
    """The section of a case.

    layout: of the mesh, with equal segments if left out. density: instead of the case's.
    """
    layout, density = layout or uniform_layout(p), density or Fraction(p.density)
    regions = tuple(p.materials)
    mesh = _ordered(layout.mesh(density), regions)
    return SealSection(layout, mesh, density, placed=p.given_arc is None, own_regions=regions)


def _ordered(mesh: SectionMesh, names: tuple[str, ...]) -> SectionMesh:
    """The mesh with the elements of these regions first, in this order."""
    if not names:
        return mesh
    first = np.concatenate([mesh.regions[name] for name in names])
    order = np.concatenate([first, np.setdiff1d(np.arange(len(mesh.quads)), first)])
    number = np.argsort(order)
    regions = {name: number[cells] for name, cells in mesh.regions.items()}
    return replace(mesh, quads=mesh.quads[order], regions=regions)
