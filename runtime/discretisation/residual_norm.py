"""Measure of the residual as one number without a unit.

Two things must be small. Every equation by itself: its residual relative to what cancels in it,
which is the contributions of its elements and loads, and the tangent's entries times the unknowns.
So no equation is overlooked because another one, elsewhere, has larger terms. And every field as a
whole: the norm of its residuals relative to that of its loads, reactions and internal forces, which
in slender and nearly incompressible bodies are much smaller than those terms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers

ROUNDING = 8.0 * np.finfo(np.float64).eps
"""Error of the residual of an element by rounding, relative to the stiffness times the largest
number that its kernel adds."""

_LEAST = ROUNDING / 1e-9
"""A field whose forces are smaller than this share of its terms is measured by that: residuals that
rounding alone leaves are then below Newton's usual tolerance, 1e-9."""

_FAR = 1e6  # times the coordinates and prescribed values: no unknown of a problem that is posed
_SWAMPED = 1e-3  # of the loads and internal forces: rounding beyond that decides nothing


@dataclass(frozen=True, eq=False)
class ResidualBalance:
    """Residuals and their terms, each (n,).

    defect: size of the residuals, 0 where the unknown is prescribed. forces: sums of the sizes of
    what elements contribute. terms: of the tangent's entries times the unknowns, 0 if no tangent is
    known. met: whether several elements contribute or the unknown is prescribed, so that `forces`
    is more than the residual's own size. deviation: prescribed unknowns less their values, and
    extent: the larger of both.
    """

    defect: Array
    forces: Array
    terms: Array
    met: Flags
    deviation: Array
    extent: Array

    def worst(self) -> float:
        """Largest residual of one equation relative to what cancels in it."""
        nonzero = np.flatnonzero(self.defect)
        return float(
            np.max(self.defect[nonzero] / (self.forces + self.terms)[nonzero], initial=0.0)
        )

    def squares(self, fields: Sequence[Integers]) -> Array:
        """Sums of squares over the unknowns of each field, (fields, 6), for `size`."""
        columns = (
            self.defect,
            np.where(self.met, self.forces, 0.0),
            self.forces + self.terms,
            self.terms,
            self.deviation,
            self.extent,
        )
        return np.array([[float(c[f] @ c[f]) for c in columns] for f in fields])


def residual_norm(squares: Array, worst: float) -> float:
    """The number, from the sums of squares of all fields and the worst equation."""
    ratios = [worst]
    for defect, forces, every, terms, deviation, extent in np.sqrt(squares).tolist():
        reference = max(forces, _LEAST * terms) if forces else every
        ratios += [min(_ratio(defect, reference), 1.0), _ratio(deviation, extent)]
    return float(max(ratios))


def is_far(largest: float, reference: float) -> bool:
    """True if the largest unknown is far beyond the known ones: if a body floats, a tangent that
    rounding alone keeps regular moves it by any amount.
    """
    return largest > _FAR * reference > 0.0


def hides(noise: float, size: float) -> bool:
    """True if rounding of this size hides the loads and internal forces."""
    return noise > _SWAMPED * size


def _ratio(deviation: float, size: float) -> float:
    """Norm of a defect over that of what it is measured by; 0 where there is no defect."""
    return (deviation / size if size else math.inf) if deviation > 0.0 else 0.0
