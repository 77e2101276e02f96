"""Surfaces of a film: roughness, asperities, cavitation, for every case.

Roughnesses are rms heights in micrometres where a user gives them, in mm in kernels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field

from softehl.cases.harness.parameters import Parameters, key
from softehl.cases.seal.gland.key_values import number
from softehl.cases.seal.gland.trade.finish_names import read_finish

MICROMETRE = 1e-3  # mm

PRESSURE_SCALE, VOID_SCALE = 1.0, 1e-3
"""Pressure (MPa) and void fraction that count the same in the condition of cavitation."""

MIXED, FULL = 1.0, 3.0
"""Lambda ratios (least h_T over sigma) below which a film is one of boundary, of mixed friction."""


def _pair(value: object) -> object:
    """A single number is that of the surface that rests, over a smooth one that moves."""
    if isinstance(value, (list, tuple)):
        return [_height(item) for item in value]
    height = _height(value)
    return (0.0, height) if number(height) else height


def _height(item: object) -> object:
    """An rms height, also of a finish, "Ra 0.2"."""
    height = read_finish(item) if isinstance(item, str) else None
    return item if height is None else height


def _some(rms: float) -> float:
    """Less than a nanometre is a slip of the unit; no film was found above such asperities."""
    if 0.0 < rms < 0.001:
        raise ValueError("a roughness is 0 or at least 0.001 um")
    return rms


Rms = Annotated[float, Field(ge=0, le=20), AfterValidator(_some)]
Roughness = Annotated[tuple[Rms, Rms], Field(strict=False), BeforeValidator(_pair)]
"""Rms heights of the moving surface and of the one that rests, um."""

SLIP = 1e-3
"""Speed at which the friction of asperities has 0.7 of its value where nothing moves, mm/s."""

ROUGHNESS = (
    '[moving, resting] or one number for the resting one alone; each 0 or 0.001 to 20, or "Ra 0.2"'
)


class Surfaces(Parameters):
    """Rod and seal as they are made."""

    roughness: Roughness = key(
        (0.0, 0.0), "rms heights of rod and seal, 0 = smooth", unit="um", bounds=ROUGHNESS
    )
    asperity_stiffness: float | None = key(
        None,
        "pressure K of touching asperities, K F_3/2(h/sigma)",
        unit="MPa",
        bounds="> 0, left out = 4 (mu_1 + mu_2)",
        gt=0,
    )
    boundary_friction: float = key(0.1, "friction coefficient of touching asperities", ge=0, le=2)

    @property
    def rough(self) -> bool:
        """True if the film knows roughness."""
        return any(self.roughness)


@dataclass(frozen=True)
class SurfacePair:
    """Two rough surfaces.

    moving, resting: rms heights, mm. stiffness: K of the asperities, MPa. friction: their
    coefficient.
    """

    moving: float = 0.0
    resting: float = 0.0
    stiffness: float = 0.0
    friction: float = 0.0

    @classmethod
    def of(cls, roughness: tuple[float, float], stiffness: float, friction: float) -> SurfacePair:
        """From rms heights in um."""
        moving, resting = (MICROMETRE * rms for rms in roughness)
        return cls(moving, resting, stiffness, friction)

    @property
    def sigma(self) -> float:
        """Rms height of both together, mm."""
        return hypot(self.moving, self.resting)

    def values(self) -> Mapping[str, float]:
        """Parameters of the kernels of rough films."""
        if not self.sigma:
            return {}
        return {
            "roughness": self.sigma,
            "roughness_difference": (self.moving**2 - self.resting**2) / self.sigma**2,
            "asperity_stiffness": self.stiffness,
            "boundary_friction": self.friction,
            "boundary_speed": SLIP,
        }


def void_values(cavitation_pressure: float) -> Mapping[str, float]:
    """Parameters of the condition of cavitation."""
    return {
        "cavitation_pressure": cavitation_pressure,
        "pressure_scale": PRESSURE_SCALE,
        "void_scale": VOID_SCALE,
    }


def regime(ratio: float) -> str:
    """ "boundary", "mixed" or "full", of a lambda ratio."""
    return "boundary" if ratio < MIXED else "mixed" if ratio < FULL else "full"
