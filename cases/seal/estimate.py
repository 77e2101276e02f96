"""An estimate of the error of h*, from the same curve on a mesh with fewer segments.

Where h* converges with order p, the difference between two meshes whose sizes have the ratio r < 1
is 1 / r^p - 1 times the error of the finer one. From density 4 on the coarser mesh has half the
density; below that this would be too coarse to be wrong in the same way, and it has five sixths.
"""

from __future__ import annotations

import math
from fractions import Fraction

from softehl.cases.seal.equations import SealSystem, build_system

ORDER = 2.5
"""Order of convergence of h*: 2 in theory, 2.1 to 3.2 were measured between densities 2 and 4."""

ESTIMATED = 1e-6
"""Residual of the films of the coarser mesh: it moves the estimate by less than 1e-3 of it."""


def coarser_density(density: int) -> Fraction:
    """Density of the coarser mesh; meshes exist for multiples of one third."""
    return Fraction(density, 2) if density >= 4 else Fraction(5 * density // 2, 3)


def coarser_system(system: SealSystem) -> SealSystem:
    """The system on a coarser mesh of the same spacing."""
    parameters = system.parameters
    return build_system(parameters, system.section.layout, coarser_density(parameters.density))


def estimated_error(density: int, value: float, coarser: float) -> float:
    """Estimated error of h* or of friction in per cent of it, + where it is too large.

    value: at `density`; coarser: at coarser_density(density).
    """
    finer = density / float(coarser_density(density))
    return 100.0 * (coarser / value - 1.0) / (math.pow(finer, ORDER) - 1.0)
