"""A low pressure order reached from a higher one, where its own path of falling speed ends.

Both pressures are unknowns on the same film: each solves its own Reynolds equation (21) or (22) on
the common film thickness, and the force on the seal passes from the higher to the lower one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from softehl.cases.seal.path import Film, PathSettings, film_problem
from softehl.cases.seal.section import OringSection, build_section, flux_scales
from softehl.cases.seal.stage import Stage
from softehl.runtime.arrays import Array
from softehl.runtime.fem.assembly import Assembler
from softehl.runtime.fem.dofs import DofLayout
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.rules import lagrange, pressure_nodes

REFERENCE_ORDER = 4
"""Order from which lower ones are reached."""

_DISPLACEMENTS = {"film": 4, "facet": 6, "upwind": 4}  # columns of a dof map that are no pressures


@dataclass(frozen=True, eq=False)
class OrderPair:
    """A section of low pressure order, the same of higher order, and both in one.

    both: the low one with the pressures of the high one as a further field, "higher".
    """

    low: OringSection
    high: OringSection
    both: OringSection

    @classmethod
    def of(cls, low: OringSection) -> OrderPair:
        """The pair for a section of an order below REFERENCE_ORDER."""
        parameters = low.parameters.model_copy(update={"pressure_order": REFERENCE_ORDER})
        high = build_section(parameters, low.disc)
        before, count = low.layout.total, high.layout.count("pressure")
        layout = DofLayout((*low.layout.names, "higher"), (*low.layout.counts, count))
        blocks = list(low.problem.assembler.blocks)
        for block in high.problem.assembler.blocks:
            if block.name in _DISPLACEMENTS:
                dofs = block.dofs.copy()
                dofs[:, _DISPLACEMENTS[block.name] :] += before - high.layout.part("pressure").start
                blocks.append(replace(block, name=f"higher_{block.name}", dofs=dofs))
        assembler = Assembler.build(layout.total, blocks)
        problem = replace(low.problem, assembler=assembler, layout=layout)
        return cls(low, high, replace(low, layout=layout, problem=problem))

    def problem(self, settings: PathSettings, film: Film, share: float) -> Problem:
        """The film whose forces come from the low order by `share`, from the high one by the rest.

        At share = 1 the high pressures are without influence: the low order's own equations.
        """
        alone = film_problem(self.both, settings, film)
        given = alone.parameters
        both = {}
        for name in _DISPLACEMENTS:
            if name in given:
                names = alone.assembler.block(name).kernel.parameters
                both[f"higher_{name}"] = dict(zip(names, given[name].tolist(), strict=True))
        low = {}
        for name in {"film", "upwind"} & given.keys():
            both[f"higher_{name}"]["force_weight"] = 1.0 - share
            low[name] = {"force_weight": share}
        shared = alone.with_parameters(**low, **both)
        ends = self.both.layout.dofs("higher")[[0, -1]]
        return replace(
            shared,
            fixed=np.concatenate([shared.fixed, ends]),
            values=np.concatenate([shared.values, [film.sealed_pressure, 0.0]]),
            scales={
                **shared.scales,
                "higher": flux_scales(self.both, film.speed, film.gap, "higher"),
            },
        )

    def start(self, high: Array) -> Array:
        """Unknowns of both from those of the higher order: its pressures, sampled for the lower."""
        x = np.concatenate([transferred(high, self.high, self.low), self._pressures(high)])
        return np.asarray(x)

    def _pressures(self, high: Array) -> Array:
        return high[self.high.layout.part("pressure")]

    def low_part(self, x: Array) -> Array:
        """Unknowns of the low order among those of both."""
        return x[: self.low.layout.total].copy()

    def stage(self, settings: PathSettings, film: Film) -> Stage:
        """The forces pass from the higher to the lower order at one rod speed."""
        orders = (s.parameters.pressure_order for s in (self.high, self.low))
        return Stage(
            name="order {} to {}".format(*orders),
            problem_at=lambda share: self.problem(settings, film, share),
            start=0.0,
            stop=1.0,
            steps=settings.order_steps,
            sealed_pressure=film.sealed_pressure,
            stroke=film.stroke,
        )


def transferred(x: Array, source: OringSection, target: OringSection) -> Array:
    """Unknowns of `target` that say what x says of `source`; pressures are sampled at its nodes."""
    y = target.at_rest()
    for name in source.layout.names:
        if name != "pressure":
            y[target.layout.part(name)] = x[source.layout.part(name)]
    nodes = [pressure_nodes(s.parameters.pressure_order) for s in (source, target)]
    given, wanted = (s.problem.assembler.block("film").dofs[:, 4:] for s in (source, target))
    y[wanted] = x[given] @ lagrange(*nodes)[:, :, 0].T
    return y
