"""Tangents as products B^T M B at the points: the same as written out, and what is left out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.abi import Task
from softehl.codegen.derive import point_products
from softehl.codegen.derive.output_entries import OutputArray
from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.codegen.verify.quick_check import check
from softehl.runtime.kernels.kernel import load_kernel

NODES = 5


def beam(name: str, energy: Callable[..., Any], *, turned: bool = True) -> Model:
    """Stretch e and bending k of a plane curve of five nodes, a spring at its end."""
    m = Model(name, nodes=NODES, rule=quadrature.gauss(3, 1))
    (X,) = m.coordinates("X")
    u, v, r = m.nodal_unknowns("u", "v", "r")
    stiff, spring = m.parameters(stiff="of bending", spring="at the end")
    (xi,) = m.point()
    points = [sp.Rational(a - 2, 2) for a in range(NODES)]
    N = [sp.prod([(xi - p) / (q - p) for p in points if p != q]) for q in points]
    J = m.define("J", sum(sp.diff(n, xi) * x for n, x in zip(N, X, strict=True)))
    slopes = [
        m.define(f"{name}_s", sum(sp.diff(n, xi) * a for n, a in zip(N, f, strict=True)) / J)
        for name, f in (("u", u), ("v", v), ("r", r))
    ]
    angle = [m.define(f"t{a}", sp.sin(x) if turned else x) for a, x in enumerate(r)]
    t = m.define("t", sum(n * a for n, a in zip(N, angle, strict=True)))
    e = m.define("e", slopes[0] + (slopes[0] ** 2 + slopes[1] ** 2) / 2 + t * slopes[1])
    energy(m, e, slopes[2], t, J, stiff)
    m.potential(spring / 2 * (u[4] - v[4]) ** 2 * (1 + r[4] ** 2))
    m.example(**{f"X{a + 1}": float(p) for a, p in enumerate(points)})
    return m


def conservative(m: Model, e: Any, k: Any, t: Any, J: Any, stiff: Any) -> None:
    """A kink in the stretch, and a quartic."""
    W = sp.Piecewise((e**2, e > 0), (2 * e**2, True)) + stiff * k**2 * (1 + e**2) + sp.exp(t) * k
    m.potential(m.integral("Pi", W * J))


def weak(m: Model, e: Any, k: Any, t: Any, J: Any, stiff: Any) -> None:
    """An unsymmetric tangent: factors that see all values."""
    m.weak_form([((e + e**3 + k * t) * J, e), (stiff * k * (1 + t**2 + e) * J, k)])


def plain(m: Model, e: Any, k: Any, t: Any, J: Any, stiff: Any) -> None:
    """A factor in front of the integral."""
    m.potential(-3 * stiff * m.integral("Pi", -(e**2 + k**2 + t**2 * e) * J))


def local(m: Model, e: Any, k: Any, t: Any, J: Any, stiff: Any) -> None:
    """A local unknown at every point."""
    s = m.implicit("s", lambda s: s**3 + s - e - t, start=0)
    m.weak_form([(s * J, e), (stiff * (k + s**2) * J, k)])


PAGES = {f.__name__: f for f in (conservative, weak, plain, local)}


def made(d: Definition, folder: Path) -> tuple[str, Path]:
    """C and library of a model."""
    folder.mkdir()
    text = ""
    for name, content in output_files.files([pipeline.compile_model(d)]).items():
        (folder / name).write_text(content, encoding="utf-8")
        text += content
    build.build(folder, extra=(*build.STRICT, "-O0"))
    return text, folder / build.LIBRARY


@pytest.fixture
def everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Products also for small tangents."""
    monkeypatch.setattr(point_products, "LARGE", 0)


def tangent(d: Definition, folder: Path) -> Any:
    """At some states, by the kernel."""
    kernel, rng = load_kernel(d.name, folder), np.random.default_rng(3)
    X = np.linspace(-1, 1, NODES) + rng.uniform(-0.05, 0.05, (7, NODES))
    u = rng.uniform(-0.4, 0.4, (7, 3 * NODES))
    return kernel.tangent(X, u, parameters=np.array([0.7, 0.3]))


@pytest.mark.parametrize("page", PAGES)
def test_the_tangent_is_the_one_written_out(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    d = beam(page, PAGES[page]).finish()
    text, _ = made(d, tmp_path / "long")
    assert "M_lanes" not in text
    monkeypatch.setattr(point_products, "LARGE", 0)
    d = beam(page, PAGES[page]).finish()
    text, library = made(d, tmp_path / "short")
    assert "M_lanes" in text
    long, short = (tangent(d, tmp_path / name) for name in ("long", "short"))
    for a, b in zip(long, short, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-13 * np.abs(b).max())
    check(d, [Task.RESIDUAL, Task.TANGENT], library)
    if page == "plain":  # an error in a second derivative is seen
        monkeypatch.setattr(point_products, "_curvature", lambda *_: {})
        made(beam(page, PAGES[page]).finish(), tmp_path / "wrong")
        wrong = tangent(d, tmp_path / "wrong")[1]
        assert np.abs(wrong - long[1]).max() > 1e-3 * np.abs(wrong).max()


@pytest.mark.usefixtures("everywhere")
def test_the_fewest_values_are_found() -> None:
    """e and its parts: three slopes and t, or e, k and t."""
    function = pipeline.compile_task(beam("few", conservative).finish(), Task.TANGENT)
    slopes = {x.row.position for x in function.best.entries if x.array is OutputArray.SLOPES}
    assert function.best.rule == "products at the points"
    assert len(slopes) == 4


@pytest.mark.usefixtures("everywhere")
def test_functions_of_integrals_are_written_out() -> None:
    def squared(m: Model, e: Any, k: Any, t: Any, J: Any, stiff: Any) -> None:
        m.potential(stiff * m.integral("Pi", (e**2 + k + t) * J) ** 2)

    def mean(m: Model, e: Any, k: Any, t: Any, J: Any, stiff: Any) -> None:
        level = m.integral("mean", e * J)
        m.potential(m.integral("Pi", (e - level) ** 2 * J * (stiff + k + t)))

    for page in (squared, mean):
        function = pipeline.compile_task(beam(page.__name__, page).finish(), Task.TANGENT)
        assert function.best.rule != "products at the points"
