"""Objectives: quantities of a study as functions of its inputs, with their gradients."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softehl.runtime.analyses.load_stepping import solve
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.analyses.time_stepping import march
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.equations.stability import UnstableState
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity import input_parsing
from softehl.runtime.sensitivity.hessian import HessianTerm, hessian_products
from softehl.runtime.sensitivity.input_parsing import By
from softehl.runtime.sensitivity.inputs import Input, Key, varied_definition_of
from softehl.runtime.sensitivity.jacobian import jacobian
from softehl.runtime.sensitivity.quantities import Quantity, UserFunction, quantity
from softehl.runtime.suggestions import short_list


@dataclass(eq=False)
class StudyEvaluations:
    """Results of a study for values of its inputs, (k,); the latest are cached.

    arguments: of `solve`, or of `march` if there is a dt. count: how often the study was solved.
    """

    definition: ProblemDefinition
    inputs: Sequence[Input]
    arguments: Mapping[str, Any]
    count: int = 0
    results: list[Result] = field(default_factory=list)
    _cached_values: Array | None = None

    @classmethod
    def by(
        cls, definition: ProblemDefinition, by: By, arguments: Mapping[str, Any]
    ) -> StudyEvaluations:
        """Return the trials of a definition by inputs.  Raises StudyError."""
        return cls(definition, input_parsing.inputs(definition, by), arguments)

    @property
    def start(self) -> Array:
        """Components of the inputs as the study has them, (k,)."""
        return np.concatenate([item.value for item in self.inputs])

    def solved(self, values: Array) -> list[Result]:
        """Results of all steps."""
        if self._cached_values is None or not np.array_equal(self._cached_values, values):
            cuts = np.cumsum([len(item.value) for item in self.inputs])[:-1]
            parts = np.split(np.asarray(values, dtype=np.float64), cuts)
            self._cached_values, self.count = None, self.count + 1
            self.results = self._solve([*zip(self.inputs, parts, strict=True)])
            self._cached_values = np.array(values)
        return self.results

    def _solve(self, changes: Sequence[tuple[Input, Array]]) -> list[Result]:
        """Results of all steps with other values of inputs."""
        definition, results = varied_definition_of(self.definition, changes), list[Result]()
        keywords = {"progress": False, "record": True, **self.arguments}
        options, arguments = SolverOptions.split(keywords)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnstableState)  # of values between
            if "dt" in arguments:
                return list(march(definition, options=options, **arguments))
            solve(definition, on_step=results.append, options=options, **arguments)
        return results


@dataclass(frozen=True, eq=False)
class Objective:
    """Quantity as a function of inputs (k,), which returns its value and its gradient (k,).

    `scipy.optimize.minimize(objective, objective.start, jac=True)` takes it, and with
    `hess=objective.hessian` or `hessp=objective.hessian_product` methods of second order.

    Attributes
    ----------
    trials : object
        The study, solved for values of inputs.
    quantity : object
        The quantity.
    """

    trials: StudyEvaluations
    quantity: Quantity

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Objective: {type(self.quantity).__name__} by {short_list(map(str, self._keys))}>"

    @property
    def _keys(self) -> list[Key]:
        return [item.key for item in self.trials.inputs]

    @property
    def start(self) -> Array:
        """Inputs as the study has them, (k,)."""
        return self.trials.start

    def __call__(self, values: Array) -> tuple[float, Array]:
        """Return value and gradient.

        Parameters
        ----------
        values : array (k,)
            Values of the inputs.

        Returns
        -------
        value : float
            The quantity.
        gradient : array (k,)
            Its derivatives.

        Raises
        ------
        NotConverged
            The study has no solution for these values.
        """
        tape = self.trials.solved(np.asarray(values, dtype=np.float64))[-1].trail
        assert tape is not None
        row = jacobian([(tape, self.quantity)], self.trials.inputs)[0]
        return self.quantity.value(tape), row

    def hessian(self, values: Array) -> Array:
        """Return the second derivatives.

        Parameters
        ----------
        values : array (k,)
            Values of the inputs.

        Returns
        -------
        array (k, k)
            Second derivatives; see `Result.hessian`.

        Raises
        ------
        NotConverged
            The study has no solution for these values.
        """
        return self._products(values, np.eye(len(self.start)))

    def hessian_product(self, values: Array, direction: Array) -> Array:
        """Return the second derivatives times a direction; two linear solutions a step.

        Parameters
        ----------
        values : array (k,)
            Values of the inputs.
        direction : array (k,)
            The direction.

        Returns
        -------
        array (k,)
            The product.

        Raises
        ------
        NotConverged
            The study has no solution for these values.
        """
        along = np.asarray(direction, dtype=np.float64)
        return np.asarray(self._products(values, along[:, None])[:, 0])

    def _products(self, values: Array, directions: Array) -> Array:
        tape = self.trials.solved(np.asarray(values, dtype=np.float64))[-1].trail
        assert tape is not None
        return hessian_products([HessianTerm(tape, self.quantity)], self.trials.inputs, directions)


def objective(
    definition: ProblemDefinition,
    what: str | UserFunction,
    *,
    by: By,
    at: tuple[float, ...] | str | None = None,
    reaction: str | None = None,
    arguments: Mapping[str, Any],
) -> Objective:
    """Return a quantity as a function of inputs; see `Study.objective`."""
    return Objective(StudyEvaluations.by(definition, by, arguments), quantity(what, at, reaction))


def varied_definition(
    definition: ProblemDefinition, values: Mapping[Key, float | Array]
) -> ProblemDefinition:
    """Return a copy of a definition with other values of inputs; see `Study.varied`."""
    inputs = input_parsing.inputs_of_keys(definition, list(values))
    changes = [(i, _numbers(i, v)) for i, v in zip(inputs, values.values(), strict=True)]
    return varied_definition_of(definition, changes)


def _numbers(item: Input, value: object) -> Array:
    """Numbers of an input, one for all or one for each.  Raises StudyError."""
    context, n = f"varied({item.key!r}: ...)", item.value.size
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise StudyError(
            f"{context}: a number is needed, which replaces a number of the study and multiplies a "
            f"function; given {type(value).__name__}; for another function write the study anew"
        )
    numbers = array.astype(np.float64)
    if numbers.size not in (1, n) or not np.isfinite(numbers).all():
        many = f", or {n} of them" if n > 1 else ""
        raise StudyError(f"{context}: one finite number{many} is needed; given {value!r}")
    return np.broadcast_to(numbers.ravel(), n).copy()
