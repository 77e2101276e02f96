"""An estimate of the errors of h*, friction and leakage, from the same curve on another mesh.

Two meshes whose sizes have the ratio r < 1 differ in h*, which converges with order p, by
1 / r^p - 1 times the error of the finer one. From density 4 on the coarser mesh has half the
density; below that this would be too coarse to be wrong in the same way, and it has five sixths.

Leakage is h* times what is exactly known, and has its relative error. Friction is a part of the
sliding and one of the slope of the pressure. Their sum may be right on two meshes by chance where
they cancel, so that their errors are added up.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, fsum

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.verdict import (
    FINER,
    INLET_SEGMENTS_OF_LOW_ORDERS,
    LARGEST_ERROR,
    FilmNumbers,
    fewest_inlet_segments,
    shows_inlet,
)

ORDER = 2.5
"""Order of convergence of h*: 2 in theory, 2.1 to 3.2 were measured between densities 2 and 4."""

LEAST_DENSITY = 2
"""Density from which two meshes show an error. At 1 h* of a square ring was 13.9 % off with an
estimate of -0.6 %, that of an O-ring 2.6 % with one of +1.2 %: no factor makes a bound of these."""


def coarser_density(density: int | Fraction) -> Fraction:
    """Density of the coarser mesh; meshes exist for multiples of one third."""
    return Fraction((3 if density >= 4 else 5) * density // 2, 3)


def finer_density(density: Fraction) -> Fraction:
    """Density of the mesh on which a film is solved again whose error is too large."""
    return Fraction(ceil(1.5 * density))


@dataclass(frozen=True)
class Estimate:
    """Errors of a film, %, from its numbers on two meshes.

    other: on the coarser one. ratio: of their densities, below 1.
    """

    film: FilmNumbers
    other: FilmNumbers
    ratio: float

    @property
    def h_star(self) -> float:
        """Estimated error of h*, + where it is too large."""
        return self._factor * (self.other.h_star / self.film.h_star - 1.0)

    @property
    def friction(self) -> float:
        """Estimated error of the friction, + where it is too large."""
        return self._factor * (self.other.friction / self.film.friction - 1.0)

    @property
    def friction_bound(self) -> float:
        """Largest error of friction, by its two parts."""
        film, other = self.film, self.other
        rubbed = (film.friction - film.drag) - (other.friction - other.drag)
        difference = fsum((abs(film.drag - other.drag), abs(rubbed)))
        return self._factor * difference / abs(self.film.friction)

    @property
    def beyond(self) -> float:
        """Friction of the oil beyond both ends of the arc, which no mesh of it has."""
        return 100.0 * self.film.beyond

    @property
    def _factor(self) -> float:
        """Error, %, of a relative difference between the meshes."""
        return float(100.0 / (self.ratio**-ORDER - 1.0))


def unseen(p: Seal) -> str:
    """Why no estimate of a case can be relied on; empty where it can."""
    if p.mesh != "graded":
        return f'mesh = "{p.mesh}" has no estimate of the error; use mesh = "graded" where it goes'
    if p.density < LEAST_DENSITY:
        return (
            f"density = {p.density} is too coarse for its error to be estimated; use density = "
            f"{LEAST_DENSITY} or more"
        )
    if (p.reynolds, p.pressure_order) in INLET_SEGMENTS_OF_LOW_ORDERS:
        return (
            f'the error of pressure_order = {p.pressure_order} with reynolds = "{p.reynolds}" '
            "cannot be estimated; use an order of 3 or more"
        )
    return ""


def reservation(p: Seal, estimate: Estimate | None) -> str:
    """Why a state whose estimated error of h* is small is not `ok` all the same; empty if it is."""
    text = unseen(p) if p.error_estimate else ""
    if text or estimate is None:
        return text
    other = estimate.other
    fewest = fewest_inlet_segments(p.reynolds, p.pressure_order, p.lobes)
    if other.short(fewest) or not shows_inlet(other.inlet_ratio):
        return f"the mesh of the estimate does not show the inlet; {FINER}"
    error = estimate.friction_bound
    if not error <= LARGEST_ERROR:
        return f"friction may be off by {error:.2g} %, h* is not; {FINER}"
    lacks = estimate.beyond
    if not error + lacks <= LARGEST_ERROR:
        return (
            f"friction may be off by {error + lacks:.2g} %: it lacks {lacks:.2g} %, that of the "
            "oil beyond the ends of the arc; h* and leakage hold"
        )
    return ""
