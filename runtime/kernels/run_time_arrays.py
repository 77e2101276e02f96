"""Run-time arrays of kernels, such as curves and weights of networks, as C reads them.

In C they stand behind the parameters of a call (`codegen/abi.py`): of each array its place, its
length and the place of its rate or 0, then the arrays and rates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array

ENTRIES = 3
"""Numbers of an array in front of all arrays."""


class ArrayDataError(SoftehlError, ValueError):
    """Error: the data of a run-time array do not fit; the message says what is allowed."""


class ArrayData(Protocol):
    """Data of a run-time array that a user gave."""

    @property
    def values(self) -> Array:
        """Numbers by which derivatives are taken, (k,): values of a curve, weights."""
        ...

    @property
    def numbers(self) -> Array:
        """The array as C reads it, (n,)."""
        ...

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest allowed `values`, (k,) each."""
        ...

    def slope(self) -> Array | None:
        """Derivatives (n, k) of `numbers` by `values`; None for the unit matrix."""
        ...

    def with_values(self, values: Array) -> ArrayData:
        """Return the data with other `values`."""
        ...


@dataclass(frozen=True)
class RunTimeArray:
    """An array that a kernel reads. kind: "table", "network", ...; options: what its page says."""

    name: str
    kind: str
    options: Mapping[str, Any] = field(default_factory=dict)


def require_equal_lengths(groups: Sequence[Sequence[str]], arrays: Mapping[str, ArrayData]) -> None:
    """Raise `ArrayDataError` where arrays of terms of one sum have different lengths."""
    for group in groups:
        lengths = {name: len(arrays[name].numbers) for name in group}
        if len(set(lengths.values())) > 1:
            text = ", ".join(f"{name} has {count}" for name, count in lengths.items())
            raise ArrayDataError(f"{text} terms: arrays of one sum have equal lengths")


def packed(
    parameters: Sequence[float] | Array,
    arrays: Sequence[Array],
    rates: Sequence[Array | None] | None = None,
) -> Array:
    """Parameters with arrays, and with the rates of those that move, as C reads them."""
    at = len(parameters) + ENTRIES * len(arrays)
    entries: list[float] = []
    parts: list[Array] = []
    for array, rate in zip(arrays, rates or [None] * len(arrays), strict=True):
        entries += [at, len(array), 0 if rate is None else at + len(array)]
        parts += [array] if rate is None else [array, rate]
        at += len(array) * (1 if rate is None else 2)
    return np.concatenate([np.asarray(parameters, dtype=np.float64), entries, *parts])


def unpacked(parameters: Array, count: int, arrays: int) -> list[Array]:
    """The arrays that stand behind `count` parameters."""
    entries = parameters[count : count + ENTRIES * arrays].astype(int).reshape(-1, ENTRIES)
    return [parameters[at : at + length] for at, length, _ in entries]


def is_packed(parameters: Array, count: int, arrays: int) -> bool:
    """True if arrays stand behind `count` parameters where they should."""
    head = count + ENTRIES * arrays
    if parameters.ndim != 1 or len(parameters) < head:
        return False
    entries = parameters[count:head].reshape(-1, ENTRIES)
    stops = [int(at + length * (2 if rate else 1)) for at, length, rate in entries]
    return max(stops, default=head) == len(parameters)
