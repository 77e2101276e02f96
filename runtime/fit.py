"""Inputs of a study that make its results what was measured, and functions for optimisers.

Least squares by SciPy's trust region with the exact Jacobian.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from scipy.optimize import least_squares

from softehl.runtime.arrays import Array, Flags
from softehl.runtime.calls import ArgumentError
from softehl.runtime.derivatives.inputs import Input, Key, PageDatum, PageParameter
from softehl.runtime.derivatives.quantities import AtPlace, Quantity, Reaction
from softehl.runtime.derivatives.results import by_key, jacobian
from softehl.runtime.fem.checks import ProblemError
from softehl.runtime.names import listed
from softehl.runtime.result import Result
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.statement.records import StudyError

Measured: TypeAlias = Mapping[Any, Mapping[str, Any]]
"""A place (x, y), or a side for its reactions -> unknown -> a number, or one for each step."""
Bounds: TypeAlias = Mapping[Key, tuple[float, float]]
Run: TypeAlias = Callable[[Sequence[tuple[Input, Array]]], list[Result]]
"""The results of all steps with other values of inputs."""

_FAILED = (NotConverged, ArgumentError, ProblemError)
"""What a trial may end with: the next one is nearer to the last that was solved."""
_SPAN = 1e-9  # of the whole path: two steps that near are one
_RANK = 1e-12  # of the largest singular value: below, inputs are not determined


@dataclass(frozen=True, eq=False)
class Fit:
    """Inputs that were found.

    values: numbers or arrays. covariance: (k, k) of all components in order, inf where the
    measurements do not determine them. residuals: (m,) results less measurements. evaluations: how
    often the study was solved. result: the last one. message: why it ended.
    """

    values: dict[Key, float | Array]
    covariance: Array
    residuals: Array
    evaluations: int
    result: Result
    message: str

    @property
    def deviations(self) -> Array:
        """Standard deviations (k,) of the components."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(eq=False)
class Trials:
    """A study solved for values of its inputs, (k,); the latest is remembered."""

    inputs: Sequence[Input]
    run: Run
    count: int = 0
    _at: Array | None = None
    results: list[Result] = field(default_factory=list)

    @property
    def start(self) -> Array:
        """Components of the inputs as the study has them, (k,)."""
        return np.concatenate([item.value for item in self.inputs])

    def solved(self, values: Array) -> list[Result]:
        """Results of all steps."""
        if self._at is None or not np.array_equal(self._at, values):
            cuts = np.cumsum([len(item.value) for item in self.inputs])[:-1]
            parts = np.split(np.asarray(values, dtype=np.float64), cuts)
            self._at, self.count = None, self.count + 1
            self.results = self.run([*zip(self.inputs, parts, strict=True)])
            self._at = np.array(values)
        return self.results


@dataclass(frozen=True, eq=False)
class Objective:
    """A quantity as a function of inputs (k,) that gives its value and its gradient (k,).

    This is what `scipy.optimize.minimize(objective, objective.start, jac=True)` takes.
    """

    trials: Trials
    quantity: Quantity

    @property
    def start(self) -> Array:
        """Inputs as the study has them, (k,)."""
        return self.trials.start

    def __call__(self, values: Array) -> tuple[float, Array]:
        """Value and gradient.  Raises NotConverged."""
        trail = self.trials.solved(np.asarray(values, dtype=np.float64))[-1].trail
        assert trail is not None
        row = jacobian([(trail, self.quantity)], self.trials.inputs)[0]
        return self.quantity.value(trail), row


@dataclass(frozen=True, eq=False)
class Data:
    """Measurements: quantities, their numbers (m,), and the step of each, 1 to `steps`."""

    quantities: list[Quantity]
    numbers: Array
    steps: list[int]

    @classmethod
    def read(cls, measured: Measured, steps: int) -> Data:
        """As they were given; a single number is one of the last step.  Raises StudyError."""
        found: list[tuple[Quantity, float, int]] = []
        if not isinstance(measured, Mapping) or not measured:
            raise StudyError('measured: a mapping is needed, {(48, 60): {"u_y": 12.4}}')
        for place, values in measured.items():
            if not isinstance(values, Mapping) or not values:
                raise StudyError(f'measured at {place!r}: give unknowns, {{"u_y": 12.4}}')
            for name, given in values.items():
                made = Reaction(name, place) if isinstance(place, str) else _at(name, place)
                row = np.asarray(given, dtype=np.float64)
                if not np.isfinite(row).all():
                    raise StudyError(f"measured at {place!r}: {name} must be finite numbers")
                if row.ndim and row.shape != (steps,):
                    raise StudyError(
                        f"measured at {place!r}: {name} has {len(row)} numbers, and there are "
                        f"{steps} steps: give one for each, or one number for the last"
                    )
                known = [(float(v), n) for n, v in enumerate(np.atleast_1d(row), 1)]
                found += [(made, v, n if row.ndim else steps) for v, n in known]
        quantities, numbers, places = zip(*found, strict=True)
        return cls([*quantities], np.array(numbers), [*places])


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Least squares of measurements: trials, data, load factors or times of steps, deviations."""

    trials: Trials
    data: Data
    times: Array
    sigma: Array | None

    def fit(self, bounds: Bounds | None, most: int) -> Fit:
        """The best inputs.  Raises StudyError, NotConverged for the start."""
        scale = Scale.of(self.trials.inputs, bounds or {})
        self.residuals(self.trials.start)  # an error here is that of the study as it is given
        found = least_squares(
            lambda y: self._tried(scale.values(y)),
            scale.start,
            lambda y: self.jacobian(scale.values(y)) * scale.slopes(y),
            bounds=(scale.lower, scale.upper),
            ftol=1e-14,
            xtol=1e-9,  # the step after it would be its square
            gtol=None,
            max_nfev=most,
        )
        if found.status == 0:
            raise StudyError(f"fit: {most} trials were not enough: give most=..., or a better start")
        values = scale.values(found.x)
        last = self.trials.solved(values)[-1]
        covariance, words = self._covariance(found.jac, found.fun, scale.slopes(found.x))
        return Fit(
            by_key(values, self.trials.inputs),
            covariance,
            found.fun * self._scales(),
            self.trials.count,
            last,
            f"{found.message}{words}",
        )

    def residuals(self, values: Array) -> Array:
        """Results less measurements, (m,), over their deviations or sizes."""
        steps = self._steps(self.trials.solved(values))
        found = [
            q.value(_trail(steps[n]))
            for q, n in zip(self.data.quantities, self.data.steps, strict=True)
        ]
        return (np.array(found) - self.data.numbers) / self._scales()

    def jacobian(self, values: Array) -> Array:
        """Their derivatives, (m, k)."""
        steps = self._steps(self.trials.solved(values))
        entries = [
            (_trail(steps[n]), q)
            for q, n in zip(self.data.quantities, self.data.steps, strict=True)
        ]
        return jacobian(entries, self.trials.inputs) / self._scales()[:, None]

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

    def _steps(self, results: list[Result]) -> dict[int, Result]:
        """Number of a step -> the result that ends there.  Raises StudyError."""
        found, span = {}, _SPAN * float(np.abs(self.times).max())
        for n in set(self.data.steps):
            here = [r for r in results if abs(r.t - self.times[n - 1]) <= span]
            if not here:
                raise StudyError(f"fit: the path has no step that ends at {self.times[n - 1]:g}")
            found[n] = here[-1]
        return found

    def _covariance(self, J: Array, residuals: Array, slopes: Array) -> tuple[Array, str]:
        """Inverse of J^T J, times the variance of the residuals if no deviations were given.

        slopes: of the inputs by what J is taken by.
        """
        m, k = J.shape
        _, sizes, rows = np.linalg.svd(J, full_matrices=False)
        if m < k or sizes[-1] <= _RANK * sizes[0]:
            return np.full((k, k), np.inf), " What was measured does not determine all inputs."
        half = (rows.T / sizes) * slopes[:, None]
        scale = 1.0
        if self.sigma is None:
            scale = float(residuals @ residuals) / (m - k) if m > k else np.inf
        return scale * half @ half.T, ""


@dataclass(frozen=True, eq=False)
class Scale:
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
    def of(cls, inputs: Sequence[Input], bounds: Bounds) -> Scale:
        """Raises StudyError for bounds of other inputs, or without the start between them."""
        start = np.concatenate([item.value for item in inputs])
        lower, upper = _limits(inputs, bounds)
        if (start < lower).any() or (start > upper).any() or (lower >= upper).any():
            raise StudyError("bounds: give (least, largest) with the value in the study between")
        stiff = [
            np.full(len(item.value), isinstance(item, PageParameter | PageDatum)) for item in inputs
        ]
        positive = np.concatenate(stiff) & (start > 0.0) & ((lower >= 0.0) | (lower == -np.inf))
        sizes = np.where(start == 0.0, 1.0, np.abs(start))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = [
                np.where(positive, np.log(np.maximum(v, 0.0) / sizes), v / sizes)
                for v in (start, lower, upper)
            ]
        return cls(sizes, positive, *found)

    def values(self, y: Array) -> Array:
        """Inputs (k,) of variables (k,)."""
        with np.errstate(over="ignore"):
            return np.asarray(self.sizes * np.where(self.positive, np.exp(y), y))

    def slopes(self, y: Array) -> Array:
        """Derivatives (k,) of the inputs by the variables."""
        return np.asarray(np.where(self.positive, self.values(y), self.sizes))


def _trail(result: Result) -> Any:
    return result.trail


def _at(name: str, place: Any) -> AtPlace:
    try:
        return AtPlace(name, tuple(float(c) for c in place))
    except (TypeError, ValueError):
        raise StudyError(
            f"measured at {place!r}: a place is a tuple of numbers, a side is a name"
        ) from None


def _limits(inputs: Sequence[Input], bounds: Bounds) -> tuple[Array, Array]:
    keys = [item.key for item in inputs]
    for key in bounds:
        if key not in keys:
            raise StudyError(f"bounds: no input {key!r}; there are {listed(map(str, keys))}")
    pairs = [bounds.get(item.key, (-np.inf, np.inf)) for item in inputs]
    sizes = [len(item.value) for item in inputs]
    lower, upper = (
        np.concatenate([np.full(n, pair[side]) for n, pair in zip(sizes, pairs, strict=True)])
        for side in (0, 1)
    )
    return lower, upper
