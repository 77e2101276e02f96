"""Products, matrices and solutions on a device, beside the processor: checks and rates.

    python -m benchmarks.device [--device cuda|emulated] [--unknowns N] [--only PART,...]

Neo-Hooke on distorted cubes of hexahedra of orders 1 to 4, in the order of these parts:

    compile    kernels of all orders in both precisions, several processes at once
    check      greatest difference of every kernel to the kernels in C
    rates      millions of unknowns a second of residual and products, in double and single
               precision; GB/s of a copy
    assembly   seconds of moduli, of the matrix of the next lower order and of the diagonal
    jax        a folder of target `cuda`: its test with a Python that has JAX ($SOFTEHL_JAX)
    solve      six whole solutions with their iterations, on the device and on the processor
    racecheck  compute-sanitizer on the kernels of order 1; fibers with an emulated device

Every figure is printed and written as soon as it is known. No part begins after --seconds. A GPU is
timed by events of CUDA. `--device emulated --unknowns 2000` tries every part without a GPU.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.products import rubber
from softehl import MatrixFree, Mesh, Study
from softehl.codegen.tools import host_files
from softehl.codegen.tools.device_library import device_source
from softehl.runtime.arrays import Array
from softehl.runtime.device.device_module import CudaModule, EmulatedModule
from softehl.runtime.device.device_operator import Device, DeviceProduct
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.parallel.matrix_free import levels_of, require_products

CHECKED, SAMPLES = 3_000, 20
ORDERS = (1, 2, 3, 4)
PARTS = ("compile", "check", "rates", "assembly", "jax", "solve", "racecheck")
GIVEN = np.array([0.4, 0.9])
LIMITS = {"double": 1e-12, "float": 1e-4}
"""Largest difference of a check; sums by atomics are not reproducible in the last digits."""


def cube(order: int, unknowns: float) -> Study:
    """A distorted cube that is sheared by a tenth."""
    n = max(round((unknowns / 3) ** (1 / 3) / order), 1)
    mesh = Mesh.box(1, 1, 1, cells=(n, n, n), order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
    study.add("body", rubber, mu=GIVEN[0], K=GIVEN[1])
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_x=0.1, u_y=0, u_z=0)
    return study


@dataclass(eq=False)
class Prepared:
    """A cube at a random state on a device."""

    order: int
    unknowns: float
    device: str

    def __post_init__(self) -> None:
        system = cube(self.order, self.unknowns).system()
        pages, order = require_products(system)
        self.block = pages[0]
        self.levels: MultigridLevels = levels_of(system, pages, order, 1)
        self.x = 1e-3 * np.random.default_rng(0).uniform(-1, 1, system.size)
        self.backend = Device(self.device, mixed=True)
        self.backend.require(self.block)
        self.product = self.backend.product(self.block, self.x, GIVEN, self.levels)

    def of(self, real: str) -> DeviceProduct:
        """The product in a precision."""
        single = self.product.single
        assert single is not None
        return self.product if real == "double" else single

    def coarse(self) -> tuple[Any, Array]:
        """Matrix of the next lower order and diagonal."""
        free = np.ones(len(self.x), dtype=bool)
        return self.backend.coarse(self.block, self.product, self.x, self.levels, free)

    @cached_property
    def expected(self) -> tuple[Array, Array]:
        """Residuals and tangents of elements by the kernels in C."""
        residuals, tangents = self.block.tangent(self.x, GIVEN)
        return np.asarray(residuals), np.asarray(tangents)

    def host(self, of_elements: Array) -> Array:
        """The sum of vectors of elements, node by node."""
        total = np.zeros(len(self.x))
        np.add.at(total, self.block.dofs, of_elements)
        return total[self.levels.unknowns[0]]


def actions(p: DeviceProduct, x: Any, y: Any) -> dict[str, Callable[[], None]]:
    """Kernels that add to y."""
    b, u, moduli = p.block, p.u, p.moduli
    return {
        "residual": lambda: b.residual(u, y),
        "geometry kept": lambda: b.product(u, x, y),
        "recomputed": lambda: b.product_recomputed(u, x, y),
        "of moduli": lambda: b.product_of_moduli(moduli, x, y),
    }


def check(order: int, device: str) -> dict[str, float]:
    """Greatest difference of every kernel to the kernels in C."""
    made, found = Prepared(order, CHECKED, device), dict[str, float]()
    residuals, K = made.expected
    numbers = made.levels.unknowns[0]
    v = np.random.default_rng(1).uniform(-1, 1, len(numbers))
    full = np.zeros(len(made.x))
    full[numbers] = v
    Kv = made.host(np.einsum("nij,nj->ni", K, full[made.block.dofs]))
    for real in LIMITS:
        p = made.of(real)
        module = p.block.module
        x, y = module.real(v), module.zeros(len(v))
        for name, run in actions(p, x, y).items():
            y[:] = 0
            run()
            right = made.host(residuals) if name == "residual" else Kv
            found[f"{name}, {real}"] = difference(module.host(y), right)
    matrix, diagonal = made.coarse()
    right = made.host(np.einsum("nii->ni", K))
    found["diagonal, double"] = difference(diagonal[numbers], right)
    P = made.levels.steps[0] if order > 1 else None
    ones = np.cos(np.arange(matrix.shape[1]))
    moved = ones if P is None else P @ ones
    full[numbers] = moved
    right = made.host(np.einsum("nij,nj->ni", K, full[made.block.dofs]))
    found["lower matrix, double"] = difference(matrix @ ones, right if P is None else P.T @ right)
    return found


def difference(a: Array, b: Array) -> float:
    """Greatest difference by the greatest entry."""
    return float(np.abs(a - b).max() / np.abs(b).max())


def seconds(xp: Any, run: Callable[[], object]) -> float:
    """Least seconds of a call on the device."""
    found = float("inf")
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


def rates(order: int, unknowns: float, device: str) -> dict[str, float]:
    """Millions of unknowns a second, and GB/s of a copy."""
    made, found = Prepared(order, unknowns, device), dict[str, float]()
    for real in LIMITS:
        p = made.of(real)
        module, n = p.block.module, len(p.u)
        x, y = module.real(np.cos(np.arange(n))), module.zeros(n)
        for name, run in actions(p, x, y).items():
            found[f"{name}, {real}"] = n / 1e6 / seconds(module.xp, run)
        found[f"copy, {real}, GB/s"] = 2e-9 * x.nbytes / seconds(module.xp, x.copy)
    return {"unknowns": n, **found}


def assembly(order: int, unknowns: float, device: str) -> dict[str, float]:
    """Seconds, and millions of elements a second."""
    made = Prepared(order, unknowns, device)
    b, u = made.product.block, made.product.u
    moduli, y = b.moduli(u), b.module.zeros(len(u))
    made.coarse()  # makes the pattern
    pattern, xp = made.backend.patterns["body"], b.module.xp
    values = b.module.zeros(pattern.count)
    lower = b.module.source.orders[0]
    found = {
        "moduli, s": seconds(xp, lambda: b.moduli(u)),
        "diagonal, s": seconds(xp, lambda: b.diagonal(moduli, y)),
        "lower matrix, s": seconds(xp, lambda: b.assemble(lower, moduli, pattern, values)),
    }
    return {
        "elements": b.n,
        **found,
        "millions of elements/s": b.n / 1e6 / found["lower matrix, s"],
    }


def jax_folder(order: int) -> dict[str, float]:
    """Errors of the test of a folder of target `cuda`, those of JAX where it is installed."""
    definition = rubber.definition(f"hex{(order + 1) ** 3}")
    with tempfile.TemporaryDirectory() as place:
        for name, text in host_files.files(definition, "cuda").items():
            (Path(place) / name).write_text(text, encoding="utf-8")
        python = os.environ.get("SOFTEHL_JAX", sys.executable)
        test = f"test_{definition.name}.py"
        variables = {**os.environ, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
        done = subprocess.run(
            [python, test], cwd=place, env=variables, capture_output=True, text=True, check=False
        )
    if done.returncode:
        raise RuntimeError(f"{test}: {(done.stdout + done.stderr)[-600:]}")
    lines = [line.rsplit(None, 2) for line in done.stdout.splitlines()]
    return {line[0]: float(line[1]) for line in lines if len(line) == 3 and line[2] == "ok"}


def solution(order: int, unknowns: float, device: str | None, precision: str) -> dict[str, Any]:
    """Seconds and iterations of a whole solution, and the displacement in the middle."""
    engine = MatrixFree(device=device, precision=precision)
    start = time.perf_counter()
    result = cube(order, unknowns).solve(engine=engine)
    middle = int(np.argmin(np.linalg.norm(result.system.mesh.points - 0.5, axis=1)))
    return {
        "unknowns": result.system.size,
        "seconds": time.perf_counter() - start,
        "iterations": list(engine.iterations),
        "middle": float(result.values("u_x")[middle]),
    }


def compiled(order: int, real: str, device: str) -> float:
    """Seconds to print and compile the kernels of an order; later runs find them in a cache."""
    start = time.perf_counter()
    source = device_source(rubber.definition(f"hex{(order + 1) ** 3}"), real)
    if device == "cuda":
        CudaModule(source).launch("geometry", 0, (None, None, None))
    else:
        EmulatedModule(source)
    return time.perf_counter() - start


def compile_all(device: str) -> dict[str, float]:
    """Seconds of every file, all at once."""
    command = [sys.executable, "-m", "benchmarks.device", "--device", device, "--compile"]
    names = [f"{order},{real}" for order in ORDERS for real in LIMITS]
    running = [subprocess.Popen([*command, n], stdout=subprocess.PIPE, text=True) for n in names]
    outputs = [p.communicate()[0] for p in running]
    failed = [n for n, p in zip(names, running, strict=True) if p.returncode]
    if failed:
        raise RuntimeError(f"not compiled: {', '.join(failed)}")
    return {n: float(text) for n, text in zip(names, outputs, strict=True)}


def races(device: str) -> str:
    """Answer of compute-sanitizer on the checks of order 1, or the difference by fibers."""
    if device != "cuda":
        made = Prepared(1, 300, device)
        b, n = made.product.block, len(made.product.u)
        module = EmulatedModule(b.module.source, fibers=True)
        x, y = np.cos(np.arange(n)), np.zeros(n)
        shared = b.parameters, b.history, b.index, b.places, b.X
        module.launch("product", b.n, (*shared, made.product.u, x, y), backwards=True)
        right = np.zeros(n)
        b.product(made.product.u, x, right)
        return f"fibers: difference {difference(y, right):.1e}"
    tool = shutil.which("compute-sanitizer")
    if tool is None:
        return "compute-sanitizer is not on the PATH"
    python = [sys.executable, "-m", "benchmarks.device", "--only", "check", "--orders", "1"]
    with tempfile.TemporaryDirectory() as place:
        command = [tool, "--tool", "racecheck", *python, "--out", str(Path(place) / "check.json")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    return (done.stdout + done.stderr).strip().splitlines()[-1]


def runs(given: argparse.Namespace) -> Iterator[tuple[str, str, Callable[[], Any]]]:
    """Part, name and call of every figure."""
    device, unknowns = given.device, given.unknowns
    yield "compile", "seconds", partial(compile_all, device)
    for order in given.orders:
        yield "check", f"order {order}", partial(check, order, device)
    for order in given.orders:
        yield "rates", f"order {order}", partial(rates, order, unknowns, device)
    for order in given.orders:
        yield "assembly", f"order {order}", partial(assembly, order, unknowns / 4, device)
    yield "jax", "order 1", partial(jax_folder, 1)
    for order, count, place, precision in (
        (1, unknowns / 100, device, "double"),
        (2, unknowns / 100, device, "double"),
        (2, unknowns / 100, None, "double"),
        (2, unknowns / 10, device, "double"),
        (2, unknowns / 10, device, "mixed"),
        (2, unknowns, device, "mixed"),
    ):
        name = f"order {order}, {count:.0f} unknowns, {place or 'processor'}, {precision}"
        yield "solve", name, partial(solution, order, count, place, precision)
    yield "racecheck", "order 1", partial(races, device)


def wrong(part: str, value: Any) -> bool:
    """True for a check whose difference is too large, or that has failed."""
    if part != "check":
        return isinstance(value, str) and value.startswith("failed")
    if not isinstance(value, dict):
        return True
    return any(not v < LIMITS[name.rsplit(", ", 1)[1]] for name, v in value.items())


def main() -> int:
    """Write every figure as soon as it is known; 1 if a check fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda", choices=["cuda", "emulated"])
    parser.add_argument("--unknowns", type=float, default=2e7)
    parser.add_argument("--orders", type=lambda t: [int(k) for k in t.split(",")], default=ORDERS)
    parser.add_argument("--only", type=lambda t: t.split(","), default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--seconds", type=float, default=200.0)
    parser.add_argument("--out", type=Path, default=Path("device.json"))
    parser.add_argument("--compile", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.compile:
        order, real = given.compile.split(",")
        print(compiled(int(order), real, given.device))
        return 0
    unknown = set(given.only) - set(PARTS)
    if unknown:
        parser.error(f"--only {', '.join(sorted(unknown))}: allowed are {', '.join(PARTS)}")
    found: dict[str, Any] = {}
    start, failures = time.perf_counter(), list[str]()
    for part, name, run in runs(given):
        if part not in given.only:
            continue
        key, begin = f"{part}: {name}", time.perf_counter()
        if begin - start > given.seconds:
            found[key] = f"left out: {given.seconds:.0f} s are over"
        else:
            try:
                found[key] = run()
            except Exception as error:
                found[key] = f"failed: {type(error).__name__}: {error}"
            failures += [key] if wrong(part, found[key]) else []
        print(f"{key} ({time.perf_counter() - begin:.1f} s): {found[key]}", flush=True)
        given.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(f"FAILED: {'; '.join(failures)}" if failures else "ALL CHECKS PASSED")
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
