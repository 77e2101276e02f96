"""A low pressure order reached from a higher one, where its own path of falling speed ends.

Both pressures are unknowns on the same film: each solves its own Reynolds equation (21) or (22) on
the common film thickness, and the force on the seal passes from the higher to the lower one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import PRESSURE
from softehl.cases.seal.solve.path import PathSettings, Stage
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.rules import lagrange, pressure_nodes

REFERENCE_ORDER = 4
"""Order from which lower ones are reached."""

_HIGHER = "higher"  # the field of its pressures beside those of the lower order


@dataclass(frozen=True, eq=False)
class OrderPair:
    """A system of low pressure order, the same of higher order, and both in one.

    both: the low one with the pressures of the high one as a further field, the last.
    """

    low: SealSystem
    high: SealSystem
    both: SealSystem

    @classmethod
    def of(cls, low: SealSystem) -> OrderPair:
        """The pair for a system of an order below REFERENCE_ORDER."""
        parameters = low.parameters.model_copy(update={"pressure_order": REFERENCE_ORDER})
        high = SealSystem.of(parameters, low.section)
        return cls(low, high, low.with_pressure(_HIGHER, REFERENCE_ORDER))

    def problem(self, film: FilmLoads, share: float) -> Problem:
        """The film whose forces come from the low order by `share`, from the high one by the rest.

        At share = 1 the high pressures are without influence: the low order's own equations.
        """
        return self.both.film_problem(film, {PRESSURE: share, _HIGHER: 1.0 - share})

    def start(self, high: Array) -> Array:
        """Unknowns of both from those of the higher order: its pressures, sampled for the lower."""
        low = transferred(high, self.high, self.low)
        return np.concatenate([low, self.high.pressures(high)])

    def low_part(self, x: Array) -> Array:
        """Unknowns of the low order among those of both."""
        return x[: self.low.layout.total].copy()

    def stage(self, settings: PathSettings, film: FilmLoads) -> Stage:
        """The forces pass from the higher to the lower order at one rod speed."""
        orders = (s.parameters.pressure_order for s in (self.high, self.low))
        return Stage(
            name="order {} to {}".format(*orders),
            problem_at=lambda share: self.problem(film, share),
            start=0.0,
            stop=1.0,
            steps=settings.order_steps,
            sealed_pressure=film.sealed_pressure,
            stroke=film.stroke,
        )


def transferred(x: Array, source: SealSystem, target: SealSystem) -> Array:
    """Unknowns of `target` that say what x says of `source`; pressures are sampled at its nodes."""
    y = target.at_rest()
    for field in source.contact_fields():
        y[target.layout.part(field.name)] = x[source.layout.part(field.name)]
    nodes = [pressure_nodes(s.parameters.pressure_order) for s in (source, target)]
    y[target.pressure_dofs()] = x[source.pressure_dofs()] @ lagrange(*nodes)[:, :, 0].T
    return y
