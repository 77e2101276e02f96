"""Newton's method for paths of a nearly incompressible solid."""

from __future__ import annotations

from dataclasses import dataclass

from softehl.cases.seal.equations.equations import SealSystem
from softehl.runtime.arrays import Array
from softehl.runtime.fem.assembly import ElementKernel
from softehl.runtime.fem.lagged_pressure import LaggedPressure, element_pressures
from softehl.runtime.fem.problem import Problem
from softehl.runtime.kernels import load_kernel
from softehl.runtime.solve.newton import Newton
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
    until the first solve, changes with every solution; the rest are settings: solids, follower and
    stiffness as of `LaggedPressure.of`.
    """

    newton: Newton
    solids: tuple[str, ...]
    follower: ElementKernel
    stiffness: Array
    pressures: Array | None = None

    def solve(self, problem: Problem, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,)."""
        pressures = self.pressures
        if pressures is None:
            pressures = element_pressures(problem, self.solids, x0)
        lagged = LaggedPressure.of(problem, self.solids, self.follower, pressures, self.stiffness)
        solution = self.newton.solve(lagged, x0)
        if solution.converged:
            self.pressures = element_pressures(problem, self.solids, solution.x)
        return solution

    def take_up(self, problem: Problem, x: Array) -> None:
        """Go on from a solution (n,) that another corrector found; see `Informed`."""
        self.pressures = element_pressures(problem, self.solids, x)
