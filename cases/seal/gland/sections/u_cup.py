"""The U-cup: two lips that the sealed pressure spreads, and a heel on the air side."""

from __future__ import annotations

from softehl.cases.seal.gland.sections.base import Section, part, require
from softehl.cases.seal.meshing.outline import Arc, Outline, Point, rounded


class UCup(Section):
    """A heel at +z, two lips towards the sealed side, alike on the rod and in the housing.

    Height is that over the lips as made, before they are squeezed into the groove.
    """

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
        least = 2.0 * self.edge_radius
        self.at_most("heel_height", self.height, "the height over the lips")
        self.at_most("mouth_root", self.mouth_opening, "the mouth_opening")
        require(
            lip > least,
            f"the tips of the lips are {lip:.4g} mm thick; (height - mouth_opening) / 2 - bevel "
            f"must be more than twice the edge_radius, {least:g} mm",
        )
        require(
            back > 0.1 * w and heel - root > least,
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
