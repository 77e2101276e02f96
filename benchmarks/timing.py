"""The clock: every candidate in turn, again and again, over the same elements in cache."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.candidate import Layout
from benchmarks.compiling import COMMON_FLAGS, Compiler
from benchmarks.problem import Case, Elements, Result
from softehl.runtime.arrays import Array

POINTER = ctypes.c_void_p
Key = tuple[int, str]


@dataclass(frozen=True)
class Loaded:
    """A compiled candidate with its own arrays, in its own layout."""

    function: Any
    layout: Layout
    coordinates: Array
    displacements: Array
    parameters: Array
    values: Array
    tangent: Array
    with_tangent: bool

    @classmethod
    def make(cls, function: Any, layout: Layout, case: Case, given: Elements) -> Loaded:
        """Arrays for the elements; the output starts as not-a-number."""
        X, u = layout.pack(given)
        values, tangent = np.full((len(given), 8), np.nan), np.full((len(given), 8, 8), np.nan)
        return cls(function, layout, X, u, given.parameters, values, tangent, case.tangent)

    def arguments(self) -> list[Any]:
        """n and the five pointers."""
        arrays = (
            self.coordinates,
            self.displacements,
            self.parameters,
            self.values,
            self.tangent,
        )
        return [ctypes.c_ssize_t(len(self.values)), *(POINTER(a.ctypes.data) for a in arrays)]

    def run(self) -> Result:
        """One call, in our order."""
        self.function(*self.arguments())
        return self.layout.unpack(self.values, self.tangent if self.with_tangent else None)


class Driver:
    """The C loop that calls a kernel, compiled once into `folder`."""

    def __init__(self, folder: Path, compiler: Compiler) -> None:
        target = folder / "driver.so"
        source = Path(__file__).resolve().with_name("driver.c")
        compiler.library([source], target, COMMON_FLAGS)
        library = ctypes.CDLL(str(target))
        self._seconds = library.bench_seconds
        self._seconds.restype = ctypes.c_double
        self._peak = library.bench_peak
        self._peak.restype = ctypes.c_double

    def seconds(self, loaded: Loaded, repeats: int) -> float:
        """Thread CPU seconds of one call over all elements, mean of `repeats`."""
        total = self._seconds(loaded.function, ctypes.c_ssize_t(repeats), *loaded.arguments())
        return float(total) / repeats

    def peak(self, steps: int) -> float:
        """Multiply-add operations per second of this core."""
        start, sink = np.array([1.0, 0.999, 1e-3]), np.zeros(16)
        sink = sink[-(sink.ctypes.data // 8) % 8 :]  # on a cache line
        pointers = (POINTER(start.ctypes.data), POINTER(sink.ctypes.data))
        return float(self._peak(ctypes.c_ssize_t(steps), *pointers))

    def rounds(
        self, entries: Mapping[Key, Loaded], rounds: int, sample: float = 1e-3
    ) -> tuple[dict[Key, Array], Array]:
        """Seconds per call of each entry (rounds,), and the peak measured in the same rounds.

        A sample lasts about `sample` seconds.  The order turns from round to round, so that
        nobody always follows the same neighbour.
        """
        repeats = {k: max(1, round(sample / self.seconds(v, 1))) for k, v in entries.items()}
        times: dict[Key, list[float]] = {key: [] for key in entries}
        peaks, order = [], list(entries)
        for _ in range(rounds):
            order = [*order[1:], order[0]]
            for key in order:
                times[key].append(self.seconds(entries[key], repeats[key]))
            peaks.append(self.peak(400_000))
        return {key: np.array(t) for key, t in times.items()}, np.array(peaks)
