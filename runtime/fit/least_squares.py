"""Least squares by SciPy's trust region with the exact Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.fit.measurements import Data
from softehl.runtime.fit.objective import Trials
from softehl.runtime.fit.scaling import Bounds, Scale
from softehl.runtime.kernels.kernel_call import ArgumentError
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.inputs import Key
from softehl.runtime.sensitivity.jacobian import Entry, by_key, jacobian
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.suggestions import few

_FAILED = (NotConverged, ArgumentError, ProblemError)
"""Ends of a trial after which the next one is nearer to the last that was solved."""
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
        Of all components in order; inf where the measurements do not determine them.
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
        return f"<Fit: {few(values)}; residuals up to {worst:.3g}; {self.evaluations} evaluations>"

    @property
    def deviations(self) -> Array:
        """Standard deviations (k,) of the components."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Least squares of measurements: trials, data, their standard deviations (m,)."""

    trials: Trials
    data: Data
    sigma: Array | None

    def fit(self, bounds: Bounds | None, most: int) -> Fit:
        """The best inputs.  Raises StudyError, NotConverged for the start."""
        scale = Scale.of(self.trials.inputs, bounds or {})
        self.residuals(self.trials.start)  # an error here is that of the study as it is given

        def residuals(y: Array) -> Array:
            return self._tried(scale.values(y))

        def slopes(y: Array) -> Array:
            return self.jacobian(scale.values(y)) * scale.slopes(y)

        found: Any = least_squares(
            residuals,
            scale.start,
            slopes,
            bounds=(scale.lower, scale.upper),
            ftol=1e-14,
            xtol=1e-9,  # the step after it would be its square
            gtol=None,
            max_nfev=most,
        )
        if found.status == 0:
            raise StudyError(
                f"fit: {most} trials were not enough: give most=..., or a better start"
            )
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
        found = [q.value(trail) for trail, q in self._entries(values)]
        return (np.array(found) - self.data.numbers) / self._scales()

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
        ends = np.array([result.t for result in results])
        found: list[Entry] = []
        for q, t in zip(self.data.quantities, self.data.times, strict=True):
            near = int(np.abs(ends - t).argmin())
            trail = results[near].trail
            if trail is None or abs(ends[near] - t) > _SPAN * max(abs(t), abs(ends[-1])):
                raise StudyError(
                    f"fit: the path has no step that ends at {t:g}, where was measured"
                )
            found.append((trail, q))
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
