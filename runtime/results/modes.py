"""Natural modes: frequencies and shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.suggestions import short_list

if TYPE_CHECKING:
    from softehl.runtime.results.result import ModeShape, Result


@dataclass(frozen=True, eq=False)
class Modes:
    """Natural modes about a state, the lowest first; a sequence of their shapes.

    Attributes
    ----------
    squares : array (k,)
        Squares of the angular frequencies [1/s^2]; negative in unstable directions.
    shapes : tuple of ModeShape
        A Result for each, whose unknowns are the mode, of unit modal mass.
    """

    squares: Array
    shapes: tuple[ModeShape, ...]

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Modes: frequencies {short_list(f'{f:.6g}' for f in self.frequencies)}>"

    @property
    def frequencies(self) -> Array:
        """Frequencies (k,) [1/s]; nan in unstable directions."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(self.squares) / (2.0 * np.pi))

    def __len__(self) -> int:
        return len(self.shapes)

    def __getitem__(self, number: int) -> Result:
        return self.shapes[number]

    def __iter__(self) -> Iterator[Result]:
        return iter(self.shapes)
