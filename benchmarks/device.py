"""Products, matrices and solutions on a device, beside the processor: rates and checks.

    python -m benchmarks.device [--device cuda|emulated] [--unknowns N] [--out FILE]

Neo-Hooke on distorted cubes of hexahedra of orders 1 to 4. First every kernel is compared with the
kernels in C; then rates of products in millions of unknowns a second, with the geometry kept, all
recomputed, and of kept moduli; seconds of moduli and matrix of the next lower order; and whole
solutions with their iterations. A GPU is timed by events of CUDA.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.products import rubber
from softehl import MatrixFree, Mesh, Study
from softehl.runtime.device.device_operator import Device, DeviceProduct
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.parallel.matrix_free import levels_of, require_products

CHECKED, SAMPLES = 3_000, 20


def cube(order: int, unknowns: float) -> Study:
    """A distorted cube that is sheared by a tenth."""
    n = max(round((unknowns / 3) ** (1 / 3) / order), 1)
    mesh = Mesh.box(1, 1, 1, cells=(n, n, n), order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
    study.add("body", rubber, mu=0.4, K=0.9)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_x=0.1, u_y=0, u_z=0)
    return study


def prepared(order: int, unknowns: float, device: str) -> tuple[Any, Any, Any, Any]:
    """Block, levels, backend and product of a cube at a random state."""
    system = cube(order, unknowns).system()
    pages, order = require_products(system)
    levels: MultigridLevels = levels_of(system, pages, order, 1)
    x = 1e-3 * np.random.default_rng(0).uniform(-1, 1, system.size)
    backend = Device(device)
    backend.require(pages[0])
    product = backend.product(pages[0], x, np.array([0.4, 0.9]), levels)
    return (pages[0], x), levels, backend, product


def seconds(product: DeviceProduct, run: Callable[[], object]) -> float:
    """Least seconds of a call on the device."""
    xp, found = product.block.module.xp, float("inf")
    for _ in range(SAMPLES):
        if xp is np:
            start = time.perf_counter()
            run()
            found = min(found, time.perf_counter() - start)
            continue
        begin, end = xp.cuda.Event(), xp.cuda.Event()
        begin.record()
        run()
        end.record()
        end.synchronize()
        found = min(found, 1e-3 * xp.cuda.get_elapsed_time(begin, end))
    return found


def check(order: int, device: str) -> float:
    """Greatest difference of the product to that of the kernels in C."""
    (block, x), levels, _, product = prepared(order, CHECKED, device)
    v = np.random.default_rng(1).uniform(-1, 1, len(product.u))
    found, (_, K) = np.zeros(len(v)), block.tangent(x, np.array([0.4, 0.9]))
    product(v, found)
    full, expected = np.zeros(len(x)), np.zeros(len(x))
    full[levels.unknowns[0]] = v
    np.add.at(expected, block.dofs, np.einsum("nij,nj->ni", K, full[block.dofs]))
    there = expected[levels.unknowns[0]]
    return float(np.abs(found - there).max() / np.abs(there).max())


def rates(order: int, unknowns: float, device: str) -> dict[str, float]:
    """Millions of unknowns a second, and seconds of moduli and matrix."""
    (block, x), levels, backend, product = prepared(order, unknowns, device)
    b, u, module = product.block, product.u, product.block.module
    v, y, moduli = module.array(np.cos(np.arange(len(u)))), module.zeros(len(u)), b.moduli(u)
    millions = len(u) / 1e6
    free = np.ones(len(x), dtype=bool)
    start = time.perf_counter()
    backend.coarse(block, product, x, levels, free)
    return {
        "unknowns": len(u),
        "geometry kept": millions / seconds(product, lambda: b.product(u, v, y)),
        "recomputed": millions / seconds(product, lambda: b.product_recomputed(u, v, y)),
        "of moduli": millions / seconds(product, lambda: b.product_of_moduli(moduli, v, y)),
        "moduli, s": seconds(product, lambda: b.moduli(u)),
        "lower matrix and diagonal, s": time.perf_counter() - start,
    }


def solution(order: int, unknowns: float, device: str | None) -> dict[str, Any]:
    """Seconds and iterations of a whole solution, and the displacement in the middle."""
    engine = MatrixFree(device=device)
    start = time.perf_counter()
    result = cube(order, unknowns).solve(engine=engine)
    middle = int(np.argmin(np.linalg.norm(result.system.mesh.points - 0.5, axis=1)))
    return {
        "seconds": time.perf_counter() - start,
        "iterations": list(engine.iterations),
        "middle": float(result.values("u_x")[middle]),
    }


def main() -> None:
    """Write every figure as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda", choices=["cuda", "emulated"])
    parser.add_argument("--unknowns", type=float, default=2e7)
    parser.add_argument("--out", type=Path, default=Path("device.json"))
    given = parser.parse_args()
    found: dict[str, Any] = {}

    def record(name: str, run: Callable[[], Any]) -> None:
        try:
            found[name] = run()
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
        print(f"{name}: {found[name]}", flush=True)
        given.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")

    for order in (1, 2, 3, 4):
        record(f"difference, order {order}", partial(check, order, given.device))
    for order in (1, 2, 3, 4):
        record(f"rates, order {order}", partial(rates, order, given.unknowns, given.device))
    for order, unknowns in ((1, 1e5), (2, 1e5), (2, given.unknowns / 10), (2, given.unknowns)):
        for device in (given.device, None) if unknowns <= 2e6 else (given.device,):
            name = f"solution, order {order}, {unknowns:.0f} unknowns, {device or 'processor'}"
            record(name, partial(solution, order, unknowns, device))


if __name__ == "__main__":
    main()
