"""Outlines from DXF drawings: lines, arcs, circles and polylines with bulges, converted exactly."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, dist, radians, sin
from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.seal.gland.sections.seated import Named, mirrored, named_shape
from softehl.cases.seal.meshing.outline import Arc, Line, OutlineError, Piece, Point, Shape
from softehl.cases.seal.meshing.outline_checks import CLOSED

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
    found: list[Named] = []
    for entity in document.modelspace():
        layer = str(entity.dxf.layer)
        found += [(p.moved(_UNITS[unit], (0.0, 0.0)), layer) for p in _converted(entity)]
    if not found:
        raise OutlineError("there is no contour of lines and arcs")
    return found


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
        ends = [(d.start_angle, d.end_angle)] if kind == "ARC" else [(0.0, 180.0), (180.0, 360.0)]
        arcs = [_arc(entity, *angles) for angles in ends]
        behind = d.hasattr("extrusion") and d.extrusion.z < 0.0
        yield from (map(mirrored, arcs) if behind else arcs)
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
