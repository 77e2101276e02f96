"""Benchmarks measure what they say: verified kernels alone are timed, operations are counted."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import (
    casadi_route,
    compiling,
    counting,
    ffcx_route,
    forms,
    lanes,
    nearly,
    problems,
    softehl_route,
    solids,
)
from benchmarks.candidate import ENTRY, Candidate, Layout
from benchmarks.deriving import TimeLimitError, run_limited
from benchmarks.field_pages import SYSTEMS
from benchmarks.measure import Settings, build, measure
from benchmarks.problem import TOLERANCE, Case, Result, deviation, elements, reference
from benchmarks.routes import GENERATORS, Generator
from benchmarks.timing import Driver
from softehl.codegen.tools import build as kernel_build

# --- The benchmark measures what it says: verified kernels alone are timed, operations are --------


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


# --- The benchmark of lanes compares results before it tells times --------------------------------


@pytest.mark.slow
def test_two_targets_are_compared_and_timed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, now, wrong = (tmp_path / name for name in ("before", "now", "wrong"))
    lanes.made(["maxwell"], before, "scalar", None)
    operations, _ = lanes.made(["maxwell"], now, "simd", None)
    assert operations == {"maxwell": 23}
    # a loaded machine may take any time, also less for the elements than for none: times are given
    times = iter([1.0, 8e-9, 2e-9, 9e-9, 3e-9, 6e-9, 1e-9])
    monkeypatch.setattr(lanes, "seconds", lambda call, repeats: next(times))
    (a, b), ratios = lanes.measure("maxwell", [before, now], 3)
    assert (a, b) == pytest.approx((8, 2))
    assert ratios == pytest.approx([4, 6])
    shutil.copytree(before, wrong)
    source = wrong / "maxwell.c"
    source.write_text(source.read_text().replace("3.0 *", "3.001 *"))
    kernel_build.build(wrong)
    with pytest.raises(SystemExit, match="maxwell: the results differ by"):
        lanes.measure("maxwell", [before, wrong], 1)


# --- The benchmark of both forms of a page of fields ----------------------------------------------


def test_both_forms_are_built_measured_and_compared(capsys: pytest.CaptureFixture[str]) -> None:
    assert forms.main(["tri3", "--material", "plastic"]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[:3] for row in rows[2:]] == [["plastic", "tri3", f] for f in ("whole", "point")]


def test_forms_that_differ_are_an_error() -> None:
    one = [np.ones(3)]
    with pytest.raises(SystemExit, match="tri3: the forms differ by 1"):
        forms._require_equal([one, [np.array([1.0, 1.0, 2.0])]], "tri3")
    with pytest.raises(SystemExit, match="nan"):
        forms._require_equal([one, [np.full(3, np.nan)]], "tri3")


def test_a_cubic_crystal_has_twelve_systems() -> None:
    assert len(SYSTEMS) == 12


# --- The benchmark beside FFCx: same nodes, same values, a missing FFCx is named ------------------


def test_nodes_are_matched_by_their_places() -> None:
    ours = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    theirs = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    assert solids.matched(ours, theirs).tolist() == [0, 1, 3, 2]
    with pytest.raises(SystemExit, match="nodes of the cells are not the same"):
        solids.matched(ours, theirs + 0.01)


def test_values_that_differ_are_an_error() -> None:
    other: Any = SimpleNamespace(order=np.array([0, 1, 3, 2]))
    at = (other.order[:, None] * 2 + np.arange(2)).ravel()
    R, K = np.arange(8.0)[None], np.arange(64.0).reshape(1, 8, 8)
    found = [R[:, at], K[:, at][:, :, at]]
    solids._require_equal("quad4", other, R, K, found)
    found[1][0, 2, 3] += 1
    with pytest.raises(SystemExit, match=r"quad4: the values differ by 1\.6e-02"):
        solids._require_equal("quad4", other, R, K, found)


def test_a_python_without_ffcx_is_named(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"has no FFCx that works: .*No module named"):
        solids.theirs(sys.executable, "quad4", tmp_path)


# --- Whole problems beside other tools: ours agrees with itself, what is missing is said ----------


@pytest.mark.slow
@pytest.mark.parametrize(("problem", "expected"), [("cook", 11.53022336), ("block", 0.03265384257)])
def test_our_side_finds_what_felupe_finds(problem: str, expected: float) -> None:
    """FElupe 11.3 by `benchmarks/rivals.py` on the same mesh; scikit-fem agrees with it."""
    found = problems.ours(problem, 4)
    assert found.iterations >= problems.STEPS[problem]
    assert found.assembly < found.total
    assert found.value == pytest.approx(expected, rel=1e-8)


def test_a_tool_that_is_missing_is_named() -> None:
    found = problems.theirs(sys.executable, "felupe", "cook", 2)
    assert isinstance(found, str)
    assert "No module named 'felupe'" in found


def test_an_answer_that_differs_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one = problems.Timing(1.0, 0.1, 8, 2.0)
    monkeypatch.setattr(problems, "ours", lambda problem, n: one)
    for value, code in ((2.0, 0), (2.0 + 1e-5, 1)):
        other = problems.Timing(2.0, 0.4, 8, value)
        monkeypatch.setattr(problems, "theirs", lambda *_, other=other: other)
        assert problems.main("python", {"cook": 4}) == code
        assert "| cook | felupe | 400.0 | 4.0 | 2.00 | 2.0 | 8 |" in capsys.readouterr().out


# --- The benchmark of nearly incompressible blocks ------------------------------------------------


@pytest.mark.slow
def test_solvers_find_the_same_answer(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyamg")
    rows = []
    for solver in ("matrix-free", "amg"):
        assert nearly.main([solver, "2"]) == 0
        rows.append(capsys.readouterr().out.split("|"))
    assert rows[0][1].strip() == "375"
    assert float(rows[0][8]) == pytest.approx(float(rows[1][8]), rel=1e-5)
