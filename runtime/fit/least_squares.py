"""Least squares: SciPy's trust region with the exact Jacobian, or Newton's method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags
from softehl.runtime.definition.argument_checks import finite
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.fit.objective import StudyEvaluations
from softehl.runtime.fit.trust_region import minimise
from softehl.runtime.kernels.kernel_call import ArgumentError
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.hessian import HessianTerm, hessian_products
from softehl.runtime.sensitivity.input_parsing import By
from softehl.runtime.sensitivity.inputs import (
    Input,
    Key,
    LawParameter,
    PageArray,
    PageDatum,
    PageParameter,
)
from softehl.runtime.sensitivity.jacobian import Entry, by_key, jacobian
from softehl.runtime.sensitivity.quantities import PointValue, Quantity, ReactionSum
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.suggestions import join_names, short_list

Measured: TypeAlias = Mapping[Any, Mapping[str, Any]]
"""A place (x, y), or a side for its reactions -> unknown -> a number, one for each step, or
{time or load factor: number}."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements: quantities, their numbers (m,), and the time or load factor of each, (m,)."""

    quantities: list[Quantity]
    numbers: Array
    times: Array

    @classmethod
    def read(cls, measured: Measured, times: Array) -> Measurements:
        """Return measurements; a list has a number for each of the times.  Raises StudyError."""
        entries: list[tuple[Quantity, float, float]] = []
        if not isinstance(measured, Mapping) or not measured:
            raise StudyError('measured: a mapping is needed, {(48, 60): {"u_y": 12.4}}')
        for location, values in measured.items():
            if not isinstance(values, Mapping) or not values:
                raise StudyError(f'measured at {location!r}: give unknowns, {{"u_y": 12.4}}')
            for name, measured_values in values.items():
                made = (
                    ReactionSum(name, location)
                    if isinstance(location, str)
                    else _at(name, location)
                )
                context = f"measured at {location!r}: {name}"
                entries += [(made, v, t) for t, v in _series(context, measured_values, times)]
        quantities, numbers, times_of_all = zip(*entries, strict=True)
        return cls([*quantities], np.array(numbers), np.array(times_of_all))


def _series(context: str, values: Any, times: Array) -> list[tuple[float, float]]:
    """Times and numbers.  Raises StudyError."""
    if isinstance(values, Mapping):
        pairs = [(float(t), float(v)) for t, v in values.items()]
    else:
        if isinstance(values, np.ma.MaskedArray):
            raise StudyError(
                f"{context} is a masked array: give {{t: number}} of what was measured"
            )
        row = np.asarray(values, dtype=np.float64)
        if row.ndim and row.shape != times.shape:
            raise StudyError(
                f"{context} has {len(row)} numbers and the path {len(times)} steps: give one for "
                "each, or {t: number}, or one number for the last"
            )
        end_times = times if row.ndim else times[-1:]
        pairs = [*zip(end_times.tolist(), np.atleast_1d(row).tolist(), strict=True)]
    if not pairs or not np.isfinite(pairs).all():
        raise StudyError(f"{context} must be finite numbers")
    return pairs


def _at(name: str, point: Any) -> PointValue:
    try:
        return PointValue(name, tuple(float(c) for c in point))
    except (TypeError, ValueError):
        raise StudyError(
            f"measured at {point!r}: a place is a tuple of numbers, a side is a name"
        ) from None


Bounds: TypeAlias = Mapping[Key, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class SearchVariables:
    """Variables of the search, (k,): logarithms of what must stay positive, else multiples.

    sizes: (k,) of the inputs. positive: which of them are searched by logarithms: parameters and
    data of pages that are positive, unless their bounds allow other values.
    """

    sizes: Array
    positive: Flags
    start: Array
    lower: Array
    upper: Array

    @classmethod
    def of(cls, inputs: Sequence[Input], bounds: Bounds) -> SearchVariables:
        """Raises StudyError for bounds of other inputs, or without the start between them."""
        start = np.concatenate([item.value for item in inputs])
        lower, upper = _limits(inputs, bounds)
        if (start < lower).any() or (start > upper).any() or (lower >= upper).any():
            raise StudyError("bounds: give (least, largest) with the value in the study between")
        stiff = [
            np.full(len(item.value), isinstance(item, LawParameter | PageParameter | PageDatum))
            for item in inputs
        ]
        positive = np.concatenate(stiff) & (start > 0.0) & ((lower >= 0.0) | (lower == -np.inf))
        sizes = np.where(start == 0.0, 1.0, np.abs(start))
        with np.errstate(divide="ignore", invalid="ignore"):
            first, low, high = (
                np.where(positive, np.log(np.maximum(v, 0.0) / sizes), v / sizes)
                for v in (start, lower, upper)
            )
        return cls(sizes=sizes, positive=positive, start=first, lower=low, upper=high)

    def values(self, y: Array) -> Array:
        """Inputs (k,) of variables (k,)."""
        with np.errstate(over="ignore"):
            return np.asarray(self.sizes * np.where(self.positive, np.exp(y), y))

    def derivatives(self, y: Array) -> Array:
        """Derivatives (k,) of the inputs by the variables."""
        return np.asarray(np.where(self.positive, self.values(y), self.sizes))


def _limits(inputs: Sequence[Input], bounds: Bounds) -> tuple[Array, Array]:
    keys = [item.key for item in inputs]
    for key in bounds:
        if key not in keys:
            raise StudyError(f"bounds: no input {key!r}; there are {join_names(map(str, keys))}")
    lower, upper = [], []
    for item in inputs:
        low_bound, high_bound = bounds.get(item.key, (-np.inf, np.inf))
        low, high = np.full(len(item.value), low_bound), np.full(len(item.value), high_bound)
        if isinstance(item, PageArray):
            low, high = np.maximum(low, item.bounds[0]), np.minimum(high, item.bounds[1])
        lower.append(low)
        upper.append(high)
    return np.concatenate(lower), np.concatenate(upper)


_FAILED = (NotConverged, ArgumentError, ProblemError)
"""Ends of a trial after which the next one is nearer to the last that was solved."""
GAUSS_NEWTON, NEWTON = "gauss-newton", "newton"
"""Methods: SciPy's trust region with the Jacobian, and Newton's with second derivatives."""
_STEP = 1e-9
"""Of the inputs: length of a step after which the next one would be its square."""
_SPAN = 1e-9  # of the whole path: two steps that near are one
_RANK = 1e-12  # of the largest singular value: below, inputs are not determined


@dataclass(frozen=True, eq=False)
class Fit:
    """Inputs that fit measurements.

    Attributes
    ----------
    values : dict
        Input -> number or array.
    covariance : array (k, k)
        Of all components in order; inf where the measurements do not determine them. With the
        Jacobian J of the residuals over their deviations and the Hessian H of half the sum of their
        squares, s^2 H^-1 J^T J H^-1; Gauss-Newton takes J^T J for H, which leaves s^2 (J^T J)^-1.
        s is 1 if `sigma` was given, else s^2 is the sum of squares over m - k.
    residuals : array (m,)
        Results less measurements.
    evaluations : int
        Number of solutions of the study.
    result : Result
        The last solution.
    message : str
        Reason of the end.
    """

    values: dict[Key, float | Array]
    covariance: Array
    residuals: Array
    evaluations: int
    result: Result
    message: str

    def __repr__(self) -> str:
        """Summary in one line."""
        values = [
            f"{key} = {value:.6g}" if np.ndim(value) == 0 else f"{key}: {len(value)} values"  # type: ignore[arg-type]
            for key, value in self.values.items()
        ]
        worst = float(np.abs(self.residuals).max(initial=0.0))
        return (
            f"<Fit: {short_list(values)}; residuals up to {worst:.3g}; "
            f"{self.evaluations} evaluations>"
        )

    @property
    def deviations(self) -> Array:
        """Standard deviations (k,) of the components."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def standard_errors(self) -> dict[Key, float | Array]:
        """Standard deviations by input, as `values`."""
        errors: dict[Key, float | Array] = {}
        start = 0
        for key, value in self.values.items():
            part = self.deviations[start : start + np.size(value)]
            errors[key] = float(part[0]) if np.ndim(value) == 0 else part
            start += np.size(value)
        return errors


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Least squares of measurements: trials, data, their standard deviations (m,)."""

    trials: StudyEvaluations
    data: Measurements
    sigma: Array | None

    def fit(self, bounds: Bounds | None, max_evaluations: int, method: str) -> Fit:
        """The best inputs.  Raises StudyError, NotConverged for the start."""
        scale = SearchVariables.of(self.trials.inputs, bounds or {})
        self.residuals(self.trials.start)  # an error here is that of the study as it is given
        search = self._gauss_newton if method == GAUSS_NEWTON else self._newton
        y, message = search(scale, max_evaluations)
        values = scale.values(y)
        residuals, rates = self.residuals(values), scale.derivatives(y)
        J = self.jacobian(values) * rates
        curvature = None
        if method == NEWTON:
            curvature = J.T @ J + self._bend(values, residuals) * np.outer(rates, rates)
        covariance, remark = self._covariance(J, curvature, residuals, rates)
        return Fit(
            by_key(values, self.trials.inputs),
            covariance,
            residuals * self._scales(),
            self.trials.count,
            self.trials.solved(values)[-1],
            f"{message}{remark}",
        )

    def _gauss_newton(self, scale: SearchVariables, max_evaluations: int) -> tuple[Array, str]:
        """Variables (k,) by SciPy's trust region, and the reason of the end."""
        from scipy.optimize import least_squares  # late: slow to import

        def residuals(y: Array) -> Array:
            return self._tried(scale.values(y))

        def derivatives(y: Array) -> Array:
            return self.jacobian(scale.values(y)) * scale.derivatives(y)

        search: Any = least_squares(
            residuals,
            scale.start,
            derivatives,
            bounds=(scale.lower, scale.upper),
            ftol=1e-14,
            xtol=_STEP,
            gtol=None,
            max_nfev=max_evaluations,
        )
        if search.status == 0:
            raise _too_few(max_evaluations)
        return search.x, search.message

    def _newton(self, scale: SearchVariables, max_evaluations: int) -> tuple[Array, str]:
        """Variables (k,) by Newton's method, and the reason of the end."""

        def value(y: Array) -> float:
            residuals = self._tried(scale.values(y))
            return float(residuals @ residuals) / 2.0

        def derivatives(y: Array) -> tuple[Array, Array]:
            values, rates = scale.values(y), scale.derivatives(y)
            residuals, J = self.residuals(values), self.jacobian(values)
            gradient = J.T @ residuals
            H = J.T @ J + self._bend(values, residuals)
            bent = np.where(scale.positive, gradient * values, 0.0)
            return rates * gradient, H * np.outer(rates, rates) + np.diag(bent)

        minimum = minimise(
            value,
            derivatives,
            scale.start,
            bounds=(scale.lower, scale.upper),
            tolerance=_STEP,
            more=lambda: self.trials.count < max_evaluations,
        )
        if not minimum.converged:
            raise _too_few(max_evaluations)
        return minimum.y, "The last Newton step was below 1e-9 of the inputs."

    def _bend(self, values: Array, residuals: Array) -> Array:
        """Sum of residuals times their second derivatives by the inputs, (k, k)."""
        weights = residuals / self._scales()
        entries = zip(self._entries(values), weights.tolist(), strict=True)
        terms = [HessianTerm(tape, q, weight) for (tape, q), weight in entries]
        return hessian_products(terms, self.trials.inputs, np.eye(len(values)))

    def residuals(self, values: Array) -> Array:
        """Results less measurements, (m,), over their deviations or sizes."""
        values_of_all = [q.value(tape) for tape, q in self._entries(values)]
        return (np.array(values_of_all) - self.data.numbers) / self._scales()

    def jacobian(self, values: Array) -> Array:
        """Their derivatives, (m, k)."""
        return jacobian(self._entries(values), self.trials.inputs) / self._scales()[:, None]

    def _tried(self, values: Array) -> Array:
        try:
            return self.residuals(values)
        except _FAILED:
            return np.full(len(self.data.numbers), np.inf)

    def _scales(self) -> Array:
        if self.sigma is not None:
            return self.sigma
        size = float(np.abs(self.data.numbers).max())
        return np.full(len(self.data.numbers), size or 1.0)

    def _entries(self, values: Array) -> list[Entry]:
        """Quantities with the steps that end when they were measured.  Raises StudyError."""
        results = self.trials.solved(values)
        end_times = np.array([result.t for result in results])
        entries: list[Entry] = []
        for q, t in zip(self.data.quantities, self.data.times, strict=True):
            nearest = int(np.abs(end_times - t).argmin())
            tape = results[nearest].trail
            if tape is None or abs(end_times[nearest] - t) > _SPAN * max(
                abs(t), abs(end_times[-1])
            ):
                raise StudyError(
                    f"fit: the path has no step that ends at {t:g}, where was measured"
                )
            entries.append((tape, q))
        return entries

    def _covariance(
        self, J: Array, curvature: Array | None, residuals: Array, rates: Array
    ) -> tuple[Array, str]:
        """Covariance of the inputs by first-order propagation of the measurements' errors, (k, k).

        curvature: the Hessian H, None for J^T J. The inputs move by -H^-1 J^T e with errors e of
        the measurements: s^2 H^-1 J^T J H^-1, where s^2 is 1 with given deviations, else the
        variance of the residuals. rates: of the inputs by what J and H are taken by.
        """
        m, k = J.shape
        _, sizes, rows = np.linalg.svd(J, full_matrices=False)
        singular = m < k or sizes[-1] <= _RANK * sizes[0]
        if not singular and curvature is not None:
            stiff = np.linalg.eigvalsh((curvature + curvature.T) / 2.0)
            singular = stiff[0] <= _RANK**2 * stiff[-1]
        if singular:
            return np.full((k, k), np.inf), " What was measured does not determine all inputs."
        half = rows.T / sizes
        if curvature is not None:
            half = np.linalg.solve(curvature, rows.T * sizes)
        half = half * rates[:, None]
        scale = 1.0
        if self.sigma is None:
            scale = float(residuals @ residuals) / (m - k) if m > k else np.inf
        return scale * half @ half.T, ""


def _too_few(max_evaluations: int) -> StudyError:
    return StudyError(
        f"fit: {max_evaluations} trials were not enough: give most=..., or a better start"
    )


def fit(
    definition: ProblemDefinition,
    measured: Measured,
    *,
    by: By,
    bounds: Bounds | None = None,
    sigma: float | Array | None = None,
    max_evaluations: int = 100,
    method: Any = GAUSS_NEWTON,
    integrator: Any = None,
    arguments: Mapping[str, Any],
) -> Fit:
    """Fit inputs to measurements by least squares; see `Study.fit`."""
    if method not in (GAUSS_NEWTON, NEWTON):
        if integrator is not None or "dt" not in arguments:
            raise StudyError(f"fit: method = {method!r}, must be {GAUSS_NEWTON!r} or {NEWTON!r}")
        method, integrator = GAUSS_NEWTON, method
    if integrator is not None:
        arguments = {**arguments, "method": integrator}
    until = finite("until", arguments.get("until", 1.0))
    count = arguments.get("steps", 1)
    times = until * np.arange(1, count + 1) / count
    if "dt" in arguments:
        dt = arguments["dt"]
        times = dt * np.arange(1, round(until / dt) + 1)
    data = Measurements.read(measured, times)
    deviations = None if sigma is None else np.broadcast_to(sigma, data.numbers.shape).copy()
    trials = StudyEvaluations.by(definition, by, arguments)
    return LeastSquares(trials, data, deviations).fit(bounds, max_evaluations, method)
