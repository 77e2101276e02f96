"""Kernels of target `ufcx` as machine code, and a distorted mesh of the meridian plane."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softehl.codegen import c_compiler, pipeline
from softehl.codegen.abi import Target, function_name
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import build, output_files
from softehl.runtime.arrays import Array, Integers

STRICT = ("-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wmissing-prototypes")
TENSOR = (0, 1, 3, 2)
"""Position in DOLFINx's tensor-product order of each corner, counterclockwise."""


@dataclass(frozen=True)
class CellKernels:
    """The functions of one family, called as DOLFINx calls them."""

    name: str
    library: Any

    def function(self, task: str) -> Any:
        return getattr(self.library, f"{function_name(self.name, task)}_ufcx")

    def address(self, task: str) -> int:
        """What a form of DOLFINx takes as its kernel."""
        address = ctypes.cast(self.function(task), ctypes.c_void_p).value
        assert address is not None
        return address

    def add(self, task: str, A: Array, w: Any, c: Any, vertices: Any) -> None:
        """Add one cell to `A`; what a cell does not have is NULL."""
        arrays = [np.ascontiguousarray(a, dtype=np.float64) for a in (w, c, vertices)]
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (A, *arrays)]
        self.function(task)(*pointers, None, None, None)


def cell_kernels(d: Definition, directory: Path, flags: Sequence[str] = ("-O0",)) -> CellKernels:
    """Compile the one file of target `ufcx`, alone, without a warning."""
    source = directory / f"{d.name}_ufcx.c"
    files = output_files.ufcx_files([pipeline.compile_model(d, Target.UFCX)])
    source.write_text(files[source.name], encoding="utf-8")
    library = source.with_suffix(".so")
    command = [
        *c_compiler.compiler(),
        *build.FLAGS,
        *STRICT,
        *flags,
        str(source),
        "-o",
        str(library),
    ]
    subprocess.run([*command, "-lm"], check=True)
    return CellKernels(d.name, ctypes.CDLL(str(library)))


@dataclass(frozen=True)
class Plane:
    """A mesh: `points` (nodes, 2) in (z, r), `cells` (n, 4) counterclockwise, a displacement."""

    points: Array
    cells: Integers
    motion: Array

    @property
    def dofs(self) -> Integers:
        """(n, 8): u_z, u_r of each node in turn."""
        out: Integers = (2 * self.cells[:, :, None] + np.arange(2)).reshape(len(self.cells), 8)
        return out


def distorted(rng: np.random.Generator, columns: int = 4, rows: int = 3) -> Plane:
    """A distorted grid at radius 20 mm, nodes numbered at random, and a motion with strains 0.1."""
    across = columns + 1
    grid = np.array([[i, j] for j in range(rows + 1) for i in range(across)], dtype=np.float64)
    points = grid * [0.5, 0.4] + rng.uniform(-0.08, 0.08, grid.shape) + [0.3, 20.0]
    corner = np.array([i + across * j for j in range(rows) for i in range(columns)])
    cells = np.column_stack([corner, corner + 1, corner + 1 + across, corner + across])
    number = rng.permutation(len(points))
    shuffled = np.empty_like(points)
    shuffled[number] = points
    centred = shuffled - shuffled.mean(axis=0)
    motion = centred @ rng.uniform(-0.1, 0.1, (2, 2)) + rng.uniform(-0.01, 0.01, points.shape)
    return Plane(shuffled, number[cells], motion)
