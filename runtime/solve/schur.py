"""A corrector for continuation that condenses the body of a layered problem as seldom as it can."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import Condensed, Condenser, SingularMatrix
from softehl.runtime.solve.modified_newton import Chord, LayeredProblem
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status

_HELD_UP = 10.0  # times the tolerance, or what rounding may make of it
_RESCUE = 3  # Newton steps after a chord iteration that ended near the solution


@dataclass
class Memory:
    """What a walk remembers from solve to solve.

    condensed, place: the condensation in use and the state (n,) it was made at. settled: the last
    state that was accepted. worn: whether the condensation is to be renewed there.
    """

    condensed: Condensed | None = None
    place: Array | None = None
    settled: Array | None = None
    worn: bool = False


@dataclass(frozen=True)
class FrozenBody:
    """Chord iterations with a condensation that is renewed as seldom as possible.

    linear: makes the condensations. chord: the iteration. wear: mean reduction of the residual in
    an outer iteration above which the condensation counts as worn; the next solve then begins with
    one of the last accepted state. A solve that is too slow gets up to `renewals` new ones: made
    where it is and going on from there if its residual is at most `near`, else one of the last
    accepted state, from the start. closing: exact Newton steps for a solution whose residual
    rounding holds up more than it does Newton's.
    """

    linear: Condenser
    chord: Chord = field(default_factory=Chord)
    wear: float = 0.35
    near: float = 0.0
    renewals: int = 2
    closing: Newton | None = None
    memory: Memory = field(default_factory=Memory)

    def loosely(self, tolerance: float) -> FrozenBody:
        """The same with another tolerance, far above rounding, sharing the condensation."""
        return replace(self, chord=replace(self.chord, tolerance=tolerance, stagnation=1.0))

    def solve(self, problem: LayeredProblem, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,); the body may have been condensed anywhere near by."""
        memory = self.memory
        if memory.settled is None:
            memory.settled = problem.admissible(x0)
        solution = self._from(problem, x0)
        rate = self._rate(solution)
        if solution.converged:
            solution = self._closed(problem, solution)
        elif self._held_up(solution):
            solution = self._rescued(problem, solution)
        if solution.converged:
            memory.settled = solution.x
            memory.worn = rate > self.wear
        return solution

    def _from(self, problem: LayeredProblem, x0: Array) -> Solution:
        """The solution from x0, with new condensations where the one in use makes it too slow."""
        memory = self.memory
        assert memory.settled is not None
        solution, place, start = _not_begun(x0), memory.settled, x0
        fresh = memory.condensed is None or memory.worn
        for _ in range(self.renewals + 1):
            solution = self._attempt(problem, place if fresh else None, start, solution)
            if solution.status is not Status.MAX_ITERATIONS or self._held_up(solution):
                break
            if solution.residual_norms[-1] <= self.near:
                place = start = solution.x
            elif memory.place is not memory.settled:
                place, start = memory.settled, x0
            else:
                break  # age is not to blame
            fresh = True
        if place is not memory.settled and not solution.converged:
            memory.worn = True  # it was made at a state that is none
        return solution

    def _attempt(
        self, problem: LayeredProblem, place: Array | None, start: Array, before: Solution
    ) -> Solution:
        """The solution from `start`, with a condensation made at `place` if there is one; its cost
        includes that of what was tried `before`.
        """
        made, spent = before.factorisations + (place is not None), before.iterations
        if place is not None:
            try:
                self._condense(problem, place)
            except SingularMatrix as error:
                return Solution(start, Status.SINGULAR, f"the body: {error}", (), made, spent)
        assert self.memory.condensed is not None
        solution = self.chord.solve(problem, self.memory.condensed, start)
        return replace(solution, factorisations=made, iterations=spent + solution.iterations)

    def _held_up(self, solution: Solution) -> bool:
        """Whether an iteration ended where rounding begins to tell, so that Newton can finish."""
        chord = self.chord
        failed = solution.status in (Status.MAX_ITERATIONS, Status.DIVERGED)
        rounding = chord.stagnation > 1.0 and self.closing is not None
        limit = _HELD_UP * chord.stagnation * chord.tolerance
        return failed and rounding and solution.residual_norms[-1] <= limit

    def _closed(self, problem: LayeredProblem, solution: Solution) -> Solution:
        """The solution, after exact Newton steps if its residual was held up."""
        norms = solution.residual_norms
        if self.closing is None or norms[-1] <= _HELD_UP * self.chord.tolerance:
            return solution
        exact = self.closing.solve(problem, solution.x)
        if exact.residual_norms[-1] < norms[-1]:  # converged or not, it is nearer
            return _continued(solution, exact)
        return _continued(solution, exact, solution.x)

    def _rescued(self, problem: LayeredProblem, solution: Solution) -> Solution:
        """The solution that exact Newton steps reach by their own rules, else the failure."""
        assert self.closing is not None
        patient = replace(self.closing, max_iterations=_RESCUE)
        exact = patient.solve(problem, solution.x)
        if not exact.converged:
            return _continued(solution, exact, solution.x)
        return replace(_continued(solution, exact), status=exact.status, message=exact.message)

    def _rate(self, solution: Solution) -> float:
        """Mean factor by which an outer iteration, but the first, reduced the residual, as long as
        rounding had no part in it.
        """
        rounding = self.chord.stagnation * self.chord.tolerance
        norms = solution.residual_norms[1:]
        last = next((n for n, norm in enumerate(norms) if norm <= rounding), len(norms) - 1)
        if last < 1 or norms[0] <= 0.0:
            return 0.0
        return float((norms[last] / norms[0]) ** (1.0 / last))

    def _condense(self, problem: LayeredProblem, place: Array) -> None:
        memory = self.memory
        memory.condensed = None  # its memory is free for the new one
        memory.condensed = self.linear.condense(problem.body(place), problem.shared)
        memory.place, memory.worn = place, False


def _continued(solution: Solution, exact: Solution, x: Array | None = None) -> Solution:
    """The solution with the cost of exact steps, and their result unless x (n,) is to be kept."""
    norms = solution.residual_norms
    return replace(
        solution,
        x=exact.x if x is None else x,
        residual_norms=(*norms, *exact.residual_norms[1:]) if x is None else norms,
        factorisations=solution.factorisations + exact.factorisations,
        iterations=solution.iterations + exact.iterations,
    )


def _not_begun(x0: Array) -> Solution:
    return Solution(x0, Status.MAX_ITERATIONS, "not begun", (), 0, 0)
