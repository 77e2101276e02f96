"""Throw-away models all the way to machine code; what a failing or stale build says."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.abi import BuildError, Task
from softehl.codegen.elements import quadrature
from softehl.codegen.emit.c_printer import number
from softehl.codegen.graph.evaluation import State
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, output_files, shipped_kernels
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.discretisation.quadrature import film_rule, gauss
from softehl.runtime.kernels.kernel import (
    Kernel,
    MissingKernelsError,
    StaleKernelsError,
    load_kernel,
)
from tests.codegen.workshop import compiled, write

x0, x1 = 0.37, -0.81


def branched() -> Definition:
    """A branch with a side that has no value on the other side, and a power of 2/7."""
    m = Model("branched", nodes=1, rule=quadrature.point_rule(), doc="Branch and power.")
    x, y = m.unknown("x"), m.unknown("y")
    (k,) = m.parameters(k="exponent helper")
    guarded = sp.Piecewise((sp.log(x) * sp.sqrt(x) + y / x, x > 0), (k * x**2 * y, True))
    m.potential(guarded + (y**2 + k) ** sp.Rational(2, 7) + sp.cos(k * x) + sp.Max(x, y) ** 3)
    return m.finish()


def nested_sums() -> Definition:
    """The mean of a field enters a second integral; three unknowns, data and parameters."""
    m = Model(
        "nested_sums", nodes=2, rule=quadrature.gauss(3, 1), unroll=False, doc="A sum feeds a sum."
    )
    X = m.coordinates("Z", "R")
    u = [m.unknown(f"u{i}") for i in range(3)]
    (c,) = m.data(c="constant of the element")
    (k,) = m.parameters(k="stiffness")
    (xi,) = m.point()
    a = m.define("a", u[0] + xi * u[1] * X[0][1] + sp.exp(xi * u[2]) * c, interface=True)
    mean = m.integral("mean", a**2 + X[1][0])
    m.potential(m.integral("Pi", k * (a - sp.sqrt(mean)) ** 2 + sp.sin(a)) + c * mean)
    m.fields(a=a, double=2 * a, xi=xi)
    return m.finish()


def line() -> Definition:
    """An interpolated field with a direct unknown, and a branch at the points."""
    m = Model("line", nodes=1, rule=quadrature.gauss(2, 1), doc="Interpolated.")
    u = m.unknown("u")
    p, p_xi = m.interpolated("p")
    (xi,) = m.point()
    density = sp.Piecewise((sp.log(p) * u, p > 1), (p_xi**2 * p * u**2, True)) + xi * p**3
    m.potential(m.integral("Pi", density))
    m.fields(p=p, slope=p_xi)
    return m.finish()


def state(kernel: Kernel, dofs: Any, **given: Any) -> State:
    rule = given.get("rule") or kernel.default_rule
    table = np.column_stack([rule.points.reshape(len(rule.weights), -1), rule.weights])
    return State(
        given.get("coordinates", [0.0] * (2 * kernel.nodes)),
        dofs,
        given.get("data", ()),
        given.get("parameters", ()),
        table.tolist(),
        () if rule.basis is None else rule.basis.tolist(),
    )


def agrees(d: Definition, kernel: Kernel, dofs: Any, **given: Any) -> bool:
    """Energy, residual, tangent and fields of the kernel are the oracle's, to 1e-13."""
    oracle, at = Oracle(d), state(kernel, dofs, **given)
    named = {k: v for k, v in given.items() if k in ("parameters", "rule")}
    if "data" in given:
        named["data"] = np.array([given["data"]])
    X = np.array([at.coordinates])
    u = np.array([dofs])
    R, K = kernel.tangent(X, u, **named)
    pairs = [
        (kernel.energy(X, u, **named), [oracle.potential(at)]),
        (kernel.residual(X, u, **named)[0], oracle.residual(at)),
        (R[0], oracle.residual(at)),
        (K[0], oracle.tangent(at)),
    ]
    if d.fields:
        pairs.append((kernel.fields_at(X, u, **named)[0], oracle.fields(at)))
    found = [np.asarray(a) for a, _ in pairs]
    expected = [np.array(b, dtype=object).astype(np.float64) for _, b in pairs]
    assert [a.shape for a in found] == [b.shape for b in expected]
    return all(
        bool(np.abs(a - b).max() <= 1e-13 * np.abs(b).max())
        for a, b in zip(found, expected, strict=True)
    )


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Definition]]:
    """One library of all throw-away models."""
    directory = tmp_path_factory.mktemp("generated")
    models = {d.name: d for d in (branched(), nested_sums(), line())}
    texts = output_files.files([pipeline.compile_model(d) for d in models.values()])
    for name, text in texts.items():
        (directory / name).write_text(text, encoding="utf-8")
    build.build(directory)
    return directory, models


Workshop = tuple[Path, dict[str, Definition]]


# ----------------------------------------------------------------------------------- the values


@pytest.mark.parametrize("dofs", [(x0, x1), (x0, 0.9), (-x0, x1), (-1.3, 0.2)], ids=str)
def test_branches_and_powers(workshop: Workshop, dofs: tuple[float, float]) -> None:
    directory, models = workshop
    kernel = load_kernel("branched", directory)
    assert agrees(models["branched"], kernel, dofs, parameters=[0.6])


def test_the_side_that_is_not_taken_leaves_no_trace(workshop: Workshop) -> None:
    directory, _ = workshop
    kernel = load_kernel("branched", directory)
    for x in (0.0, -0.0, -2.0):
        u = np.array([[x, 0.5]])
        R, K = kernel.tangent(np.zeros((1, 2)), u, parameters=[0.6])
        assert np.isfinite(R).all()
        assert np.isfinite(K).all()
        assert np.isfinite(kernel.energy(np.zeros((1, 2)), u, parameters=[0.6])).all()
    text = (directory / "branched.c").read_text()
    assert "if (" in text
    assert "?" not in text.split("*/", 1)[1], "a branch is a branch, not a selection"
    rows = [row for row in text.splitlines() if "log(" in row]
    assert rows
    assert all(row.startswith(8 * " ") for row in rows), "inside the if"
    assert text.count("pow(") > 0, "2/7 is no root of the C library"


def test_outside_its_domain_a_kernel_says_not_a_number(workshop: Workshop) -> None:
    directory, _ = workshop
    kernel = load_kernel("branched", directory)
    R, _ = kernel.tangent(np.zeros((1, 2)), np.array([[0.3, 0.1]]), parameters=[-1.0])
    assert np.isnan(R[0, 1])


@pytest.mark.parametrize("points", [None, 1, 5])
def test_a_sum_that_feeds_a_sum(workshop: Workshop, points: int | None) -> None:
    directory, models = workshop
    kernel = load_kernel("nested_sums", directory)
    given: dict[str, Any] = {
        "coordinates": [0.2, 1.4, 0.9, 1.1],
        "data": [0.7],
        "parameters": [2.5],
        "rule": None if points is None else gauss(points),
    }
    assert agrees(models["nested_sums"], kernel, (0.4, x0, x1), **given)


@pytest.mark.parametrize("m_p", [1, 3])
@pytest.mark.parametrize("level", [0.2, 2.0, 1.0])
def test_an_interpolated_field_with_any_number_of_modes(
    workshop: Workshop, m_p: int, level: float
) -> None:
    directory, models = workshop
    kernel = load_kernel("line", directory)
    pressures = level + 0.3 * np.sin(1.0 + np.arange(m_p + 1))
    rule = film_rule(m_p, "gauss")
    assert agrees(models["line"], kernel, (0.7, *pressures), rule=rule)


def test_a_kernel_of_another_model_is_refused(workshop: Workshop) -> None:
    """The comparison that these tests rest on sees a slightly different page."""
    directory, models = workshop
    kernel = load_kernel("branched", directory)
    d = models["branched"]
    assert agrees(d, kernel, (x0, x1), parameters=[0.6])
    m = Model("branched", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    (k,) = m.parameters(k="exponent helper")
    guarded = sp.Piecewise((sp.log(x) * sp.sqrt(x) + y / x, x > 0), (k * x**2 * y, True))
    tiny = sp.Rational(1, 10**11)
    m.potential(guarded + (y**2 + k) ** sp.Rational(2, 7) + sp.cos(k * x) + (1 + tiny) * x**3)
    assert not agrees(m.finish(), kernel, (x0, x1), parameters=[0.6])


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


@pytest.mark.parametrize(
    "fields",
    [
        {"a": "xi", "b": "x"},
        {"a": "xi", "b": "two"},
        {"a": "x"},
        {"a": "xi", "b": "total"},
        {"a": "xi", "b": "late"},
    ],
    ids=str,
)
def test_fields_of_every_kind(fields: dict[str, str], tmp_path: Path) -> None:
    d = fields_model(**fields)
    kernel = compiled(d, tmp_path)
    found = kernel.fields_at(np.zeros((1, 2)), np.array([[3.0]]))
    expected = np.array(Oracle(d).fields(state(kernel, (3.0,))), dtype=object).astype(np.float64)
    np.testing.assert_allclose(found[0], expected, rtol=1e-15)


def test_a_mean_of_the_interpolated_field_in_a_direct_row(tmp_path: Path) -> None:
    """dR_x/dp is known after the first loop only, dR_p/dp in it: both are scattered."""
    m = Model("mean", nodes=1, rule=quadrature.gauss(2, 1))
    x = m.unknown("x")
    p, _ = m.interpolated("p")
    mean = m.define("mean", m.integral("sum_p", p) ** 2)
    m.weak_form([(mean, x), (p**2, p)])
    d = m.finish()
    kernel = compiled(d, tmp_path)
    at = state(kernel, (0.3, 1.2, 0.4), rule=film_rule(1))
    _, K = kernel.tangent(np.zeros((1, 2)), np.array([at.dofs]), rule=film_rule(1))
    expected = np.array(Oracle(d).tangent(at), dtype=object).astype(np.float64)
    np.testing.assert_allclose(K[0], expected, atol=1e-14)


@pytest.mark.parametrize("interface", [False, True])
def test_a_named_value_of_one_side_leaves_no_trace_in_the_other(
    interface: bool, tmp_path: Path
) -> None:
    m = Model("named", nodes=1, rule=quadrature.gauss(2, 1))
    x = m.unknown("x")
    (xi,) = m.point()
    root = m.define("root", sp.sqrt(x + xi / 10), interface=interface)
    m.potential(m.integral("Pi", sp.Piecewise((root**3, x > 1), (x**2, True))))
    d = m.finish()
    kernel = compiled(d, tmp_path)
    assert agrees(d, kernel, (2.0,))
    assert agrees(d, kernel, (-2.0,))


def test_a_named_value_of_an_interpolated_field_in_one_side(tmp_path: Path) -> None:
    m = Model("named", nodes=1, rule=quadrature.gauss(2, 1))
    p, _ = m.interpolated("p")
    root = m.define("root", sp.sqrt(p))
    m.potential(m.integral("Pi", sp.Piecewise((root**3, p > 1), (p**2, True))))
    d = m.finish()
    kernel = compiled(d, tmp_path)
    assert agrees(d, kernel, (2.0, 1.7), rule=film_rule(1))
    assert agrees(d, kernel, (-2.0, -1.7), rule=film_rule(1))


# ------------------------------------------------------------------------------------- the text


def test_numbers_are_read_back_exactly() -> None:
    for v in (0.1, 1 / 3, -2.5, 1e300, 5e-324, 0.0):
        text = number(v)
        assert float(text.strip("()")) == v
        assert text.startswith("(") == (v < 0)


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


def test_every_value_is_declared_once() -> None:
    kernel = pipeline.compile_model(ALL["contact"]())
    for task, function in kernel.functions.items():
        rows = re.findall(r"(?:const )?(?:V|M|double) ([vms]\d[^;]*);", function.text)
        names = [n for row in rows for n in re.findall(r"(?:^|,\s+)([vms]\d+)", row)]
        assert len(names) == len(set(names)) == function.temporaries, task
        assert "pow(" not in function.text


def test_the_manifest_tells_costs_and_meanings() -> None:
    source = pipeline.compile_model(nested_sums())
    text = output_files.files([source])["manifest.json"]
    assert output_files.files([source])["manifest.json"] == text
    plan = source.functions[Task.TANGENT].plan
    for expected in (
        '"doc": "A sum feeds a sum."',
        '"k": "stiffness"',
        f'"operations": {plan.operations_once + 3 * plan.operations_per_point}',
        f'"operations_per_point": {plan.operations_per_point}',
    ):
        assert expected in text


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


def test_a_compiler_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "fake compiler"
    script.write_text("#!/bin/sh\necho licence expired >&2\nexit 3\n")
    script.chmod(0o755)
    monkeypatch.setenv("CC", f"'{script}' --wrapped")
    (tmp_path / "a.c").write_text("int a;\n")
    with pytest.raises(BuildError, match=r"failed \(3\)") as failed:
        build.build(tmp_path)
    assert "licence expired" in str(failed.value)
    assert f"'{script}' --wrapped -std=c11" in str(failed.value)
    assert not (tmp_path / build.LIBRARY).exists()


def test_a_missing_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(BuildError, match=r"'no-such-compiler' is not on the PATH.* set CC"):
        build.build(tmp_path)
    assert list(tmp_path.iterdir()) == []
    before = {p.name: p.stat().st_mtime_ns for p in build.GENERATED.iterdir()}
    assert shipped_kernels.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("softehl: no C compiler: 'no-such-compiler' is not on the PATH")
    assert len(printed.err.splitlines()) == 1
    assert {p.name: p.stat().st_mtime_ns for p in build.GENERATED.iterdir()} == before


def test_an_empty_cc_is_no_cc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "")
    assert build.compiler() == ["cc"]


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


def test_the_signature_is_that_of_names_and_contents(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    for directory in (first, second):
        directory.mkdir()
        (directory / "a.c").write_text("int a;\n")
        (directory / "notes.txt").write_text(str(directory))
    assert build.signature(first) == build.signature(second)
    os.rename(second / "a.c", second / "b.c")
    assert build.signature(first) != build.signature(second)
