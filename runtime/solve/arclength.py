"""Pseudo-arclength continuation (Keller), which passes limit points and reports them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
from scipy.sparse import csc_array, hstack, vstack

from softehl.runtime.arrays import Array
from softehl.runtime.solve.continuation import ProblemAt
from softehl.runtime.solve.linear import LinearSolver, SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import MeasuredProblem, Newton, NonlinearProblem
from softehl.runtime.solve.predictor import admissible_fraction
from softehl.runtime.solve.record import OnPoint, Record
from softehl.runtime.solve.solution import Branch, LimitPoint, Solution, Status
from softehl.runtime.solve.steps import StepRule

Derivative: TypeAlias = Callable[[float, Array], Array]
_FOLD_ITERATIONS = 20


@dataclass(frozen=True, eq=False)
class _Trial:
    """A point of arc-length continuation, accepted or refused; t: unit tangent, shape (n + 1,)."""

    parameter: float
    solution: Solution
    t: Array = field(default_factory=lambda: np.empty(0))

    @property
    def y(self) -> Array:
        return np.append(self.solution.x, self.parameter)

    def refuse(self, status: Status, message: str) -> _Trial:
        return replace(self, solution=replace(self.solution, status=status, message=message))


@dataclass(frozen=True, eq=False)
class _Path:
    """The curve R(x, parameter) = 0 in the space of y = (x, parameter), with a metric."""

    problem_at: ProblemAt
    derivative: Derivative | None
    x_scale: float
    parameter_scale: float
    difference: float

    def weigh(self, t: Array) -> Array:
        """Covector of t: weigh(t) @ y is the scalar product of the metric."""
        weights = np.full(t.size, 1.0 / ((t.size - 1) * self.x_scale**2))
        weights[-1] = self.parameter_scale**-2
        return weights * t

    def parameter_derivative(self, y: Array) -> Array:
        """dR/dparameter at y, shape (n,); a central difference unless a derivative is given."""
        x, parameter = y[:-1], float(y[-1])
        if self.derivative is not None:
            return self.derivative(parameter, x)
        h = self.difference * max(abs(parameter), self.parameter_scale)
        ahead = self.problem_at(parameter + h).residual(x)
        behind = self.problem_at(parameter - h).residual(x)
        return (ahead - behind) / (2.0 * h)

    def bordered(self, y: Array, row: Array) -> tuple[Array, SparseMatrix]:
        """R at y, and [[dR/dx, dR/dparameter], [row]], regular at a simple limit point."""
        r, K = self.problem_at(float(y[-1])).linearise(y[:-1])
        column = self.parameter_derivative(y)[:, None]
        upper = hstack([csc_array(K), csc_array(column)])
        return r, vstack([upper, csc_array(row[None, :])], format="csc")

    def tangent(self, y: Array, along: Array, linear: LinearSolver) -> Array:
        """Unit tangent at y on the side of the covector `along`; may raise SingularMatrix."""
        _, matrix = self.bordered(y, along)
        unit = np.zeros(y.size)
        unit[-1] = 1.0
        t = linear.factorise(matrix).solve(unit)
        return t / math.sqrt(float(self.weigh(t) @ t))


@dataclass(frozen=True, eq=False)
class _Corrector:
    """NonlinearProblem in y: R = 0 on the plane `length` along the unit tangent t at `base`."""

    path: _Path
    base: Array
    covector: Array
    length: float

    def _plane(self, y: Array) -> Array:
        return np.array([self.covector @ (y - self.base) / self.length - 1.0])

    def _problem(self, y: Array) -> NonlinearProblem:
        return self.path.problem_at(float(y[-1]))

    def residual(self, y: Array) -> Array:
        return np.concatenate([self._problem(y).residual(y[:-1]), self._plane(y)])

    def linearise(self, y: Array) -> tuple[Array, SparseMatrix]:
        r, matrix = self.path.bordered(y, self.covector / self.length)
        return np.concatenate([r, self._plane(y)]), matrix

    def norm(self, r: Array) -> float:
        problem = self._problem(self.base)
        return max(problem.norm(r[:-1]), abs(float(r[-1])))

    def measure(self, y: Array, K: SparseMatrix | None, *, rounded: bool = False) -> float:
        problem, off = self._problem(y), abs(float(self._plane(y)[0]))
        if isinstance(problem, MeasuredProblem):
            inner = None if K is None else csc_array(csc_array(K)[:-1, :-1])
            return max(problem.measure(y[:-1], inner, rounded=rounded), off)
        r = problem.residual(y[:-1])
        return max(problem.norm(r), off) if np.isfinite(r).all() else math.inf

    def step_limit(self, y: Array, dy: Array) -> float:
        return self._problem(y).step_limit(y[:-1], dy[:-1])


@dataclass(frozen=True)
class Arclength:
    """Pseudo-arclength continuation, which passes limit points and reports them.

    newton: corrector on the plane normal to the tangent; steps: step rule, lengths in the metric
    |dy|^2 = |dx|^2 / (n x_scale^2) + (dparameter / parameter_scale)^2;
    turn: largest angle between successive tangents [degrees]; a sharper turn (often a jump to
    another branch, or two folds in one step) is refused and the step cut;
    difference: relative step of the central difference for dR/dparameter, about eps^(1/3);
    fold_tolerance: parameter component of the unit tangent at which a fold counts as located
    (the error of its parameter is of second order in this);
    max_points, keep_all, name: as for Continuation.
    """

    newton: Newton
    steps: StepRule
    x_scale: float = 1.0
    parameter_scale: float = 1.0
    turn: float = 30.0
    difference: float = 6e-6
    fold_tolerance: float = 1e-7
    max_points: int = 1000
    keep_all: bool = False
    name: str = "parameter"

    def follow(
        self,
        problem_at: ProblemAt,
        start: float,
        x0: Array,
        *,
        direction: float = 1.0,
        within: tuple[float, float] = (-math.inf, math.inf),
        until: Callable[[Branch], bool] | None = None,
        derivative: Derivative | None = None,
        on_point: OnPoint | None = None,
    ) -> Branch:
        """Follow the path through the solution at `start`, x0 of shape (n,) being the guess.

        direction: sign of the first change of the parameter. derivative(parameter, x): dR/dp,
        shape (n,). on_point: called after each converged point. Start must not be a limit point.
        The path ends CONVERGED where the parameter leaves `within` (the last point lies exactly
        on the bound) or when `until` is true of the branch so far; MAX_ITERATIONS at max_points,
        unless no other end was asked for. Raises ValueError if start is not within.
        """
        if not within[0] <= start <= within[1]:
            raise ValueError(f"start {start} lies outside {within}")
        path = _Path(problem_at, derivative, self.x_scale, self.parameter_scale, self.difference)
        log = Record(self.name, self.keep_all, on_point)
        here, step = _counted(log, self._start(path, start, x0, direction)), self.steps.first
        if not here.solution.converged:
            return log.no_start(start, here.solution)
        log.accept(here.parameter, here.solution)
        while len(log.points) < self.max_points:
            trial = _counted(log, self._trial(path, here, step))
            leaving = trial.solution.converged and not within[0] <= trial.parameter <= within[1]
            if leaving:
                trial = _counted(log, self._leave(path, here, trial, within))
            if not trial.solution.converged:
                log.refuse(trial.parameter, trial.solution)
                step = self.steps.after_failure(step, trial.solution.status)
                if step < self.steps.smallest:
                    return log.too_small(step, self.steps.smallest)
                continue
            if not leaving and _turns(here, trial):
                log.limit_points.append(self._locate(path, log, (here, trial), step))
            log.accept(trial.parameter, trial.solution)
            if leaving or (until is not None and until(log.branch(Status.CONVERGED, ""))):
                return log.branch(Status.CONVERGED, f"reached {self.name} = {trial.parameter:.9g}")
            here, step = trial, self.steps.after_success(step, step, trial.solution.iterations)
        endless = until is None and math.isinf(within[0]) and math.isinf(within[1])
        status = Status.CONVERGED if endless else Status.MAX_ITERATIONS
        message = f"{self.max_points} points, the last at {self.name} = {here.parameter:.9g}"
        return log.branch(status, message)

    def _start(self, path: _Path, start: float, x0: Array, direction: float) -> _Trial:
        """Solve at `start` and find the tangent on which the parameter changes as asked."""
        trial = _Trial(start, self.newton.solve(path.problem_at(start), x0))
        along = np.zeros(trial.y.size)
        along[-1] = math.copysign(1.0 / self.parameter_scale, direction)
        return self._with_tangent(path, trial, along, cosine=0.0)

    def _trial(self, path: _Path, here: _Trial, length: float) -> _Trial:
        """Predict along the tangent, no further than the problem admits, and correct."""
        corrector = _Corrector(path, here.y, path.weigh(here.t), length)
        dy = length * here.t
        end = self.newton.solve(corrector, here.y + admissible_fraction(corrector, here.y, dy) * dy)
        trial = _Trial(float(end.x[-1]), replace(end, x=end.x[:-1]))
        cosine = math.cos(math.radians(self.turn))
        return self._with_tangent(path, trial, corrector.covector, cosine)

    def _with_tangent(self, path: _Path, trial: _Trial, along: Array, cosine: float) -> _Trial:
        """The trial with its tangent; refused if there is none or it turns away from `along`."""
        if not trial.solution.converged:
            return trial
        count = trial.solution.factorisations + 1
        try:
            t = path.tangent(trial.y, along, self.newton.linear)
        except SingularMatrix as error:
            refused = trial.refuse(Status.SINGULAR, f"no tangent of the path: {error}")
            return replace(refused, solution=replace(refused.solution, factorisations=count))
        trial = replace(trial, solution=replace(trial.solution, factorisations=count), t=t)
        if along @ t < cosine:
            angle = math.degrees(math.acos(float(along @ t)))
            return trial.refuse(Status.DIVERGED, f"the path turned by {angle:.0f} degrees")
        return trial

    def _leave(
        self, path: _Path, here: _Trial, trial: _Trial, within: tuple[float, float]
    ) -> _Trial:
        """The point on the bound that the path crosses between `here` and `trial`."""
        if _turns(here, trial):
            return trial.refuse(Status.DIVERGED, "a limit point and the bound within one step")
        bound = within[0] if trial.parameter < within[0] else within[1]
        part = (bound - here.parameter) / (trial.parameter - here.parameter)
        guess = here.y + part * (trial.y - here.y)
        return _Trial(bound, self.newton.solve(path.problem_at(bound), guess[:-1]))

    def _locate(
        self, path: _Path, log: Record, ends: tuple[_Trial, _Trial], step: float
    ) -> LimitPoint:
        """The fold between the ends, where the tangent has no parameter component (Illinois)."""
        here, there = ends
        kind, index = "maximum" if here.t[-1] > 0.0 else "minimum", len(log.points)
        a, slope_a, b, slope_b = 0.0, float(here.t[-1]), step, float(there.t[-1])
        near = min(ends, key=lambda end: abs(end.t[-1]))
        for _ in range(_FOLD_ITERATIONS):
            if abs(near.t[-1]) <= self.fold_tolerance * self.parameter_scale:
                return LimitPoint(near.parameter, near.solution.x, kind, index, located=True)
            c = b - slope_b * (b - a) / (slope_b - slope_a)
            trial = _counted(log, self._trial(path, here, c))
            if not trial.solution.converged:
                break
            slope = float(trial.t[-1])
            if slope * slope_b < 0.0:
                a, slope_a = b, slope_b
            else:
                slope_a *= 0.5
            b, slope_b, near = c, slope, trial
        return LimitPoint(near.parameter, near.solution.x, kind, index, located=False)


def _turns(here: _Trial, there: _Trial) -> bool:
    """True if the parameter changes direction between the two points."""
    return bool(here.t[-1] != 0.0 and here.t[-1] * there.t[-1] <= 0.0)


def _counted(log: Record, trial: _Trial) -> _Trial:
    log.count(trial.solution)
    return trial
