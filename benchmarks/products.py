"""Products of a tangent with a vector by sum factorisation: millions of unknowns a second.

    python -m benchmarks.products [ORDER ...] [--unknowns N] [--threads T]

Neo-Hooke on a distorted cube of hexahedra, the least of many products: seconds of the thread for
one thread, wall-clock seconds for several. Beside the rate: bytes that are kept for an unknown; the
rate that the memory allows (what a product moves by the measured bandwidth of reading); the rate of
the same product on a cube that the cache holds; the share of the smaller of both that is reached.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import softehl
from softehl import Mesh, Study
from softehl.codegen.language.fields import Fields
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.matrix_free_products import ElementNumbering, ElementProduct

SAMPLES = 15
IN_CACHE = 8e5
"""Bytes that are kept for a cube in the cache of one core."""


@softehl.page
def rubber(m: Fields) -> None:
    """Compressible neo-Hooke."""
    from benchmarks.field_pages import MATERIALS

    MATERIALS["neo_hooke"].page().write(m)
    m.offer(product=True)


def least(run: Callable[[], object], clock: Callable[[], float] = time.thread_time) -> float:
    """Least seconds of a call; those of the thread itself, whatever else the machine does."""
    found = float("inf")
    for _ in range(SAMPLES):
        start = clock()
        run()
        found = min(found, clock() - start)
    return found


def bandwidth() -> float:
    """GB/s of reading: a product reads twenty times as much as it writes."""
    a = np.ones(40_000_000)
    return a.nbytes / least(lambda: a @ a) / 1e9


def prepared(order: int, unknowns: float, threads: int) -> tuple[ElementProduct, Array, Array]:
    """The product of a cube, and two vectors."""
    n = max(round((unknowns / 3) ** (1 / 3) / order), 1)
    mesh = Mesh.box((1, 1, 1), cells=(n, n, n), order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
    names = softehl.load_kernel(rubber, cell="hex8").parameters
    given: dict[str, Any] = dict.fromkeys(names, 1.0)
    study.add("body", rubber, **given)
    system = study.system()
    block = system.assembler.block("body")
    places = ElementNumbering.of(block, threads)
    parameters = np.ones(len(block.kernel.parameters))
    product = ElementProduct.of(block, np.zeros(system.size), parameters, places)
    v = places.vector()
    v[: places.unknowns.size] = 1.0
    return product, v, places.vector()


def measured(order: int, unknowns: float, threads: int, memory: float) -> str:
    """One line of the table."""
    product, v, found = prepared(order, unknowns, threads)
    clock = time.thread_time if threads == 1 else time.perf_counter
    seconds = least(lambda: product(v, found), clock)
    size = product.numbering.unknowns.size
    small, w, other = prepared(order, IN_CACHE / product.cached.nbytes * size, 1)
    cached = small.numbering.unknowns.size / least(lambda: small(w, other)) / 1e6
    rate, kept = size / seconds / 1e6, product.cached.nbytes / size
    moved = (product.cached.nbytes + product.numbering.index.nbytes) / size + 3 * v.itemsize
    roof = min(1e3 * memory / moved, cached) * threads
    return (
        f"{order:5} {size:9} {1e3 * seconds:9.2f} {rate:8.1f} {kept:8.0f} "
        f"{1e3 * memory / moved:8.1f} {cached:8.1f} {rate / roof:8.0%}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.products", description=__doc__)
    parser.add_argument("orders", nargs="*", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--unknowns", type=float, default=2e6)
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args(arguments)
    memory = bandwidth()
    print(f"memory: {memory:.1f} GB/s")
    print("order  unknowns product ms    M/s   kept B   memory    cache    share")
    for order in given.orders:
        print(measured(order, given.unknowns, given.threads, memory), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
