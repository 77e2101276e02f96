"""Newton's method for R(x) = 0, as a frozen record of settings over explicit state.

A residual is a function of x: asking for one never changes the answer to the next. Failure is a
`Status` in the returned `Solution`, never an exception.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np

from softehl.log import LOG
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import LinearSolver, SingularMatrix, SparseMatrix
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.solution import Solution, Status

_SLOW_DECREASE = 0.5  # of the norm before: Newton does better unless rounding is all that is left
_NEAR_TOLERANCE = (
    10.0  # times the tolerance: more than that is iterated on before it counts as rounding
)
_SUFFICIENT_DECREASE = 1e-4  # Armijo's constant on the norm, the customary value


class NonlinearProblem(Protocol):
    """Interface of a problem to the solvers: n equations R(x) = 0 in n unknowns."""

    def residual(self, x: Array) -> Array:
        """R(x), shape (n,)."""
        ...

    def linearise(self, x: Array) -> tuple[Array, SparseMatrix]:
        """R(x), shape (n,), and K = dR/dx, shape (n, n), csc."""
        ...

    def norm(self, r: Array) -> float:
        """Dimensionless size of a residual; 1 is about the reference load."""
        ...

    def step_limit(self, x: Array, dx: Array) -> float:
        """Largest admissible fraction of the step dx from x, in (0, 1]."""
        ...


class Corrector(Protocol):
    """Anything that solves R(x) = 0 from a guess: Newton's method, or a cheaper relative."""

    def solve(self, problem: Any, x0: Array) -> Solution:
        """The solution from x0, shape (n,); failure is its status."""
        ...


@runtime_checkable
class WarmStartable(Corrector, Protocol):
    """A corrector that starts from its last solution, or from one of another corrector."""

    def warm_start(self, problem: Any, x: Array) -> None:
        """Start the next solve from a solution x, (n,), that another corrector found."""
        ...


@runtime_checkable
class EvolvingProblem(NonlinearProblem, Protocol):
    """A problem whose tangent depends on the iterates so far (its residual must not)."""

    def after(self, previous: Array, x: Array) -> Self:
        """The problem as it is after a step from `previous` to x, shapes (n,)."""
        ...


@runtime_checkable
class MeasuredProblem(NonlinearProblem, Protocol):
    """A problem with its own measure of residuals, which Newton uses instead of `norm`."""

    def measure(self, x: Array, K: SparseMatrix | None, *, rounded: bool = False) -> float:
        """Dimensionless size of R(x), (n,), inf if it is not finite.

        K: a tangent near x, from which the size of the terms is known; None at a start. rounded:
        what rounding may have caused does not count.
        """
        ...


@runtime_checkable
class SearchedProblem(NonlinearProblem, Protocol):
    """A problem with a merit function for line searches, not bounded by 1."""

    def merit(self, x: Array) -> float:
        """Size of R(x), (n,), that falls along a good step."""
        ...


@runtime_checkable
class RoundedProblem(NonlinearProblem, Protocol):
    """A problem with a bound of what rounding contributes to its residual."""

    def beyond_rounding(self, r: Array, x: Array, K: SparseMatrix) -> float:
        """Norm of what is left of r = R(x), (n,), where the last digits of x are at fault for the
        rest. K: a tangent near x.
        """
        ...


@runtime_checkable
class NamedProblem(NonlinearProblem, Protocol):
    """A problem with names of unknowns and elements for messages."""

    def name_of(self, number: int) -> str:
        """Name of an unknown."""
        ...

    def where_not_finite(self, x: Array) -> str:
        """Places where the equations are not finite at x, (n,); empty if they are."""
        ...


@dataclass(frozen=True, eq=False)
class NewtonState:
    """Everything an iteration needs and changes; `status` is None while it may go on.

    x: (n,) the last accepted iterate; norms: of the residuals at x0 and every accepted iterate.
    """

    x: Array
    norms: tuple[float, ...]
    factorisations: int = 0
    status: Status | None = None
    message: str = ""

    @property
    def iterations(self) -> int:
        """Completed iterations."""
        return len(self.norms) - 1


@dataclass(frozen=True)
class Newton:
    """Settings of Newton's method.

    Parameters
    ----------
    tolerance : float
        Dimensionless residual at which the method has converged: `measure` of the problem, or its
        `norm`.
    max_iterations : int
        Largest number of iterations.
    stagnation : float
        The method has also converged if the norm does not decrease while it and the previous one
        are below stagnation * tolerance, where only rounding prevents it: a stiff, nearly
        incompressible solid loses two decades by cancellation. 1 switches this off.
    divergence : float
        The method diverges if the norm exceeds divergence * max(1, first norm). Large, because a
        good step of a finite deformation may raise the norm a thousandfold.
    halvings : int
        Number of halvings of a step while the residual is not finite or, with line search, does
        not decrease.
    line_search : bool
        Semismooth problems (contact, cavitation) need full steps, although their norm may rise.
    linear : LinearSolver
        Solver of the linear systems.
    """

    tolerance: float = 1e-9
    max_iterations: int = 25
    stagnation: float = 100.0
    divergence: float = 1e6
    halvings: int = 6
    line_search: bool = False
    linear: LinearSolver = field(default_factory=SuperLU)

    def solve(self, problem: NonlinearProblem, x0: Array) -> Solution:
        """Solve R(x) = 0.

        Parameters
        ----------
        problem : Problem
            The equations, or any object with `residual`, `linearise`, `norm` and `step_limit`.
        x0 : array (n,)
            Initial guess; it is not changed.

        Returns
        -------
        Solution
            Converged or not; see `Solution.raise_for_status`.
        """
        # An inadmissible trial is a handled value here, so numpy need not warn of it.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            state = self.terminate(self.init(problem, x0))
            best = state
            LOG.debug("Newton iteration 0: norm %.3e", state.norms[-1])
            while state.status is None:
                previous = state.x
                state = self.terminate(self.step(problem, state))
                LOG.debug("Newton iteration %d: norm %.3e", state.iterations, state.norms[-1])
                if state.norms[-1] < best.norms[-1]:
                    best = state
                if isinstance(problem, EvolvingProblem):
                    problem = problem.after(previous, state.x)
        LOG.debug("Newton's method ends: %s, %s", state.status.value, state.message)
        return Solution(
            x=state.x,
            status=state.status,
            message=state.message,
            residual_norms=state.norms,
            factorisations=state.factorisations,
            iterations=state.iterations,
            best=None if state.norms[-1] <= best.norms[-1] else best.x,
        )

    def init(self, problem: NonlinearProblem, x0: Array) -> NewtonState:
        """Return the state before the first iteration.

        Parameters
        ----------
        problem : Problem
            The equations.
        x0 : array (n,)
            Initial guess.

        Returns
        -------
        NewtonState
            With the norm at x0.
        """
        x = np.array(x0, dtype=np.float64)
        state = NewtonState(x, (norm_at(problem, x),))
        if math.isfinite(state.norms[0]):
            return state
        where = _not_finite_message(problem, x)
        return _ended(state, Status.NOT_FINITE, f"the residual at the start is not finite{where}")

    def step(self, problem: NonlinearProblem, state: NewtonState) -> NewtonState:
        """Return the state after one iteration: factorise, solve, advance.

        Parameters
        ----------
        problem : Problem
            The equations.
        state : NewtonState
            State before it.

        Returns
        -------
        NewtonState
            With the status of a failure, if it fails.
        """
        r, K = problem.linearise(state.x)
        state = replace(state, factorisations=state.factorisations + 1)
        try:
            dx = -self.linear.factorise(K).solve(r)
        except SingularMatrix as error:
            return _ended(
                state, Status.SINGULAR, f"{error}{_singular_message(problem, state.x, error)}"
            )
        return self._advance(problem, state, dx, K)

    def terminate(self, state: NewtonState) -> NewtonState:
        """Return the state with its status, if the method has ended.

        Parameters
        ----------
        state : NewtonState
            State after an iteration.

        Returns
        -------
        NewtonState
            The state.
        """
        norm = state.norms[-1]
        if state.status is not None:
            return state
        if norm <= self.tolerance:
            return _ended(state, Status.CONVERGED, f"norm {norm:.1e}")
        if self._stagnates(state.norms):
            return _ended(state, Status.CONVERGED, f"norm {norm:.1e}, limited by rounding")
        if norm > self.divergence * max(1.0, state.norms[0]):
            return _ended(state, Status.DIVERGED, f"norm {norm:.1e} from {state.norms[0]:.1e}")
        if state.iterations >= self.max_iterations:
            return _ended(state, Status.MAX_ITERATIONS, f"last norms {_last_norms(state.norms)}")
        return state

    def _stagnates(self, norms: tuple[float, ...]) -> bool:
        if len(norms) < 2:
            return False
        previous, latest = norms[-2:]
        return previous <= latest <= self.stagnation * self.tolerance

    def _advance(
        self, problem: NonlinearProblem, state: NewtonState, dx: Array, K: SparseMatrix
    ) -> NewtonState:
        """Go along dx as far as the problem admits; shorter while the residual is refused."""
        fraction = min(problem.step_limit(state.x, dx), 1.0)  # in this order nan stays nan
        if not fraction > 0.0:
            return _ended(state, Status.DIVERGED, "no part of the Newton step is admissible")
        best, best_norm, best_merit = state.x, math.inf, math.inf
        initial_merit = self._merit(problem, state.x, state.norms[-1])
        for _ in range(self.halvings + 1):
            x = state.x + fraction * dx
            norm = norm_at(problem, x, K)
            merit = self._merit(problem, x, norm) if math.isfinite(norm) else math.inf
            if merit < best_merit:
                best, best_norm, best_merit = x, norm, merit
            if math.isfinite(merit) and self._decreases(merit, initial_merit, fraction):
                break
            fraction *= 0.5
        if not math.isfinite(best_norm):
            message = f"the residual along the Newton step is not finite, down to {fraction:.1e}"
            return _ended(state, Status.NOT_FINITE, message + _not_finite_message(problem, x))
        state = replace(state, x=best, norms=(*state.norms, best_norm))
        hardly_less = best_norm > _SLOW_DECREASE * state.norms[-2]
        rounding = hardly_less and self._is_rounding(problem, best, K)
        if rounding or self._is_exact(problem, state, K):
            return _ended(state, Status.CONVERGED, f"norm {best_norm:.1e}, all of it rounding")
        return state

    def _is_rounding(self, problem: NonlinearProblem, x: Array, K: SparseMatrix) -> bool:
        """True if rounding may have caused all of the residual at x."""
        return isinstance(problem, MeasuredProblem) and (
            problem.measure(x, K, rounded=True) <= self.tolerance
        )

    def _is_exact(self, problem: NonlinearProblem, state: NewtonState, K: SparseMatrix) -> bool:
        """True if the last digits of x make all that is left of a residual near the tolerance."""
        if (
            not self.tolerance
            < state.norms[-1]
            <= min(_NEAR_TOLERANCE, self.stagnation) * self.tolerance
        ):
            return False
        if not isinstance(problem, RoundedProblem):
            return False
        r = problem.residual(state.x)
        return problem.beyond_rounding(r, state.x, K) <= self.tolerance

    def _merit(self, problem: NonlinearProblem, x: Array, norm: float) -> float:
        """Problem of a line search."""
        if self.line_search and isinstance(problem, SearchedProblem):
            return problem.merit(x)
        return norm

    def _decreases(self, merit: float, initial_merit: float, fraction: float) -> bool:
        return (
            not self.line_search or merit <= (1.0 - _SUFFICIENT_DECREASE * fraction) * initial_merit
        )


def norm_at(problem: NonlinearProblem, x: Array, K: SparseMatrix | None = None) -> float:
    """Norm of the residual at x, inf if either is not finite.  K: a tangent near x, if known."""
    if isinstance(problem, MeasuredProblem):
        norm = problem.measure(x, K)
        return norm if math.isfinite(norm) else math.inf
    r = problem.residual(x)
    norm = float(problem.norm(r)) if np.isfinite(r).all() else math.inf
    return norm if math.isfinite(norm) else math.inf


def _not_finite_message(problem: NonlinearProblem, x: Array) -> str:
    """Message: where the equations are not finite at x."""
    place_message = problem.where_not_finite(x) if isinstance(problem, NamedProblem) else ""
    return f": {place_message}" if place_message else ""


def _singular_message(problem: NonlinearProblem, x: Array, error: SingularMatrix) -> str:
    """The unknown that no equation determines, or the element that spoils the matrix."""
    if error.row is not None and isinstance(problem, NamedProblem):
        return f": no equation determines {problem.name_of(error.row)}"
    return _not_finite_message(problem, x)


def _ended(state: NewtonState, status: Status, message: str) -> NewtonState:
    return replace(state, status=status, message=message)


def _last_norms(norms: tuple[float, ...]) -> str:
    return ", ".join(f"{norm:.1e}" for norm in norms[-4:])
