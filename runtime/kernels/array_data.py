"""Data of run-time arrays of every kind, from what users give.

Tables and networks have modules of their own; numbers of terms (`Model.array`: branches of a Prony
series, fibres, slip systems) are here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.networks import weights_of
from softehl.runtime.kernels.run_time_arrays import ArrayData, ArrayDataError, RunTimeArray
from softehl.runtime.kernels.tables import table_of


@dataclass(frozen=True, eq=False)
class TermValues:
    """One number for each term."""

    values: Array

    @property
    def numbers(self) -> Array:
        """As C reads them."""
        return self.values

    @property
    def bounds(self) -> tuple[Array, Array]:
        """None."""
        return np.full(len(self.values), -np.inf), np.full(len(self.values), np.inf)

    def slope(self) -> None:
        """The unit matrix."""

    def with_values(self, values: Array) -> TermValues:
        """Other numbers."""
        return TermValues(np.array(values, dtype=np.float64))


def terms_of(array: RunTimeArray, value: Any) -> TermValues:
    """Numbers that a user gave.  Raises `ArrayDataError`."""
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.array(np.nan)
    if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
        raise ArrayDataError(
            f"one finite number for each term is needed, as in {array.name}=[0.3, 0.2, 0.1]; given "
            f"{value!r}"
        )
    return TermValues(numbers)


KINDS: dict[str, Callable[[RunTimeArray, Any], ArrayData]] = {
    "table": table_of,
    "network": weights_of,
    "terms": terms_of,
}
"""Maker of the data of an array, by its kind in the manifest. They raise `ArrayDataError`."""


def data_of(array: RunTimeArray, value: object) -> ArrayData:
    """Data of an array from what a user gave.  Raises `ArrayDataError`."""
    return KINDS[array.kind](array, value)
