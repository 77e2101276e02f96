"""Measurements as they are given: at places, of reactions, at the end or along a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.sensitivity.quantities import AtPlace, Quantity, Reaction

Measured: TypeAlias = Mapping[Any, Mapping[str, Any]]
"""A place (x, y), or a side for its reactions -> unknown -> a number, one for each step, or
{time or load factor: number}."""


@dataclass(frozen=True, eq=False)
class Data:
    """Measurements: quantities, their numbers (m,), and the time or load factor of each, (m,)."""

    quantities: list[Quantity]
    numbers: Array
    times: Array

    @classmethod
    def read(cls, measured: Measured, times: Array) -> Data:
        """As they were given; a list has a number for each of the times.  Raises StudyError."""
        found: list[tuple[Quantity, float, float]] = []
        if not isinstance(measured, Mapping) or not measured:
            raise StudyError('measured: a mapping is needed, {(48, 60): {"u_y": 12.4}}')
        for place, values in measured.items():
            if not isinstance(values, Mapping) or not values:
                raise StudyError(f'measured at {place!r}: give unknowns, {{"u_y": 12.4}}')
            for name, given in values.items():
                made = Reaction(name, place) if isinstance(place, str) else _at(name, place)
                words = f"measured at {place!r}: {name}"
                found += [(made, v, t) for t, v in _series(words, given, times)]
        quantities, numbers, places = zip(*found, strict=True)
        return cls([*quantities], np.array(numbers), np.array(places))


def _series(words: str, given: Any, times: Array) -> list[tuple[float, float]]:
    """Times and numbers.  Raises StudyError."""
    if isinstance(given, Mapping):
        pairs = [(float(t), float(v)) for t, v in given.items()]
    else:
        if isinstance(given, np.ma.MaskedArray):
            raise StudyError(f"{words} is a masked array: give {{t: number}} of what was measured")
        row = np.asarray(given, dtype=np.float64)
        if row.ndim and row.shape != times.shape:
            raise StudyError(
                f"{words} has {len(row)} numbers and the path {len(times)} steps: give one for "
                "each, or {t: number}, or one number for the last"
            )
        ends = times if row.ndim else times[-1:]
        pairs = [*zip(ends.tolist(), np.atleast_1d(row).tolist(), strict=True)]
    if not pairs or not np.isfinite(pairs).all():
        raise StudyError(f"{words} must be finite numbers")
    return pairs


def _at(name: str, place: Any) -> AtPlace:
    try:
        return AtPlace(name, tuple(float(c) for c in place))
    except (TypeError, ValueError):
        raise StudyError(
            f"measured at {place!r}: a place is a tuple of numbers, a side is a name"
        ) from None
