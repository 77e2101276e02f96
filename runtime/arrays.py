"""Array types, named once; arrays that do not change; counts."""

from __future__ import annotations

from numbers import Integral
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]
A = TypeVar("A", bound=NDArray[Any])


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A copy that cannot be written to; the array itself where nobody can write to it already."""
    owner: object = array
    while type(owner) is np.ndarray and not owner.flags.writeable:
        owner = owner.base
    if owner is None:
        return array
    copied = np.array(array, subok=False)
    copied.setflags(write=False)
    return copied


def read_only(array: A) -> A:
    """A view that cannot be written to."""
    view = array.view()
    view.setflags(write=False)
    return view


def count_of(value: object) -> int | None:
    """A whole number of at least 1, NumPy's and SymPy's too; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        return None
    return int(value)
