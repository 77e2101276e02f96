"""Kernels of one text from two compilers: `python -m benchmarks.compilers [OTHER]`.

OTHER is a command, `zig cc` of the package ziglang if left out. Nanoseconds of an element, the
least of many samples that alternate between both, of kernels that ship and of neo-Hooke on
hexahedra; beside them the seconds of each build with an empty cache.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import exp, log
from pathlib import Path
from time import perf_counter, thread_time

from softehl.codegen import c_compiler, models
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.weak_form import CellOptions
from softehl.codegen.tools import build, kernel_cache
from softehl.codegen.verify.kernel_batch import Batch
from softehl.codegen.verify.random_states import admissible_states

SHIPPED = ("solid_q4", "solid_taylor_mean", "contact", "mortar_33", "touch", "film", "film_rough")
CELLS = ("hex8", "hex27")
TASKS = ("residual", "tangent")
ELEMENTS, SAMPLES, SECONDS = 64, 25, 2e-3


@contextmanager
def environment(**variables: str) -> Iterator[None]:
    """Variables of the environment for a while."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def built(files: Mapping[str, str], command: str) -> tuple[Path, float]:
    """Library of some C by a compiler, and seconds of its build with an empty cache."""
    cache = tempfile.mkdtemp(prefix="softehl-compilers-")
    variables = {"CC": command, "SOFTEHL_CACHE": cache, "XDG_CACHE_HOME": cache}
    with environment(**variables):
        start = perf_counter()
        folder, _ = kernel_cache.compiled(files)
        return folder / build.LIBRARY, perf_counter() - start


def alternately(runs: Sequence[Callable[[], None]]) -> list[float]:
    """Least seconds of a call of each of some functions."""
    for run in runs:
        run()
    counts = []
    for run in runs:
        start = thread_time()
        run()
        counts.append(max(1, round(SECONDS / max(thread_time() - start, 1e-7))))
    least = [float("inf")] * len(runs)
    for _ in range(SAMPLES):
        for k, (run, count) in enumerate(zip(runs, counts, strict=True)):
            start = thread_time()
            for _ in range(count):
                run()
            least[k] = min(least[k], (thread_time() - start) / count)
    return least


def compared(d: Definition, libraries: Sequence[Path]) -> Iterator[tuple[str, list[float]]]:
    """Task, and nanoseconds of an element from each library."""
    (state,) = admissible_states(d, 1)
    along = [1.0] * len(state.dofs)
    for task in TASKS:
        batches = [
            Batch(d, ctypes.CDLL(str(path)), [state] * ELEMENTS, [along] * ELEMENTS)
            for path in libraries
        ]
        seconds = alternately([batch.prepared(task)[2] for batch in batches])
        yield task, [1e9 * s / ELEMENTS for s in seconds]


def pages() -> Iterator[tuple[str, Definition]]:
    """Neo-Hooke on hexahedra."""
    from benchmarks.field_pages import MATERIALS

    for cell in CELLS:
        (d,) = MATERIALS["neo_hooke"].page().definitions(CellOptions((cell,)))
        yield cell, d


def main(arguments: Sequence[str]) -> int:
    """Print the tables."""
    zig = c_compiler.ziglang()
    if not arguments and zig is None:
        print("pip install ziglang, or name a command", file=sys.stderr)
        return 2
    other = " ".join(arguments) or shlex.join([str(zig), "cc"])
    commands = [shlex.join(c_compiler.compiler()), other]
    for command in commands:
        with environment(CC=command):
            print(build.compiler_name())
    shipped = {p.name: p.read_text("utf-8") for p in build.GENERATED.glob("*.[ch]")}
    groups = [("shipped", shipped, {n: models.ALL[n]() for n in SHIPPED})]
    for cell, d in pages():
        groups.append((cell, kernel_cache.derive([d])[0], {d.name: d}))
    ratios = []
    print("kernel, task                       first ns   other ns   ratio")
    for title, files, definitions in groups:
        libraries, seconds = zip(*(built(files, command) for command in commands), strict=True)
        print(f"{title}: built in {seconds[0]:.1f} s and {seconds[1]:.1f} s")
        for name, d in definitions.items():
            for task, (first, second) in compared(d, libraries):
                ratios.append(second / first)
                label = f"{name}, {task}"
                print(f"{label:32} {first:10.1f} {second:10.1f} {ratios[-1]:7.2f}", flush=True)
    mean = exp(sum(map(log, ratios)) / len(ratios))
    print(f"geometric mean of the ratios {mean:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
