"""Base of the sections of seals: named dimensions, and the shape that follows."""

from __future__ import annotations

from math import dist
from typing import Any

from softehl.cases.harness.parameters import Parameters, declared, key
from softehl.cases.seal.gland.sections.seated import seat
from softehl.cases.seal.meshing.outline import Outline, OutlineError, Piece, Point, Shape

HEIGHT = 3.53
"""Radial height of a section whose height is not given, mm."""


class Section(Parameters):
    """Dimensions of a section, mm; those that are not given are parts of its height.

    Raises pydantic.ValidationError for dimensions that bound no section.
    """

    height: float = key(HEIGHT, "radial height of the section (section_diameter)", unit="mm", gt=0)

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """The dimensions with those left out as parts of the height."""
        height = given.get("height", HEIGHT)
        return {name: part * height for name, part in parts_of(cls).items()} | given

    def shape(self, inner_diameter: float) -> Shape:
        """The section around z = 0, its lowest point at r = inner_diameter / 2.

        Raises OutlineError, a ValueError, where the dimensions do not go together.
        """
        drawn = self.drawn()
        (z, r), (aside, lift) = self.crown(drawn), seat(drawn, inner_diameter)
        name = type(self).__module__.rpartition(".")[2]
        return Shape.facing(drawn.moved(shift=(aside, lift)), (z + aside, r + lift), name)

    def at_most(self, name: str, limit: float, words: str) -> None:
        """Raises OutlineError for a dimension beyond a limit that others set, but for rounding."""
        size = getattr(self, name)
        require(
            size <= (1.0 + 1e-9) * limit, f"{name} = {size:g} mm; at most {words}, {limit:.4g} mm"
        )

    def drawn(self) -> Outline:
        """The outline as the section's own page draws it, anywhere in the plane."""
        raise NotImplementedError

    def crown(self, drawn: Outline) -> Point:
        """Place in that drawing at which the housing ends the sealed pressure: top, middle."""
        return 0.0, drawn.box[3]


def part(share: float, meaning: str, **limits: Any) -> Any:
    """Declare a dimension, mm, that is this part of the height where it is not given."""
    bounds = limits.pop("bounds", "> 0")
    field = key(
        round(share * HEIGHT, 3),
        meaning,
        unit="mm",
        bounds=f"{bounds}; left out = {share:g} x height",
        **(limits or {"gt": 0}),
    )
    declared(field)["part"] = share
    return field


def parts_of(kind: type[Section]) -> dict[str, float]:
    """Dimensions of a section that are parts of its height, and which part."""
    extras = {name: declared(field) for name, field in kind.model_fields.items()}
    return {name: extra["part"] for name, extra in extras.items() if "part" in extra}


def require(holds: bool, words: str) -> None:
    """Raises OutlineError, in words, where dimensions do not go together."""
    if not holds:
        raise OutlineError(words)


def joined(*pieces: Piece) -> Outline:
    """The outline of pieces, without those too short to matter."""
    shortest = 1e-5 * max(dist(piece.start, piece.end) for piece in pieces)
    return Outline([piece for piece in pieces if dist(piece.start, piece.end) > shortest])
