"""How the mesh of a section is laid out: everything that knows the shape of a seal.

Whatever comes behind asks a `Layout` for its mesh and for where the sealed pressure ends.
"""

from __future__ import annotations

from fractions import Fraction
from math import inf
from typing import Protocol

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.fem.postprocess import run_around
from softehl.runtime.mesh.sections import SectionMesh
from softehl.runtime.mesh.spacing import Spacing


class Layout(Protocol):
    """A section in its reference configuration and how a mesh is laid into it; lengths in mm."""

    @property
    def long(self) -> int:
        """Segments of the arc at density 1."""

    @property
    def spacing(self) -> Spacing | None:
        """That of the nodes along the arc, None where they are equally spaced."""

    @property
    def flat(self) -> bool:
        """Whether a contact may have flats, at whose corners pressure peaks."""

    @property
    def contour(self) -> Array:
        """Points (n, 2) in (z, r) of its boundary, for pictures."""

    def mesh(self, density: int | Fraction) -> SectionMesh:
        """The mesh of a density."""

    def lowest(self, mesh: SectionMesh) -> int:
        """The arc node at which the sealed pressure of the contact ends: that nearest to the rod,
        or where the section was seen to touch it.
        """

    def pressed(self, mesh: SectionMesh) -> int:
        """The first outer segment that the sealed pressure acts on, which it does up to the arc."""

    def held(self, mesh: SectionMesh, rod: Array, housing: Array, p_s: float) -> Layout:
        """The same with the sealed pressure ending where contact holds it back.

        rod, housing: pressures in excess of it, (arc nodes,) and (outer nodes,) of this mesh, MPa.
        """

    def bounds(self, old: Layout) -> tuple[float, float]:
        """Places (mm) on the arc of another one between which parts of this one's lie."""

    def between(self, old: Layout, ends: tuple[float, float]) -> Layout:
        """The same laid out on an arc whose ends are at these places of that of another one."""

    def graded(
        self, spacing: Spacing, long: int, depth: float = inf, first: float | None = None
    ) -> Layout:
        """With these segments on the arc.

        depth: that elements on the arc are to have at most, mm, as far as their number allows.
        first: size of the segment beyond the air end of the arc, mm.
        """


def dam_nodes(
    layout: Layout, mesh: SectionMesh, rod: Array, housing: Array, p_s: float
) -> tuple[int | None, int | None]:
    """Numbers along the boundary of the nodes that `Layout.held` moves the pressure's ends to.

    Of that on the rod and that on the housing; None where it stays.
    """
    last = len(housing) - 1  # the pressure comes from there, round the sealed side
    lip = dam(rod, layout.lowest(mesh), p_s)
    crown = dam(housing[::-1], last - layout.pressed(mesh), p_s)
    return lip, None if crown is None else (mesh.arc + last - crown) % len(mesh.boundary)


def moved_dams(
    dams: tuple[float | None, float | None], nodes: tuple[int | None, int | None], at: Array
) -> tuple[float | None, float | None]:
    """The dams at these nodes of the boundary, None: as before.  at: (boundary nodes,)."""
    lip, crown = (
        old if node is None else float(at[node]) for old, node in zip(dams, nodes, strict=True)
    )
    return lip, crown


def dam(excess: Array, index: int, p_s: float) -> int | None:
    """Where contact holds back a pressure that is taken to act up to an index, None if just there.

    excess: (n,) of contact over the pressure, which is p_s up to there and zero beyond. Where less
    than p_s holds it back it goes on, at most to where contact presses most.
    """
    touching = excess > 0.0
    if not touching.any() or (touching[index] and excess[min(index + 1, len(excess) - 1)] >= p_s):
        return None
    nodes = np.flatnonzero(touching)
    run = run_around(touching, int(nodes[np.argmin(np.abs(nodes - index))]))
    total = excess + np.where(np.arange(len(excess)) <= index, p_s, 0.0)
    return int(run.start + np.argmax(total[run]))
