"""Correctors of a film in time: modified Newton iterations, else Newton for all unknowns."""

from __future__ import annotations

from dataclasses import dataclass, replace

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.pressure_newton import PressureNewton
from softehl.runtime.arrays import Array
from softehl.runtime.fem.layered import Layer, Layered
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.ladder import Ladder
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.modified_newton import ModifiedNewton
from softehl.runtime.solve.newton import Corrector, Newton
from softehl.runtime.solve.schur import SchurCorrector
from softehl.runtime.solve.solution import Solution

TOLERANCE = 1e-5
"""Residual of a step in time; above 1e-3 some steps need no iteration, and nothing is squeezed out.
A share of what a step begins with, up to 3e-4, saved 9 to 15 % of the iterations."""

_NEAR = 0.3
"""Residual at which the section is in equilibrium well enough to be condensed."""

_CAVITIES = 40
"""Inner iterations where oil ruptures and joins again node by node."""

_MONOLITHIC = 12
"""Iterations of Newton's method for all unknowns."""


def film_corrector(p: Seal, linear: Condenser) -> SchurCorrector:
    """Modified Newton iterations on the Schur complement of the section, for films of a case."""
    inner = ModifiedNewton(max_inner=_CAVITIES) if p.conserving else ModifiedNewton()
    finish = Newton(max_iterations=1, linear=linear)
    return SchurCorrector(linear, inner, near=_NEAR, finish=finish)


@dataclass(frozen=True, eq=False)
class FilmCorrectors:
    """Correctors of one film; `fast` is None where condensing does not serve."""

    system: SealSystem
    newton: Newton
    fast: SchurCorrector | None

    @classmethod
    def of(cls, system: SealSystem, newton: Newton) -> FilmCorrectors:
        """For films of a system; newton holds the linear solver."""
        p, linear = system.parameters, newton.linear
        quick = p.solver == "auto" and p.rotation == "fixed" and not p.rubs
        fast = film_corrector(p, linear) if quick and isinstance(linear, Condenser) else None
        return cls(system, replace(newton, max_iterations=_MONOLITHIC), fast)

    def whole(self, pressures: Array | None = None) -> PressureNewton:
        """Solves for all unknowns; pressures: (Q,) of a state that another mesh has left."""
        return PressureNewton(self.newton, self.system, pressures)

    def steps(self, pressures: Array | None = None) -> Corrector:
        """Solves steps in time; pressures: as of `whole`."""
        newton = replace(self.newton, tolerance=TOLERANCE, stagnation=1.0)
        fast = (self.fast.with_tolerance(TOLERANCE),) if self.fast else ()
        return Ladder((*fast, PressureNewton(newton, self.system, pressures)))

    @property
    def first(self) -> Corrector:
        """Solves steady films that are `layered`, from others near by."""
        return self.fast or self.whole()

    def layered(self, problem: Problem, layer: Layer) -> Layered:
        """A steady film as its correctors take it."""
        return Layered(problem, layer, (self.system.film_guard(),))

    def steady(self, problem: Problem, layer: Layer, x: Array) -> Solution:
        """The steady film from the last step in time, x (n,)."""
        fast = (self.fast,) if self.fast else ()
        return Ladder((*fast, self.whole())).solve(self.layered(problem, layer), x)
