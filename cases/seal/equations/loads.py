"""Loads of a seal: of the contact problem and of the film problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from softehl.cases.seal.gland.surfaces import SLIP
from softehl.runtime.arrays import Array

Stroke = Literal["out", "in"]


@dataclass(frozen=True)
class ContactLoads:
    """Loads of frictionless contact.

    sealed_pressure: p_s, MPa. offsets: obstacle -> distance (mm) that it keeps from the section,
    0 where none is given. position: mean axial displacement at which the section is held, mm, None
    where it is free; then axial_force pushes it to the air side, N. moment: that turns it where
    its mean rotation is not held, N mm, None where it is.
    """

    sealed_pressure: float = 0.0
    offsets: Mapping[str, float] = field(default_factory=dict)
    position: float | None = None
    axial_force: float = 0.0
    moment: float | None = None


@dataclass(frozen=True, eq=False)
class FilmLoads:
    """Loads of a film.

    sealed_pressure: p_s, MPa. speed: |U|, mm/s. gap: (arc nodes,) distance of the rod in the
    contact state, mm. shear: weight of the shear stress. moment: moment on the section (N mm) if it
    is free to roll, None if its rotation is held. position: as of the contact state. rate:
    coefficient of time derivatives, 1/s, 0 where nothing changes. inflow: void fractions at the
    sealed and the air end, where oil comes in. entrance: pressure that oil has built up before the
    arc, MPa. slip: speed at which the friction of asperities has 0.7 of its value, mm/s.
    viscosity_ratio: viscosity in a warm inlet over that of the cold oil.
    """

    sealed_pressure: float
    stroke: Stroke
    speed: float
    gap: Array
    shear: float = 1.0
    moment: float | None = None
    position: float | None = None
    rate: float = 0.0
    inflow: tuple[float, float] = (0.0, 0.0)
    entrance: float = 0.0
    slip: float = SLIP
    viscosity_ratio: float = 1.0

    @property
    def end_pressures(self) -> Array:
        """Pressures (2,) at the sealed and the air end of the film, MPa, (15)."""
        out, wedge_pressure = self.stroke == "out", self.entrance
        return np.array(
            [self.sealed_pressure + wedge_pressure, 0.0]
            if out
            else [self.sealed_pressure, wedge_pressure]
        )

    def along(self, values: Array) -> Array:
        """Values (n,) at places from the sealed side on, in the order in which oil passes them."""
        return values if self.stroke == "out" else values[::-1]

    @property
    def rod_speed(self) -> float:
        """U, positive for outstroke, mm/s."""
        return self.speed if self.stroke == "out" else -self.speed
