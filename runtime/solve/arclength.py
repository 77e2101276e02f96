"""Pseudo-arclength continuation (Keller), which passes limit points and reports them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from scipy.sparse import csc_array, hstack, vstack

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.continuation import (
    End,
    OnPoint,
    PathLog,
    ProblemAt,
    StepAttempt,
    Stepper,
    StepRule,
    admissible_fraction,
    follow_path,
)
from softehl.runtime.solve.linear.linear_solver import LinearSolver, SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import MeasuredProblem, Newton, NonlinearProblem
from softehl.runtime.solve.solution import Branch, LimitPoint, Solution, Status

Derivative: TypeAlias = Callable[[float, Array], Array]
_FOLD_ITERATIONS = 20
_SHORTEST_CHORD = 1e-3
"""Of the extent of the path so far: a chord that is shorter passes a kink, whatever its angle. From
1e-2 to 1e-4 a snap-back and a shallow roof have the same limits, and costs within a tenth."""
_MIN_ASPECT_RATIO = 1e-2
"""Least ratio of the sides of that extent: a path may begin along one of them. From 1e-1 to 1e-3
limits are the same, and costs within a thirtieth."""
_TARGET_ANGLE_FRACTION = 0.5
"""Of the largest angle: at which the next step aims. From 0.5 to 1 the same limits take from 318 to
435 Newton steps in a snap-back, from 552 to 596 in a shallow roof."""


@runtime_checkable
class DrivenProblem(NonlinearProblem, Protocol):
    """A problem with prescribed unknowns, which it eliminates from its matrix."""

    @property
    def fixed(self) -> Integers:
        """Numbers of the prescribed unknowns."""
        ...

    def linearise_along(self, x: Array, rate: Array) -> tuple[Array, SparseMatrix, Array]:
        """As `linearise`, and K times the rate (n,) before the elimination, free rows only."""
        ...


@dataclass(frozen=True, eq=False)
class _ArclengthAttempt(StepAttempt):
    """A point of arc-length continuation, accepted or refused.

    t: unit tangent, shape (n + 1,). side: sign of the determinant of the bordered matrix, None
    where it is not known. at_bound: it is the last one, on a bound of the parameter.
    """

    t: Array = field(default_factory=lambda: np.empty(0))
    side: float | None = None
    at_bound: bool = False

    @property
    def y(self) -> Array:
        return np.append(self.solution.x, self.parameter)

    def refuse(
        self, status: Status, message: str, next_step: float | None = None
    ) -> _ArclengthAttempt:
        solution = replace(self.solution, status=status, message=message)
        return replace(self, solution=solution, next_step=next_step)


@dataclass(frozen=True, eq=False)
class _SolutionCurve:
    """The curve R(x, parameter) = 0 in the space of y = (x, parameter), with a metric."""

    problem_at: ProblemAt
    derivative: Derivative | None
    x_scale: float | Array
    parameter_scale: float
    difference: float

    @cached_property
    def x_weights(self) -> Array | float:
        """Of the squares of changes of x: one for all, or one for each, (n,)."""
        scale = np.asarray(self.x_scale)
        return scale**-2.0 / np.isfinite(scale).sum() if scale.ndim else float(scale**-2.0)

    def weigh(self, t: Array) -> Array:
        """Covector of t: weigh(t) @ y is the scalar product of the metric."""
        weights = np.empty(t.size)
        weights[:-1] = self.x_weights
        weights[:-1] /= 1.0 if np.ndim(self.x_scale) else t.size - 1
        weights[-1] = self.parameter_scale**-2
        return weights * t

    def length(self, t: Array) -> float:
        """Length of t in the metric."""
        return math.sqrt(float(self.weigh(t) @ t))

    def parameter_derivative(self, y: Array) -> Array:
        """dR/dparameter at y, shape (n,); a central difference unless a derivative is given."""
        x, parameter = y[:-1], float(y[-1])
        if self.derivative is not None:
            return self.derivative(parameter, x)
        h = self.difference * max(abs(parameter), self.parameter_scale)
        forward = self.problem_at(parameter + h).residual(x)
        backward = self.problem_at(parameter - h).residual(x)
        return (forward - backward) / (2.0 * h)

    def linearise(self, y: Array) -> tuple[Array, SparseMatrix, Array]:
        """R at y, dR/dx, and dR/dparameter, (n,), with prescribed unknowns following.

        Prescribed unknowns u(parameter) are eliminated from dR/dx, so that the change of the other
        residuals has their share K u'.
        """
        x, problem = y[:-1], self.problem_at(float(y[-1]))
        column = self.parameter_derivative(y)
        if not isinstance(problem, DrivenProblem):
            return *problem.linearise(x), column
        rate = np.zeros_like(column)
        rate[problem.fixed] = -column[problem.fixed]
        r, K, along = problem.linearise_along(x, rate)
        return r, K, column + along

    def bordered(self, y: Array, row: Array) -> tuple[Array, SparseMatrix]:
        """R at y, and [[dR/dx, dR/dparameter], [row]], regular at a simple limit point."""
        r, K, column = self.linearise(y)
        upper = hstack([csc_array(K), csc_array(column[:, None])])
        return r, vstack([upper, csc_array(row[None, :])], format="csc")

    def tangent(self, y: Array, along: Array, linear: LinearSolver) -> tuple[Array, float | None]:
        """Unit tangent at y on the side of the covector `along`, and the sign of the determinant of
        the bordered matrix, None where it is not known; may raise SingularMatrix.
        """
        _, matrix = self.bordered(y, along)
        unit = np.zeros(y.size)
        unit[-1] = 1.0
        factors = linear.factorise(matrix)
        t = factors.solve(unit)
        sign = getattr(factors, "sign", None)
        return t / self.length(t), None if sign is None else sign()

    def response(self, y: Array, linear: LinearSolver) -> Array:
        """dx/dparameter at y, (n,); may raise SingularMatrix."""
        _, K, column = self.linearise(y)
        return -linear.factorise(K).solve(column)


@dataclass(frozen=True, eq=False)
class _PathExtent:
    """Extent of a path so far: a box in the plane of |x| and the parameter.

    Angles and lengths are those of a diagram of the path that is drawn into this box.
    start: (n + 1,) where the path begins. x, parameter: sides of the box in units of the metric,
    zero in the beginning.
    """

    path: _SolutionCurve
    start: Array
    x: float = 0.0
    parameter: float = 0.0

    def with_point(self, y: Array) -> _PathExtent:
        """The box that has a further point in it."""
        x, parameter = self._sizes(y - self.start)
        return replace(self, x=max(self.x, x), parameter=max(self.parameter, parameter))

    def length(self, dy: Array) -> float:
        """Of a change (n + 1,), relative to the box."""
        return math.hypot(
            *(a / b if b else 0.0 for a, b in zip(self._sizes(dy), self._box, strict=True))
        )

    def angle(self, a: Array, b: Array) -> float:
        """Angle between two changes (n + 1,) [degrees]."""
        x, parameter = self._box
        weighed = self.path.weigh(a) * b
        product = float(weighed[:-1].sum()) / (x**2 or 1.0) + float(weighed[-1]) / (
            parameter**2 or 1.0
        )
        sizes = self.length(a) * self.length(b)
        return math.degrees(math.acos(min(max(product / sizes, -1.0), 1.0))) if sizes else 0.0

    @property
    def _box(self) -> tuple[float, float]:
        return max(self.x, _MIN_ASPECT_RATIO * self.parameter), max(
            self.parameter, _MIN_ASPECT_RATIO * self.x
        )

    def _sizes(self, dy: Array) -> tuple[float, float]:
        weighed = self.path.weigh(dy) * dy
        return math.sqrt(float(weighed[:-1].sum())), math.sqrt(float(weighed[-1]))


@dataclass(frozen=True, eq=False)
class _PlaneEquations:
    """NonlinearProblem in y: R = 0 on the plane `length` along the unit tangent t at `base`."""

    path: _SolutionCurve
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
        problem, distance = self._problem(y), abs(float(self._plane(y)[0]))
        if isinstance(problem, MeasuredProblem):
            inner = None if K is None else csc_array(csc_array(K)[:-1, :-1])
            return max(problem.measure(y[:-1], inner, rounded=rounded), distance)
        r = problem.residual(y[:-1])
        return max(problem.norm(r), distance) if np.isfinite(r).all() else math.inf

    def step_limit(self, y: Array, dy: Array) -> float:
        return self._problem(y).step_limit(y[:-1], dy[:-1])


@dataclass(frozen=True)
class Arclength:
    """Pseudo-arclength continuation: it passes limit points and locates them.

    Parameters
    ----------
    newton : Newton
        Corrector on the plane normal to the tangent.
    steps : StepRule
        Step control, lengths in the metric
        |dy|^2 = |dx|^2 / (n x_scale^2) + (dparameter / parameter_scale)^2.
    x_scale : float or array (n,)
        Unit of the unknowns; inf for unknowns without length.
    parameter_scale : float
        Unit of the parameter.
    turn : float
        Largest angle between successive tangents, and twice that between the chord of a step and
        the tangent at either end [degrees], in the diagram of |x| over the parameter scaled to
        the path so far. A step with a sharper angle, or after which the number of negative pivots
        changes between odd and even without a limit point, is cut, down to 1e-3 of the diagram,
        where there is a kink or a bifurcation.
    difference : float
        Relative step of the central difference for dR/dparameter, about eps^(1/3).
    fold_tolerance : float
        Parameter component of the unit tangent at which a limit point is located; the error of
        its parameter is of second order in it.
    max_points : int
        Largest number of points.
    keep_all : bool
        True: all points have their x, else the last two.
    name : str
        Name of the parameter, for messages.
    """

    newton: Newton
    steps: StepRule
    x_scale: float | Array = 1.0
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
        leave: Array | None = None,
        on_point: OnPoint | None = None,
    ) -> Branch:
        """Follow the path through the solution at `start`.

        Parameters
        ----------
        problem_at : callable
            Function of the parameter that returns the problem.
        start : float
            First parameter, not a limit point.
        x0 : array (n,)
            Initial guess at the start.
        direction : float
            Sign of the first change of the parameter.
        within : tuple of float
            The path ends on these bounds of the parameter.
        until : callable, optional
            Called with the branch so far; the path ends where it returns True.
        derivative : callable, optional
            Function of parameter and x that returns dR/dparameter (n,); a central difference if
            left out.
        leave : array (n + 1,), optional
            In place of `direction`: initial change of x and parameter, off a bifurcation.
        on_point : callable, optional
            Called with each converged Point.

        Returns
        -------
        Branch
            CONVERGED at a bound or by `until`; MAX_ITERATIONS at `max_points`, if another end was
            requested.

        Raises
        ------
        ValueError
            `start` lies outside `within`.
        """
        if not within[0] <= start <= within[1]:
            raise ValueError(f"start {start} lies outside {within}")
        path = self._path(problem_at, derivative)
        log = PathLog(self.name, self.keep_all, on_point)
        return follow_path(
            _ArclengthStepper(self, path, log, start, x0, direction, within, until, leave),
            self.steps,
            log,
        )

    def response(self, problem_at: ProblemAt, start: float, x: Array) -> Array:
        """Return dx/dparameter of the path through a solution.

        Parameters
        ----------
        problem_at : callable
            Function of the parameter that returns the problem.
        start : float
            Parameter.
        x : array (n,)
            Solution there.

        Returns
        -------
        array (n,)
            The derivative.

        Raises
        ------
        SingularMatrix
            At a limit point or bifurcation.
        """
        return self._path(problem_at, None).response(np.append(x, start), self.newton.linear)

    def _path(self, problem_at: ProblemAt, derivative: Derivative | None) -> _SolutionCurve:
        return _SolutionCurve(
            problem_at=problem_at,
            derivative=derivative,
            x_scale=self.x_scale,
            parameter_scale=self.parameter_scale,
            difference=self.difference,
        )


@dataclass(eq=False)
class _ArclengthStepper(Stepper):
    """Stepper by arc length. last: last accepted point; extent: of the path so far."""

    settings: Arclength
    path: _SolutionCurve
    log: PathLog
    start_parameter: float
    x0: Array
    direction: float
    within: tuple[float, float]
    until: Callable[[Branch], bool] | None
    initial_direction: Array | None = None
    last: _ArclengthAttempt | None = None
    extent: _PathExtent | None = None

    def start(self) -> _ArclengthAttempt:
        """Solve at the start, and take the tangent in the direction of the parameter."""
        newton = self.settings.newton
        if self.initial_direction is not None:
            solution = Solution(self.x0, Status.CONVERGED, "", (), 0, 0)
            return _ArclengthAttempt(
                self.start_parameter,
                solution,
                t=self.initial_direction / self.path.length(self.initial_direction),
            )
        attempt = _ArclengthAttempt(
            self.start_parameter, newton.solve(self.path.problem_at(self.start_parameter), self.x0)
        )
        along = np.zeros(attempt.y.size)
        along[-1] = math.copysign(1.0 / self.settings.parameter_scale, self.direction)
        return self._with_tangent(attempt, along)

    def attempt(self, step: float) -> _ArclengthAttempt:
        """Predict and correct; onto the bound of the parameter where that is passed."""
        candidate = self._predict_and_correct(step)
        if candidate.converged:
            candidate = self._check_smoothness(candidate, step)
        if not candidate.converged or self.within[0] <= candidate.parameter <= self.within[1]:
            return candidate
        self.log.count(candidate.solution)
        return self._stop_at_bound(candidate)

    def accept(self, attempt: StepAttempt) -> None:
        """See `Stepper`; a fold that was passed is located first."""
        assert isinstance(attempt, _ArclengthAttempt)
        if self.last is not None and not attempt.at_bound and _passes_fold(self.last, attempt):
            self.log.limit_points.append(self._locate_fold(self.last, attempt))
        self.last = attempt
        if self.extent is None:
            # off a bifurcation the scales are the box
            unit = 0.0 if self.initial_direction is None else 1.0
            self.extent = _PathExtent(self.path, attempt.y, unit, unit)
        self.extent = self.extent.with_point(attempt.y)

    def end(self) -> End | None:
        """See `Stepper`."""
        last, settings = self._last, self.settings
        if last.at_bound or (
            last.step_length and self.until is not None and self.until(self.log.branch())
        ):
            return Status.CONVERGED, f"reached {settings.name} = {last.parameter:.9g}"
        if len(self.log.points) < settings.max_points:
            return None
        endless = self.until is None and math.isinf(self.within[0]) and math.isinf(self.within[1])
        message = (
            f"{settings.max_points} points, the last at {settings.name} = {last.parameter:.9g}"
        )
        return Status.CONVERGED if endless else Status.MAX_ITERATIONS, message

    @property
    def _last(self) -> _ArclengthAttempt:
        assert self.last is not None, "start() and accept() come first"
        return self.last

    def _predict_and_correct(self, length: float) -> _ArclengthAttempt:
        """Predict along the tangent, no further than the problem admits, and correct."""
        last, newton = self._last, self.settings.newton
        corrector = _PlaneEquations(self.path, last.y, self.path.weigh(last.t), length)
        dy = length * last.t
        end = newton.solve(corrector, last.y + admissible_fraction(corrector, last.y, dy) * dy)
        attempt = _ArclengthAttempt(float(end.x[-1]), replace(end, x=end.x[:-1]), length)
        return self._with_tangent(attempt, corrector.covector)

    def _with_tangent(self, attempt: _ArclengthAttempt, along: Array) -> _ArclengthAttempt:
        """The attempt with its tangent on the side of `along`; refused if there is none."""
        if not attempt.converged:
            return attempt
        count = attempt.solution.factorisations + 1
        attempt = replace(attempt, solution=replace(attempt.solution, factorisations=count))
        try:
            t, side = self.path.tangent(attempt.y, along, self.settings.newton.linear)
        except SingularMatrix as error:
            return attempt.refuse(Status.SINGULAR, f"no tangent of the path: {error}")
        return replace(attempt, t=t, side=side)

    def _check_smoothness(self, attempt: _ArclengthAttempt, step: float) -> _ArclengthAttempt:
        """The trial with the length of the next step; refused if the path between is not smooth."""
        last, steps, limit = self._last, self.settings.steps, 0.5 * self.settings.turn
        assert self.extent is not None, "accept() comes first"
        box, chord = self.extent.with_point(attempt.y), attempt.y - last.y
        angle = max(box.angle(last.t, chord), box.angle(chord, attempt.t))
        fraction = _TARGET_ANGLE_FRACTION * limit / max(angle, 1e-3 * limit)
        short = (
            box.length(chord) <= _SHORTEST_CHORD
            or attempt.step_length <= steps.smallest / steps.cut
        )
        signs_known = None not in (last.side, attempt.side)
        if (angle <= limit and not (signs_known and last.side != attempt.side)) or short:
            next_step = steps.after_success(step, attempt.step_length, attempt.solution.iterations)
            if not short:
                next_step = min(next_step, max(fraction * attempt.step_length, steps.smallest))
            return replace(attempt, next_step=next_step)
        message = "the number of negative pivots changes"
        if angle > limit:
            message = f"the path turned by {angle:.0f} degrees from the chord of the step"
        next_step = attempt.step_length * min(max(fraction, steps.cut**2), steps.cut)
        return attempt.refuse(Status.DIVERGED, message, next_step)

    def _stop_at_bound(self, attempt: _ArclengthAttempt) -> _ArclengthAttempt:
        """The point on the bound that the path crosses before the trial."""
        last = self._last
        if _passes_fold(last, attempt):
            return attempt.refuse(Status.DIVERGED, "a limit point and the bound within one step")
        bound = self.within[0] if attempt.parameter < self.within[0] else self.within[1]
        fraction = (bound - last.parameter) / (attempt.parameter - last.parameter)
        guess = last.y + fraction * (attempt.y - last.y)
        solution = self.settings.newton.solve(self.path.problem_at(bound), guess[:-1])
        return _ArclengthAttempt(bound, solution, attempt.step_length, at_bound=True)

    def _locate_fold(self, left: _ArclengthAttempt, right: _ArclengthAttempt) -> LimitPoint:
        """The fold between the ends, where the tangent has no parameter component (Illinois)."""
        kind, index = "maximum" if left.t[-1] > 0.0 else "minimum", len(self.log.points)
        a, slope_a, b, slope_b = 0.0, float(left.t[-1]), right.step_length, float(right.t[-1])
        nearest = min(left, right, key=lambda end: abs(end.t[-1]))
        tolerance = self.settings.fold_tolerance * self.settings.parameter_scale
        for _ in range(_FOLD_ITERATIONS):
            if abs(nearest.t[-1]) <= tolerance:
                return LimitPoint(nearest.parameter, nearest.solution.x, kind, index, located=True)
            c = b - slope_b * (b - a) / (slope_b - slope_a)
            attempt = self._predict_and_correct(c)
            self.log.count(attempt.solution)
            if not attempt.converged:
                break
            slope = float(attempt.t[-1])
            if slope * slope_b < 0.0:
                a, slope_a = b, slope_b
            else:
                slope_a *= 0.5
            b, slope_b, nearest = c, slope, attempt
        return LimitPoint(nearest.parameter, nearest.solution.x, kind, index, located=False)


def _passes_fold(left: _ArclengthAttempt, right: _ArclengthAttempt) -> bool:
    """True if the parameter changes direction between the two points."""
    return bool(left.t[-1] != 0.0 and left.t[-1] * right.t[-1] <= 0.0)
