"""Sections of seals by name: dimensions, and the outline that follows.

Round (O-ring), rectangular (square ring), X-ring (quad ring), D-ring, trapezoid, U-cup. A section
is a class with its dimensions and its outline of lines and arcs, and an entry of `SECTIONS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, sqrt
from typing import Any, ClassVar

from softehl.cases.harness.parameters import Parameters, declared, key
from softehl.cases.seal.gland.sections.placement import mirrored, seat
from softehl.cases.seal.meshing.outline import (
    Arc,
    Line,
    Outline,
    OutlineError,
    Piece,
    Point,
    Shape,
    rounded,
)

HEIGHT = 3.53
"""Radial height of a section whose height is not given, mm."""


class Section(Parameters):
    """Dimensions of a section, mm; those that are not given are parts of its height.

    Raises pydantic.ValidationError for dimensions that bound no section.
    """

    name: ClassVar[str]
    """Name of the section, as a case has it."""

    height: float = key(HEIGHT, "radial height of the section (section_diameter)", unit="mm", gt=0)

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """The dimensions with those left out as parts of the height."""
        height = values.get("height", HEIGHT)
        return {name: part * height for name, part in parts_of(cls).items()} | values

    def shape(self, inner_diameter: float) -> Shape:
        """The section around z = 0, its lowest point at r = inner_diameter / 2.

        Raises OutlineError, a ValueError, where the dimensions do not go together.
        """
        drawn = self.drawn()
        (z, r), (aside, lift) = self.crown(drawn), seat(drawn, inner_diameter)
        moved = drawn.moved(shift=(aside, lift))
        return Shape.facing(moved, (z + aside, r + lift), type(self).name)

    def at_most(self, name: str, limit: float, limit_text: str) -> None:
        """Raises OutlineError for a dimension beyond a limit that others set, but for rounding."""
        size = getattr(self, name)
        require(
            size <= (1.0 + 1e-9) * limit,
            f"{name} = {size:g} mm; at most {limit_text}, {limit:.4g} mm",
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


def require(holds: bool, message: str) -> None:
    """Raises OutlineError, in words, where dimensions do not go together."""
    if not holds:
        raise OutlineError(message)


def joined(*pieces: Piece) -> Outline:
    """The outline of pieces, without those too short to matter."""
    shortest = 1e-5 * max(dist(piece.start, piece.end) for piece in pieces)
    return Outline([piece for piece in pieces if dist(piece.start, piece.end) > shortest])


class Round(Section):
    """A circle of the section's height."""

    name = "round"

    def drawn(self) -> Outline:
        """About the origin."""
        return Outline.circle((0.0, 0.0), 0.5 * self.height)


class Rectangular(Section):
    """A rectangle, its four corners rounded alike."""

    name = "rectangular"
    width: float = part(1.0, "axial width")
    corner_radius: float = part(
        0.12, "radius of the four corners", bounds="0 to half the smaller side", ge=0
    )

    def drawn(self) -> Outline:
        """About the origin."""
        z, r = 0.5 * self.width, 0.5 * self.height
        self.at_most("corner_radius", min(z, r), "half of the smaller side")
        return Outline(rounded([(-z, -r), (z, -r), (z, r), (-z, r)], self.corner_radius))


class XRing(Section):
    """Four circles in the corners of a box; a circle that touches two of them joins them."""

    name = "x_ring"
    width: float = part(1.0, "axial width")
    lobe_radius: float = part(
        0.255, "radius of the four lobes", bounds="> 0 to half the smaller side", gt=0
    )
    fillet_radius: float = part(0.17, "radius of the grooves between the lobes")

    def drawn(self) -> Outline:
        """About the origin; a circle where the lobes have grown together."""
        z, r = 0.5 * self.width - self.lobe_radius, 0.5 * self.height - self.lobe_radius
        self.at_most("lobe_radius", 0.5 * min(self.width, self.height), "half of the smaller side")
        if max(z, r) <= 1e-5 * self.height:
            return Outline.circle((0.0, 0.0), self.lobe_radius)
        reach = self.lobe_radius + self.fillet_radius
        require(
            max(z, r) < reach,
            f"fillet_radius = {self.fillet_radius:g} mm does not reach from lobe to lobe; more "
            f"than {max(z, r) - self.lobe_radius:.4g} mm is needed",
        )
        under, across = sqrt(reach**2 - z**2), sqrt(reach**2 - r**2)
        waist = 2.0 * (min(z + across, r + under) - self.fillet_radius)
        require(
            waist > 0.1 * self.height,
            f"lobe_radius = {self.lobe_radius:g} and fillet_radius = {self.fillet_radius:g} mm "
            "leave no rubber between the grooves; make one of them larger",
        )
        grooves = [(0.0, -r - under), (z + across, 0.0), (0.0, r + under), (-z - across, 0.0)]
        return joined(*self._arcs([(z, -r), (z, r), (-z, r), (-z, -r)], grooves))

    def crown(self, drawn: Outline) -> Point:
        """The crest of the upper lobe on the sealed side."""
        return self.lobe_radius - 0.5 * self.width, drawn.box[3]

    def _arcs(self, lobes: Sequence[Point], grooves: Sequence[Point]) -> list[Arc]:
        """About these centres from the groove at the bottom on, counterclockwise: lobe, groove."""
        part = self.lobe_radius / (self.lobe_radius + self.fillet_radius)

        def touch(lobe: Point, groove: Point) -> Point:
            (a, b), (c, d) = lobe, groove
            return a + part * (c - a), b + part * (d - b)

        arcs = []
        for k, lobe in enumerate(lobes):
            previous, after = grooves[k], grooves[(k + 1) % 4]
            start, end = touch(lobe, previous), touch(lobe, after)
            arcs += [Arc(start, end, lobe)]
            arcs += [Arc(end, touch(lobes[(k + 1) % 4], after), after, ccw=False)]
        return arcs


class DRing(Section):
    """A flat back and straight sides with round corners, closed by a circular nose."""

    name = "d_ring"
    width: float = part(1.0, "axial width")
    nose_radius: float = part(
        0.5, "radius of the nose on the rod", bounds="half the width to ten widths"
    )
    corner_radius: float = part(
        0.1, "radius of the corners", bounds="> 0 to a quarter of the smaller side"
    )

    def drawn(self) -> Outline:
        """The lowest point of the nose at the origin."""
        half, R, f = 0.5 * self.width, self.nose_radius, self.corner_radius
        require(
            half * (1.0 - 1e-9) <= R <= 20.0 * half,
            f"nose_radius = {R:g} mm; half the width to ten widths, {half:g} to {20 * half:g} mm",
        )
        smaller = min(self.width, self.height)
        self.at_most("corner_radius", 0.25 * smaller, "a quarter of the smaller side")
        rise = R - sqrt(max((R - f) ** 2 - (half - f) ** 2, 0.0))  # of the lower corners' centres
        top = self.height - f
        require(
            rise < top,
            f"nose_radius = {R:g} mm takes {rise:.4g} mm of the height; the back leaves "
            f"{top:.4g} mm; make the section higher or narrower",
        )
        part_of_nose = R / (R - f)
        touch = part_of_nose * (half - f), R + part_of_nose * (rise - R)
        low, high = half - f, self.height
        right: list[Piece] = [
            Arc(touch, (half, rise), (low, rise)),
            Line((half, rise), (half, top)),
            Arc((half, top), (low, high), (low, top)),
        ]
        left = [mirrored(piece).reversed() for piece in reversed(right)]
        nose, back = Arc((-touch[0], touch[1]), touch, (0.0, R)), Line((low, high), (-low, high))
        return joined(nose, *right, back, *left)


class Trapezoid(Section):
    """A symmetric trapezoid with round corners."""

    name = "trapezoid"
    width: float = part(1.0, "axial width at the housing")
    rod_width: float = part(0.6, "axial width at the rod", bounds="> 0 to twice the width")
    corner_radius: float = part(
        0.1, "radius of the four corners", bounds="0 to a third of the smallest side", ge=0
    )

    def drawn(self) -> Outline:
        """The middle of the lower side at the origin."""
        smallest = min(self.width, self.rod_width, self.height)
        self.at_most("corner_radius", smallest / 3.0, "a third of the smallest side")
        self.at_most("rod_width", 2.0 * self.width, "twice the width")
        a, b, h = 0.5 * self.rod_width, 0.5 * self.width, self.height
        return Outline(rounded([(-a, 0.0), (a, 0.0), (b, h), (-b, h)], self.corner_radius))


class UCup(Section):
    """A heel at +z, two lips towards the sealed side, alike on the rod and in the housing.

    Height is that over the lips as made, before they are squeezed into the groove.
    """

    name = "u_cup"
    width: float = part(1.3, "axial width")
    heel_height: float = part(0.84, "radial height of the heel", bounds="> 0 to the height")
    mouth_depth: float = part(
        0.62, "depth of the mouth between the lips", bounds="> 0 to the width"
    )
    mouth_opening: float = part(0.42, "radial width of the mouth at its opening")
    mouth_root: float = part(0.22, "radial width of the mouth at its root, rounded fully")
    bevel: float = part(0.17, "axial length of the bevel in front of the sealing edges")
    edge_radius: float = part(0.05, "radius of the sealing edges and of the tips of the lips")
    corner_radius: float = part(0.08, "radius of the corners of the heel")

    def drawn(self) -> Outline:
        """The front of the lips at z = 0, the middle between the lips at r = 0."""
        h, heel, w = 0.5 * self.height, 0.5 * self.heel_height, self.width
        opening, root, depth = 0.5 * self.mouth_opening, 0.5 * self.mouth_root, self.mouth_depth
        lip, back = self._tip - opening, w - depth
        minimum = 2.0 * self.edge_radius
        self.at_most("heel_height", self.height, "the height over the lips")
        self.at_most("mouth_root", self.mouth_opening, "the mouth_opening")
        require(
            lip > minimum,
            f"the tips of the lips are {lip:.4g} mm thick; (height - mouth_opening) / 2 - bevel "
            f"must be more than twice the edge_radius, {minimum:g} mm",
        )
        require(
            back > 0.1 * w and heel - root > minimum,
            f"mouth_depth = {depth:g} and mouth_root = {2 * root:g} mm leave no heel of a width "
            f"of {w:g} and a heel_height of {2 * heel:g} mm",
        )
        missing = 0.0  # a rounded edge lies within the corner that it was cut from
        for _ in range(12):  # the height settles
            outline = self._with_edges_at(h + missing)
            missing += h - outline.box[3]
        return outline

    def _with_edges_at(self, h: float) -> Outline:
        """The outline whose sealing edges, not yet rounded, are that far from the middle."""
        heel, w, depth, tip = 0.5 * self.heel_height, self.width, self.mouth_depth, self._tip
        opening, root = 0.5 * self.mouth_opening, 0.5 * self.mouth_root
        lower = [(self.bevel, -h), (w, -heel), (w, heel), (self.bevel, h)]
        mouth = [(0.0, tip), (0.0, opening), (depth, root), (depth, -root), (0.0, -opening)]
        e, c, inner = self.edge_radius, self.corner_radius, 0.98 * root
        radii = [e, c, c, e, e, e, inner, inner, e, e]
        return Outline(rounded([*lower, *mouth, (0.0, -tip)], radii))

    @property
    def _tip(self) -> float:
        """Distance of the front of the lips' bevels from the middle."""
        return 0.5 * self.height - self.bevel

    def crown(self, drawn: Outline) -> Point:
        """The highest point of the lip in the housing, on its rounded sealing edge."""
        top = max(drawn.pieces, key=lambda piece: piece.box[3])
        z = top.centre[0] if isinstance(top, Arc) else self.bevel
        return z, top.box[3]


SECTIONS: dict[str, type[Section]] = {
    section.name: section for section in (Round, Rectangular, XRing, DRing, Trapezoid, UCup)
}
"""Every section by its name."""
