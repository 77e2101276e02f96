"""The parameters of the slider: profiles of a gap, and what is asked of its film."""

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from softehl.cases.harness.parameters import Nonzeros, key
from softehl.cases.seal.gland.shear_thinning import ThinningKeys
from softehl.cases.seal.gland.surfaces import ROUGHNESS, Roughness
from softehl.runtime.arrays import Array


class Slider(ThinningKeys):
    """Everything that defines one run of the slider."""

    headings: ClassVar = {
        "gap": (
            *("profile", "h0", "radius", "amplitude", "ratio", "pocket_start", "pocket_end"),
            *("start", "end"),
        ),
        "oil": ("viscosity", "pressure_viscosity", *ThinningKeys.model_fields),
        "motion": ("speeds", "start_pressure", "end_pressure"),
        "film": (
            *("roughness", "asperity_stiffness", "boundary_friction"),
            *("cavitation", "cavitation_pressure", "cavitation_penalty", "supply"),
        ),
        "mesh": ("segments",),
        "numerics": ("pressure_order", "reynolds"),
    }

    profile: Literal["wedge", "parabola", "cosine", "exponential", "pocket"] = key(
        "parabola", "gap h(x)"
    )
    h0: float = key(
        0.001, "gap at the end; parabola: least, cosine: mean, pocket: lands", unit="mm", gt=0
    )
    radius: float = key(10.0, "parabola: radius R", unit="mm", gt=0)
    amplitude: float = key(0.5, "cosine: amplitude over h0", gt=-1, lt=1)
    ratio: float = key(
        2.2,
        "wedge, exponential: gap at the start over that at the end; pocket: over the lands",
        gt=0,
    )
    pocket_start: float | None = key(
        None, "where the pocket starts", unit="mm", bounds="left out = after a third of the film"
    )
    pocket_end: float | None = key(
        None, "where the pocket ends", unit="mm", bounds="left out = after two thirds of the film"
    )
    start: float = key(-1.5, "where the film starts", unit="mm", bounds="less than end")
    end: float = key(0.75, "where the film ends", unit="mm", bounds="more than start")
    start_pressure: float = key(0.0, "pressure at the start", unit="MPa", ge=0)
    end_pressure: float = key(0.0, "pressure at the end", unit="MPa", ge=0)
    supply: float | None = key(
        None,
        "mass-conserving: film thickness that the plane brings in, as h*",
        unit="mm",
        bounds="> 0, left out = flooded",
        gt=0,
    )
    segments: int = key(400, "segments of the film, equally long", ge=4, le=100_000)
    speeds: Nonzeros = key((400.0, 200.0, 100.0), "speeds U, + towards the end", unit="mm/s")
    viscosity: float = key(6.59e-8, "viscosity at zero pressure", unit="MPa s", gt=0)
    pressure_viscosity: float = key(0.0, "coefficient alpha of Barus' law", unit="1/MPa", ge=0)
    pressure_order: int = key(4, "order of the pressure on a segment", ge=1, le=16)
    reynolds: Literal["fe", "dg"] = key("fe", "continuous or discontinuous pressure")
    cavitation: Literal["penalty", "mass-conserving"] | None = key(
        None,
        "model of cavitation",
        bounds='"penalty" or "mass-conserving", left out = by the other keys: the first that can',
    )
    cavitation_pressure: float = key(
        0.0, "mass-conserving: pressure of the ruptured film", unit="MPa", ge=-0.1, le=0
    )
    cavitation_penalty: float = key(1e5, "penalty of p < 0", unit="mm/(MPa s)", gt=0)
    roughness: Roughness = key(
        (0.0, 0.0), "rms heights of plane and profile", unit="um", bounds=ROUGHNESS
    )
    asperity_stiffness: float = key(
        0.0, "pressure K of touching asperities, K F_3/2(h/sigma)", unit="MPa", ge=0
    )
    boundary_friction: float = key(0.1, "friction coefficient of touching asperities", ge=0, le=2)

    @model_validator(mode="after")
    def _is_a_film(self) -> Self:
        if not self.start < self.end:
            raise ValueError(f"start = {self.start:g} must be less than end = {self.end:g}")
        first, last = self.pocket
        if self.profile == "pocket" and not self.start < first < last < self.end:
            raise ValueError(
                f"the pocket, {first:g} to {last:g} mm, must lie between {self.start:g} and "
                f"{self.end:g} mm, the ends of the film: give pocket_start and pocket_end"
            )
        self.require_model(
            conserving=self.conserving, dg=self.reynolds == "dg", asks=self._beyond_penalty
        )
        return self

    @property
    def conserving(self) -> bool:
        """True if the film conserves mass where it ruptures."""
        if self.cavitation is None:
            return any(self._beyond_penalty.values())
        return self.cavitation == "mass-conserving"

    @property
    def _beyond_penalty(self) -> dict[str, bool]:
        return {
            "roughness": any(self.roughness),
            "supply": self.supply is not None,
            "cavitation_pressure": self.cavitation_pressure < 0.0,
            "a pocket": self.profile == "pocket",
        }

    @property
    def pocket(self) -> tuple[float, float]:
        """Start and end of the pocket."""
        third = (self.end - self.start) / 3.0
        first, last = self.pocket_start, self.pocket_end
        return (
            self.start + third if first is None else first,
            self.end - third if last is None else last,
        )

    @property
    def nodes(self) -> Array:
        """Ends of the segments (n,), equally long, or nearly so where a pocket has its steps."""
        if self.profile != "pocket":
            return np.linspace(self.start, self.end, self.segments + 1)
        steps = np.array([self.start, *self.pocket, self.end])
        share = np.round(self.segments * (steps - steps[0]) / (steps[-1] - steps[0]))
        counts = np.maximum(np.diff(share), 1.0).astype(int)
        parts = [np.linspace(steps[k], steps[k + 1], n + 1)[:-1] for k, n in enumerate(counts)]
        return np.append(np.concatenate(parts), self.end)

    @property
    def segment_ends(self) -> tuple[Array, Array]:
        """Places and gaps (n, 2) at the ends of the segments; a gap may jump between them."""
        nodes = self.nodes
        x = np.stack([nodes[:-1], nodes[1:]], axis=1)
        if self.profile != "pocket":
            return x, self.gap(x)
        return x, np.repeat(self.gap(x.mean(axis=1))[:, None], 2, axis=1)

    def gap(self, x: Array) -> Array:
        """Film thickness h (n,) at x (n,), mm."""
        before_end = (self.end - x) / (self.end - self.start)
        relative = {
            "wedge": 1.0 + (self.ratio - 1.0) * before_end,
            "parabola": 1.0 + x**2 / (2.0 * self.radius * self.h0),
            "cosine": 1.0 + self.amplitude * np.cos(2.0 * np.pi * before_end),
            "exponential": self.ratio**before_end,
            "pocket": np.where((x > self.pocket[0]) & (x < self.pocket[1]), self.ratio, 1.0),
        }
        return np.asarray(self.h0 * relative[self.profile])
