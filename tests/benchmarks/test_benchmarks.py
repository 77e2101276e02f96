"""The benchmark measures what it says: verified kernels alone are timed, operations are counted."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import casadi_route, compiling, counting, ffcx_route, softehl_route
from benchmarks.candidate import ENTRY, Candidate, Layout
from benchmarks.deriving import TimeLimitError, run_limited
from benchmarks.measure import Settings, build, measure
from benchmarks.problem import TOLERANCE, Case, Result, deviation, elements, reference
from benchmarks.routes import GENERATORS, Generator
from benchmarks.timing import Driver

COMPILER = compiling.compilers(all_found=False)[0]
ONLY = Generator("softehl", "benchmarks.softehl_route", "codegen", ("shipped page",))


def settings(limit: float = 60.0, rounds: int = 2) -> Settings:
    return Settings([COMPILER], rounds, False, True, limit, lambda _: None)


def small(body: str) -> Candidate:
    """A candidate of one C file whose entry function has this body."""
    text = f"#include <math.h>\n#include <stddef.h>\n#include <stdlib.h>\n{ENTRY}\n{{\n{body}\n}}\n"
    return Candidate("nobody", "by hand", Case.Q4_A, 0.0, {"kernel.c": text})


@pytest.fixture(scope="module")
def ours() -> Candidate:
    return softehl_route.derive(Case.Q4_A, "shipped page")


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Driver:
    return Driver(tmp_path_factory.mktemp("driver"), COMPILER)


def test_our_route_from_start_to_end(driver: Driver, tmp_path: Path) -> None:
    found = measure(Case.Q4_A, [ONLY], driver, tmp_path, settings())
    (row,) = found.rows
    assert row.outcome == ""
    assert row.error is not None
    assert row.error <= TOLERANCE
    assert row.nanoseconds is not None
    assert row.nanoseconds > 0
    assert row.ratio == 1.0
    assert row.operations is not None
    assert row.operations > 0
    assert [b.generator for b in found.best] == ["softehl"]


def test_a_wrong_kernel_is_not_timed(ours: Candidate, driver: Driver, tmp_path: Path) -> None:
    name = next(n for n in ours.files if n == "entry.c")
    end = "    for (ptrdiff_t k = 0; k < 8 * n; ++k) values[k] *= 1.0 + {};\n}}\n"
    stem = ours.files[name].rstrip().removesuffix("}")
    outcomes = []
    for k, factor in enumerate(("1e-14", "1e-11")):
        changed = replace(ours, files={**ours.files, name: stem + end.format(factor)})
        (built,) = build(changed, tmp_path / str(k), settings(), None)
        outcomes.append((built.common.outcome, built.common.loaded is None))
    assert outcomes == [("", False), ("off by 1e-11", True)]


def test_not_a_number_or_a_missing_tangent_is_infinitely_wrong() -> None:
    right = reference(Case.Q4_B, 1)
    assert right.tangent is not None
    bad = right.tangent.copy()
    bad[0, 3, 4] = np.nan
    assert deviation(right, right) == 0.0
    assert deviation(Result(right.residual, bad), right) == np.inf
    assert deviation(Result(right.residual, None), right) == np.inf


@pytest.mark.parametrize(
    ("body", "operations"),
    [
        ("values[0] = u[0];", 0),
        ("values[0] = u[0] * u[1] + p[0] / X[2] - 2.0;", 4),
        ("values[0] = -u[0]; values[1] += fabs(u[1]);", 2),
        ("values[0] = pow(u[0] * u[0], 0.5) + log(p[0]) * sqrt(p[1]) + cbrt(p[2]);", 8),
        ("for (int k = 0; k < 5; ++k) values[k] = u[k] < 9.0 ? 3 * u[k] : u[k];", 5),
    ],
)
def test_operations_are_counted(body: str, operations: int, tmp_path: Path) -> None:
    assert counting.count(small(body), tmp_path, elements()) == operations


def test_the_counted_operations_are_those_of_one_element(ours: Candidate, tmp_path: Path) -> None:
    """Straight-line code: about as many as there are operators in its text."""
    compiling.write(ours, tmp_path / "c")
    counted = counting.count(ours, tmp_path / "c", elements())
    text = ours.files["solid_q4.c"]
    printed = sum(text.count(f" {sign} ") for sign in "+-*/")
    assert counted is not None
    assert 0.8 * printed < counted < 1.1 * printed


def test_a_foreign_layout_comes_back() -> None:
    layout = Layout(nodes=(0, 3, 1, 2), width=3, column_major=True)
    given = elements(2)
    X, u = layout.pack(given)
    assert (X.reshape(2, 4, 3)[:, 1, :2] == given.coordinates.reshape(2, 4, 2)[:, 3]).all()
    K = np.einsum("ei,ej->eji", u, 2 * u)  # column major: the first index is the column
    back = layout.unpack(u, K)
    assert back.tangent is not None
    assert (back.residual == given.displacements).all()
    expected = np.einsum("ei,ej->eij", given.displacements, 2 * given.displacements)
    assert (back.tangent == expected).all()


def test_time_limits_are_named_outcomes(tmp_path: Path) -> None:
    with pytest.raises(TimeLimitError, match=r"> 0\.2 s"):
        run_limited([sys.executable, "-c", "import time; time.sleep(60)"], 0.2)
    (built,) = build(small("(void)n;"), tmp_path / "late", settings(limit=0.001), None)
    assert built.common.outcome == "compile > 0.001 s"
    assert built.operations is None


@pytest.mark.parametrize("generator", GENERATORS[1:], ids=lambda g: g.title)
def test_a_peer_computes_the_same(generator: Generator, tmp_path: Path) -> None:
    pytest.importorskip(generator.package)
    module = {"FFCx": ffcx_route, "CasADi": casadi_route}[generator.title]
    for case in (Case.Q4_A, Case.FBAR_A):
        for route in generator.of(case, every=True)[-1:]:
            candidate = module.derive(case, route)
            (built,) = build(candidate, tmp_path / case.name, settings(), None)
            assert built.common.outcome == ""


def test_fast_math_leaves_subnormal_numbers_to_the_process(tmp_path: Path) -> None:
    source = tmp_path / "empty.c"
    source.write_text("void bench_entry(void) {}\n", encoding="utf-8")
    compiler = compiling.compilers(all_found=False)[0]
    compiler.library([source], tmp_path / "empty.so", ("-O3", "-ffast-math"))
    compiling.load(tmp_path / "empty.so")
    smallest = np.array([5e-324])
    assert (smallest * 1.0)[0] > 0.0
