"""Sections from files: drawings (.dxf), points (.csv), and the boundary of a mesh (.msh, ...).

Lines, arcs, circles and polylines with bulges of a DXF drawing are converted exactly.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from math import cos, dist, radians, sin
from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.seal.gland.sections.placement import (
    FILM,
    PRESSURE,
    Named,
    film_below,
    mirrored,
    named_shape,
    runs,
    seated,
)
from softehl.cases.seal.gland.tables import reading
from softehl.cases.seal.meshing.outline import Arc, Line, Outline, OutlineError, Piece, Point, Shape
from softehl.cases.seal.meshing.outline_checks import CLOSED
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians
from softehl.cases.seal.meshing.subdivision import subdivided
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.body_thickness import in_chains
from softehl.runtime.mesh.face_matching import unrepeated_faces
from softehl.runtime.mesh.mesh import Mesh

_UNITS = {0: 1.0, 1: 25.4, 4: 1.0, 5: 10.0, 6: 1000.0, 13: 1e-3}  # $INSUNITS of DXF -> mm
_WORDS = ("DIMENSION", "HATCH", "LEADER", "MTEXT", "MULTILEADER", "POINT", "TEXT", "VIEWPORT")


def read_dxf(path: Path, inner_diameter: float | None = None) -> Shape:
    """The section of a drawing, x to the air side and y away from the rod, in its units.

    One closed contour; the layers FILM and PRESSURE name its lubricated and its sealed part. A
    drawing whose sealed side is on the right is mirrored. Raises OutlineError.
    """
    return named_shape(_chained(_pieces(path)), inner_diameter, path.stem)


def _pieces(path: Path) -> list[Named]:
    """Pieces of the contour in mm with their layers, in the order of the file."""
    try:
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
    except ImportError:
        raise OutlineError("DXF files are read by ezdxf; pip install 'softehl[cad]'") from None
    try:
        document = readfile(path)
    except DXFError as error:
        raise OutlineError(" ".join(str(error).split()) or "not a DXF file") from None
    unit = int(document.header.get("$INSUNITS", 0))
    if unit not in _UNITS:
        raise OutlineError(f"$INSUNITS = {unit} is no metric unit or inch; use mm")
    pieces_read: list[Named] = []
    for entity in document.modelspace():
        layer = str(entity.dxf.layer)
        pieces_read += [(p.moved(_UNITS[unit], (0.0, 0.0)), layer) for p in _converted(entity)]
    if not pieces_read:
        raise OutlineError("there is no contour of lines and arcs")
    return pieces_read


def _converted(entity: Any) -> Iterator[Piece]:
    """The pieces of one entity; text and dimensions have none."""
    kind = entity.dxftype()
    if kind in _WORDS:
        return
    if kind == "LINE":
        start, end = _flat(entity.dxf.start), _flat(entity.dxf.end)
        if start != end:  # a last corner upon the first closes a polyline as well
            yield Line(start, end)
    elif kind == "LWPOLYLINE" or (kind == "POLYLINE" and entity.is_2d_polyline):
        for part in entity.virtual_entities():
            yield from _converted(part)
    elif kind in ("ARC", "CIRCLE"):
        d = entity.dxf
        angle_pairs = (
            [(d.start_angle, d.end_angle)] if kind == "ARC" else [(0.0, 180.0), (180.0, 360.0)]
        )
        arcs = [_arc(entity, start, end) for start, end in angle_pairs]
        mirrored_view = d.hasattr("extrusion") and d.extrusion.z < 0.0
        yield from (map(mirrored, arcs) if mirrored_view else arcs)
    else:
        raise OutlineError(
            f"{kind} on layer {entity.dxf.layer!r} is no line, arc, circle or flat polyline; "
            "explode it or draw it as arcs"
        )


def _flat(point: Any) -> Point:
    return float(point[0]), float(point[1])


def _arc(entity: Any, start: float, end: float) -> Arc:
    """Counterclockwise between angles in degrees."""
    z, r = _flat(entity.dxf.center)
    R = float(entity.dxf.radius)
    a, b = ((z + R * cos(radians(t)), r + R * sin(radians(t))) for t in (start, end))
    return Arc(a, b, (z, r))


def _chained(named: list[Named]) -> list[Named]:
    """The pieces, turned and in order, so that each begins where the one before ends."""
    left, chain = list(named[1:]), [named[0]]
    boxes = np.array([piece.box for piece, _ in named])
    size = dist(boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0))
    while dist(chain[-1][0].end, chain[0][0].start) > CLOSED * size:
        end = chain[-1][0].end
        gaps = [min(dist(end, p.start), dist(end, p.end)) for p, _ in left]
        gaps.append(dist(end, chain[0][0].start))
        gap = min(gaps)
        k = gaps.index(gap)
        if gap > CLOSED * size or k == len(left):
            raise OutlineError(
                f"the contour is open: a gap of {gap:.4g} mm at ({end[0]:.6g}, {end[1]:.6g}); "
                "close it"
            )
        piece, layer = left.pop(k)
        forward = dist(end, piece.start) <= dist(end, piece.end)
        chain.append((piece if forward else piece.reversed(), layer))
    if left:
        z, r = left[0][0].start
        raise OutlineError(
            f"there is more than one contour, such as at ({z:.6g}, {r:.6g}); holes and second "
            "parts are not allowed"
        )
    return chain


COLUMNS = ("z_mm", "r_mm", "part")
"""Of a CSV file: points in order; part, of the side from a point to the next, may be left out."""


def read_outline(path: Path, inner_diameter: float | None = None) -> Shape:
    """The section of a drawing (.dxf) or of points (.csv).

    inner_diameter: twice the radius of its lowest point, mm; None leaves it where it was drawn.
    Raises ValueError, one line.
    """
    reader = read_dxf if path.suffix.lower() == ".dxf" else read_points
    with reading(path.name):
        return reader(path, inner_diameter)


def read_points(path: Path, inner_diameter: float | None = None) -> Shape:
    """The section of a CSV file with the columns of COLUMNS.  Raises OutlineError."""
    rows = list(csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines()))
    try:
        points = [(float(row["z_mm"]), float(row["r_mm"])) for row in rows]
    except (KeyError, TypeError, ValueError):
        raise OutlineError(
            f"a file of points has the columns {', '.join(COLUMNS)} (the last may be left out), "
            "numbers in the first two"
        ) from None
    parts = [(row.get("part") or "").strip() for row in rows]
    return outline_of(points, inner_diameter, parts if any(parts) else None, path.stem)


def outline_of(
    points: Sequence[Point],
    inner_diameter: float | None = None,
    parts: Sequence[str] | None = None,
    name: str = "outline",
) -> Shape:
    """The section of a polygon, (z, r) in mm.

    parts: FILM, PRESSURE or else of the side behind each point. Without: film where the polygon
    faces the rod, sealed pressure from its highest point on. Raises OutlineError.
    """
    if parts is not None:
        if points[0] == points[-1]:
            points, parts = points[:-1], parts[:-1]
        sides = zip(points, [*points[1:], points[0]], parts, strict=True)
        return named_shape([(Line(a, b), part) for a, b, part in sides], inner_diameter, name)
    outline = seated(Outline.polygon(points), inner_diameter)
    z, r = np.array([piece.start for piece in outline.pieces]).T
    highest = np.flatnonzero(r >= r.max() - 1e-6 * outline.size)
    crown = highest[int(np.argmin(z[highest]))]
    return film_below(Shape.facing(outline, (float(z[crown]), float(r[crown])), name))


def read_mesh(path: Path, inner_diameter: float | None = None) -> tuple[Shape, SectionMesh]:
    """The section of a mesh file, and its mesh: quadrilaterals, sides FILM and PRESSURE.

    Groups of cells become regions. Raises ValueError, one line.
    """
    mesh = Mesh.read(path)
    with reading(path.name):
        return _section_of(mesh, inner_diameter, path.stem)


def _section_of(mesh: Mesh, inner_diameter: float | None, name: str) -> tuple[Shape, SectionMesh]:
    if set(mesh.cells) != {"quad4"}:
        raise OutlineError(
            f"it has cells of the kinds {', '.join(mesh.cells)}; a section is meshed by "
            "quadrilaterals of four nodes alone (Gmsh: Mesh.RecombineAll = 1)"
        )
    points, quads = mesh.points, _counterclockwise(mesh.points, mesh.cells["quad4"])
    loop = _loop(points, quads)
    names = _names(mesh, loop)
    sides = runs(names)
    if sides.mirrored:
        points, quads = points * [-1.0, 1.0], quads[:, ::-1]
        loop, names = loop[::-1], [*names[-2::-1], names[-1]]
        sides = runs(names)
    first, arc = sides.film
    loop = np.roll(loop, -first)
    drawn = Outline.polygon(points[loop])
    outline = seated(drawn, inner_diameter)
    points = points + np.subtract(outline.pieces[0].start, drawn.pieces[0].start)
    positions = outline.starts
    begin, count = (sides.pressure[0] - first) % len(loop), sides.pressure[1]
    pressure = float(positions[begin]), float(positions[(begin + count) % len(loop)])
    shape = Shape(outline, (0.0, float(positions[arc])), pressure, name)
    regions = {group: cells["quad4"] for group, cells in mesh.groups.items() if "quad4" in cells}
    section = SectionMesh(points, quads, loop, arc, positions[:-1], outline.length, regions)
    _require_sound(section)
    return film_below(shape), section


def _counterclockwise(points: Array, quads: Integers) -> Integers:
    x = points[quads]
    a, b = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0.0
    return np.where(clockwise[:, None], quads[:, ::-1], quads)


def _loop(points: Array, quads: Integers) -> Integers:
    """Nodes (B,) of the boundary, counterclockwise.  Raises OutlineError where it is no loop."""
    edges = unrepeated_faces(np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)]), 2)
    starts, times = np.unique(edges[:, 0], return_counts=True)
    if times.max() > 1:
        z, r = points[starts[times.argmax()]]
        raise OutlineError(f"the boundary meets itself at ({z:.6g}, {r:.6g}); part it")
    begin, end = in_chains(edges).T
    loop_length = np.flatnonzero(end == begin[0])[0] + 1
    if loop_length < len(edges):
        raise OutlineError(
            f"the boundary is more than one loop: {loop_length} of {len(edges)} nodes are on one; "
            "a section has no holes and is one part"
        )
    return np.asarray(begin)


def _names(mesh: Mesh, loop: Integers) -> list[str]:
    """FILM, PRESSURE or nothing, of the segment behind each node of the loop."""
    side_names = {
        frozenset(segment): name.upper()
        for name, faces in mesh.sides.items()
        if name.upper() in (FILM, PRESSURE) and "line2" in faces
        for segment in faces["line2"].tolist()
    }
    pairs = zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
    return [side_names.get(frozenset(pair), "") for pair in pairs]


def _require_sound(mesh: SectionMesh) -> None:
    quality = corner_jacobians(mesh).min(axis=1)
    worst = int(quality.argmin())
    if quality[worst] < 0.02:
        z, r = mesh.points[mesh.quads[worst]].mean(axis=0)
        raise OutlineError(
            f"an element at ({z:.6g}, {r:.6g}) is folded or nearly so, a corner of it has "
            f"{quality[worst]:.3g} of its share; mend the mesh there"
        )


def finer(mesh: SectionMesh, k: int) -> SectionMesh:
    """The mesh with every element divided k by k; its boundary stays the same polygon."""
    x = mesh.points[mesh.boundary]
    t = (np.arange(k) / k)[None, :, None]
    curve = ((1 - t) * x[:, None] + t * np.roll(x, -1, axis=0)[:, None]).reshape(-1, 2)
    points, quads, border = subdivided(mesh.points, mesh.quads, mesh.boundary, curve, k)
    ends_of_segments = np.append(mesh.positions, mesh.positions[0] + mesh.length)
    positions = (
        ends_of_segments[:-1, None] + np.diff(ends_of_segments)[:, None] * t[0, :, 0]
    ).ravel()
    regions = {
        name: (cells[:, None] * k**2 + np.arange(k**2)).ravel()
        for name, cells in mesh.regions.items()
    }
    return SectionMesh(points, quads, border, mesh.arc * k, positions, mesh.length, regions)
