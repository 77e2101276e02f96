"""C that is written and built: warnings, sanitizers, C++, targets, the budget of operations."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cffi
import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp

from softehl.codegen import abi, c_compiler, pipeline
from softehl.codegen.abi import AT_POINTS, BuildError, Target, Task, function_name
from softehl.codegen.elements import quadrature
from softehl.codegen.emit import c_source
from softehl.codegen.emit.code_motion import Schedule, schedule
from softehl.codegen.emit.liveness import peak_live
from softehl.codegen.graph.graph import Node
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, cli, output_files
from softehl.runtime.kernels.kernel import (
    Kernel,
    MissingKernelsError,
    StaleKernelsError,
    load_kernel,
)
from softehl.runtime.kernels.shared_library import manifest
from tests.codegen.budget import LARGEST_FILE, REMEDY, excess, published, shipped
from tests.codegen.element_states import Case, all_cases
from tests.codegen.workshop import compiled, write

# --- Throw-away models all the way to machine code; what a failing or stale build says ------------


# ----------------------------------------------------------------------------------- the values


# -------------------------------------------------------------------------- outputs, their place


def fields_model(**fields: str) -> Definition:
    m = Model("places", nodes=1, rule=quadrature.gauss(2, 1))
    x = m.unknown("x")
    (xi,) = m.point()
    total = m.integral("total", x * xi**2)
    m.potential(total)
    known = {"x": x, "xi": xi, "total": total, "late": total * xi, "two": sp.Integer(2)}
    m.fields(**{name: known[value] for name, value in fields.items()})
    return m.finish()


# ------------------------------------------------------------------------------------- the text


@pytest.mark.slow
def test_shipped_c_is_plain_c11_without_warnings(tmp_path: Path) -> None:
    """Every warning the compiler knows of that is not a matter of taste, under two dialects."""
    for source in build.GENERATED.glob("*.[ch]"):
        shutil.copy(source, tmp_path)
    build.build(tmp_path, extra=(*build.STRICT, "-Wpedantic", "-Wconversion", "-Wshadow", "-O0"))
    # a C compiler that knows no restrict in C++ is no matter: C17 must do as well
    build.build(tmp_path, extra=(*build.STRICT, "-std=c17", "-O0"))


def test_documentation_cannot_end_the_comment(tmp_path: Path) -> None:
    m = Model("commented", nodes=1, rule=quadrature.point_rule(), doc="kappa*/mu ratio")
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness [N*/mm]")
    m.potential(k * x**2)
    compiled(m.finish(), tmp_path)


# ------------------------------------------------------------------------------------- the build


def test_a_failed_build_shows_the_command_and_the_words_of_the_compiler(tmp_path: Path) -> None:
    (tmp_path / "broken.c").write_text("int f(void) { return no_such_name; }\n")
    with pytest.raises(BuildError) as failed:
        build.build(tmp_path, extra=build.STRICT)
    message = str(failed.value)
    assert "the C compiler failed" in message
    assert "broken.c" in message
    assert all(flag in message for flag in (*build.STRICT, "-std=c11"))
    assert "no_such_name" in message
    assert [p.name for p in tmp_path.iterdir()] == ["broken.c"], "nothing is left behind"


def test_warnings_are_errors_for_us_and_nothing_to_users(tmp_path: Path) -> None:
    (tmp_path / "sloppy.c").write_text("int f(int unused) { return 0; }\n")
    with pytest.raises(BuildError, match="unused"):
        build.build(tmp_path, extra=build.STRICT)
    build.build(tmp_path)


def test_a_missing_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(BuildError, match=r"'no-such-compiler' is not on the PATH.* set CC"):
        build.build(tmp_path)
    assert list(tmp_path.iterdir()) == []
    before = {p.name: p.stat().st_mtime_ns for p in build.GENERATED.iterdir()}
    assert build.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("softehl: no C compiler: 'no-such-compiler' is not on the PATH")
    assert len(printed.err.splitlines()) == 1
    assert {p.name: p.stat().st_mtime_ns for p in build.GENERATED.iterdir()} == before


def test_a_failed_build_keeps_the_old_library(tmp_path: Path) -> None:
    write(fields_model(a="xi"), tmp_path)
    assert set(build.build(tmp_path)) == {"places", "signature"}
    library = tmp_path / build.LIBRARY
    before = library.read_bytes()
    (tmp_path / "places.c").write_text("syntax error\n")
    with pytest.raises(BuildError):
        build.build(tmp_path)
    assert library.read_bytes() == before
    assert not [p for p in tmp_path.iterdir() if p.suffix == ".so" and p != library]


# ------------------------------------------------------------------------------ stale and missing


def test_a_library_that_was_not_built(tmp_path: Path) -> None:
    with pytest.raises(MissingKernelsError, match=r"manifest\.json is missing: run"):
        load_kernel("places", tmp_path)
    write(fields_model(a="xi"), tmp_path / "")
    other = tmp_path / "other"
    other.mkdir()
    write(fields_model(a="xi"), other)
    with pytest.raises(MissingKernelsError, match=r"not built: run `softehl generate`"):
        load_kernel("places", other)


@pytest.mark.parametrize("changed", ["places.c", "softehl_kernels.h", "new.c"])
def test_a_stale_library_is_refused(changed: str, tmp_path: Path) -> None:
    write(fields_model(a="xi"), tmp_path)
    build.build(tmp_path, extra=("-O0",))
    with (tmp_path / changed).open("a", encoding="utf-8") as file:
        file.write("\n")
    with pytest.raises(StaleKernelsError, match=r"was built from other sources .*softehl generate"):
        load_kernel("places", tmp_path)


def test_the_remedy_helps_in_the_same_process(tmp_path: Path) -> None:
    write(fields_model(a="xi"), tmp_path)
    build.build(tmp_path, extra=("-O0",))
    (tmp_path / "new.c").write_text("int new;\n")
    with pytest.raises(StaleKernelsError):
        load_kernel("places", tmp_path)
    build.build(tmp_path, extra=("-O0",))
    assert load_kernel("places", tmp_path).unknowns == ("x",)


# --- The generated C under the address and undefined-behaviour sanitizers, and two compilers ------


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
    base = [*c_compiler.compiler(), *SANITIZE, *build.STRICT, "-std=c11"]
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


# --- Costs of the shipped kernels stay in their budget; live temporaries are counted right --------


def test_no_cost_rose() -> None:
    assert excess(shipped(), published()) == [], REMEDY


def test_the_budget_is_of_the_kernels_that_ship() -> None:
    assert set(published()) == set(shipped()), REMEDY


def test_no_c_file_is_too_large() -> None:
    sizes = {p.name: p.stat().st_size for p in build.GENERATED.glob("*.[ch]")}
    assert {name: size for name, size in sizes.items() if size > LARGEST_FILE} == {}
    assert all(sizes[f"{name}.c"] == shipped()[f"{name} bytes"] for name in ALL)
    assert all(sizes.get(f"{n}_design.c", 0) == shipped()[f"{n} design_bytes"] for n in ALL)


@pytest.mark.parametrize("cost", ["operations", "temporaries", "peak_live"])
def test_one_operation_more_is_seen(cost: str) -> None:
    found = published()
    key = f"solid_q4 tangent {cost}"
    found[key] = published()[key] + 1
    assert excess(found, published()) == [f"{key}: {found[key]}, budget {found[key] - 1}"]
    assert excess({"new tangent operations": 1}, published())[0].endswith("budget missing")


# -------------------------------------------------------------------------------- live temporaries


def intervals(plan: Schedule) -> int:
    """Peak of a straight line by another count: overlaps of [computed, last read)."""
    order = plan.stages[0].preamble
    at = {n: k for k, n in enumerate(order)}
    last = dict(at)
    for n in order:
        assert isinstance(n, Node)
        last.update({a: at[n] for a in n.args if a in at})
    return max(sum(at[n] <= k < max(last[n], at[n] + 1) for n in at) for k in range(len(order)))


def of(*roots: Node) -> int:
    return peak_live(schedule(roots))


@pytest.mark.parametrize("name", ["axial_spring", "solid_q4"])
def test_the_manifest_counts_as_intervals_do(name: str) -> None:
    kernel = pipeline.compile_model(ALL[name]())
    manifest = json.loads(output_files.files([kernel])["manifest.json"])["kernels"][name]["tasks"]
    for task in ("energy", "residual", "tangent"):
        plan = kernel.functions[task].plan
        assert manifest[task]["peak_live"] == peak_live(plan) == intervals(plan) > 8


# --- The generated header is C++ as well ----------------------------------------------------------


CALLER = """
#include <cstdio>
#include <vector>
#include "softehl_kernels.h"

int main()
{
    const std::vector<double> dofs{3.0}, parameters{2.0}, rule{1.0};
    std::vector<double> force(1), tangent(1);
    softehl_spring_tangent(1, 1, 0, nullptr, dofs.data(), nullptr, parameters.data(), nullptr,
        rule.data(), nullptr, force.data(), tangent.data());
    std::printf("%g %g %d\\n", force[0], tangent[0], softehl_signature() != nullptr);
}
"""


def test_a_kernel_is_called_from_cpp(tmp_path: Path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("no C++ compiler")
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness [N/mm]")
    m.potential(k / 2 * x**2)
    compiled(m.finish(), tmp_path, "-O0")
    (tmp_path / "caller.cpp").write_text(CALLER)
    strict = (*build.STRICT, "-Wpedantic", "-std=c++17")
    command = ["g++", *strict, "caller.cpp", build.LIBRARY, "-Wl,-rpath,$ORIGIN", "-o", "caller"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "caller"], capture_output=True, text=True, check=True)
    assert done.stdout == "6 2 1\n"


def test_cffi_reads_the_prototypes() -> None:
    text = c_source.header([abi.function_name("spring", "energy")])
    kind = text[text.index("typedef void softehl_kernel") : text.index("#if !defined(__cplusplus)")]
    prototypes = text[
        text.index("softehl_kernel softehl") : text.rindex("#if defined(__cplusplus)")
    ]
    cffi.FFI().cdef(kind + prototypes)


# --- Targets: which files; several lanes, one lane and scalar C say the same ----------------------


FAMILIES = ("solid_taylor", "contact", "axial_spring")
CASES = [c for c in all_cases() if c.family in FAMILIES]


@pytest.fixture(scope="module")
def scalar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Kernels of target `scalar`."""
    directory = tmp_path_factory.mktemp("scalar")
    kernels = [pipeline.compile_model(ALL[name](), Target.SCALAR) for name in FAMILIES]
    for name, text in output_files.files(kernels).items():
        (directory / name).write_text(text, encoding="utf-8")
    build.build(directory, extra=(*build.STRICT, "-O1"))
    return directory


@pytest.fixture(scope="module")
def one_lane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped C as a compiler without vector extensions reads it."""
    directory = tmp_path_factory.mktemp("one_lane")
    for name in (
        *(f"{f}.c" for f in FAMILIES),
        "signature.c",
        "softehl_kernels.h",
        "manifest.json",
    ):
        shutil.copy(build.GENERATED / name, directory)
    build.build(directory, extra=(*build.STRICT, "-Wpedantic", "-O1", "-DSOFTEHL_LANES=1"))
    return directory


def values(kernel: Kernel, case: Case) -> list[Any]:
    """All that a kernel says about a batch of three elements."""
    X, u, a = (np.tile(v, (3, 1)) for v in (case.coordinates, case.dofs, case.data))
    given: dict[str, Any] = {"data": a, "parameters": case.parameters}
    out = [kernel.residual(X, u, **given), *kernel.tangent(X, u, **given)]
    return out + ([kernel.energy(X, u, **given)] if "energy" in kernel.tasks else [])


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.family}: {c.label}")
@pytest.mark.parametrize("other", ["scalar", "one_lane"])
def test_targets_agree(case: Case, other: str, request: pytest.FixtureRequest) -> None:
    directory: Path = request.getfixturevalue(other)
    found = values(load_kernel(case.family, directory), case)
    expected = values(load_kernel(case.family), case)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * np.abs(b).max())


def test_scalar_c_is_the_shipped_text_with_one_lane(scalar: Path) -> None:
    for name in FAMILIES:
        shipped = (build.GENERATED / f"{name}.c").read_text()
        plain = (scalar / f"{name}.c").read_text()
        assert plain.replace("#define SOFTEHL_LANES 1\n", "") == shipped
        assert plain != shipped


# ------------------------------------------------------------------------------- the command line


def test_generate_writes_cells_for_dolfinx(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "ALL", {k: ALL[k] for k in ("contact", "film")})
    assert cli.generate(target="ufcx", out=tmp_path / "cells") == 0
    printed = capsys.readouterr()
    assert "left out: film interpolates p" in printed.err
    assert "files of target ufcx in " in printed.out
    assert [p.name for p in (tmp_path / "cells").iterdir()] == ["contact_ufcx.c"]


def test_generate_writes_a_complete_folder_of_scalar_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "ALL", {"contact": ALL["contact"]})
    assert cli.generate(target="scalar", out=tmp_path) == 0
    build.build(tmp_path, extra=("-O0",))
    assert load_kernel("contact", tmp_path).tasks == ("residual", "tangent", "pseudo_load")
