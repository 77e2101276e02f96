"""An estimate of the error of h*, from the same curve on a mesh with fewer segments, or with more.

Where h* converges with order p, the difference between two meshes whose sizes have the ratio r < 1
is 1 / r^p - 1 times the error of the finer one. From density 4 on the coarser mesh has half the
density; below that this would be too coarse to be wrong in the same way, and it has five sixths.

Slow films that ours shows collapse on a coarser mesh that is not much coarser. A finer one of four
thirds has them: the same difference is 1 - r^p times the error of ours.
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


def finer_density(density: int) -> Fraction:
    """Density of the finer mesh."""
    return Fraction(4 * density, 3)


def system_at(system: SealSystem, density: Fraction) -> SealSystem:
    """The system on a mesh of the same spacing and another density."""
    return build_system(system.parameters, system.section.layout, density)


def estimated_error(density: int, value: float, other: float, at: Fraction | None = None) -> float:
    """Estimated error of h* or of friction in per cent of it, + where it is too large.

    value: at `density`; other: at another one, coarser_density(density) if that is None.
    """
    ratio = density / float(at or coarser_density(density))
    return 100.0 * (other / value - 1.0) / (math.pow(ratio, ORDER) - 1.0)
