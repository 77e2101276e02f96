"""Arguments of elements that move with an input, and by how much."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array, Integers


@dataclass(frozen=True, eq=False)
class Column:
    """An argument of the elements of a block that moves with an input.

    column: among coordinates, data and parameters; of a load, coordinates and its amount. target:
    (n,) component of the input, -1 for elements that do not move. factor: (n,) rates.
    """

    block: str
    column: int
    target: Integers
    factor: Array

    def push(self, rows: Array, seed: Array) -> None:
        """Add the rate of the argument to rows (n, width) when the input moves by seed."""
        there = self.target >= 0
        rows[there, self.column] += self.factor[there] * seed[self.target[there]]

    def pull(self, gradient: Array, slopes: Array) -> None:
        """Add to the gradient what the slopes (n,) by the argument make of it."""
        there = self.target >= 0
        np.add.at(gradient, self.target[there], self.factor[there] * slopes[there])


@dataclass(frozen=True, eq=False)
class Held:
    """Prescribed values that move with an input.

    numbers: (m,) unknowns. target, factor: (m,), as of `Column`.
    """

    numbers: Integers
    target: Integers
    factor: Array


@dataclass(frozen=True, eq=False)
class Moves:
    """All that moves with an input in one step."""

    columns: Sequence[Column] = field(default=())
    held: Sequence[Held] = field(default=())
