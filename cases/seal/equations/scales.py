"""Reference sizes of the residuals: a residual of this size is as large as the loads are."""

from __future__ import annotations

from math import pi

import numpy as np

from softehl.cases.seal.gland.records import Duty, Gland
from softehl.runtime.arrays import Array

GAP, ROTATION, VOID = 0.01, 1e-3, 1.0
"""10 micrometres; 1 milliradian; a void fraction as of `surfaces`."""

DIFFERENCE = 1e-4
"""Difference of pressure along a segment, MPa: 1e-9 of it, to which Newton's method solves, is a
hundred times the last digit of 5 MPa."""


def force(p: Gland) -> float:
    """1 MPa on 1 mm of the rod, N."""
    return pi * abs(p.rod_diameter)


def gap(p: Gland) -> float:
    """A gap times an area of the rod, mm^3."""
    return pi * abs(p.rod_diameter) * GAP


def film_flux(speed: float) -> float:
    """Flux (mm^2/s) of a film at |U| (mm/s): mean velocity times 10 micrometres."""
    return 0.5 * speed * GAP


def largest_flux(p: Duty) -> float:
    """Flux of the highest speed of a case."""
    return film_flux(max(p.speeds))


def pressure_flux(thickness: Array, dx: Array, order: int, viscosity: float) -> Array:
    """Flux (n,), mm^2/s, that a small difference of pressure drives through segments.

    In a thick film h^3 / (12 eta dx) turns the rounding of a pressure into a flux, which is to
    count as small. thickness, dx: (n,), mm.
    """
    conductance = order**2 * np.maximum(thickness, 0.0) ** 3 / (12.0 * viscosity * dx)
    return np.asarray(DIFFERENCE * conductance)
