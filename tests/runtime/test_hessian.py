"""Second derivatives of results against central differences of order 6 of exact gradients."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl import Mesh, Study, page
from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result
from softehl.runtime.study import StudyError
from tests.runtime.test_derivatives import (
    BY,
    EXACT,
    METAL,
    PLACE,
    START,
    difference,
    panel,
    relaxing,
    rings,
    rubber,
    solids,
    strip,
    touching,
)


@page
def bar(m: Any) -> None:
    """A linear bar with a stiffness, and a share of it of each element."""
    u = m.scalar("u")
    (E,) = m.parameters(E="stiffness")
    (s,) = m.data(s="share of the stiffness")
    m.minimise(s * E / 2 * m.grad(u)[0] ** 2)


@cache
def pulled(E: float = 2.0, F: float = 3.0) -> Result:
    study = Study(Mesh.line(1.0, cells=2))
    study.add("bar", bar, E=E, s=[1.0, 0.5])
    study.fix("left", u=0)
    study.load("right", u=F)
    return study.solve()


def matrix(hessian: dict[Any, Any]) -> Array:
    """All second derivatives by numbers."""
    n = round(len(hessian) ** 0.5)
    return np.array([*hessian.values()]).reshape(n, n)


def test_a_bar_has_its_closed_form() -> None:
    """u = F / (2 E) (1 / s1 + 1 / s2) at the end of a bar of unit length."""
    E, F, s = 2.0, 3.0, np.array([1.0, 0.5])
    by: Any = {"bar": ["E", "s"], "load:right": "u"}
    H = pulled().hessian("u", at=(1.0,), by=by)
    stiffness, share, force = ("bar", "E"), ("bar", "s"), ("load:right", "u")
    assert H[stiffness, stiffness] == pytest.approx(3 * F / E**3, rel=1e-14)
    assert H[stiffness, force] == pytest.approx(-1.5 / E**2, rel=1e-14)
    assert H[force, force] == pytest.approx(0.0, abs=1e-15)
    assert H[share, share] == pytest.approx(np.diag(F / E / s**3), rel=1e-14)
    assert H[stiffness, share] == pytest.approx(F / (2 * E**2 * s**2), rel=1e-14)
    assert H[share, force] == pytest.approx(-1 / (2 * E * s**2), rel=1e-14)
    along = pulled().hessian_product(
        "u", at=(1.0,), by=by, direction={stiffness: 2.0, share: np.array([0.0, 1.0])}
    )
    assert along[force] == pytest.approx(2.0 * H[stiffness, force] + H[share, force][1])  # type: ignore[index]


def check(solved: Callable[..., Result], start: dict[str, float], **asked: Any) -> None:
    """The Hessian is symmetric, and its product with a direction that of differences of slopes.

    Factors of functions are the inputs named "wave".
    """
    H = matrix(solved(**start).hessian(**asked))
    assert np.abs(H - H.T).max() < 1e-11 * np.abs(H).max()

    def slopes(s: float) -> Array:
        values = {n: v + s * d for (n, v), d in zip(start.items(), direction, strict=True)}
        found: Array = np.array([*solved(**values).sensitivity(**asked).values()])
        found /= np.array([values[n] if n == "wave" else 1.0 for n in start])
        return found

    signs = np.random.default_rng(len(start)).uniform(0.5, 1.0, len(start))
    direction = signs * np.array([*start.values()])
    expected = difference(slopes, 0.0, 2e-3)
    assert np.abs(H @ direction - expected).max() < 1e-6 * np.abs(expected).max()
    assert np.abs(1.00001 * H @ direction - expected).max() > 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize(
    "asked", [{"what": "u_y", "at": PLACE}, {"what": "u_x", "reaction": "left"}]
)
def test_by_all_that_a_study_is_given(asked: dict[str, Any]) -> None:
    names = ("mu", "K", "lift", "p", "shift", "k", "wave")

    def solved(**changes: float) -> Result:
        return panel(None, **changes).solve(steps=2, newton=EXACT)

    check(solved, {n: START[n] for n in names}, by=BY, **asked)


def test_through_plasticity_and_load_steps() -> None:
    def solved(**changes: float) -> Result:
        scaled = {n: v * METAL[n] for n, v in changes.items()}
        return strip(**scaled).solve(steps=5, newton=EXACT, record=True)

    result = strip().solve(steps=5, newton=EXACT, record=True)
    asked: Any = {"what": "u_x", "reaction": "right", "by": {"metal": [*METAL]}}
    H, names = matrix(result.hessian(**asked)), [*METAL]
    assert result.state["metal"][:, :, 3].max() > 0.01
    assert np.abs(H - H.T).max() < 1e-11 * np.abs(H).max()
    sizes = np.array([*METAL.values()])

    def slopes(s: float) -> Array:
        found = solved(**{n: 1 + s * (k + 1) for k, n in enumerate(names)}).sensitivity(**asked)
        return np.asarray(sizes * np.array([*found.values()]))

    expected = difference(slopes, 0.0, 2e-5)
    found = sizes * (H @ (sizes * np.arange(1, len(names) + 1)))
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("method", ["euler", "bdf2"])
def test_through_time(method: Any) -> None:
    def last(k: float, c: float) -> Result:
        study = Study(Mesh.line(1.0, cells=1))
        study.add("node", relaxing(), on="right", k=k, c=c)
        study.load((1.0,), u=lambda x, t: 1 + np.sin(3 * t))
        *_, result = study.march(dt=0.1, until=0.5, method=method, newton=EXACT, record=True)
        return result

    check(last, {"k": 2.0, "c": 0.7}, what="u", at=(1.0,), by={"node": ["k", "c"]})


@page
def maxwell(m: Any) -> None:
    """Visco-elasticity of small strains: a spring beside a spring and a dashpot, one history."""
    u = m.vector("u")
    G, Gv, K, tau, dt = m.parameters(
        G="shear", Gv="shear of the branch", K="bulk", tau="relaxation time", dt="step"
    )
    names = {"v_xx": "viscous strain", "v_yy": "", "v_xy": ""}
    v_xx, v_yy, v_xy = m.point_data(**names)
    grad = m.deformation_gradient(u) - sp.eye(3)
    strain = m.define("strain", (grad + grad.T) / 2)
    e = strain - strain.trace() / 3 * sp.eye(3)
    v = sp.Matrix([[v_xx, v_xy, 0], [v_xy, v_yy, 0], [0, 0, -v_xx - v_yy]])
    new = m.define("new", (v + dt / tau * e) / (1 + dt / tau))
    stress = m.define("stress", K * strain.trace() * sp.eye(3) + 2 * G * e + 2 * Gv * (e - new))
    for i in range(2):
        for j in range(2):
            m.weak(stress[i, j], strain[i, j])
    m.history(v_xx=new[0, 0], v_yy=new[1, 1], v_xy=new[0, 1])


def test_through_relaxation_with_shape_and_prescribed_values() -> None:
    """Parameters, a prescribed function of places, and the shape at once, in time."""
    points = Mesh.rectangle(2, 1, cells=(2, 1)).points
    mode = 0.1 * np.sin(2 * points + 1)
    names = {"G": 1.0, "Gv": 2.0, "K": 3.0, "tau": 0.3}

    def last(shape: float, wave: float, **values: float) -> Result:
        study = Study(Mesh.rectangle(2, 1, cells=(2, 1)).map(lambda _: points + shape * mode))
        study.add("body", maxwell, **values)  # type: ignore[arg-type]
        study.fix("left", u_x=0, u_y=0)
        study.fix("right", u_y=lambda x, t: wave * t * np.cos(x[:, 1]) * x[:, 0] ** 2)
        *_, result = study.march(dt=0.1, until=0.4, newton=EXACT, record=True)
        return result

    by = {"nodes": {"mode": mode}, "fix:right": "u_y", "body": [*names]}
    check(last, {"shape": 1.0, "wave": 1.0, **names}, what="u_y", reaction="left", by=by)


@pytest.mark.parametrize("made", [panel, rings, pytest.param(solids, marks=pytest.mark.slow)])
def test_by_places_of_nodes(made: Callable[[Array], Study]) -> None:
    points = Mesh.rectangle(2, 1, cells=(2, 2)).points
    points = Mesh.box((2, 1, 1), cells=(2, 1, 1)).points if made is solids else points
    points = points + np.array([0.0, 1.0]) if made is rings else points
    modes = [0.1 * np.cos(w * points + np.arange(points.shape[1])) for w in (5, 3)]
    by = {"nodes": {f"m{k}": mode for k, mode in enumerate(modes)}, "body": "mu"}

    def solved(a: float, b: float, mu: float) -> Result:
        places = points + (a - 1) * modes[0] + (b - 1) * modes[1]
        return made(places).varied({("body", "mu"): mu}).solve(newton=EXACT)

    check(solved, {"a": 1.0, "b": 1.0, "mu": 0.4}, what="u_x", reaction="left", by=by)


def test_through_ties_with_an_offset() -> None:
    def solved(mu: float, offset: float) -> Result:
        study = Study(Mesh.rectangle(2, 1, cells=(2, 2)))
        study.add("body", rubber, mu=mu, K=0.9, swell=1.0)
        for name, value in (("u_x", offset), ("u_y", 0.0)):
            study.tie("right", "left", name, offset=value)
        study.fix("bottom", u_y=0)
        study.fix((0.0, 0.0), u_x=0)
        study.load("top", u_x=lambda x, t: 0.05 * x[:, 0])
        return study.solve(newton=EXACT)

    by = {"body": "mu", "tie:right": "u_x"}
    check(solved, {"mu": 0.4, "offset": 0.2}, what="u_x", at=(1.0, 1.0), by=by)


def test_every_node_and_modes_agree() -> None:
    result = panel().solve(newton=EXACT)
    modes = np.sin(3.0 * result.system.mesh.points + 1.0)
    by: Any = {"nodes": ["x", "y"]}
    asked: Any = {"what": "u_y", "reaction": "left"}
    direction: Any = {("nodes", "x"): modes[:, 0], ("nodes", "y"): modes[:, 1]}
    along = result.hessian_product(by=by, direction=direction, **asked)
    twice = sum(float(along[key] @ v) for key, v in direction.items())
    mode = ("nodes", "m")
    moved = result.hessian(by={"nodes": {"m": modes}}, **asked)[mode, mode]
    assert twice == pytest.approx(moved, rel=1e-9)


def test_of_a_function_of_the_unknowns() -> None:
    """The square of a displacement: by product rule from the displacement's own."""
    result, by = pulled(), {"bar": "E", "load:right": "u"}
    n = result.system.numbering.nodal["u"][result.system.mesh.node_at(np.array([1.0]))]
    unit = np.eye(len(result.x))[n]
    H = matrix(
        result.hessian(lambda x: ((unit @ x) ** 2, 2 * x * unit, 2 * np.outer(unit, unit)), by=by)
    )
    u = result.at((1.0,))["u"]
    slope = np.array([*result.sensitivity("u", at=(1.0,), by=by).values()])
    expected = 2 * np.outer(slope, slope) + 2 * u * matrix(result.hessian("u", at=(1.0,), by=by))
    assert pytest.approx(expected, rel=1e-13) == H
    for function, words in {
        lambda x: (x @ x, 2 * x): "need its own: let it return",
        lambda x: (x @ x, 2 * x, np.eye(2)): r"has the shape \(2, 2\), must be",
    }.items():
        with pytest.raises(StudyError, match=words):
            result.hessian(function, by=by)


def test_what_does_not_exist_is_refused() -> None:
    asked: Any = {"reaction": "upper:top", "by": {"lower": "mu"}}
    with pytest.raises(StudyError, match="second derivatives through contact of bodies do not"):
        touching().solve(steps=2).hessian("u_y", **asked)
    other: Any = {"at": (1.0,), "by": {"bar": ["E", "s"]}}
    directions: list[tuple[Any, str]] = [
        ({}, "say how inputs move"),
        ({("bar", "F"): 1.0}, r"direction: \('bar', 'F'\) is no input of by; there are"),
        ({("bar", "s"): (1.0, 2.0, 3.0)}, r"needs a number, or an array \(2,\)"),
        ({("bar", "E"): np.nan}, r"direction: \('bar', 'E'\) must be finite"),
    ]
    for direction, words in directions:
        with pytest.raises(StudyError, match=words):
            pulled().hessian_product("u", direction=direction, **other)


def loaded_bar(F: float = 3.0) -> Study:
    study = Study(Mesh.line(1.0, cells=2))
    study.add("bar", bar, E=2.0, s=[1.0, 0.5])
    study.fix("left", u=0)
    study.load("right", u=F)
    return study


def test_covariance_of_a_linear_regression() -> None:
    """u = F x at the middle and the end: the variance of F is s^2 / (x . x)."""
    measured = {(0.5,): {"u": 1.0}, (1.0,): {"u": 2.0}}
    x = np.array([0.25, 0.75])
    F = float(x @ [1.0, 2.0] / (x @ x))
    for method in ("gauss-newton", "newton"):
        fit = loaded_bar().fit(measured, by={"load:right": "u"}, method=method)
        s2 = float(((F * x - [1.0, 2.0]) ** 2).sum())
        assert fit.values["load:right", "u"] == pytest.approx(F, rel=1e-10)
        assert fit.standard_errors["load:right", "u"] == pytest.approx((s2 / (x @ x)) ** 0.5)


def test_covariance_is_how_the_fit_follows_the_measurements() -> None:
    """Large residuals: slopes of the fitted value by each measurement, by differences."""
    sigma, step, mu = 0.1, 1e-3, ("body", "mu")
    base = np.array([0.2, 1.0])

    def fitted(numbers: Array, method: str = "newton") -> Any:
        study = panel().varied({("load:right", "u_y"): 0.2})
        measured: Any = {PLACE: {"u_y": numbers.tolist()}}
        by = {"body": "mu"}
        return study.fit(measured, by=by, sigma=sigma, method=method, steps=2, newton=EXACT)

    values = [[fitted(base + s * step * e).values[mu] for s in (1, -1)] for e in np.eye(2)]
    slopes = np.array([(a - b) / (2 * step) for a, b in values])
    variance = sigma**2 * float(slopes @ slopes)
    assert fitted(base).covariance[0, 0] == pytest.approx(variance, rel=1e-4)
    assert abs(fitted(base, "gauss-newton").covariance[0, 0] / variance - 1) > 0.1


def test_methods_of_a_fit_and_of_a_march_are_told_apart() -> None:
    measured, by = {(1.0,): {"u": 2.0}}, {"bar": "E"}
    with pytest.raises(StudyError, match="method = 'newtn', must be 'gauss-newton' or 'newton'"):
        loaded_bar().fit(measured, by=by, method="newtn")
    options: Any = ({"method": "bdf2"}, {"method": "newton", "integrator": "bdf2"})
    values = [loaded_bar().fit(measured, by=by, dt=0.5, until=1, **o).values for o in options]
    assert values[0]["bar", "E"] == pytest.approx(values[1]["bar", "E"], rel=1e-8)


def test_hessian_of_an_objective() -> None:
    tip = loaded_bar().objective("u", at=(1.0,), by={"bar": "E", "load:right": "u"})
    p = np.array([2.0, 3.0])
    expected = np.array([[3 * 3 / 2**3, -1.5 / 4], [-1.5 / 4, 0.0]])
    assert tip.hessian(p) == pytest.approx(expected, abs=1e-14)
    assert tip.hessian_product(p, np.array([1.0, 2.0])) == pytest.approx(expected @ [1.0, 2.0])
