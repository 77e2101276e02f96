"""Lanes that go different ways: branches, local iterations and failures beside each other."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen import c_compiler, pipeline
from softehl.codegen.elements import quadrature
from softehl.codegen.emit import c_source
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.discretisation.quadrature import film_rule
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.workshop import element_state, off, write

LANES = ("-DSOFTEHL_LANES=1", "-DSOFTEHL_LANES=4", "-DSOFTEHL_LANES=8")
BATCH = 19
"""Two full groups of eight and a rest."""


def branched() -> Definition:
    """Three ways, each without a value on the others; a branch inside a branch."""
    m = Model("three_ways", nodes=1, rule=quadrature.gauss(2, 1))
    x, y = m.unknown("x"), m.unknown("y")
    (k,) = m.parameters(k="stiffness")
    (xi,) = m.point()
    e = m.define("e", x * (1 + xi / 3) + y**2 / 7)
    inner = sp.Piecewise((sp.sqrt(e - 1) * y, e > 1), (sp.log(1 - e) + e**2, e < 1), (0, True))
    energy = sp.Piecewise((sp.log(-e) * y + k * e**3, e < 0), (inner * e + 1 / (e + 5), True))
    m.potential(m.integral("Pi", energy + sp.exp(k * y * e / 9)))
    m.fields(e=e, energy=energy, twice=2 * k)
    return m.finish()


def plastic() -> Definition:
    """A local iteration on one side of a branch only; it has no solution for c < 0."""
    m = Model("some_yield", nodes=1, rule=quadrature.gauss(2, 1))
    x, y = m.unknown("x"), m.unknown("y")
    (c,) = m.data(c="what the equation needs to be positive")
    old = m.point_data(a="history", b="history")
    (xi,) = m.point()
    e = m.define("e", x * (1 + xi / 5) + y)

    def flow(s: Any) -> list[Any]:
        rest = sp.Piecewise((s[0] ** 3 - s[1], s[0] > 1), (s[0] - s[1] ** 2, True))
        return [s[0] ** 2 + s[1] ** 2 * s[0] - c * (1 + e), rest + old[0] / 10 - old[1]]

    s = m.implicit("s", flow, start=[1, 1])
    yields = e > sp.Rational(1, 2)
    load = sp.Piecewise((s[0] * e + s[1] ** 2, yields), (e**2, True))
    m.potential(m.integral("Pi", load * (1 + y**2)))
    m.fields(s=sp.Piecewise((s[0], yields), (0, True)), e=e)
    return m.finish()


def interpolated() -> Definition:
    m = Model("some_rupture", nodes=1, rule=quadrature.gauss(2, 1))
    u, v = m.unknown("u"), m.unknown("v")
    p, p_xi = m.interpolated("p")
    (k,) = m.parameters(k="penalty")
    load = sp.Piecewise((sp.log(p) * p_xi**2, p > 0), (k * p**2, True))
    m.potential(m.integral("Pi", load * u + sp.exp(p * v) + p_xi**2) + u**2 * v)
    m.fields(load=load, p=p)
    m.offer(product=True)
    return m.finish()


MODELS = (branched, plastic, interpolated)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Definition, Path]]:
    """Definitions, and folders with their C."""
    found = {make.__name__: (make(), tmp_path_factory.mktemp(make.__name__)) for make in MODELS}
    for d, directory in found.values():
        write(d, directory)
    return found


@pytest.fixture(scope="module", params=LANES)
def library(
    request: pytest.FixtureRequest,
    written: dict[str, tuple[Definition, Path]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Any:
    """Definitions and kernels, compiled for each number of lanes on whatever processor this is."""
    found = {}
    for name, (d, c_files) in written.items():
        directory = tmp_path_factory.mktemp(name) / "compiled"
        shutil.copytree(c_files, directory)
        build.build(directory, extra=(*build.STRICT, "-Wno-psabi", "-O1", request.param))
        found[name] = d, load_kernel(d.name, directory)
    return found


def states(name: str, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
    """Unknowns and arguments of a batch whose neighbours take different ways."""
    if name == "branched":
        return rng.uniform(-1.5, 2.5, (BATCH, 2)), {"parameters": [0.7]}
    if name == "plastic":
        given = {"data": rng.uniform(1, 2, (BATCH, 1))}
        given["point_data"] = rng.uniform(0.1, 0.3, (BATCH, 2, 2))
        return rng.uniform(-1, 1.5, (BATCH, 2)), given
    u = np.hstack([rng.uniform(0.5, 1, (BATCH, 2)), rng.uniform(-1, 1, (BATCH, 4))])
    return u, {"parameters": [1.3], "rule": film_rule(3, "gauss")}


def of(given: dict[str, Any], part: slice) -> dict[str, Any]:
    return {k: v[part] if k.endswith("data") else v for k, v in given.items()}


def everything(kernel: Kernel, u: Any, given: dict[str, Any]) -> list[Any]:
    X = np.zeros((len(u), 0))
    out = [kernel.energy(X, u, **given), kernel.residual(X, u, **given)]
    out += [*kernel.tangent(X, u, **given), kernel.fields_at(X, u, **given)]
    if "product" in kernel.tasks:
        out.append(kernel.product(X, u, np.cos(u), **given))
    return out


@pytest.mark.parametrize("name", [m.__name__ for m in MODELS])
def test_neighbours_that_go_different_ways(
    name: str, library: Any, rng: np.random.Generator
) -> None:
    d, kernel = library[name]
    u, given = states(name, rng)
    together = everything(kernel, u, given)
    w = np.linspace(0.5, 1.5, u.shape[1])
    for e in range(BATCH):
        single = {k: v[e] if k.endswith("data") else v for k, v in given.items()}
        expected = said(d, element_state(kernel, (), u[e], **single), tuple(w))
        energy, R, _, K, fields, *_ = (v[e] for v in together)
        for found, exact in zip((energy, R, K @ w, fields), expected, strict=True):
            assert off(found, exact) <= 1e-13


SAID: dict[tuple[str, str], Any] = {}
"""What the oracle says, which is the same for any number of lanes."""


def said(d: Definition, at: EvaluationState, w: tuple[float, ...]) -> Any:
    """Energy, residual, tangent times w and fields of an element."""
    key = d.name, repr((at, w))
    if key not in SAID:
        o = Oracle(d)
        SAID[key] = o.potential(at), o.residual(at), o.product(at, list(w)), o.fields(at)
    return SAID[key]


def test_every_way_is_taken_within_one_group(rng: np.random.Generator) -> None:
    """The states of the test above really mix, or it would show nothing."""
    u, _ = states("branched", rng)
    e = u[:8, 0] + u[:8, 1] ** 2 / 7
    assert (e < 0).any()
    assert ((e > 0) & (e < 1)).any()
    assert (e > 1).any()


@pytest.mark.parametrize("name", [m.__name__ for m in MODELS])
def test_batches_of_every_size_are_bitwise_equal(
    name: str, library: Any, rng: np.random.Generator
) -> None:
    _, kernel = library[name]
    u, given = states(name, rng)
    together = everything(kernel, u, given)
    for n in (*range(1, 10), 16, 17):
        for start in (0, BATCH - n):
            part = slice(start, start + n)
            for a, b in zip(everything(kernel, u[part], of(given, part)), together, strict=True):
                np.testing.assert_array_equal(a, b[part])


def test_a_failure_stays_in_its_lane(library: Any, rng: np.random.Generator) -> None:
    """c < 0 has no solution: fatal where the branch asks for one, of no matter where not."""
    _, kernel = library["plastic"]
    u, given = states("plastic", rng)
    good = everything(kernel, u, given)
    spoilt = np.arange(0, BATCH, 3)
    given["data"][spoilt] = -40.0
    asks = (u[:, :1] * (1 + np.array([-1, 1]) / math.sqrt(3) / 5) + u[:, 1:] > 0.5).any(axis=1)
    failing = np.isin(np.arange(BATCH), spoilt) & asks
    assert 0 < failing.sum() < len(spoilt)
    for a, b in zip(everything(kernel, u, given), good, strict=True):
        assert np.isnan(a[failing]).all()
        np.testing.assert_array_equal(a[~failing], b[~failing])


def test_a_side_that_nobody_takes_is_skipped(tmp_path: Path) -> None:
    """Its code stands inside `if (any lane wants it)`; the blend is by bits, not by a product."""
    text = pipeline.compile_model(branched()).text
    assert "softehl_vsqrt(" in text
    depth = {len(row) - len(row.lstrip()) for row in text.splitlines() if "softehl_vsqrt(" in row}
    assert min(depth) >= 8
    assert text.count("if (softehl_any(") >= 4


# ---------------------------------------------------------------------- functions of the header

DRIVER = """#include "softehl_kernels.h"
void run(int log, ptrdiff_t n, const double *a, double *b)
{
    for (ptrdiff_t i = 0; i < n; i += SOFTEHL_LANES) {
        V v = softehl_column(a + i, 1);
        v = log ? softehl_vlog(v) : softehl_vexp(v);
        softehl_store1(b + i, 1, v);
    }
}
"""


@pytest.fixture(scope="module", params=LANES[1:])
def functions(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str, Any], Any]:
    folder = tmp_path_factory.mktemp("functions")
    (folder / c_source.HEADER).write_text(c_source.header([]))
    (folder / "run.c").write_text(DRIVER)
    flags = [f for f in build.FLAGS if f != "-shared"]
    line = [*c_compiler.compiler(), *flags, request.param, "-Wno-psabi", "-shared"]
    made = folder / "run.so"
    subprocess.run([*line, str(folder / "run.c"), "-o", str(made), "-lm"], check=True)
    run = ctypes.CDLL(str(made)).run

    def call(name: str, values: Any) -> Any:
        out = np.empty_like(values)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (values, out)]
        run(ctypes.c_int(name == "log"), ctypes.c_ssize_t(len(values)), *pointers)
        return out

    return call


def test_exponentials_and_logarithms_to_the_last_digit(
    functions: Callable[[str, Any], Any], rng: np.random.Generator
) -> None:
    given = {
        "exp": [rng.uniform(-1, 1, 400), rng.uniform(-745, 709, 400), rng.normal(0, 1e-9, 400)],
        "log": [rng.uniform(0.5, 2, 400), 1 + rng.normal(0, 1e-6, 400),
                10 ** rng.uniform(-320, 308, 400)],
    }  # fmt: skip
    for name, parts in given.items():
        values = np.concatenate(parts)
        with mpmath.workdps(40):
            for x, y in zip(values, functions(name, values), strict=True):
                exact = getattr(mpmath, name)(mpmath.mpf(float(x)))
                assert abs(mpmath.mpf(float(y)) - exact) <= 1.01 * math.ulp(float(exact)), (name, x)


def test_exponentials_and_logarithms_at_their_ends(
    functions: Callable[[str, Any], Any],
) -> None:
    inf, nan = math.inf, math.nan
    at = np.array([0.0, -0.0, inf, -inf, nan, -1.0, 710.0, -746.0])
    exp = np.array([1.0, 1.0, inf, 0.0, nan, math.exp(-1), inf, 0.0])
    log = np.array([-inf, -inf, inf, nan, nan, nan, math.log(710), nan])
    np.testing.assert_allclose(functions("exp", at), exp, rtol=3e-16)
    np.testing.assert_allclose(functions("log", at), log, rtol=3e-16)


# ---------------------------------------------------------------------- what the generator chooses


def test_a_long_file_is_compiled_lightly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[list[str]] = []
    run = build._run

    def told(command: Sequence[str], makes: Path) -> None:
        commands.append(list(command))
        run(command, makes)

    monkeypatch.setattr(build, "_run", told)
    write(plastic(), tmp_path)
    for limit, light in ((10, True), (10_000, False)):
        commands.clear()
        monkeypatch.setattr(build, "LARGE", limit)
        build.build(tmp_path)
        (compiling,) = (c for c in commands if str(tmp_path / "some_yield.c") in c)
        assert (build.LIGHT in compiling) is light
