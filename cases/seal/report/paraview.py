"""For ParaView beside the sections: the gland around them, and their series over the speeds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softehl.cases.harness.file_content import Cells, write_content
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array
from softehl.runtime.io import write_pvd

if TYPE_CHECKING:
    from softehl.cases.seal.gland.records import Gland

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
    """Lines of the gland; part: which of `PARTS`."""
    lines = gland_lines(p)
    first = np.cumsum([0, *map(len, lines)])
    pieces = [np.arange(a, b - 1) for a, b in pairwise(first.tolist())]
    nodes = np.concatenate(pieces)
    part = np.repeat(np.arange(float(len(lines))), [len(piece) for piece in pieces])
    return Cells(np.concatenate(lines), np.stack([nodes, nodes + 1], axis=1), {}, {"part": part})


def gland_lines(p: Gland, clearance: float = 0.0) -> tuple[Array, Array, Array]:
    """Points (n, 2) of the rod, the groove and the housing beside it, as they are modelled.

    clearance: of the ends of the walls from the rod, mm. Beside an extrusion gap the wall of the
    air side ends in the fillet at its edge instead.
    """
    size, rod, housing = p.section_diameter, 0.5 * p.rod_diameter, 0.5 * p.housing_diameter
    start, end = p.sealed_wall, p.air_wall
    left, right, top, lip = start - size, end + size, housing + size, rod + clearance
    foot, edge = np.array([[start, lip]]), np.array([[end, lip]])
    if p.opens:
        angles = np.linspace(0.0, 0.5 * pi, 17)
        around = 1.0 - np.stack([np.cos(angles), np.sin(angles)], axis=1)
        edge = [end, rod + p.extrusion_gap] + p.corner_fillet * around
    outline = [[left, lip], [left, top], [right, top], [right, edge[-1, 1]]]
    return (
        np.array([[left, rod], [right, rod]]),
        np.concatenate([foot, [[start, housing], [end, housing]], edge]),
        np.concatenate([foot, outline, edge[-1:]]),
    )
