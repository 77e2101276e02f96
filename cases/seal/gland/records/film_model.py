"""The model of a film: surfaces, cavitation, shear of the seal, and its arc."""

from typing import Literal

from softehl.cases.harness.parameters import key
from softehl.cases.seal.gland.records.free_seal import FreeSeal
from softehl.cases.seal.gland.surfaces import Surfaces


class FilmModel(FreeSeal, Surfaces):
    """The model of a film between these surfaces; the number of its contacts is by the section."""

    cavitation: Literal["penalty", "mass-conserving"] | None = key(
        None,
        "model of cavitation",
        bounds='"penalty" or "mass-conserving", left out = mass-conserving with roughness, '
        "with a cavitation_pressure, with an outline and where a section has two lobes",
    )
    cavitation_pressure: float = key(
        0.0, "mass-conserving: pressure of the ruptured film", unit="MPa", ge=-0.1, le=0
    )
    cavitation_penalty: float = key(
        1.0e4, "penalty of pressures below zero, flux for a pressure", unit="mm/(MPa s)", gt=0
    )
    shear_traction: bool = key(True, "whether the shear stress of the film acts on the seal")
    arc_start: float | None = key(
        None,
        "sealed end of the lubricated arc, from the bottom",
        unit="degrees",
        bounds="-120 to < 0, left out = found from the contact",
        ge=-120.0,
        lt=0.0,
    )
    arc_end: float | None = key(
        None,
        "air end of the lubricated arc, from the bottom",
        unit="degrees",
        bounds="> 0 to 120, left out = found from the contact",
        gt=0.0,
        le=120.0,
    )

    @property
    def given_arc(self) -> tuple[float, float] | None:
        """Ends of the lubricated arc where they are given; else the contact decides."""
        start, end = self.arc_start, self.arc_end
        return None if start is None or end is None else (start, end)

    @property
    def conserving(self) -> bool:
        """True if the film conserves mass where it ruptures."""
        if self.cavitation is None:
            drawn = (
                self.outline is not None
            )  # its pressure may fall to zero anywhere in the contact
            return self.rough or drawn or self.lobes > 1 or self.cavitation_pressure < 0.0
        return self.cavitation == "mass-conserving"
