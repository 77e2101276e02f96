"""Numbers of terms (`Model.array`): branches of a Prony series, fibres, slip systems."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.run_time_arrays import ArrayDataError, RunTimeArray


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
