"""A corrector for continuation that condenses the body of a layered problem as seldom as it can."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from softehl.cases.seal.correctors.chord_newton import LayeredProblem, ModifiedNewton
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import Condenser, SchurComplement, SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status

_NEAR_ROUNDING = 10.0  # times the tolerance, or what rounding may make of it
_FINISHING_STEPS = 3  # exact Newton steps after an iteration that ended near the solution
_STALLED_STEPS = 8  # and after one that ended where it does not go on


@dataclass(eq=False)
class StaleTangent:
    """The condensation in use: what a corrector carries from solve to solve, and changes.

    condensed, state: the condensation and the state (n,) at which it was made. accepted: (n,) the
    last solution. outdated: the next solve begins with a new condensation, made at `accepted`.
    unreported: condensations that no solution has counted yet.
    """

    condensed: SchurComplement | None = None
    state: Array | None = None
    accepted: Array | None = None
    outdated: bool = False
    unreported: int = 0

    def renew(self, linear: Condenser, problem: LayeredProblem, state: Array) -> None:
        """Condense the body of the problem at a state (n,); raises SingularMatrix."""
        self.condensed = None  # gives its memory back before the new one needs it
        self.condensed = linear.condense(problem.body(state), problem.shared)
        self.state, self.outdated = state, False
        self.unreported += 1

    def reported(self) -> int:
        """Number of the condensations that were not counted yet; now they are."""
        count, self.unreported = self.unreported, 0
        return count


@dataclass(eq=False)
class SchurCorrector:
    """Modified Newton on a condensation that is renewed only where it makes the iteration slow.

    Every field but `tangent` is a setting; `tangent` changes with every solve.

    linear: makes the condensations. iteration: the modified Newton iteration. stale: mean reduction
    of the residual in an outer iteration above which the condensation is outdated. A solve that is
    too slow gets up to `renewals` new ones: made at its last iterate and continued from there if
    the residual is at most `threshold`, else made at the last solution and begun again. finish:
    exact Newton steps where rounding keeps the modified iteration from the tolerance before it
    would keep Newton's method. stalled: residual from which Newton's method goes on where new
    condensations do not help, as where contact elsewhere on the body comes and goes from one
    iterate to the next.
    """

    linear: Condenser
    iteration: ModifiedNewton = field(default_factory=ModifiedNewton)
    stale: float = 0.35
    threshold: float = 0.0
    renewals: int = 2
    finish: Newton | None = None
    stalled: float = 0.0
    tangent: StaleTangent = field(default_factory=StaleTangent)

    def with_tolerance(self, tolerance: float) -> SchurCorrector:
        """A corrector with another tolerance, far above rounding, and the same `tangent`."""
        return replace(self, iteration=replace(self.iteration, tolerance=tolerance, stagnation=1.0))

    def solve(self, problem: LayeredProblem, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,); the body may have been condensed anywhere near by."""
        tangent = self.tangent
        if tangent.accepted is None:
            tangent.accepted = problem.admissible(x0)
        solution = self._iterate(problem, x0, tangent.accepted)
        rate = self._rate(solution)
        if solution.converged:
            solution = self._refined(problem, solution)
        elif finish := self._going_on(solution):
            solution = self._finished(problem, solution, finish)
        if solution.converged:
            tangent.accepted = solution.x
            tangent.outdated = rate > self.stale
        return solution

    def warm_start(self, problem: LayeredProblem, x: Array) -> None:
        """Go on from a solution (n,) that another corrector found; see `WarmStartable`."""
        self.tangent.accepted, self.tangent.outdated = problem.admissible(x), True

    def _iterate(self, problem: LayeredProblem, x0: Array, accepted: Array) -> Solution:
        """The solution from x0, with new condensations where the one in use makes it too slow."""
        tangent = self.tangent
        solution, state, start = _not_begun(x0), accepted, x0
        renew = tangent.condensed is None or tangent.outdated
        for _ in range(self.renewals + 1):
            solution = self._attempt(problem, state if renew else None, start, solution)
            slow = solution.status is Status.MAX_ITERATIONS
            if not slow or self._limited_by_rounding(solution):
                break
            if solution.residual_norms[-1] <= self.threshold:
                state = start = solution.x
            elif tangent.state is not accepted:
                state, start = accepted, x0
            else:
                break  # it was made at the last solution: a new one would be the same
            renew = True
        if state is not accepted and not solution.converged:
            tangent.outdated = True  # it was made at an iterate that led to no solution
        return solution

    def _attempt(
        self, problem: LayeredProblem, state: Array | None, start: Array, failed: Solution
    ) -> Solution:
        """The solution from `start`, with a condensation made at `state` if one is given; its cost
        includes that of what was tried `failed`.
        """
        made, spent = failed.factorisations, failed.iterations
        if state is not None:
            try:
                self.tangent.renew(self.linear, problem, state)
            except SingularMatrix as error:
                made += 1 + self.tangent.reported()
                return Solution(start, Status.SINGULAR, f"the body: {error}", (), made, spent)
        made += self.tangent.reported()
        assert self.tangent.condensed is not None
        solution = self.iteration.solve(problem, self.tangent.condensed, start)
        return replace(solution, factorisations=made, iterations=spent + solution.iterations)

    def _limited_by_rounding(self, solution: Solution) -> bool:
        """True if a failed iteration ended so near to rounding that Newton can finish it."""
        iteration = self.iteration
        failed = solution.status in (Status.MAX_ITERATIONS, Status.DIVERGED)
        rounding = iteration.stagnation > 1.0 and self.finish is not None
        limit = _NEAR_ROUNDING * iteration.stagnation * iteration.tolerance
        return failed and rounding and solution.residual_norms[-1] <= limit

    def _going_on(self, solution: Solution) -> Newton | None:
        """Newton's method as it goes on from a failed iteration, None where that ended too far."""
        failed = solution.status in (Status.MAX_ITERATIONS, Status.DIVERGED)
        if not failed or self.finish is None:
            return None
        if self._limited_by_rounding(solution):
            return replace(self.finish, max_iterations=_FINISHING_STEPS)
        if solution.residual_norms[-1] > self.stalled:
            return None
        tolerance = self.iteration.tolerance
        return replace(self.finish, max_iterations=_STALLED_STEPS, tolerance=tolerance)

    def _refined(self, problem: LayeredProblem, solution: Solution) -> Solution:
        """The solution, after exact Newton steps if rounding kept it from the tolerance."""
        norms = solution.residual_norms
        if self.finish is None or norms[-1] <= _NEAR_ROUNDING * self.iteration.tolerance:
            return solution
        exact = self.finish.solve(problem, solution.x)
        if exact.residual_norms[-1] < norms[-1]:  # converged or not, it is nearer
            return _continued(solution, exact)
        return _continued(solution, exact, solution.x)

    def _finished(self, problem: LayeredProblem, solution: Solution, finish: Newton) -> Solution:
        """The solution that exact Newton steps reach by their own rules, else the failure."""
        exact = finish.solve(problem, solution.x)
        if not exact.converged:
            return _continued(solution, exact, solution.x)
        return replace(_continued(solution, exact), status=exact.status, message=exact.message)

    def _rate(self, solution: Solution) -> float:
        """Mean factor by which an outer iteration, but the first, reduced the residual, as long as
        rounding had no part in it.
        """
        rounding = self.iteration.stagnation * self.iteration.tolerance
        norms = solution.residual_norms[1:]
        last = next((n for n, norm in enumerate(norms) if norm <= rounding), len(norms) - 1)
        if last < 1 or norms[0] <= 0.0:
            return 0.0
        return float((norms[last] / norms[0]) ** (1.0 / last))


def _continued(solution: Solution, exact: Solution, x: Array | None = None) -> Solution:
    """The solution with the cost of exact steps, and their result unless x (n,) is to be kept."""
    norms = solution.residual_norms
    return replace(
        solution,
        x=exact.x if x is None else x,
        residual_norms=(*norms, *exact.residual_norms[1:]) if x is None else norms,
        factorisations=solution.factorisations + exact.factorisations,
        iterations=solution.iterations + exact.iterations,
        best=None if x is None else solution.best,
    )


def _not_begun(x0: Array) -> Solution:
    return Solution(x0, Status.MAX_ITERATIONS, "not begun", (), 0, 0)
