"""Newton's method for a nearly incompressible solid, and the correctors of a film in time.

A film is solved by modified Newton iterations on the Schur complement of the section, and by
Newton's method for all unknowns where these fail.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from softehl.cases.seal.correctors.chord_newton import ModifiedNewton
from softehl.cases.seal.correctors.layer_split import Layered
from softehl.cases.seal.correctors.perturbed_lagrangian import LaggedPressure
from softehl.cases.seal.correctors.proximal_term import Anchored, Relaxed
from softehl.cases.seal.correctors.schur_corrector import SchurCorrector
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.solve.linear.linear_solver import Condenser
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.solution import Solution
from softehl.runtime.solve.solver_cascade import Ladder

TOLERANCE = 1e-5
"""Residual of a step in time; above 1e-3 some steps need no iteration, and nothing is squeezed out.
A share of what a step begins with, up to 3e-4, saved 9 to 15 % of the iterations."""

_NEAR = 0.3
"""Residual at which the section is in equilibrium well enough to be condensed."""

_CAVITIES = 40
"""Inner iterations where oil ruptures and joins again node by node."""

_MONOLITHIC, _PATIENT = 12, 30
"""Iterations of Newton's method for all unknowns; above HARD."""

HARD = 6.0
"""p_s / mu above which a film gets more iterations, and more and shorter steps: with those of lower
pressures an outstroke at 6.5 and 1000 mm/s was not found, with all three it took 12 s."""


def lagged(system: SealSystem, problem: Problem, pressures: Array) -> LaggedPressure:
    """A problem of a seal with lagged pressures (Q,) of the elements of its section."""
    kernel = load_kernel("follower_pressure")
    return LaggedPressure.of(problem, system.solids, kernel, pressures, system.bulk_moduli)


@dataclass(eq=False)
class PressureNewton:
    """Newton's method with lagged element pressures, which go on from solution to solution.

    A predictor of continuation spoils volume ratios like any interpolation: with the pressures of
    the last solution, steps are as long as those of a compressible solid. `pressures`, (Q,), are
    None for those of the start and change with every solution; the rest are settings.
    """

    newton: Newton
    system: SealSystem
    pressures: Array | None = None

    def solve(self, problem: Problem | Layered | Anchored, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,); of an anchored problem the one within is lagged."""
        bare = problem if isinstance(problem, Problem) else problem.problem
        if self.pressures is None:
            self.pressures = self.system.element_pressures(x0)
        augmented: NonlinearProblem = lagged(self.system, bare, self.pressures)
        if isinstance(problem, Relaxed | Anchored):
            augmented = Anchored(augmented, problem.term, problem.state)
        start = problem.admissible(x0) if isinstance(problem, Layered) else x0
        solution = self.newton.solve(augmented, start)
        if solution.converged:
            self.pressures = self.system.element_pressures(solution.x)
        return solution

    def warm_start(self, problem: Problem | Layered | Anchored, x: Array) -> None:
        """Go on from a solution (n,) that another corrector found; see `WarmStartable`."""
        self.pressures = None  # of the start of the next solve


def film_corrector(p: Seal, linear: Condenser) -> SchurCorrector:
    """Modified Newton iterations on the Schur complement of the section, for films of a case."""
    inner = ModifiedNewton(max_inner=_CAVITIES) if p.conserving else ModifiedNewton()
    finish = Newton(max_iterations=1, linear=linear)
    return SchurCorrector(linear, inner, threshold=_NEAR, finish=finish)


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
        hard = p.load_ratio(p.sealed_pressure) > HARD
        whole = replace(newton, max_iterations=_PATIENT if hard else _MONOLITHIC)
        return cls(system, whole, fast)

    def monolithic(self, pressures: Array | None = None) -> PressureNewton:
        """Solves for all unknowns; pressures: (Q,) of a state that another mesh has left."""
        return PressureNewton(self.newton, self.system, pressures)

    @property
    def first(self) -> Corrector:
        """Solves steady films from others near by."""
        return self.fast or self.monolithic()

    def steady(self, pressures: Array | None = None) -> Corrector:
        """Solves the steady film from the last step in time; pressures: as of `whole`."""
        fast = (self.fast,) if self.fast else ()
        return Ladder((*fast, self.monolithic(pressures)))

    def steps(self, pressures: Array | None = None) -> Corrector:
        """Solves steps in time; pressures: as of `whole`."""
        newton = replace(self.newton, tolerance=TOLERANCE, stagnation=1.0)
        fast = self.fast and self.fast.with_tolerance(TOLERANCE)
        return replace(self, newton=newton, fast=fast).steady(pressures)
