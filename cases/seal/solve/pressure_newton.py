"""Newton's method for paths of a nearly incompressible solid."""

from __future__ import annotations

from dataclasses import dataclass, replace

from softehl.cases.seal.equations.equations import SealSystem
from softehl.runtime.arrays import Array
from softehl.runtime.fem.lagged_pressure import LaggedPressure, element_pressures
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.relaxed import Anchored
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
    the last solution, steps are as long as those of a compressible solid. `pressures`, (Q,), None
    until the first solve, changes with every solution; the rest are settings.
    """

    newton: Newton
    system: SealSystem
    pressures: Array | None = None

    def solve(self, problem: Problem | Anchored, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,); of an anchored problem the one within is lagged."""
        bare = problem.problem if isinstance(problem, Anchored) else problem
        if self.pressures is None:
            self.take_up(bare, x0)
        assert self.pressures is not None
        held: NonlinearProblem = lagged(self.system, bare, self.pressures)
        if isinstance(problem, Anchored):
            held = replace(problem, problem=held)
        solution = self.newton.solve(held, x0)
        if solution.converged:
            self.take_up(bare, solution.x)
        return solution

    def take_up(self, problem: Problem, x: Array) -> None:
        """Go on from a solution (n,) that another corrector found; see `Informed`."""
        self.pressures = element_pressures(problem, self.system.solids, x)
