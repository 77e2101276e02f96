"""The mesh of a section from its outline and the sizes along the part that carries a film.

Layers of elements follow every outline, and its nodes are on it. What they enclose is one mapped
block in a circle, and triangles divided into quadrilaterals in any other outline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import degrees, inf

import numpy as np

from softehl.cases.seal.meshing.o_grid import LONG, Disc, disc_mesh, fine_disc
from softehl.cases.seal.meshing.outline import Outline, Shape
from softehl.cases.seal.meshing.outline_mesh import outline_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.meshing.spacing import Spacing
from softehl.cases.seal.meshing.two_region_mesh import parted_mesh


@dataclass(frozen=True)
class Sizes:
    """Sizes of the elements of a section.

    long: segments of the film at density 1. spacing: of the nodes there, None = equal. depth: that
    the outermost layer of a circle has at most on the film, mm, as far as the number of layers
    allows; None: thick layers, as the paper has them. first: largest size of the segment beyond the
    air end of that film, mm. Of other outlines both follow from the segments.
    """

    long: int = LONG
    spacing: Spacing | None = None
    depth: float | None = None
    first: float = inf


def section_mesh(
    shape: Shape, film: tuple[float, float], sizes: Sizes, density: int | Fraction
) -> SectionMesh:
    """The mesh of a section with `sizes.long` times the density segments on its film.

    film: places (s0, s1) on the outline, mm, counterclockwise. density: a multiple of 1/3, at least
    2/3. Raises ValueError for others, and where no mesh of sound elements is found.
    """
    if shape.chord is None and shape.outline.disc is not None:
        return _round_mesh(shape.outline, film, sizes, density)
    mesh = parted_mesh if shape.chord else outline_mesh
    return mesh(shape, film, sizes.spacing, sizes.long, density)


def _round_mesh(
    outline: Outline, film: tuple[float, float], sizes: Sizes, density: int | Fraction
) -> SectionMesh:
    """The O-grid of a circle."""
    assert outline.disc is not None
    (z, r), radius = outline.disc
    half = 0.5 * outline.length
    bottom = float(outline.position(np.array([[z, r - radius]]))[0])
    begin = (film[0] - bottom + half) % outline.length - half
    end = begin + (film[1] - film[0]) % outline.length
    disc = Disc(
        centre_z=z,
        centre_r=r,
        radius=radius,
        arc_start=degrees(begin / radius),
        arc_end=degrees(end / radius),
        spacing=sizes.spacing,
        long=sizes.long,
    )
    if sizes.depth is not None:
        disc = fine_disc(disc, sizes.depth, sizes.first)
    mesh = disc_mesh(disc, density)
    return replace(mesh, positions=mesh.positions - mesh.positions[0] + film[0])
