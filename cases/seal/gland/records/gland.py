"""The gland: what a seal slides on, its groove, and how it sits in there."""

from math import pi

from pydantic import field_validator

from softehl.cases.harness.parameters import key
from softehl.cases.seal.gland.grooves import Kind, squeeze
from softehl.cases.seal.gland.records.free_seal import SIGNED, FreeSeal

OF_PISTON = {"rod_diameter": "bore", "housing_diameter": "groove_diameter"}
"""Key that is less than 0 in a piston seal -> the key that it is given by."""


class Gland(FreeSeal):
    """A seal in its gland; lengths in mm."""

    rod: float | None = key(
        None, "the same as rod_diameter", unit="mm", bounds='> 0, or "36 f7"', gt=0
    )
    bore: float | None = key(
        None,
        "bore that a piston seal slides on: the groove is in the piston, inside the ring",
        unit="mm",
        bounds='> 0, or "40 H8"; left out = a rod seal',
        gt=0,
    )
    rod_diameter: float = key(50.0, "rod diameter D_rod", unit="mm", bounds=SIGNED)
    gland: Kind | None = key(
        None,
        "a standard gland, for housing_diameter and groove_width where they are not given",
        bounds='"dynamic" or "hydraulic" (the same), "pneumatic", left out = none, or "dynamic" '
        "with a ring (docs/glands.md)",
    )
    groove_depth: float | None = key(
        None,
        "radial depth of the groove, from rod or bore to its bottom, for housing_diameter",
        unit="mm",
        bounds="> 0, left out = by housing_diameter",
        gt=0,
    )
    squeeze: float | None = key(
        None,
        "reduction of section_diameter by the gland, for housing_diameter",
        unit="%",
        bounds="> 0 to 50, left out = by housing_diameter",
        gt=0,
        le=50,
    )
    groove_diameter: float | None = key(
        None,
        "diameter of the bottom of the groove, for housing_diameter",
        unit="mm",
        bounds='> 0, or "43 H9" of a rod seal, "33 h9" of a piston seal',
        gt=0,
    )
    housing_diameter: float = key(
        56.30, "inner diameter of the housing D_housing", unit="mm", bounds=SIGNED
    )
    fill: float | None = key(
        None,
        "part of the gland that the free seal fills, for groove_width",
        unit="%",
        bounds="30 to 100, left out = by groove_width",
        ge=30,
        le=100,
    )
    groove_width: float = key(3.74, "axial width of the groove", unit="mm", gt=0)
    groove_centre: float = key(
        0.0,
        "axial position of the middle of the groove, section centre = 0",
        unit="mm",
        bounds="such that the section is between the walls",
    )
    backup: bool | None = key(
        None,
        "whether a back-up ring closes the gap between rod and housing on the air side",
        bounds="true, false (then extrusion_gap too), left out = true without extrusion_gap",
    )
    extrusion_gap: float = key(
        0.0,
        "radial gap between rod and housing on the air side",
        unit="mm",
        bounds="0 = closed, to 0.5",
        ge=0,
        le=0.5,
    )
    corner_fillet: float = key(
        0.1,
        "fillet of the edge of the housing at the extrusion gap",
        unit="mm",
        bounds="0.02 to 2, used where there is an extrusion_gap",
        ge=0.02,
        le=2,
    )
    housing_friction: float = key(
        0.0,
        "coefficient of Coulomb friction at the housing and the walls of the groove",
        bounds="0 to 1; 0 = frictionless, the section is held",
        ge=0,
        le=1,
    )

    @property
    def piston(self) -> bool:
        """True if the seal sits in a piston and slides on a bore.

        Its diameters are counted negative then. With r = -radius a piston seal is a rod seal: what
        slides is below it, what holds it above.
        """
        return self.rod_diameter < 0.0

    def called(self, key: str) -> str:
        """The key that a user of this seal knows: of a piston seal its bore and its groove."""
        return OF_PISTON.get(key, key) if self.piston else key

    @property
    def ring_diameter(self) -> float:
        """Inside diameter of the free seal, mm."""
        outside = self.inner_diameter + 2.0 * self.section_diameter
        return -outside if self.piston else self.inner_diameter

    @property
    def depth(self) -> float:
        """Radial depth of the gland, from rod or bore to its ground, mm."""
        return 0.5 * (self.housing_diameter - self.rod_diameter)

    @property
    def squeeze_percent(self) -> float:
        """Part of the free section that the gland takes away, %."""
        return squeeze(self.section_diameter, self.depth)

    @property
    def stretch_percent(self) -> float:
        """Circumferential stretch of the free ring on its rod, or on the ground of the groove of
        its piston, %; 0 if it is loose.
        """
        on = -self.housing_diameter if self.piston else self.rod_diameter
        return 100.0 * max(on / self.ring_diameter - 1.0, 0.0)

    @property
    def fill_percent(self) -> float:
        """Volume of the free ring over that of the gland, %."""
        around = 0.25 * pi * (self.housing_diameter**2 - self.rod_diameter**2)
        return 100.0 * self.volume / (around * self.groove_width)

    @property
    def sealed_wall(self) -> float:
        """Axial place of the groove's wall on the sealed side, mm."""
        return self.groove_centre - 0.5 * self.groove_width

    @property
    def air_wall(self) -> float:
        """Axial place of the groove's wall on the air side, mm."""
        return self.groove_centre + 0.5 * self.groove_width

    @property
    def rubs(self) -> bool:
        """True if housing and walls have friction, which then holds the section by itself."""
        return self.housing_friction > 0.0

    @property
    def opens(self) -> bool:
        """True if there is a gap between rod and housing on the air side."""
        return self.extrusion_gap > 0.0

    @field_validator("inner_diameter", "rod_diameter", "housing_diameter")
    @classmethod
    def _diameter_is_not_zero(cls, diameter: float) -> float:
        if diameter == 0.0:
            raise ValueError("a diameter is not 0")
        return diameter
