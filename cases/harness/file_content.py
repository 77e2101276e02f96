"""Contents of the files of a run beside its tables: columns of numbers, fields on plane cells."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.io import write_columns, write_vtu


@dataclass(frozen=True, eq=False)
class Cells:
    """Four-node cells in the plane, or lines.

    points: (n, 2).  cells: (m, 4), counterclockwise node numbers, or (m, 2).
    point_data: name -> (n,) or (n, k).  cell_data: name -> (m,) or (m, k).
    """

    points: Array
    cells: Integers
    point_data: Mapping[str, Array] = field(default_factory=dict)
    cell_data: Mapping[str, Array] = field(default_factory=dict)


Content = Mapping[str, Array] | Cells
"""Columns of one length, for a .csv, or cells, for a .vtu."""


def file_digest(path: Path) -> str:
    """Digest of a file, 16 letters.  Raises OSError."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def write_content(path: Path, content: Content) -> None:
    """Write a file, atomically.  Raises OSError."""
    if isinstance(content, Cells):
        write_vtu(path, content.points, content.cells, content.point_data, content.cell_data)
    else:
        write_columns(path, content)
