"""Methods of a study that use derivatives: other values of inputs, objectives, fits."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.argument_checks import finite
from softehl.runtime.definition.problem_definition import Statement, StudyError
from softehl.runtime.equations.stability import UnstableState
from softehl.runtime.fit.jax_operation import Operation
from softehl.runtime.fit.least_squares import Fit, LeastSquares
from softehl.runtime.fit.measurements import Data, Measured
from softehl.runtime.fit.objective import Objective, Trials
from softehl.runtime.fit.scaling import Bounds
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity import input_parsing
from softehl.runtime.sensitivity.input_parsing import By
from softehl.runtime.sensitivity.inputs import Input, Key, varied
from softehl.runtime.sensitivity.quantities import quantity


class Solvable(Protocol):
    """A study: what was written down, and its paths."""

    mesh: Mesh
    _statement: Statement

    @property
    def solve(self) -> Callable[..., Result]:
        """See `Study`."""
        ...

    @property
    def march(self) -> Callable[..., Iterator[Result]]:
        """See `Study`."""
        ...


S = TypeVar("S", bound=Solvable)


class Fitted:
    """Base of `Study`: see there for the arguments of paths."""

    def varied(self: S, values: Mapping[Key, float | Array]) -> S:
        """Return a copy of the study with other values of inputs.

        Parameters
        ----------
        values : mapping
            Input -> value, {("rubber", "mu"): 0.5}; keys as of `Result.sensitivity`. A function of
            the study is multiplied by its value.

        Returns
        -------
        Study
            The copy.

        Raises
        ------
        StudyError
            The study has no such input, or a value has a wrong shape.
        """
        items = input_parsing.of_keys(self._statement, list(values))
        return _changed(
            self, [(i, _numbers(i, v)) for i, v in zip(items, values.values(), strict=True)]
        )

    def objective(
        self: Solvable,
        what: str | Callable[[Array], tuple[float, Array]],
        *,
        by: By,
        at: tuple[float, ...] | None = None,
        reaction: str | None = None,
        **path: Any,
    ) -> Objective:
        """Return a quantity as a function of inputs (k,), with its gradient.

        Optimisers of SciPy take it.

        Parameters
        ----------
        what : str or callable
            The quantity, as in `Result.sensitivity`.
        by : mapping
            The inputs, as in `Result.sensitivity`.
        at : tuple of float, optional
            As in `Result.sensitivity`.
        reaction : str, optional
            As in `Result.sensitivity`.
        **path
            Arguments of `solve`, or of `march` if there is a `dt`.

        Returns
        -------
        Objective
            Called with inputs (k,) it returns the value and its gradient (k,).

        Raises
        ------
        StudyError
            The study has no such input.
        """
        items = input_parsing.inputs(self._statement, by)
        return Objective(Trials(items, _Runner(self, path)), quantity(what, at, reaction))

    def in_jax(self: Solvable, *, by: By, **path: Any) -> Operation:
        """Return all unknowns as a function of inputs (k,), for JAX.

        Parameters
        ----------
        by : mapping
            The inputs, as in `Result.sensitivity`, one after the other; `start` of the operation
            has their values.
        **path
            Arguments of `solve`, or of `march` if there is a `dt`.

        Returns
        -------
        Operation
            Function (k,) -> (n,) with an adjoint for `jax.grad`.

        Raises
        ------
        StudyError
            The study has no such input.
        """
        return Operation(Trials(input_parsing.inputs(self._statement, by), _Runner(self, path)))

    def fit(
        self: Solvable,
        measured: Measured,
        *,
        by: By,
        bounds: Bounds | None = None,
        sigma: float | Array | None = None,
        most: int = 100,
        **path: Any,
    ) -> Fit:
        """Fit inputs to measurements by least squares, from their present values on.

        Parameters
        ----------
        measured : mapping
            {(48, 60): {"u_y": 12.4}, "left": {"u_x": 0.3}}: unknowns at places, reactions at sides.
            A number is measured at the end; a list has a number for each step; a mapping is
            {load factor or time: number}.
        by : mapping
            The inputs, as in `Result.sensitivity`.
        bounds : mapping, optional
            Input -> (lower, upper), {("rubber", "mu"): (0, 1)}. Positive parameters and data of
            pages stay positive, unless their bounds allow other values.
        sigma : float or array, optional
            Standard deviation of the measurements, one for all or one for each. Left out, all have
            the same weight, and the covariance follows from the residuals.
        most : int
            Largest number of evaluations.
        **path
            Arguments of `solve`, or of `march` if there is a `dt`.

        Returns
        -------
        Fit
            Values, their covariance, residuals, and the last result.

        Raises
        ------
        StudyError
            The study has no such input, or the path no step at the time of a measurement.
        NotConverged
            The study has no solution for the present values.
        """
        until = finite("until", path.get("until", 1.0))
        count = path.get("steps", 1)
        times = until * np.arange(1, count + 1) / count
        if "dt" in path:
            times = path["dt"] * np.arange(1, round(until / path["dt"]) + 1)
        data = Data.read(measured, times)
        scales = None if sigma is None else np.broadcast_to(sigma, data.numbers.shape).copy()
        trials = Trials(input_parsing.inputs(self._statement, by), _Runner(self, path))
        return LeastSquares(trials, data, scales).fit(bounds, most)


def _numbers(item: Input, value: object) -> Array:
    """Numbers of an input, one for all or one for each.  Raises StudyError."""
    words, n = f"varied({item.key!r}: ...)", item.value.size
    given = np.asarray(value)
    if given.dtype.kind not in "fiu":
        raise StudyError(
            f"{words}: a number is needed, which replaces a number of the study and multiplies a "
            f"function; given {type(value).__name__}; for another function write the study anew"
        )
    found = given.astype(np.float64)
    if found.size not in (1, n) or not np.isfinite(found).all():
        many = f", or {n} of them" if n > 1 else ""
        raise StudyError(f"{words}: one finite number{many} is needed; given {value!r}")
    return np.broadcast_to(found.ravel(), n).copy()


def _changed(study: S, changes: Sequence[tuple[Input, Array]]) -> S:
    """A copy of a study with other values of inputs."""
    statement, other = varied(study._statement, changes), copy(study)
    vars(other).update(mesh=statement.mesh, _statement=statement)
    return other


@dataclass(frozen=True, eq=False)
class _Runner:
    """Solves a study with other values of inputs; path: arguments of its path."""

    study: Solvable
    path: Mapping[str, Any]

    def __call__(self, changes: Sequence[tuple[Input, Array]]) -> list[Result]:
        """Results of all steps."""
        other, found = _changed(self.study, changes), list[Result]()
        given = {"progress": False, "record": True, **self.path}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnstableState)  # of values on the way
            if "dt" in self.path:
                return list(other.march(**given))
            other.solve(on_step=found.append, **given)
        return found
