"""A study solved for values of its inputs, and quantities of it as functions of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.inputs import Input, Key
from softehl.runtime.sensitivity.jacobian import jacobian
from softehl.runtime.sensitivity.quantities import Quantity
from softehl.runtime.suggestions import few

Run: TypeAlias = Callable[[Sequence[tuple[Input, Array]]], list[Result]]
"""The results of all steps with other values of inputs."""


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
    """Quantity as a function of inputs (k,), which returns its value and its gradient (k,).

    `scipy.optimize.minimize(objective, objective.start, jac=True)` takes it.

    Attributes
    ----------
    trials : object
        The study, solved for values of inputs.
    quantity : object
        The quantity.
    """

    trials: Trials
    quantity: Quantity

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Objective: {type(self.quantity).__name__} by {few(map(str, self._keys))}>"

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
        trail = self.trials.solved(np.asarray(values, dtype=np.float64))[-1].trail
        assert trail is not None
        row = jacobian([(trail, self.quantity)], self.trials.inputs)[0]
        return self.quantity.value(trail), row
