"""Newton's method for paths of a nearly incompressible solid."""

from __future__ import annotations

from dataclasses import dataclass, replace

from softehl.cases.seal.equations.equations import SealSystem
from softehl.runtime.arrays import Array
from softehl.runtime.fem.assembly import ElementKernel
from softehl.runtime.fem.lagged_pressure import LaggedPressure, element_pressures
from softehl.runtime.fem.problem import Problem
from softehl.runtime.kernels import load_kernel
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution

_ROUGH = 1e-3
_PATIENT = 30


def roughly(newton: Newton) -> Newton:
    """Newton's method for states on the way, which are no results.

    On a fine mesh half of the iterations go from there to what rounding leaves. A residual that is
    above that and does not fall is no rounding.
    """
    return replace(newton, tolerance=max(_ROUGH, newton.tolerance), stagnation=1.0)


def patient(newton: Newton, iterations: int = _PATIENT) -> Newton:
    """Newton's method for a state of another mesh where fewer iterations lead nowhere.

    Each has to reduce the residual: that helps where the ring is squeezed into the corners of its
    groove, and the edges of contact there lie elsewhere.
    """
    return replace(newton, max_iterations=iterations, line_search=True)


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

    def take_up(self, problem: Problem, x: Array) -> None:
        """Go on from a solution (n,) that another corrector found; see `Informed`."""
        self.pressures = element_pressures(problem, self.solids, x)
