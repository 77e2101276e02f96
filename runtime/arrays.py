"""Array types, named once, and counts."""

from __future__ import annotations

from numbers import Integral
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]


def count_of(value: object) -> int | None:
    """A whole number of at least 1, NumPy's and SymPy's too; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        return None
    return int(value)
