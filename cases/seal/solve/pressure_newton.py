"""Newton's method for paths of a nearly incompressible solid."""

from __future__ import annotations

from dataclasses import dataclass

from softehl.cases.seal.equations.equations import SealSystem
from softehl.runtime.arrays import Array
from softehl.runtime.fem.lagged_pressure import LaggedPressure, element_pressures
from softehl.runtime.fem.layered import Layered
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.relaxed import Anchored, Relaxed
from softehl.runtime.kernels import load_kernel
from softehl.runtime.solve.newton import Newton, NonlinearProblem
from softehl.runtime.solve.solution import Solution


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
            self.pressures = element_pressures(bare, self.system.solids, x0)
        held: NonlinearProblem = lagged(self.system, bare, self.pressures)
        if isinstance(problem, Relaxed | Anchored):
            held = Anchored(held, problem.term, problem.state)
        start = problem.admissible(x0) if isinstance(problem, Layered) else x0
        solution = self.newton.solve(held, start)
        if solution.converged:
            self.pressures = element_pressures(bare, self.system.solids, solution.x)
        return solution

    def take_up(self, problem: Problem | Layered | Anchored, x: Array) -> None:
        """Go on from a solution (n,) that another corrector found; see `Informed`."""
        self.pressures = None  # of the start of the next solve
