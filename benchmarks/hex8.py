"""Residual and tangent of hex8 beside other programs: `python -m benchmarks.hex8 TOOL=PYTHON ...`.

Each TOOL of `benchmarks.hex8_rivals` runs in the environment of its PYTHON; they are no
dependency of ours. Every program computes the same distorted cube of neo-Hookean hexahedra in a
process of its own on one core, in turn, `--rounds` times; its residual and a product of its tangent
must agree with ours to 1e-12. Least CPU seconds, in microseconds an element: some programs give
arrays of elements, others assemble; each is compared with our time of the same.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.hex8_cube import MU, K, cube, direction, displacement, mapped
from benchmarks.hosts import least
from benchmarks.problems import rubber
from softehl import Mesh, Study, load_kernel
from softehl.runtime.arrays import Array

AGREEMENT = 1e-12
SAMPLES = 7
ASSEMBLED = ("torchfem", "mfem", "ngsolve", "felupe", "dolfinx")
"""Programs that assemble; the others give arrays of elements."""


class Ours:
    """The cube as a study: its results in the order of places, and calls to be timed."""

    def __init__(self, n: int) -> None:
        kernel = load_kernel(rubber("hex8"))
        lattice, cells = cube(n)
        study = Study(Mesh.box((1, 1, 1), cells=(n, n, n)).map(mapped))
        study.add("rubber", kernel, mu=MU, bulk=K)
        nodes = {"u": ("u_x", "u_y", "u_z")}
        system, lattice_of_mesh = study.system(nodes), Mesh.box((1, 1, 1), cells=(n, n, n)).points
        x, parameters = displacement(lattice_of_mesh).ravel(), {"rubber": np.array([MU, K])}
        self.order = np.lexsort(np.round(lattice_of_mesh, 9).T)
        self.direction = direction(lattice_of_mesh).ravel()
        self.system, self.state = system, (x, parameters)
        X, u = (a[cells].reshape(-1, 24) for a in (mapped(lattice), displacement(lattice)))
        again = kernel.call("tangent", X, u, parameters={"mu": MU, "bulk": K}).again()
        R, A = np.empty(u.shape), np.empty((*u.shape, 24))
        self.elements = lambda: again(u, R, A)

    def results(self) -> tuple[Array, Array]:
        """Residual and product, (nodes, 3)."""
        r, A = self.system.assembler.linearise(*self.state)
        product = np.asarray(A @ self.direction)
        return r.reshape(-1, 3)[self.order], product.reshape(-1, 3)[self.order]


def theirs(tool: str, python: str, n: int, expected: tuple[Array, Array]) -> float:
    """Least CPU seconds of another program.  Raises RuntimeError where it fails or differs."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    folder = str(Path(python).parent)  # where NGSolve has its compiler
    environment = {**os.environ, **one, "PATH": folder + os.pathsep + os.environ["PATH"]}
    environment.pop("PYTHONPATH", None)
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch, "results.npz")
        script = str(Path(__file__).with_name("hex8_rivals.py"))
        done = subprocess.run(
            [python, script, tool, str(n), str(file)],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RuntimeError((done.stderr.strip().splitlines() or ["?"])[-1])
        found = np.load(file)
        for a, b in zip(expected, (found["r"], found["product"]), strict=True):
            error = abs(a - b).max() / abs(a).max()
            if error > AGREEMENT:
                raise RuntimeError(f"it differs from ours by {error:.1e}")
    return float(done.stdout.split()[-1])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 where a program fails or differs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hex8")
    parser.add_argument("tools", nargs="*", metavar="TOOL=PYTHON")
    parser.add_argument("--cells", type=int, default=12, help="elements along an edge")
    parser.add_argument("--rounds", type=int, default=2)
    given = parser.parse_args(arguments)
    tools = dict(text.split("=", 1) for text in given.tools)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    ours = Ours(given.cells)
    expected, found = ours.results(), dict.fromkeys(tools, float("inf"))
    failed: dict[str, str] = {}
    best = {"elements": float("inf"), "assembled": float("inf")}
    for _ in range(given.rounds):
        calls: dict[str, Callable[[], object]] = {
            "elements": ours.elements,
            "assembled": lambda: ours.system.assembler.linearise(*ours.state),
        }
        for name, seconds in least(calls, SAMPLES, time.process_time).items():
            best[name] = min(best[name], seconds)
        for tool in [t for t in tools if t not in failed]:
            try:
                seconds = theirs(tool, tools[tool], given.cells, expected)
            except (RuntimeError, KeyError) as error:
                failed[tool] = str(error)
            else:
                found[tool] = min(found[tool], seconds)
    each = 1e6 / given.cells**3
    print("| program | result | us an element | ratio |\n|---|---|---|---|")
    for kind, seconds in best.items():
        print(f"| softehl | {kind} | {each * seconds:.2f} | 1 |")
    for tool, seconds in found.items():
        kind = "assembled" if tool in ASSEMBLED else "elements"
        if tool not in failed:
            print(f"| {tool} | {kind} | {each * seconds:.2f} | {seconds / best[kind]:.1f} |")
    for tool, reason in failed.items():
        print(f"{tool}: {reason}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
