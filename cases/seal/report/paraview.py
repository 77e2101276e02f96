"""For ParaView beside the sections: the gland around them, and their series over the speeds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softehl.cases.harness.files import Cells, write_content
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import write_pvd

if TYPE_CHECKING:
    from softehl.cases.seal.gland.records.gland import Gland

FILES = ("gland.vtu", "section_out.pvd", "section_in.pvd")

PARTS = ("rod", "groove", "housing")
"""Names of the values of `part` in gland.vtu, from 0."""


def write_paraview(p: Gland, folder: Path, rows: Sequence[FilmRow]) -> None:
    """Write the gland, and a series over |U| in mm/s for each stroke that has rows."""
    write_content(folder / "gland.vtu", gland_outlines(p))
    for stroke in ("out", "in"):
        entries = [(abs(r.rod_speed_mm_s), r.file_names()[1]) for r in rows if r.stroke == stroke]
        if entries:
            write_pvd(folder / f"section_{stroke}.pvd", sorted(entries))


def gland_outlines(p: Gland) -> Cells:
    """Lines of the rod, the groove and the housing beside it, as they are modelled; part: which.

    The walls end at the rod, and where there is an extrusion gap, in the fillet at its edge.
    """
    rod, housing = 0.5 * p.rod_diameter, 0.5 * p.housing_diameter
    start, end = p.sealed_wall, p.air_wall
    left, right = start - p.section_diameter, end + p.section_diameter
    top, edge = housing + p.section_diameter, _edge(p, end, rod)
    foot = [start, rod]
    outside = [foot, [left, rod], [left, top], [right, top], [right, edge[-1][1]], edge[-1]]
    lines = (
        [[left, rod], [right, rod]],
        [foot, [start, housing], [end, housing], *edge],
        outside,
    )
    first = np.cumsum([0, *map(len, lines)])
    pieces = [np.arange(a, b - 1) for a, b in pairwise(first.tolist())]
    nodes = np.concatenate(pieces)
    part = np.repeat(np.arange(float(len(lines))), [len(piece) for piece in pieces])
    return Cells(np.concatenate(lines), np.stack([nodes, nodes + 1], axis=1), {}, {"part": part})


def _edge(p: Gland, wall: float, rod: float) -> list[list[float]]:
    """Points of the end of the air wall, from the wall on: at the rod, or the fillet."""
    if not p.opens:
        return [[wall, rod]]
    fillet, lip = p.corner_fillet, rod + p.extrusion_gap
    angles = np.linspace(0.0, 0.5 * pi, 17)
    across, up = wall + fillet * (1.0 - np.cos(angles)), lip + fillet * (1.0 - np.sin(angles))
    edge: list[list[float]] = np.stack([across, up], axis=1).tolist()
    return edge
