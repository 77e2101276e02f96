"""A layered problem whose body has no equations for some of the unknowns that it shares."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.cut import Parts
from softehl.runtime.fem.layered import Layered


@dataclass(frozen=True, eq=False)
class Propped(Layered):
    """Contact as the layer: its multipliers are shared, but the body knows nothing of them.

    lacking: (j,) those unknowns. The body is given unity on their diagonal so that it can be
    condensed, and the layer takes it off again: what is solved is the same.
    """

    lacking: Integers = field(kw_only=True)

    def body(self, x: Array) -> csc_array[np.float64]:
        """See `LayeredProblem`."""
        K = super().body(x)
        K.data[self.problem.assembler.pattern.diagonal[self.lacking]] += 1.0
        return K

    def layer_residual(self, x: Array) -> Array:
        """See `LayeredProblem`."""
        return self._without_props(super().layer_residual(x), x)

    def layer_linearise(self, x: Array) -> tuple[Array, Parts]:
        """See `LayeredProblem`."""
        r, parts = super().layer_linearise(x)
        return self._without_props(r, x), replace(parts, data=parts.data - self._props)

    def _without_props(self, r: Array, x: Array) -> Array:
        r = r.copy()
        r[self._rows] -= x[self.shared[self._rows]]
        return r

    @cached_property
    def _props(self) -> Array:
        """Unity on their diagonal in the data of the layer's tangent."""
        return self.layer.cut.placed(self._rows, self._rows, np.ones(len(self._rows)))

    @cached_property
    def _rows(self) -> Integers:
        return np.flatnonzero(np.isin(self.shared, self.lacking))
