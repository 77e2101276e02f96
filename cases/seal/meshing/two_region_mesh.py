"""A mesh of a section that a straight cut parts into two regions, with nodes along the cut.

Each part is meshed for itself, as `outline_mesh` does; the second one takes the nodes of the cut
from the first. Where the cut meets the outline elements are not small: the softer material folds
over the edge of the stiffer one there, at any size, and what is smaller than that turns inside out.
"""

from __future__ import annotations

from fractions import Fraction
from math import isclose

import numpy as np

from softehl.cases.seal.meshing.boundary_layout import BoundaryLayout
from softehl.cases.seal.meshing.outline import Shape
from softehl.cases.seal.meshing.outline_mesh import Strip, outline_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.meshing.spacing import Spacing
from softehl.runtime.mesh.mesh import MeshError

CAP, BODY = "cap", "body"
"""Regions: what is on the film's side of the cut, and what is behind it."""

_THICK = 4.0  # of the usual strip: that of the body, which carries no film
_COARSE = 0.02  # of the height: segments where the cut meets the outline


def parted_mesh(
    shape: Shape,
    film: tuple[float, float],
    spacing: Spacing | None,
    long: int,
    density: int | Fraction,
) -> SectionMesh:
    """The mesh of a shape with a chord, its regions CAP and BODY in this order of the elements.

    See `outline_mesh` for the others. Raises MeshError.
    """
    assert shape.chord is not None
    lower, far = shape.parts
    length, width = shape.outline.length, far.pieces[0].length
    begin = (film[0] - shape.chord[0]) % length
    bounds, full_width = (begin, begin + (film[1] - film[0]) % length), (0.0, width)
    _, low, _, high = shape.outline.box
    smallest = _COARSE * (high - low)
    outside, inside = Strip(minimum=smallest), Strip(1.0, _THICK, smallest)
    cap = outline_mesh(Shape(lower, bounds, bounds, CAP), bounds, spacing, long, density, outside)
    cut, count = _cut(BoundaryLayout.of(lower, bounds, spacing, long, smallest), lower.length)
    body = outline_mesh(
        Shape(far, full_width, full_width, BODY), full_width, cut, count, density, inside
    )
    positions = film[0] - begin, lower.length - width, width
    return _joined(cap, body, positions, length)


def _cut(layout: BoundaryLayout, length: float) -> tuple[Spacing, int]:
    """Spacing of the nodes along the cut, the other way, and their segments at density 1."""
    for _, end, spacing, count in layout.parts:
        if spacing is not None and isclose(end, length):
            return Spacing(1.0 - spacing.positions[::-1]), count
    raise MeshError("no corners where a cut meets the outline")


def _joined(
    cap: SectionMesh, body: SectionMesh, positions: tuple[float, float, float], length: float
) -> SectionMesh:
    """Both in one, on an outline of this length.

    positions: on it where the cap begins; lengths of the cap's part of it and of the cut.
    """
    start, side_length, width = positions
    first, last = (
        int(np.argmin(np.abs(cap.positions - at))) for at in (side_length, side_length + width)
    )
    cut, outer = body.boundary[: body.arc + 1], body.boundary[body.arc + 1 :]
    numbers = np.full(len(body.points), -1, dtype=np.int64)
    numbers[cut] = cap.boundary[first : last + 1][::-1]
    free = numbers < 0
    numbers[free] = len(cap.points) + np.arange(int(free.sum()))
    boundary = [cap.boundary[: first + 1], numbers[outer], cap.boundary[last:]]
    around = [
        cap.positions[: first + 1] + start,
        body.positions[body.arc + 1 :] - width + side_length + start,
        cap.positions[last:] - side_length - width + length + start,
    ]
    cells = len(cap.quads)
    return SectionMesh(
        np.concatenate([cap.points, body.points[free]]),
        np.concatenate([cap.quads, numbers[body.quads]]),
        np.concatenate(boundary),
        cap.arc,
        np.concatenate(around),
        length,
        {CAP: np.arange(cells), BODY: cells + np.arange(len(body.quads))},
    )
