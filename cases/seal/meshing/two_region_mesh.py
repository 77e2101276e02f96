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
    near, far = shape.parts
    length, width = shape.outline.length, far.pieces[0].length
    begin = (film[0] - shape.chord[0]) % length
    ends, whole = (begin, begin + (film[1] - film[0]) % length), (0.0, width)
    _, low, _, high = shape.outline.box
    least = _COARSE * (high - low)
    outside, inside = Strip(least=least), Strip(1.0, _THICK, least)
    cap = outline_mesh(Shape(near, ends, ends, CAP), ends, spacing, long, density, outside)
    cut, count = _cut(BoundaryLayout.of(near, ends, spacing, long, least), near.length)
    body = outline_mesh(Shape(far, whole, whole, BODY), whole, cut, count, density, inside)
    places = film[0] - begin, near.length - width, width
    return _joined(cap, body, places, length)


def _cut(layout: BoundaryLayout, length: float) -> tuple[Spacing, int]:
    """Spacing of the nodes along the cut, the other way, and their segments at density 1."""
    for _, end, spacing, count in layout.parts:
        if spacing is not None and isclose(end, length):
            return Spacing(1.0 - spacing.places[::-1]), count
    raise MeshError("no corners where a cut meets the outline")


def _joined(
    cap: SectionMesh, body: SectionMesh, places: tuple[float, float, float], length: float
) -> SectionMesh:
    """Both in one, on an outline of this length.

    places: on it where the cap begins; lengths of the cap's part of it and of the cut.
    """
    start, beside, width = places
    first, last = (int(np.argmin(np.abs(cap.places - at))) for at in (beside, beside + width))
    cut, outer = body.boundary[: body.arc + 1], body.boundary[body.arc + 1 :]
    numbers = np.full(len(body.points), -1, dtype=np.int64)
    numbers[cut] = cap.boundary[first : last + 1][::-1]
    free = numbers < 0
    numbers[free] = len(cap.points) + np.arange(int(free.sum()))
    boundary = [cap.boundary[: first + 1], numbers[outer], cap.boundary[last:]]
    around = [
        cap.places[: first + 1] + start,
        body.places[body.arc + 1 :] - width + beside + start,
        cap.places[last:] - beside - width + length + start,
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
