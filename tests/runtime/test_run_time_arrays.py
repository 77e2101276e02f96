"""Curves and networks in studies: solutions, derivatives by their data, fits, messages."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad
from scipy.optimize import brentq

import softehl
from softehl import Mesh, NotConverged, Study, StudyError, Table, initial_weights

PAGE = '''"""Heat with a conductivity of a curve."""

import softehl


@softehl.page
def conducting(m):
    """div (k(T) grad T) + q = 0."""
    T = m.scalar("T")
    (q,) = m.parameters(q="source")
    k = m.table("k", T, meaning="conductivity [W/(mm K)]")
    m.weak(k * m.grad(T), m.grad(T))
    m.weak(-q, T)
    m.fields(k=k)
'''
X, Y = [20.0, 100.0, 250.0, 400.0], np.array([1.2, 1.1, 1.0, 0.9])


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "conducting.py"
    path.write_text(PAGE, encoding="utf-8")
    return path


def bar(page: Any, curve: Any, q: float = 0.0, n: int = 6) -> Study:
    study = Study(Mesh.rectangle(1.0, 0.1, cells=(n, 1)))
    study.add("bar", page, q=q, k=curve)
    study.fix("left", T=20.0)
    study.fix("right", T=400.0)
    return study


@pytest.mark.parametrize("kind", ["linear", "pchip", "spline"])
def test_a_bar_conducts_by_its_curve(page: Path, kind: Any) -> None:
    """Kirchhoff's transformation: the integral of k over T is linear in space."""
    curve = Table(X, Y, kind, "constant")

    def integral(t: float) -> float:
        kinks = [x for x in X[1:-1] if x < t]
        return float(quad(lambda s: float(curve(s)), 20, t, points=kinks or None)[0])

    middle = brentq(lambda t: integral(t) - integral(400) / 2, 30, 390)
    T = bar(page, Table(X, Y, kind), n=40).solve().at((0.5, 0.05))["T"]
    assert pytest.approx(middle, rel=1e-5) == T


@pytest.mark.parametrize("kind", ["linear", "pchip", "spline"])
def test_results_are_differentiated_by_the_values_of_a_curve(page: Path, kind: Any) -> None:
    def value(y: Any) -> float:
        return float(bar(page, Table(X, y, kind), q=30).solve().at((0.5, 0.05))["T"])

    result = bar(page, Table(X, Y, kind), q=30).solve(record=True)
    slopes = result.sensitivity("T", at=(0.5, 0.05), by={"bar": ["k"]})["bar", "k"]
    steps = 1e-5 * np.eye(4)
    differences = [(value(Y + h) - value(Y - h)) / 2e-5 for h in steps]
    assert slopes == pytest.approx(differences, rel=1e-6)


def test_a_curve_is_fitted(page: Path) -> None:
    """Temperatures and a flux of one curve give it back from the start of another one."""
    results: list[Any] = []
    truth = Y + np.array([0.1, 0.05, -0.05, -0.1])
    bar(page, Table(X, truth, "pchip")).solve(steps=4, on_step=results.append)
    places = [(x, 0.05) for x in (0.25, 0.5, 0.75)]
    measured: dict[Any, Any] = {p: {"T": {r.t: r.at(p)["T"] for r in results}} for p in places}
    measured["left"] = {"T": {r.t: r.reaction("left")["T"] for r in results}}
    fit = bar(page, Table(X, Y, "pchip")).fit(measured, by={"bar": ["k"]}, steps=4)
    assert fit.values["bar", "k"] == pytest.approx(truth, rel=1e-6)


def test_a_curve_that_ends_is_named_with_its_line(page: Path) -> None:
    with pytest.raises(
        NotConverged, match=r"the curve 'k' ends there: its points go from 20 to"
    ) as e:
        bar(page, Table(X, Y, outside="error")).solve()
    assert "k has no value at point 0, T = 0 (k, " in str(e.value)
    assert f"{page}:11" in str(e.value)


def test_data_that_do_not_fit_name_their_block(page: Path) -> None:
    with pytest.raises(StudyError, match="'bar': k: a curve is needed, as in k="):
        bar(page, 3.0)
    with pytest.raises(StudyError, match="needs k"):
        Study(Mesh.rectangle(1, 1, cells=(1, 1))).add("bar", page, q=0.0)


def test_a_study_with_a_curve_is_pickled(page: Path) -> None:
    study = bar(page, (X, Y))
    again = pickle.loads(pickle.dumps(study))
    assert again.solve().x.tolist() == study.solve().x.tolist()


@softehl.material
def learned(m: Any) -> None:
    """A network of invariants beside a volumetric energy."""
    (K,) = m.parameters(K="bulk modulus [MPa]")
    J = m.define("J", m.F.det())
    C = m.F.T * m.F
    I1 = m.define("I1", C.trace() * J ** sp.Rational(-2, 3) - 3)
    m.energy(m.network("W", [I1], layers=(4,), convex=True, monotone=True) + K / 2 * (J - 1) ** 2)


@softehl.page
def learned_body(m: Any) -> None:
    """A body of it, with products."""
    F = m.deformation_gradient(m.vector("u"))
    m.weak(m.stress(learned, F), F)
    m.offer(product=True)


def block(weights: Any, page: Any = None) -> Study:
    study = Study(Mesh.box((1, 1, 1), cells=(2, 1, 1)))
    source = {"material": learned} if page is None else {"source": page}
    study.add("body", **source, K=2.0, W=weights)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0)
    study.fix("right", u_x=0.3)
    return study


def test_results_are_differentiated_by_weights() -> None:
    """Adjoint and direct derivatives by all weights agree with differences."""
    weights = initial_weights(1, (4,), convex=True, monotone=True, seed=4)
    result = block(weights).solve(steps=2, record=True)
    by = {"body": ["W"]}
    adjoint = np.asarray(result.sensitivity("u_x", reaction="right", by=by)["body", "W"])
    flat = np.concatenate([v.ravel() for layer in weights for v in layer])

    def force(values: Any) -> float:
        return float(block(values).solve(steps=2).reaction("right")["u_x"])

    for k in (0, 5, 9, 13):
        h = 1e-6 * np.eye(len(flat))[k]
        assert adjoint[k] == pytest.approx((force(flat + h) - force(flat - h)) / 2e-6, abs=1e-7)


def test_a_network_solves_without_a_matrix() -> None:
    weights = initial_weights(1, (4,), convex=True, monotone=True, seed=4)
    direct = block(weights).solve(steps=2)
    free = block(weights, learned_body).solve(steps=2, linear="matrix-free")
    assert free.x == pytest.approx(direct.x, abs=1e-9)
