"""Pages of fields in both forms: whole elements and loops around a point.

    python -m benchmarks.forms [CELL ...] [--material NAME] [--point]

CPU seconds to derive and to compile all tasks, kB of C, nanoseconds of an element, least of many
calls that alternate between both forms. Results that differ by more than 1e-12 of the largest
entry are an error. `--point` leaves whole elements out, which take minutes for large cells. The C
that pages share (tangents of a cell from moduli) is listed on its own: it is compiled once.
"""

from __future__ import annotations

import argparse
import ctypes
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.field_pages import EXAMPLES, PAGES
from softehl.codegen import pipeline
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.weak_form import Form
from softehl.codegen.tools import build, output_files
from softehl.runtime.mesh.cells import CELLS

ELEMENTS = 256
SAMPLES = 40


@dataclass(frozen=True)
class Built:
    """A family in one form: CPU seconds, kB of C of its own and of the shared file."""

    definition: Definition
    library: Any
    derive: float
    compile: tuple[float, float]
    size: tuple[float, float]


def built(material: str, cell: str, form: Form | None, folder: Path) -> Built:
    """Derive and compile, in series. form: None for that which is taken by itself."""
    start = time.process_time()
    d = replace(PAGES[material], form=form).definition(cell)
    files = output_files.files([pipeline.compile_model(d)])
    derive = time.process_time() - start
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    seconds, sizes, objects = [0.0, 0.0], [0.0, 0.0], []
    for source in sorted(folder.glob("*.c")):
        k = int(source.name.startswith(build.SHARED))
        objects.append(source.with_suffix(".o"))
        seconds[k] += _compiled(source, objects[-1])
        sizes[k] += source.stat().st_size / 1e3
    library = folder / build.LIBRARY
    subprocess.run(["cc", "-shared", *map(str, objects), "-o", str(library), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    return Built(d, loaded, derive, (seconds[0], seconds[1]), (sizes[0], sizes[1]))


def _compiled(source: Path, to: Path) -> float:
    """CPU seconds of the compiler."""
    light = build.extra_flags(source, source.read_text())
    flags = [f for f in build.FLAGS if f != "-shared"]
    command = ["cc", *flags, *light, '-DSOFTEHL_SIGNATURE="x"', "-c", str(source), "-o", str(to)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime


def call(b: Built, task: str, arrays: dict[str, Any]) -> tuple[Callable[[], None], list[Any]]:
    """A call of a task and what it writes."""
    size = len(b.definition.unknowns)
    found = [np.zeros((ELEMENTS, size)), np.zeros((ELEMENTS, size, size))]
    function = getattr(b.library, f"softehl_{b.definition.name}_{task}")
    function.restype = None
    order = ("coordinates", "dofs", "data", "parameters", None, "rule", None)
    pointers = [None if key is None else _pointer(arrays[key]) for key in order]
    sizes = [ctypes.c_ssize_t(n) for n in (ELEMENTS, len(b.definition.rule.points), 0)]
    return lambda: function(*sizes, *pointers, *map(_pointer, found)), found


def _pointer(array: Any) -> Any:
    return array.ctypes.data_as(ctypes.c_void_p)


def state(d: Definition, material: str) -> dict[str, Any]:
    """Arrays of a batch: elements of different shapes, strains of some per cent."""
    rng, nodes = np.random.default_rng(7), CELLS[d.cell].nodes
    places = nodes[None] + rng.uniform(-0.05, 0.05, (ELEMENTS, *nodes.shape))
    points = len(d.rule.points)
    rule = [[float(x.evalf(30)) for x in (*p, w)] for p, w in zip(*_rule(d), strict=True)]
    return {
        "coordinates": np.ascontiguousarray(places.reshape(ELEMENTS, -1)),
        "dofs": rng.uniform(-0.03, 0.03, (ELEMENTS, len(d.unknowns))),
        "data": rng.uniform(-1e-3, 1e-3, (ELEMENTS, max(points * len(d.point_data), 1))),
        "parameters": np.array(EXAMPLES[material]),
        "rule": np.array(rule),
    }


def _rule(d: Definition) -> tuple[Sequence[Any], Sequence[Any]]:
    return d.rule.points, d.rule.weights


def nanoseconds(calls: Sequence[Callable[[], None]]) -> list[float]:
    """Least nanoseconds of an element by each call, in turn."""
    least = [float("inf")] * len(calls)
    for _ in range(SAMPLES):
        for k, run in enumerate(calls):
            start = time.perf_counter()
            run()
            least[k] = min(least[k], time.perf_counter() - start)
    return [1e9 * t / ELEMENTS for t in least]


def compared(material: str, cell: str, forms: Sequence[Form]) -> list[str]:
    """Lines of the table of one page on one cell."""
    with tempfile.TemporaryDirectory() as scratch:
        families = [built(material, cell, form, Path(scratch) / form) for form in forms]
        arrays = state(families[0].definition, material)
        times: list[list[float]] = []
        for task in ("residual", "tangent"):
            pairs = [call(b, task, arrays) for b in families]
            times.append(nanoseconds([run for run, _ in pairs]))
            _require_equal([found for _, found in pairs], f"{material} {cell} {task}")
    rows = []
    for k, (form, b) in enumerate(zip(forms, families, strict=True)):
        rows.append(
            f"{material:10} {cell:7} {form:6} {b.derive:7.2f} {b.compile[0]:8.2f} "
            f"{b.compile[1]:7.2f} {b.size[0]:7.0f} {b.size[1]:7.0f} "
            f"{times[0][k]:9.0f} {times[1][k]:9.0f}"
        )
    return rows


def _require_equal(found: list[list[Any]], what: str) -> None:
    for others in found[1:]:
        for a, b in zip(found[0], others, strict=True):
            error = np.abs(a - b).max() / max(np.abs(a).max(), 1e-300)
            if not error < 1e-12:
                raise SystemExit(f"{what}: the forms differ by {error:.1e} of the largest entry")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.forms", description=__doc__)
    parser.add_argument("cells", nargs="*", default=["quad4", "hex8"], help="kinds of cells")
    parser.add_argument("--material", choices=list(PAGES), default="neo_hooke")
    parser.add_argument("--point", action="store_true", help="loops around a point alone")
    given = parser.parse_args(arguments)
    forms: list[Form] = ["point"] if given.point else ["whole", "point"]
    print("                          derive  compile  shared      kB  shared  residual   tangent")
    print("page       cell    form        s        s       s              kB        ns        ns")
    for cell in given.cells:
        print(*compared(given.material, cell, forms), sep="\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
