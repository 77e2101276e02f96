"""Data of run-time arrays of every kind, from what users give."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from softehl.runtime.kernels.networks import weights_of
from softehl.runtime.kernels.run_time_arrays import ArrayData, RunTimeArray
from softehl.runtime.kernels.tables import table_of
from softehl.runtime.kernels.terms import terms_of

KINDS: dict[str, Callable[[RunTimeArray, Any], ArrayData]] = {
    "table": table_of,
    "network": weights_of,
    "terms": terms_of,
}
"""Maker of the data of an array, by its kind in the manifest. They raise `ArrayDataError`."""


def data_of(array: RunTimeArray, value: object) -> ArrayData:
    """Data of an array from what a user gave.  Raises `ArrayDataError`."""
    return KINDS[array.kind](array, value)
