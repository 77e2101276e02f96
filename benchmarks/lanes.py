"""Kernels that loop, branch or iterate: several elements at once against one after another.

    python -m benchmarks.lanes [hex8 ...] [--before CHECKOUT]

Tangents of `benchmarks.pages` are generated twice, by this generator and by that of another
checkout of softehl (else by target `scalar` of this one), compiled alike and called in turn on the
same elements.  Results that differ by more than 1e-10 of the largest entry are an error.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from softehl.codegen.tools import build

ELEMENTS = 32
MODES = 5
DIFFERENT = 32
"""Random states, repeated in turn over the elements."""
PAGES = Path(__file__).with_name("pages.py")


def write(names: Sequence[str], folder: Path, target: str) -> None:
    """The C of some pages by the generator that is first on the path, and what it cost."""
    from softehl.codegen import pipeline
    from softehl.codegen.abi import Target
    from softehl.codegen.tools import model_loader, output_files

    models = {d.name: d for d in model_loader.definitions(PAGES)}
    kernels = [pipeline.compile_model(models[name], Target(target)) for name in names]
    for name, text in output_files.files(kernels).items():
        (folder / name).write_text(text, encoding="utf-8")
    for kernel in kernels:
        f = kernel.functions["tangent"]
        print(kernel.definition.name, f.best.operations, f.temporaries)
    build.build(folder)


def made(names: Sequence[str], folder: Path, target: str, checkout: Path | None) -> Any:
    """Folder of compiled kernels, and operations of each."""
    folder.mkdir()
    code = f"import sys; sys.path.insert(0, {str(PAGES.parents[1])!r})\n"
    code += "from benchmarks.lanes import write; from pathlib import Path\n"
    code += f"write({list(names)!r}, Path({str(folder)!r}), {target!r})"
    environment = dict(os.environ)
    if checkout is not None:
        environment["PYTHONPATH"] = str(checkout / "src")
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    rows = [line.split() for line in done.stdout.splitlines()]
    return {name: int(count) for name, count, _ in rows}, time.perf_counter() - start


def states(name: str) -> tuple[tuple[int, int, int], list[Any]]:
    """Sizes and arrays of a batch whose neighbours take different ways."""
    from softehl.codegen.tools import model_loader
    from softehl.codegen.verify import random_states

    d = next(d for d in model_loader.definitions(PAGES) if d.name == name)
    rng, rows = np.random.default_rng(7), []
    for s in random_states.admissible_states(d, 4):
        for _ in range(DIFFERENT // 4):
            factor = rng.uniform(0.2, 1.2)
            dofs = [v * factor for v in s.dofs]
            if d.interpolated:
                dofs = dofs[: len(d.unknowns)] + list(rng.uniform(-1, 1, MODES))
            data = [*s.data, *(v for point in s.point_data for v in point)]
            rows.append((s, dofs, data))
    first = rows[0][0]
    points = len(first.rule)
    tables = [np.array(first.rule), np.zeros(0)]
    modes = MODES if d.interpolated else 0
    if modes:
        xi = np.array([p[0] for p in first.rule])
        shapes = np.stack([np.cos(k * xi) for k in range(modes)], axis=1)
        slopes = np.stack([-k * np.sin(k * xi) for k in range(modes)], axis=1)
        tables[1] = np.stack([shapes, slopes], axis=2)
    turn = [rows[k % len(rows)] for k in range(ELEMENTS)]
    arrays = [
        np.array([s.coordinates for s, _, _ in turn]),
        np.array([u for _, u, _ in turn]),
        np.array([a for _, _, a in turn]),
        np.array(first.parameters),
        np.zeros(0),
        *tables,
    ]
    return (ELEMENTS, points, modes), [np.ascontiguousarray(a, dtype=np.float64) for a in arrays]


def caller(folder: Path, name: str, sizes: Any, arrays: Any) -> tuple[Callable[[int], None], Any]:
    """A function that calls the kernel on the first so many elements, and what it writes."""
    function = getattr(ctypes.CDLL(str(folder / "kernels.so")), f"softehl_{name}_tangent")
    function.restype = None
    ndof = arrays[1].shape[1]
    R, K = np.full((ELEMENTS, ndof), np.nan), np.full((ELEMENTS, ndof, ndof), np.nan)
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in (*arrays, R, K)]
    rest = [ctypes.c_ssize_t(v) for v in sizes[1:]]
    return lambda n: function(ctypes.c_ssize_t(n), *rest, *pointers), (R, K)


def seconds(call: Callable[[int], None], repeats: int) -> float:
    """Thread seconds of one element, without those of an empty call."""
    times = []
    for n in (ELEMENTS, 0):
        start = time.thread_time()
        for _ in range(repeats):
            call(n)
        times.append(time.thread_time() - start)
    return (times[0] - times[1]) / repeats / ELEMENTS


def measure(name: str, folders: Sequence[Path], rounds: int) -> tuple[list[float], list[float]]:
    """Nanoseconds of an element by each folder; the median of each round's ratios, and the ratio
    of the least times, which other work of the machine disturbs least.
    """
    sizes, arrays = states(name)
    calls = [caller(f, name, sizes, arrays) for f in folders]
    for call, _ in calls:
        call(ELEMENTS)
    (_, expected), (_, found) = calls
    for a, b in zip(expected, found, strict=True):
        off = np.abs(a - b).max() / np.abs(a).max()
        if not off <= 1e-10:
            raise SystemExit(f"{name}: the results differ by {off:.1e}")
    repeats = max(1, int(2e-3 / ELEMENTS / max(seconds(calls[0][0], 1), 1e-9)))
    samples = [[seconds(c, repeats) for c, _ in calls] for _ in range(rounds)]
    best = [median(column) * 1e9 for column in zip(*samples, strict=True)]
    before, now = (min(column) for column in zip(*samples, strict=True))
    return best, [median(a / b for a, b in samples), before / now]


def main() -> None:
    from benchmarks import pages

    parser = argparse.ArgumentParser(prog="python -m benchmarks.lanes", description=__doc__)
    parser.add_argument("names", nargs="*", default=list(pages.MODELS), metavar="PAGE")
    parser.add_argument("--before", type=Path, help="another checkout of softehl")
    parser.add_argument("--rounds", type=int, default=21)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch) / k for k in ("before", "now")]
        old = "simd" if given.before else "scalar"
        before, _ = made(given.names, folders[0], old, given.before)
        now, _ = made(given.names, folders[1], "simd", None)
        print("| tangent | operations before | now | ns before | ns now | ratio | of least |")
        print("|---|---|---|---|---|---|---|")
        for name in given.names:
            (a, b), (ratio, least) = measure(name, folders, given.rounds)
            row = f"{before[name]} | {now[name]} | {a:.0f} | {b:.0f} | {ratio:.2f} | {least:.2f}"
            print(f"| {name} | {row} |", flush=True)


if __name__ == "__main__":
    main()
