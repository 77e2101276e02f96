"""Film stages by modified Newton on a Schur complement: few factorisations for a whole curve.

At a fixed sealed pressure the section moves by micrometres from state to state. It is the body of
`modified_newton`; the film, the rod that fades out below it and the sealed pressure on the arc are
the layer, the displacements of the arc and the moment are what both share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from softehl.cases.seal.section import OringSection, film_guard
from softehl.cases.seal.stage import Stage
from softehl.runtime.fem.layered import Layer, Layered
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.schur import SchurCorrector
from softehl.runtime.solve.steps import StepRule

LAYER = ("film", "rod", "sealed_arc", "facet", "upwind")
"""Blocks of the layer, as far as a section has them."""

METHOD = "modified Newton on the Schur complement of the section"

_NEAR = 0.3  # residual at which the section is in equilibrium well enough to be condensed
_LOOSE = 1e-3  # of the states on the way from contact to film, which are no results
_FIRM = 1e-6  # of the state from which speeds fall: a section is condensed there that is at rest
_WEIGHT_STEPS = StepRule(0.04, 0.005, growth=2.5, target_iterations=8)
_SHEAR_STEPS = StepRule(1.0, 0.05, target_iterations=8)
_SPEED_STEPS = StepRule(math.log(2.0), 0.004, math.log(2.0) + 1e-9, target_iterations=30)


@dataclass(frozen=True, eq=False)
class FastFilm:
    """Turns the film stages of a section into ones that are solved by modified Newton."""

    section: OringSection
    layer: Layer
    corrector: SchurCorrector

    @classmethod
    def of(cls, section: OringSection, linear: Condenser) -> FastFilm:
        """For one stroke; the factors of the section are kept from stage to stage."""
        layout, nodes = section.layout, section.mesh.arc_nodes
        shared = np.concatenate([2 * nodes, 2 * nodes + 1, layout.dofs("rotation")])
        inner = np.setdiff1d(layout.dofs("pressure"), section.film_ends)
        present = [block.name for block in section.problem.assembler.blocks]
        names = [name for name in LAYER if name in present]
        layer = Layer.of(section.problem.assembler, names, shared, inner)
        finish = Newton(max_iterations=1, linear=linear)
        return cls(section, layer, SchurCorrector(linear, near=_NEAR, finish=finish))

    def weight(self, stage: Stage) -> Stage:
        """The stage from contact to film, to a tolerance that is enough for a way."""
        return self._stage(stage, self.corrector.with_tolerance(_LOOSE), _WEIGHT_STEPS)

    def shear(self, stage: Stage) -> Stage:
        """The stage in which the shear stress begins to act, to a smaller tolerance."""
        return self._stage(stage, self.corrector.with_tolerance(_FIRM), _SHEAR_STEPS)

    def speed(self, stage: Stage) -> Stage:
        """The stage of falling speed, to the full tolerance."""
        return replace(self._stage(stage, self.corrector, _SPEED_STEPS), predictor="parabola")

    def _stage(self, stage: Stage, corrector: SchurCorrector, steps: StepRule) -> Stage:
        guards = (film_guard(self.section),)

        def problem_at(parameter: float) -> Layered:
            problem = stage.problem_at(parameter)
            assert isinstance(problem, Problem)
            return Layered(problem, self.layer, guards)

        return replace(
            stage, problem_at=problem_at, steps=steps, corrector=corrector, method=METHOD
        )
