"""An estimate of the error of h*, from the same curve on a mesh with fewer segments.

Elements and film converge with the square of the size, so the difference of h* between two meshes
of ratio r is 1 / r^2 - 1 times the error of the finer one. The coarser mesh has the same spacing
and five sixths of the segments, close enough for both to be wrong in the same way at low speed.
"""

from __future__ import annotations

from fractions import Fraction

from cases.oring_section import OringSection, build_section

ORDER = 2
"""Order of convergence of h*."""


def coarser_density(density: int) -> Fraction:
    """About five sixths of a density; meshes exist for multiples of one third."""
    return Fraction(5 * density // 2, 3)


def coarser_section(section: OringSection) -> OringSection:
    """The section on a coarser mesh of the same spacing."""
    parameters = section.parameters
    return build_section(parameters, section.disc, coarser_density(parameters.density))


def h_star_error(density: int, h_star: float, coarser: float) -> float:
    """Estimated error of h* in per cent of it, + where it is too large.

    h_star: at `density`; coarser: at coarser_density(density), nan where it is not known.
    """
    ratio = float(coarser_density(density)) / density
    return 100.0 * (coarser / h_star - 1.0) / (ratio**-ORDER - 1.0)
