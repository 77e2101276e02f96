"""Content of a mesh file, before it is a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from softehl.runtime.arrays import Array, Integers


@dataclass(frozen=True)
class Content:
    """Content of a file: points (n, 3); kind -> cells (m, k), each once; name -> kind -> numbers of
    cells of that kind, rising. tags: (n,) numbers of the points in the file, if it has some.
    sides: name -> kind -> faces (m, k) that are no cells of the file.
    """

    points: Array
    cells: Mapping[str, Integers]
    names: Mapping[str, Mapping[str, Integers]]
    tags: Integers | None = None
    sides: Mapping[str, Mapping[str, Integers]] = field(default_factory=dict)
