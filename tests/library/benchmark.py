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

    @property
    def key(self) -> str:
        """Name of the number."""
        return f"{self.entry}: {self.problem}"

    def error(self, value: float) -> float:
        """Relative error of a value."""
        return abs(value - self.published) / (abs(self.published) or 1.0)


@dataclass(frozen=True)
class Convergence:
    """A number of an element on finer and finer meshes.

    published: the limit, from `source`. tolerance: relative, of the finest mesh. run: computes the
    number with so many cells a side. sizes: numbers of cells.
    """

    entry: str
    problem: str
    published: float
    tolerance: float
    source: str
    run: Callable[[int], float]
    sizes: tuple[int, ...] = (4, 8, 16, 32)

    def key(self, size: int) -> str:
        """Name of one of the numbers."""
        return f"{self.entry}: {self.problem}: {size} x {size}"
