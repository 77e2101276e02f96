"""A corrector for continuation that condenses the body of a layered problem as seldom as it can."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from runtime.chord import Chord, LayeredProblem
from runtime.linear import Condensed, Condenser, SingularMatrix
from runtime.newton import Newton
from runtime.solution import Solution, Status, Vector

_HELD_UP = 10.0  # times the tolerance


@dataclass
class Memory:
    """What a walk remembers from solve to solve.

    condensed, place: the condensation in use and the state (n,) it was made at. settled: the last
    state that was accepted. worn: whether the condensation is to be renewed there.
    """

    condensed: Condensed | None = None
    place: Vector | None = None
    settled: Vector | None = None
    worn: bool = False


@dataclass(frozen=True)
class FrozenBody:
    """Chord iterations with a condensation that is renewed at converged states only.

    linear: makes the condensations. chord: the iteration. wear: mean reduction of the residual in
    an outer iteration above which the condensation counts as worn. A solve that is too slow with
    an old condensation is tried once more with one of the last accepted state. closing: exact
    Newton steps for a solution whose residual rounding holds up more than it does Newton's.
    """

    linear: Condenser
    chord: Chord = field(default_factory=Chord)
    wear: float = 0.35
    closing: Newton | None = None
    memory: Memory = field(default_factory=Memory)

    def loosely(self, tolerance: float) -> FrozenBody:
        """The same with another tolerance, far above rounding, sharing the condensation."""
        return replace(self, chord=replace(self.chord, tolerance=tolerance, stagnation=1.0))

    def solve(self, problem: LayeredProblem, x0: Vector) -> Solution:
        """Solve R(x) = 0 from x0, (n,); the body may have been condensed anywhere near by."""
        memory = self.memory
        if memory.settled is None:
            memory.settled = problem.admissible(x0)
        made, first = 0, None
        while True:
            if memory.condensed is None or memory.worn:
                try:
                    self._condense(problem)
                except SingularMatrix as error:
                    return _no_condensation(x0, str(error), made + 1)
                made += 1
            assert memory.condensed is not None
            solution = self.chord.solve(problem, memory.condensed, x0)
            spent = solution.iterations + (first.iterations if first else 0)
            solution = replace(solution, factorisations=made, iterations=spent)
            if solution.converged:
                rate = _rate(solution)
                solution = self._closed(problem, solution)
                memory.settled = solution.x
                memory.worn = rate > self.wear
                return solution
            slow = solution.status is Status.MAX_ITERATIONS  # else age is not to blame
            if not slow or first is not None or memory.place is memory.settled:
                return solution
            first, memory.worn = solution, True

    def _closed(self, problem: LayeredProblem, solution: Solution) -> Solution:
        """The solution, after exact Newton steps if its residual was held up."""
        norms = solution.residual_norms
        if self.closing is None or norms[-1] <= _HELD_UP * self.chord.tolerance:
            return solution
        exact = self.closing.solve(problem, solution.x)
        made, spent = exact.factorisations, exact.iterations
        if exact.residual_norms[-1] < norms[-1]:  # converged or not, it is nearer
            norms = (*norms, *exact.residual_norms[1:])
            solution = replace(solution, x=exact.x, residual_norms=norms)
        return replace(
            solution,
            factorisations=solution.factorisations + made,
            iterations=solution.iterations + spent,
        )

    def _condense(self, problem: LayeredProblem) -> None:
        memory = self.memory
        assert memory.settled is not None
        memory.condensed = None  # its memory is free for the new one
        memory.condensed = self.linear.condense(problem.body(memory.settled), problem.shared)
        memory.place, memory.worn = memory.settled, False


def _rate(solution: Solution) -> float:
    """Mean factor by which an outer iteration, but the first, reduced the residual."""
    norms = solution.residual_norms[1:]
    if len(norms) < 2 or norms[0] <= 0.0:
        return 0.0
    return float((norms[-1] / norms[0]) ** (1.0 / (len(norms) - 1)))


def _no_condensation(x0: Vector, message: str, made: int) -> Solution:
    return Solution(x0, Status.SINGULAR, f"the body: {message}", (), made, 0)
