"""Newton's method for paths of a nearly incompressible solid."""

from __future__ import annotations

from dataclasses import dataclass, replace

from softehl.runtime.arrays import Array
from softehl.runtime.fem.assembly import ElementKernel
from softehl.runtime.fem.lagged_pressure import LaggedPressure, element_pressures
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution


@dataclass(eq=False)
class PressureNewton:
    """Newton's method with lagged element pressures, which go on from solution to solution.

    A predictor of continuation spoils volume ratios like any interpolation: with the pressures of
    the last solution, steps are as long as those of a compressible solid. `pressures`, (Q,), None
    until the first solve, changes with every solution; the rest are settings: solids, follower and
    stiffness as of `LaggedPressure.of`, starts the iterations of the first solve.
    """

    newton: Newton
    solids: tuple[str, ...]
    follower: ElementKernel
    stiffness: Array
    starts: int = 40
    pressures: Array | None = None

    def solve(self, problem: Problem, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,)."""
        newton, pressures = self.newton, self.pressures
        if pressures is None:
            newton = replace(newton, max_iterations=self.starts)
            pressures = element_pressures(problem, self.solids, x0)
        lagged = LaggedPressure.of(problem, self.solids, self.follower, pressures, self.stiffness)
        solution = newton.solve(lagged, x0)
        if solution.converged:
            self.pressures = element_pressures(problem, self.solids, solution.x)
        return solution
