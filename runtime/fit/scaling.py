"""Variables in which inputs are searched, and their bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.sensitivity.inputs import Input, Key, PageDatum, PageParameter
from softehl.runtime.suggestions import listed

Bounds: TypeAlias = Mapping[Key, tuple[float, float]]


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
