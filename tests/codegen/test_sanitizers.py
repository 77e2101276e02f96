"""The generated C under the address and undefined-behaviour sanitizers, and two compilers.

A C driver calls every task of every shipped kernel on batches whose buffers are exactly as large
as `codegen.abi` says, so that one double too many is caught, read or written.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from softehl.codegen.abi import AT_POINTS, Task, function_name
from softehl.codegen.tools import build
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.kernels.shared_library import manifest
from tests.codegen.element_states import Case, all_cases

BATCHES = (0, 1, 2, 3, 4, 5, 7, 9)
SANITIZE = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g")

DRIVER = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "softehl_kernels.h"

typedef void kernel(ptrdiff_t, ptrdiff_t, ptrdiff_t, const double *, const double *, const double *,
    const double *, const double *, const double *, const double *, double *, double *);

/* Name of the array that is one double too short. */
static const char *shortened = "";

/* n copies of `width` doubles, to the byte; nothing at all is NULL. */
static double *copies(const char *name, const double *from, size_t n, size_t width)
{
    size_t size = n * width;
    if (!size) return NULL;
    size -= !strcmp(name, shortened);
    double *to = malloc(size * sizeof *to);
    for (size_t i = 0; i < size; ++i) to[i] = from ? from[i % width] : NAN;
    return to;
}

/* Every element was given the same numbers and must have the same finite results. */
static void compare(const char *what, const double *a, size_t n, size_t width)
{
    for (size_t i = 0; i < n * width; ++i)
        if (!(fabs(a[i] - a[i % width]) <= 1e-9 * fabs(a[i % width]))) {
            fprintf(stderr, "%s: entry %zu is %g, not %g\n", what, i, a[i], a[i % width]);
            exit(3);
        }
}

static void call(const char *what, kernel *f, size_t n, size_t points, size_t modes,
    const double *const in[7], const size_t width[9])
{
    static const char *const names[] = {"coordinates", "dofs", "data", "parameters", "direction",
        "rule", "basis"};
    double *a[7];
    for (int k = 0; k < 7; ++k) {
        const size_t times = k == 3 || k > 4 ? 1 : n;
        a[k] = copies(names[k], in[k], times, width[k]);
    }
    double *values = copies("values", NULL, n, width[7]);
    double *tangent = copies("tangent", NULL, n, width[8]);
    f((ptrdiff_t)n, (ptrdiff_t)points, (ptrdiff_t)modes, a[0], a[1], a[2], a[3], a[4], a[5], a[6],
        values, tangent);
    compare(what, values, n, width[7]);
    compare(what, tangent, n, width[8]);
    for (int k = 0; k < 7; ++k) free(a[k]);
    free(values), free(tangent);
}

int main(int argc, char **argv)
{
    if (argc > 1) shortened = argv[1];
    static const size_t batches[] = {@BATCHES@};
    for (size_t b = 0; b < sizeof batches / sizeof *batches; ++b) {
        const size_t n = batches[b];
@CALLS@
    }
    puts("clean");
    return 0;
}
"""


def numbers(values: npt.NDArray[np.float64]) -> str:
    """A C array of doubles; NULL for nothing."""
    flat = ", ".join(repr(float(v)) for v in values.ravel())
    return f"(const double[]){{{flat}}}" if values.size else "NULL"


def call(case: Case, task: str) -> str:
    """The lines of the driver that call one kernel."""
    kernel = load_kernel(case.family)
    rule = case.rule or kernel.default_rule
    table = np.column_stack([rule.points.reshape(len(rule.weights), -1), rule.weights])
    basis = np.empty(0) if rule.basis is None else rule.basis
    variation = np.concatenate([case.coordinates, case.data, case.parameters, case.dofs]) / 7
    others: dict[str, npt.NDArray[np.float64]] = {
        Task.PRODUCT: case.dofs[::-1],
        Task.PSEUDO_LOAD: variation[: variation.size - case.dofs.size],
        Task.FIELDS_RATE: variation,
    }
    along = others.get(task, np.empty(0))
    held = [] if case.point_data is None else [case.point_data.ravel()]
    data = np.concatenate([case.data, *held])
    inputs = [case.coordinates, case.dofs, data, case.parameters, along, table, basis]
    ndof, points = len(case.dofs), len(rule.weights)
    at_points: dict[str, int] = {task: points * len(kernel.fields) for task in AT_POINTS}
    lengths: dict[str, int] = {Task.ENERGY: 1} | at_points
    out = lengths.get(task, ndof)
    sizes = [*(a.size for a in inputs), out, ndof * ndof if task == Task.TANGENT else 0]
    modes = basis.shape[1] if basis.size else 0
    name = function_name(case.family, task)
    return (
        f'        call("{case.family} {task}", {name}, n, {points}, {modes},\n'
        f"            (const double *const[]){{{', '.join(map(numbers, inputs))}}},\n"
        f"            (const size_t[]){{{', '.join(map(str, sizes))}}});"
    )


def driver() -> str:
    """C text that calls every shipped kernel."""
    first = {c.family: c for c in reversed(all_cases())}
    calls = [call(first[name], t) for name, entry in manifest().items() for t in entry["tasks"]]
    return DRIVER.replace("@BATCHES@", ", ".join(map(str, BATCHES))).replace(
        "@CALLS@", "\n".join(calls)
    )


def sanitized(directory: Path, flags: Sequence[str] = ()) -> Path:
    """The driver and all shipped C, with sanitizers; skips where the compiler has none."""
    probe = directory / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    base = [*build.compiler(), *SANITIZE, *build.STRICT, "-std=c11"]
    done = subprocess.run([*base, str(probe), "-o", str(directory / "probe")], capture_output=True)
    if done.returncode:
        pytest.skip("this C compiler has no sanitizers")
    source, program = directory / "driver.c", directory / "driver"
    source.write_text(driver())
    shipped = sorted(str(p) for p in build.GENERATED.glob("*.c"))
    command = [*base, "-O0", *flags, '-DSOFTEHL_SIGNATURE=""', f"-I{build.GENERATED}"]
    command += [*shipped, str(source), "-o", str(program), "-lm"]
    subprocess.run(command, check=True)
    return program


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sanitized(tmp_path_factory.mktemp("sanitized"), ("-march=native", "-ffp-contract=fast"))


def run(program: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}
    return subprocess.run(
        [str(program), *arguments], env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_all_kernels_are_clean_on_every_batch(program: Path) -> None:
    done = run(program)
    assert (done.returncode, done.stdout, done.stderr) == (0, "clean\n", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    "array",
    [
        *("coordinates", "dofs", "data", "parameters", "direction"),
        *("rule", "basis", "values", "tangent"),
    ],
)
def test_one_double_too_few_is_caught(array: str, program: Path) -> None:
    done = run(program, array)
    assert done.returncode != 0
    assert "AddressSanitizer: heap-buffer-overflow" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_the_shipped_c_compiles_without_a_warning(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if shutil.which(name) is None:
        pytest.skip(f"no {name} here")
    monkeypatch.setenv("CC", name)
    for source in build.GENERATED.glob("*.[ch]"):
        shutil.copy(source, tmp_path)
    build.build(tmp_path, extra=(*build.STRICT, "-pedantic", "-O0"))
