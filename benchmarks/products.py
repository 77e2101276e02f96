"""Products of a tangent with a vector by sum factorisation: millions of unknowns a second.

    python -m benchmarks.products [ORDER ...] [--unknowns N] [--threads T]

Neo-Hooke on a distorted cube of hexahedra, least wall-clock time of many products; bytes that are
kept for an unknown. Before them: memory bandwidth of adding vectors, which bounds low orders.
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
from softehl.runtime.fem.products import Places, Product

SAMPLES = 15


@softehl.page
def rubber(m: Fields) -> None:
    """Compressible neo-Hooke."""
    from benchmarks.field_pages import MATERIALS

    MATERIALS["neo_hooke"].page().write(m)
    m.offer(product=True)


def least(run: Callable[[], object]) -> float:
    """Least seconds of a call."""
    found = float("inf")
    for _ in range(SAMPLES):
        start = time.perf_counter()
        run()
        found = min(found, time.perf_counter() - start)
    return found


def bandwidth() -> float:
    """GB/s of adding two vectors into a third, whose lines are fetched before they are written."""
    a = np.ones(20_000_000)
    b, c = np.ones_like(a), np.ones_like(a)
    return 4 * a.nbytes / least(lambda: np.add(a, b, out=c)) / 1e9


def measured(order: int, unknowns: float, threads: int) -> str:
    """One line of the table."""
    n = max(round((unknowns / 3) ** (1 / 3) / order), 1)
    mesh = Mesh.box((1, 1, 1), cells=(n, n, n), order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
    names = softehl.load_kernel(rubber, cell="hex8").parameters
    given: dict[str, Any] = dict.fromkeys(names, 1.0)
    study.add("body", rubber, **given)
    system = study.system()
    block = system.assembler.block("body")
    places = Places.of(block, threads)
    parameters = np.ones(len(block.kernel.parameters))
    start = time.perf_counter()
    product = Product.of(block, np.zeros(system.size), parameters, places)
    keep = time.perf_counter() - start
    v = np.ones((len(places.unknowns) + 1, places.unknowns.shape[1]))
    v[-1] = 0.0
    seconds = least(lambda: product(v))
    rate, kept = system.size / seconds / 1e6, product.kept.nbytes / system.size
    return f"{order:5} {system.size:9} {keep:8.2f} {1e3 * seconds:9.2f} {rate:8.1f} {kept:8.0f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.products", description=__doc__)
    parser.add_argument("orders", nargs="*", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--unknowns", type=float, default=2e6)
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args(arguments)
    print(f"memory: {bandwidth():.1f} GB/s")
    print("order  unknowns   keep s  product ms  M/s   kept B")
    for order in given.orders:
        print(measured(order, given.unknowns, given.threads), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
