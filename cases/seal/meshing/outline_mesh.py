"""A quadrilateral mesh of a section of any outline: layers along it, and a graded inside.

A strip of layers follows the whole outline. What it encloses is filled with triangles, each of
which is three quadrilaterals; of a finer mesh each of these is divided k by k, so that the meshes
of density d and 2 d are of one family. Every node of the boundary lies exactly on the outline.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from softehl.cases.seal.meshing.boundary_layout import AROUND, SMOOTH, BoundaryLayout, normals
from softehl.cases.seal.meshing.outline import Shape
from softehl.cases.seal.meshing.section_mesh import (
    LAYERS,
    SectionMesh,
    corner_shares,
    graded_steps,
    grid_cells,
)
from softehl.cases.seal.meshing.spacing import Spacing
from softehl.cases.seal.meshing.subdivision import subdivided
from softehl.cases.seal.meshing.triangulation import triangulate
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.mesh import MeshError

WORST = 0.3
"""Least Jacobian at a corner, relative to the area, that is looked for with thinner strips."""

_LEAST = 0.1  # the same that is accepted where they do not help: long segments over a fillet
_TRIES = 6  # at a strip that does not fold, each half as thick
_COARSEST_TRIANGLES = Fraction(2, 3)  # density of the triangles: finer meshes divide theirs


@dataclass(frozen=True)
class Strip:
    """The layers along an outline, and its nodes off the film.

    growth: ratio of the thickness of the innermost to the outermost layer. thick: of the strip, in
    the usual thickness. minimum: size of the segments at a corner, mm, at density 1.
    """

    growth: float = 8.0
    thick: float = 1.0
    minimum: float = 0.0


FILM_STRIP = Strip()
"""For the surface that carries a film."""


def outline_mesh(
    shape: Shape,
    film: tuple[float, float],
    spacing: Spacing | None,
    long: int,
    density: int | Fraction,
    strip: Strip = FILM_STRIP,
) -> SectionMesh:
    """The mesh of a section, with `long` d segments between the places of the film.

    film: (s0, s1) on the outline, mm, counterclockwise. spacing: of the nodes there, None = equal.
    density: a multiple of 1/3, at least 2/3, that makes `long` d whole. strip: of layers.
    Raises MeshError for others, and where no mesh of sound elements is found.
    """
    layout = BoundaryLayout.of(shape.outline, film, spacing, long, strip.minimum)
    _require_density(density, long)
    coarse = Fraction(density) / _divisions(Fraction(density))
    best, mesh = 0.0, None
    for halvings in range(_TRIES):  # the coarsest of its family decides how thick the strip is
        thick = strip.thick * 0.5**halvings
        tried = _mesh(layout, coarse, thick, strip.growth)
        share = _worst(tried)
        if share <= best:
            continue
        if coarse != density and share >= _LEAST:
            tried = _mesh(layout, Fraction(density), thick, strip.growth)
            if _worst(tried) < _LEAST:  # elements of the finer one fold in a front that is curved
                continue
        best, mesh = share, tried
        if share >= WORST:
            break
    if mesh and best >= _LEAST:
        return mesh
    raise MeshError(
        f"no sound mesh of {shape.name} at density {density} with {long} segments of its film: a "
        f"corner of an element has {best:.2g} of its share, at least {_LEAST:g} is needed; use a "
        "higher density, a finer spacing or rounder corners"
    )


def _mesh(
    layout: BoundaryLayout, density: Fraction, part: float, growth: float
) -> SectionMesh | None:
    """The mesh with a strip of this part of its thickness; None where it folds."""
    rows = _strip(layout, density, part, growth)
    if corner_shares(rows.reshape(-1, 2)[_strip_quads(*rows.shape[:2])]).min() < _LEAST:
        return None
    try:
        return _filled(layout, rows, density)
    except MeshError:
        return None


def _worst(mesh: SectionMesh | None) -> float:
    """The least share of a corner, 0 without a mesh."""
    return float(corner_shares(mesh.points[mesh.quads]).min()) if mesh else 0.0


def _require_density(density: int | Fraction, long: int) -> None:
    if density < Fraction(2, 3) or (3 * density) % 1 or (long * density) % 1:
        raise MeshError(
            f"outline_mesh: density {density} is not allowed with {long} segments; it is a "
            "multiple of 1/3, at least 2/3, that divides them"
        )


def _strip(layout: BoundaryLayout, density: Fraction, part: float, growth: float) -> Array:
    """Points (layers + 1, B, 2) from the outline to the front of the strip."""
    s = layout.positions(density)
    depth = part * layout.depth(s)
    ring = layout.outline.at(s)
    # over half a segment of the coarsest of the family: chords may pass over a small fillet
    over = np.maximum(0.5 * layout.lengths(density / _divisions(density), s), 1.5 * depth)
    inner = ring + depth[:, None] * normals(layout.outline, s, np.maximum(SMOOTH, over))
    t = graded_steps(int(LAYERS * density), growth)[:, None, None]
    return np.asarray(ring[None] + t * (inner - ring)[None])


def _strip_quads(rows: int, around: int) -> Integers:
    numbers = np.arange(rows * around).reshape(rows, around)
    return grid_cells(np.append(numbers, numbers[:, :1], axis=1))


def _divisions(density: Fraction) -> int:
    """k, a power of 2, of a mesh whose triangles, each 3 k^2 elements, are not too coarse."""
    k = 1
    while (3 * density / (2 * k)) % 1 == 0 and density / (4 * k) >= _COARSEST_TRIANGLES:
        k *= 2
    return k


def _filled(layout: BoundaryLayout, strip: Array, density: Fraction) -> SectionMesh:
    """The strip, and what is inside."""
    rows, around = strip.shape[:2]
    front, k = strip[-1], _divisions(density)
    largest = 2.0 * layout.outline.length / AROUND * float(k / density)
    corners, triangles = triangulate(front[:: 2 * k], 2.0 * largest)
    points, quads, loop = _three_quads(corners, triangles, front[::k])
    points, quads, border = subdivided(points, quads, loop, front, k)
    numbers = np.full(len(points), -1, dtype=np.int64)
    numbers[border] = (rows - 1) * around + np.arange(around)
    free = numbers < 0
    numbers[free] = rows * around + np.arange(int(free.sum()))
    every = np.concatenate([strip.reshape(-1, 2), points[free]])
    cells = np.concatenate([_strip_quads(rows, around), numbers[quads]])
    arc = int(layout.parts[0][3] * density)
    boundary = np.arange(around)
    return SectionMesh(
        every, cells, boundary, arc, layout.positions(density), layout.outline.length
    )


def _three_quads(
    corners: Array, triangles: Integers, front: Array
) -> tuple[Array, Integers, Integers]:
    """Points, quadrilaterals about the middles of the triangles' sides, and their outer loop.

    front: (2 m, 2), corners and middles of the sides at the border; the corners come first.
    """
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
    edges, which = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    middles = len(corners) + which.reshape(-1, 3)
    centres = len(corners) + len(edges) + np.arange(len(triangles))
    quads = [
        np.stack([triangles[:, i], middles[:, i], centres, middles[:, i - 1]], axis=1)
        for i in range(3)
    ]
    m = len(front) // 2
    sorted_ends = np.sort(np.stack([np.arange(m), (np.arange(m) + 1) % m], axis=1), axis=1)
    base = len(corners) + 1
    at = np.searchsorted(
        edges[:, 0] * base + edges[:, 1], sorted_ends[:, 0] * base + sorted_ends[:, 1]
    )
    loop = np.stack([np.arange(m), len(corners) + at], axis=1).ravel()
    ends_and_middles = np.concatenate([corners, corners[edges].mean(axis=1)])
    ends_and_middles[loop] = front
    points = np.concatenate([ends_and_middles, ends_and_middles[middles].mean(axis=1)])
    return points, np.concatenate(quads), loop
