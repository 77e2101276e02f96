"""Benchmark of an entry of the library: a published number and the function that computes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Benchmark:
    """A number of an element or law.

    entry: name in the library. problem: in words, with the mesh. published: the number, from
    `source` or in closed form. tolerance: relative to it; absolute if it is zero. run: computes it.
    slow: takes more than two seconds of CPU once its kernels are built.
    """

    entry: str
    problem: str
    published: float
    tolerance: float
    source: str
    run: Callable[[], float]
    slow: bool = False

    def error(self, value: float) -> float:
        """Relative error of a value."""
        return abs(value - self.published) / (abs(self.published) or 1.0)
