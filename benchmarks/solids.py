"""Residual and tangent of a neo-Hookean cell beside FFCx, in one run.

    python -m benchmarks.solids PYTHON [CELL ...]

PYTHON is that of an environment with FFCx (`pip install fenics-ffcx`). Both have the same energy,
nodes and quadrature, and are called in turn on the same 256 distorted and deformed elements, least
of many calls. FFCx is compiled with -O3 -march=native -ffast-math, softehl with its own flags.
Values that differ by more than 1e-10 of the largest entry are an error.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import re
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ffcx_route, forms
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS

ROUTE = Path(__file__).with_name("ffcx_solid.py")
FLAGS = ("-std=c17", "-O3", "-march=native", "-ffast-math", "-fPIC", "-shared")
DEGREES = {"quad4": 3, "quad9": 5, "hex8": 3, "hex27": 5, "tet4": 1, "tet10": 2}
HEAD = """\
| cell | both, ns | FFCx: residual, ns | tangent, ns | ratio | of tangent | built in s | FFCx, s |
|---|---|---|---|---|---|---|---|"""
_ENTRY = """
#include <stddef.h>
#include <string.h>
void run_{task}(ptrdiff_t n, const double *X, const double *u, const double *c, double *A)
{{
    for (ptrdiff_t e = 0; e < n; ++e) {{
        memset(A + {entries} * e, 0, {entries} * sizeof *A);
        {name}(A + {entries} * e, u + {size} * e, c, X + {coordinates} * e, 0, 0, 0);
    }}
}}
"""


@dataclass(frozen=True)
class Theirs:
    """FFCx's kernels of a cell. order: our node at each of theirs; seconds: derive, compile."""

    version: str
    library: Any
    order: Integers
    seconds: tuple[float, float]


def theirs(python: str, cell: str, folder: Path) -> Theirs:
    """Derive and compile in the other environment."""
    command = [python, str(ROUTE), cell, str(folder), str(DEGREES[cell])]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{python} has no FFCx that works: {done.stderr.strip().splitlines()[-1]}")
    told = json.loads((folder / "told.json").read_text())
    nodes = CELLS[cell].nodes
    text = (folder / "forms.c").read_text()
    names = re.findall(r"void (tabulate_tensor_\w+)\(", text)
    count, dimension = nodes.shape
    size = count * dimension
    for name, rank in zip(names, ffcx_route._ranks(text, names), strict=True):
        task, entries = ("residual", size) if rank == 1 else ("tangent", size * size)
        text += _ENTRY.format(
            task=task, entries=entries, name=name, size=size, coordinates=3 * count
        )
    (folder / "forms.c").write_text(text)
    target = folder / "theirs.so"
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    compiling = ["cc", *FLAGS, f"-I{told['include']}", str(folder / "forms.c"), "-o", str(target)]
    subprocess.run([*compiling, "-lm"], check=True)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return Theirs(
        told["version"],
        ctypes.CDLL(str(target)),
        matched(nodes, np.array(told["nodes"])),
        (told["seconds"], spent),
    )


def matched(ours: Array, others: Array) -> Integers:
    """Our node at the place of each of theirs, on cells between 0 and 1."""
    low, high = ours.min(axis=0), ours.max(axis=0)
    distance = np.abs(others[:, None] - (ours - low)[None] / (high - low)).max(axis=2)
    order: Integers = distance.argmin(axis=1)
    if sorted(order) != list(range(len(ours))) or distance.min(axis=1).max() > 1e-12:
        raise SystemExit("the nodes of the cells are not the same")
    return order


def compared(python: str, cell: str) -> str:
    """One line of the table."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        mine = forms.built("neo_hooke", cell, None, folder / "ours")
        other = theirs(python, cell, folder)
        arrays = forms.state(mine.definition, "neo_hooke")
        run, (R, K) = forms.call(mine, "tangent", arrays)
        calls, found = _calls(other, cell, arrays)
        least = forms.nanoseconds([run, *calls])
        _require_equal(cell, other, R, K, found)
    ours, residual, tangent = least
    seconds = f"{mine.derive + sum(mine.compile):.1f}"
    ratios = f"{(residual + tangent) / ours:.1f} | {tangent / ours:.1f}"
    times = f"{ours:.0f} | {residual:.0f} | {tangent:.0f}"
    return f"| {cell} | {times} | {ratios} | {seconds} | {sum(other.seconds):.1f} |"


def _calls(other: Theirs, cell: str, arrays: dict[str, Any]) -> tuple[list[Any], list[Array]]:
    """Calls of residual and tangent, and what they write."""
    count, dimension = CELLS[cell].nodes.shape
    shape, size = (forms.ELEMENTS, count, dimension), count * dimension
    X = np.zeros((forms.ELEMENTS, count, 3))  # geometry has three coordinates in any case
    X[:, :, :dimension] = arrays["coordinates"].reshape(shape)[:, other.order]
    u = np.ascontiguousarray(arrays["dofs"].reshape(shape)[:, other.order])
    found = [np.zeros((forms.ELEMENTS, size)), np.zeros((forms.ELEMENTS, size, size))]
    given = [X, u, arrays["parameters"]]

    def call(task: str, out: Array) -> Any:
        function = getattr(other.library, f"run_{task}")
        function.restype = None
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (*given, out)]
        return lambda: function(ctypes.c_ssize_t(forms.ELEMENTS), *pointers)

    return [call(t, a) for t, a in zip(("residual", "tangent"), found, strict=True)], found


def _require_equal(cell: str, other: Theirs, R: Array, K: Array, found: list[Array]) -> None:
    """Our values in their order are theirs."""
    dimension = CELLS[cell].nodes.shape[1]
    at = (other.order[:, None] * dimension + np.arange(dimension)).ravel()
    for a, b in zip((R[:, at], K[:, at][:, :, at]), found, strict=True):
        error = np.abs(a - b).max() / np.abs(a).max()
        if not error < 1e-10:
            raise SystemExit(f"{cell}: the values differ by {error:.1e} of the largest entry")


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.solids", description=__doc__)
    parser.add_argument("python", help="Python of an environment with FFCx")
    parser.add_argument("cells", nargs="*", default=["hex8", "hex27"], help=", ".join(DEGREES))
    given = parser.parse_args()
    print(HEAD)
    for cell in given.cells:
        print(compared(given.python, cell), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
