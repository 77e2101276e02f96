"""A candidate: C that one generator wrote for one case, by one of its routes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.problem import Case, Elements, Result
from softehl.runtime.arrays import Array

ENTRY = """void bench_entry(
    ptrdiff_t n, const double *X, const double *u, const double *p, double *values,
    double *tangent)"""
"""The function that a candidate's C defines: `n` elements, one after another, in its own layout."""


@dataclass(frozen=True)
class Layout:
    """Element layout of a candidate: order of our nodes, doubles per node, tangent order.

    The driver packs before and unpacks after the clock: nobody pays for a foreign layout.
    """

    nodes: tuple[int, ...] = (0, 1, 2, 3)
    width: int = 2
    column_major: bool = False

    def pack(self, given: Elements) -> tuple[Array, Array]:
        """Coordinates (n, 4 * width) and displacements (n, 8) in this layout."""
        n, order = len(given), list(self.nodes)
        X = np.zeros((n, 4, self.width))
        X[:, :, :2] = given.coordinates.reshape(n, 4, 2)[:, order]
        u = given.displacements.reshape(n, 4, 2)[:, order]
        return X.reshape(n, -1), np.ascontiguousarray(u.reshape(n, 8))

    def unpack(self, values: Array, tangent: Array | None) -> Result:
        """A candidate's output in our order."""
        own = [2 * a + c for a in self.nodes for c in (0, 1)]
        back = np.argsort(own)
        if tangent is None:
            return Result(values[:, back], None)
        K = tangent.transpose(0, 2, 1) if self.column_major else tangent
        return Result(values[:, back], K[:, back][:, :, back])


@dataclass(frozen=True)
class Candidate:
    """C of one route: files by name, of which the .c ones are compiled, each on its own."""

    generator: str
    route: str
    case: Case
    derive_seconds: float
    files: Mapping[str, str]
    layout: Layout = Layout()
    own_flags: tuple[str, ...] = ()
    include: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Generator and route."""
        return f"{self.generator}, {self.route}"


Derivation = Callable[[Case, str], Candidate]
"""What a generator's module offers as `derive`: the candidate of a case by a named route."""


class Stopwatch:
    """CPU seconds of this process since it was made."""

    def __init__(self) -> None:
        self._start = time.process_time()

    def seconds(self) -> float:
        """Seconds until now."""
        return time.process_time() - self._start
