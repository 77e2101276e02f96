"""Cost of the coarse matrix and the diagonal, which `linear="matrix-free"` sets up in each step.

    python -m benchmarks.coarse [ORDER ...] [--unknowns N]

The body is neo-Hookean: a distorted cube of hexahedra, on one thread. Two routes are compared:
tangents of the elements are computed and projected, or both follow from the moduli at the points.

Printed for each route: the shortest of several times, and the largest memory of NumPy meanwhile
(without the data of the products). Printed for both: the largest difference of their matrices,
relative to the largest entry.
"""

from __future__ import annotations

import argparse
import sys
import time
import tracemalloc
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import softehl
from benchmarks.products import rubber
from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation import matrix_free_operator as operator
from softehl.runtime.discretisation.matrix_free_products import ElementProduct
from softehl.runtime.parallel.matrix_free import levels_of, require_products

SAMPLES = 7
Setup = tuple[Any, Array]


def cube(order: int, unknowns: float) -> Study:
    """A distorted cube of hexahedra."""
    n = max(round((unknowns / 3) ** (1 / 3) / order), 1)
    mesh = Mesh.box((1, 1, 1), cells=(n, n, n), order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
    names = softehl.load_kernel(rubber, cell="hex8").parameters
    given: dict[str, Any] = dict.fromkeys(names, 1.0)
    study.add("body", rubber, **given)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    return study


def routes(order: int, unknowns: float) -> tuple[int, list[Callable[[], Setup]]]:
    """Unknowns, and both ways."""
    system = cube(order, unknowns).system()
    pages, _ = require_products(system)
    (block,) = pages
    levels = levels_of(system, pages, order, 1)
    x, parameters = np.zeros(system.size), np.ones(len(block.kernel.parameters))
    free = np.ones(system.size, dtype=bool)
    product = ElementProduct.of(block, x, parameters, levels.numberings[block.name])
    lower = levels.lower[block.name]

    def projected_route() -> Setup:
        P, diagonal, at = levels.transfers[block.name].matrix(), np.zeros(system.size), 0
        projected = np.empty((len(lower), P.shape[1], P.shape[1]))
        for piece, _ in block.pieces(np.empty(0, dtype=np.int64)):
            tangents = piece.tangent(x, parameters)[1]
            np.add.at(diagonal, piece.dofs, np.einsum("nii->ni", tangents))
            projected[at : at + len(tangents)] = P.T @ (tangents @ P)
            at += len(tangents)
        return operator.assembled(lower, projected, len(levels.unknowns[1])), diagonal

    def point_route() -> Setup:
        return operator.coarse_matrix(block, product, x, levels, free)

    return system.size, [projected_route, point_route]


def measured(run: Callable[[], Setup]) -> tuple[float, float, Setup]:
    """Least seconds of the thread, largest megabytes, and the result."""
    result, seconds = run(), float("inf")
    for _ in range(SAMPLES):
        start = time.thread_time()
        run()
        seconds = min(seconds, time.thread_time() - start)
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return seconds, peak / 1e6, result


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.coarse", description=__doc__)
    parser.add_argument("orders", nargs="*", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--unknowns", type=float, default=27783)
    given = parser.parse_args(arguments)
    print("order  unknowns  projected  points ms  ratio  projected  points MB  ratio  difference")
    for order in given.orders:
        size, (first, second) = routes(order, given.unknowns)
        s, m, (K, d) = measured(first)
        t, n, (A, e) = measured(second)
        difference = max(abs(A - K).max() / abs(K).max(), np.abs(d - e).max() / np.abs(d).max())
        print(
            f"{order:5} {size:9} {1e3 * s:10.1f} {1e3 * t:9.1f} {s / t:6.1f} {m:10.1f} {n:9.1f} "
            f"{m / n:6.1f} {difference:11.1e}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
