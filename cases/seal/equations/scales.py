"""Reference sizes of the residuals: a residual of this size is as large as the loads are."""

from __future__ import annotations

from math import pi

import numpy as np

from softehl.cases.seal.gland.records.duty import Duty
from softehl.cases.seal.gland.records.gland import Gland
from softehl.runtime.arrays import Array

# 1 MPa on 1 mm of rod, a gap of 10 micrometres, 1 milliradian.
_PRESSURE, _GAP, _ROTATION = 1.0, 0.01, 1e-3
_DIFFERENCE = 1e-4  # MPa between the ends of a segment


def force(p: Gland) -> float:
    """A pressure on the rod, N."""
    return pi * abs(p.rod_diameter) * _PRESSURE


def gap(p: Gland) -> float:
    """A gap times an area of the rod, mm^3."""
    return pi * abs(p.rod_diameter) * _GAP


def rotation(_: object) -> float:
    """A mean rotation."""
    return _ROTATION


def place(_: object) -> float:
    """A mean axial displacement, mm."""
    return _GAP


def void(_: object) -> float:
    """The condition of cavitation: a pressure and a void fraction of `surfaces`."""
    return 1.0


def film_flux(speed: float) -> float:
    """Flux (mm^2/s) of a film at |U| (mm/s): mean velocity times 10 micrometres."""
    return 0.5 * speed * _GAP


def largest_flux(p: Duty) -> float:
    """Flux of the highest speed of a case."""
    return film_flux(max(p.speeds))


def pressure_flux(thickness: Array, dx: Array, order: int, viscosity: float) -> Array:
    """Flux (n,), mm^2/s, that a small difference of pressure drives through segments.

    In a thick film h^3 / (12 eta dx) turns the rounding of a pressure into a flux, which is to
    count as small. thickness, dx: (n,), mm.
    """
    conductance = order**2 * np.maximum(thickness, 0.0) ** 3 / (12.0 * viscosity * dx)
    return np.asarray(_DIFFERENCE * conductance)
