"""Keys of a case that choose the section of its seal, and the shape that they give.

`section` names a class of `shapes`; its dimensions are keys by their own names, but for the height,
which is `section_diameter`, and the width, `section_width`. They are read from the classes, so that
another section is its class and an entry of the registry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from os.path import isfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import create_model

from softehl.cases.harness.parameters import Parameters, declared, key
from softehl.cases.seal.gland.key_values import one_line
from softehl.cases.seal.gland.sections.section_files import read_mesh, read_outline
from softehl.cases.seal.gland.sections.shapes import SECTIONS
from softehl.cases.seal.meshing.outline import Shape
from softehl.cases.seal.meshing.section_mesh import SectionMesh

Name = Literal["round", "rectangular", "x_ring", "d_ring", "trapezoid", "u_cup"]

ROUND: Name = "round"
"""The section that needs no outline: its mesh is the O-grid of the paper."""

NAMES = {
    ROUND: "O-ring",
    "rectangular": "square ring",
    "x_ring": "X-ring",
    "d_ring": "D-ring",
    "trapezoid": "trapezoidal ring",
    "u_cup": "U-cup",
}
"""Names of seals of these sections."""


def dimensions(section: str) -> dict[str, str]:
    """Keys of the dimensions of a section, and what its page calls them."""
    names = [name for name in SECTIONS[section].model_fields if name != "height"]
    return {"section_width" if name == "width" else name: name for name in names}


def _dimensions() -> dict[str, Any]:
    """Every dimension of every section as a key, once, with what it means in each."""
    uses: dict[str, dict[str, dict[str, Any]]] = {}
    for section, page in SECTIONS.items():
        for name, field_name in dimensions(section).items():
            uses.setdefault(name, {})[section] = declared(page.model_fields[field_name])
    return {name: (float | None, _key(of)) for name, of in uses.items()}


def _key(uses: Mapping[str, Mapping[str, Any]]) -> Any:
    """A key of the sections that have this dimension."""
    first, *_ = uses.values()
    parts = " or ".join(dict.fromkeys(f"{extra['part']:g}" for extra in uses.values()))
    bounds = f"left out = {parts} of section_diameter"
    return key(
        None, f"{', '.join(uses)}: {first['meaning']}", unit="mm", bounds=bounds, ge=0, le=500
    )


MEASURES = tuple(_dimensions())
"""Keys of the dimensions of sections."""

if TYPE_CHECKING:
    _Dimensions = Parameters
else:
    _Dimensions = create_model("_Dimensions", __base__=Parameters, **_dimensions())


class SectionKeys(_Dimensions):
    """Which section a seal has, and the dimensions of it."""

    section: Name = key(ROUND, "section of the seal (docs/sections.md)")
    outline: str | None = key(
        None,
        "instead of `section`: one that is drawn, given by points, or bounds a mesh",
        bounds="a .dxf, .csv or mesh file (.msh, .vtu, ...), see docs/sections.md",
        file=True,
    )
    cap_thickness: float | None = key(
        None,
        "thickness of a cap of its own material (materials.cap, PTFE) on the side of the rod",
        unit="mm",
        bounds="left out = none; it holds the whole film",
        gt=0,
    )

    @property
    def round(self) -> bool:
        """True if the section is a disc, which the O-grid of the paper is laid into."""
        return self.section == ROUND and self.outline is None

    @property
    def named(self) -> str:
        """Name of the seal."""
        return NAMES[self.section] if self.outline is None else f"ring of {Path(self.outline).name}"


def section_of_file(
    path: Path, inner_diameter: float | None = None
) -> tuple[Shape, SectionMesh | None]:
    """The shape of a file, and its mesh if it has one; without inner_diameter where it was drawn.

    Raises ValueError, one line.
    """
    if not isfile(path):
        raise ValueError(f'outline = "{path}": there is no such file')
    return _section_of_file(path, path.stat().st_mtime_ns, inner_diameter)


@lru_cache(maxsize=32)
def _section_of_file(
    path: Path, _changed: int, inner_diameter: float | None
) -> tuple[Shape, SectionMesh | None]:
    if is_mesh(str(path)):
        return read_mesh(path, inner_diameter)
    return read_outline(path, inner_diameter), None


def is_mesh(outline: str | None) -> bool:
    """True if an outline is that of a mesh file."""
    return outline is not None and Path(outline).suffix.lower() not in (".dxf", ".csv")


@lru_cache(maxsize=32)
def shape_of(section: str, sizes: tuple[tuple[str, float], ...], inner_diameter: float) -> Shape:
    """The shape of a section of these dimensions.  ValueError where they bound none."""
    with one_line(f'section = "{section}": '):
        return SECTIONS[section](**dict(sizes)).shape(inner_diameter)


@lru_cache(maxsize=32)
def capped(shape: Shape, thickness: float) -> Shape:
    """The shape with a cut at this height above its lowest point.  ValueError where none can be."""
    outline, text = shape.outline, f"cap_thickness = {thickness:g} mm"
    _, low, _, high = outline.box
    if thickness >= high - low:
        raise ValueError(f"{text}: it must be less than the height, {high - low:g} mm")
    at = outline.level(low + thickness)
    if len(at) != 2:
        raise ValueError(
            f"{text}: the section is in {len(at) // 2} parts there; a cap is cut off straight"
        )
    begin, end = float(at[0]), float(at[1])
    inside = (np.array(shape.film) - begin) % outline.length
    if not inside[0] < inside[1] < (end - begin) % outline.length:
        minimum = float(outline.at(np.array(shape.film))[:, 1].max()) - low
        raise ValueError(f"{text}: it must hold the film, which needs more than {minimum:.4g} mm")
    if np.abs(np.sin(outline.heading(at))).min() < 0.5:  # 30 degrees between sides and edge
        raise ValueError(f"{text}: the sides are too flat there; make it thicker or thinner")
    return replace(shape, chord=(begin, end))


@lru_cache(maxsize=32)
def lobes(shape: Shape) -> int:
    """Number of parts of its film that a section rests on: minima of r with a groove between.

    The film is looked at every 3 um or so; a groove has a hundredth of its height.
    """
    r = shape.outline.at(np.linspace(*shape.film, 2000))[:, 1]
    count, deep, bottom, top = 1, 0.01 * float(np.ptp(r)), r[0], r[0]
    for value in r:
        if min(top - bottom, top - value) > deep:  # behind a groove
            count, bottom, top = count + 1, value, value
        elif value < bottom:
            bottom, top = value, value
        else:
            top = max(top, value)
    return count
