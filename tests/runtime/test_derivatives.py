"""Derivatives of results against central differences of order 4 of studies written anew."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.sparse import csc_array

from softehl import Definition, Mesh, Model, Newton, Study, page, quadrature
from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity import jacobian, linearised_step
from softehl.runtime.sensitivity.linearised_step import refined
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.study import StudyError

EXACT = Newton(tolerance=1e-13)
PLACE = (2.0, 1.0)


@page
def rubber(m: Any) -> None:
    """Compressible neo-Hooke with a swelling of each element."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus", K="bulk modulus")
    (swell,) = m.data(swell="relative volume")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det() / swell)
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)


@page
def hardening(m: Any) -> None:
    """J2 plasticity of small strains with linear hardening: radial return, history."""
    u = m.vector("u")
    G, K, sy, H = m.parameters(G="shear", K="bulk", sy="yield stress", H="hardening")
    names = {"p_xx": "plastic strain", "p_yy": "", "p_xy": "", "alpha": "equivalent one"}
    p_xx, p_yy, p_xy, alpha = m.point_data(**names)
    grad = m.deformation_gradient(u) - sp.eye(3)
    strain = m.define("strain", (grad + grad.T) / 2)
    p = sp.Matrix([[p_xx, p_xy, 0], [p_xy, p_yy, 0], [0, 0, -p_xx - p_yy]])
    s = m.define("s", 2 * G * (strain - strain.trace() / 3 * sp.eye(3) - p))
    q = m.define("q", sp.sqrt(sp.Rational(3, 2) * (s * s).trace()))
    excess = m.define("excess", q - sy - H * alpha)
    dg = m.define("dg", sp.Piecewise((excess / (3 * G + H), excess > 0), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), excess > 0), (0, True)))
    stress = m.define("stress", K * strain.trace() * sp.eye(3) + (1 - 2 * G * flow) * s)
    for i, j in itertools.product(range(2), range(2)):
        m.weak(stress[i, j], strain[i, j])
    m.fields(yielding=dg)
    new = p + flow * s
    m.history(p_xx=new[0, 0], p_yy=new[1, 1], p_xy=new[0, 1], alpha=alpha + dg)


@cache
def relaxing() -> Definition:
    """A node on a spring and a dashpot beside a spring whose memory h follows it."""
    m = Model("relaxing", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    k, c, dt = m.parameters(k="stiffness", c="viscosity", dt="step")
    (h_old,) = m.point_data(h_old="memory")
    ((rate,),) = m.rates("u")
    h = m.define("h", (h_old + dt * k * u**2) / (1 + dt * c))
    m.weak_form([(k * u + c * rate + h * u, u)])
    m.fields(memory=h)
    m.history(h_old=h)
    return m.finish()


def difference(value: Callable[[float], Any], x: float, step: float) -> Any:
    rises = [value(x + k * step) - value(x - k * step) for k in (1, 2)]
    return np.dot([8.0, -1.0], rises) / (12.0 * step)


START = {"mu": 0.4, "K": 0.9, "lift": 0.05, "p": 0.02, "shift": 0.1, "k": 0.3, "wave": 1.0}


def panel(points: Array | None = None, **changes: float) -> Study:
    given = START | changes
    mesh = Mesh.rectangle(2, 1, cells=(2, 2))
    if points is not None:
        mesh = mesh.map(lambda _: points)
    study = Study(mesh)
    study.add("body", rubber, mu=given["mu"], K=given["K"], swell=1.1)
    study.fix("left", u_x=given["shift"], u_y=lambda x, t: 0.02 * t * x[:, 1] ** 2)
    study.load("right", u_y=given["lift"])
    study.load("top", u_x=lambda x, t: given["wave"] * 0.01 * t * np.sin(x[:, 0]))
    study.pressure("bottom", given["p"])
    study.spring("right", u_x=given["k"])
    return study


BY = {
    "body": ["mu", "K"],
    "load:right": ["u_y"],
    "pressure:bottom": ["pressure"],
    "fix:left": ["u_x"],
    "spring:right": "u_x",
    "load:top": "u_x",
}


def both_ways(result: Result, monkeypatch: pytest.MonkeyPatch, **asked: Any) -> dict[Any, Any]:
    """Sensitivities, for which both ways must have the same figures."""
    found = []
    for cheaper in (True, False):
        monkeypatch.setattr(jacobian, "_direct_is_cheaper", lambda *_, c=cheaper: c)
        found.append(result.sensitivity(**asked))
    for key, value in found[0].items():
        assert np.allclose(value, found[1][key], rtol=1e-10, atol=1e-13), key
    return found[0]


def test_by_all_that_a_study_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    result = panel().solve(steps=2, newton=EXACT)
    place = both_ways(result, monkeypatch, what="u_y", by=BY, at=PLACE)
    force = both_ways(result, monkeypatch, what="u_y", by=BY, reaction="left")

    def values(**changes: float) -> Array:
        found = panel(None, **changes).solve(steps=2, newton=EXACT)
        return np.array([found.at(PLACE)["u_y"], found.reaction("left")["u_y"]])

    for key, (name, x) in zip(place, START.items(), strict=True):
        expected = difference(lambda v, n=name: values(**{n: v}), x, 5e-3 * x)  # type: ignore[misc]
        got = np.array([place[key], force[key]])
        assert np.allclose(got, expected, rtol=1e-7, atol=1e-9), key
        assert not np.allclose(1.001 * got, expected, rtol=1e-7, atol=1e-9), key


def test_by_places_of_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    result = panel().solve(newton=EXACT)
    points = result.system.mesh.points
    mode = np.sin(3.0 * points + 1.0)
    mode[result.system.mesh.node_at(np.array(PLACE))] = 0.0  # where the value is taken
    by = {"nodes": ["x", "y"]}
    found = both_ways(result, monkeypatch, what="u_y", by=by, at=PLACE)
    along = found["nodes", "x"] @ mode[:, 0] + found["nodes", "y"] @ mode[:, 1]
    expected = difference(
        lambda s: panel(points + s * mode).solve(newton=EXACT).at(PLACE)["u_y"], 0.0, 1e-3
    )
    assert along == pytest.approx(expected, rel=1e-8)
    moved = result.sensitivity("u_y", at=PLACE, by={"nodes": {"wavy": mode}})
    assert moved["nodes", "wavy"] == pytest.approx(along, rel=1e-10)
    right = result.sensitivity("u_y", at=PLACE, by={"nodes:right": "x"})["nodes:right", "x"]
    assert np.allclose(right, found["nodes", "x"][result.system.mesh.nodes("right")], atol=1e-14)


def rings(points: Array) -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 2)).map(lambda _: points), "axisymmetric")
    study.add("body", rubber, mu=0.4, K=0.9, swell=1.05)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=lambda x, t: 0.03 * t * x[:, 1])
    study.pressure("bottom", 0.03)
    return study


def solids(points: Array) -> Study:
    study = Study(Mesh.box((2, 1, 1), cells=(2, 1, 1)).map(lambda _: points))
    study.add("body", rubber, mu=0.4, K=0.9, swell=1.05)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.load("right", u_y=lambda x, t: 0.03 * t * x[:, 1])
    study.pressure("bottom", 0.03)
    return study


@pytest.mark.parametrize("made", [rings, solids])
def test_by_places_of_rings_and_solids(made: Callable[[Array], Study]) -> None:
    mesh = Mesh.rectangle(2, 1, cells=(2, 2)).map(lambda x: x + np.array([0.0, 1.0]))
    points = mesh.points if made is rings else Mesh.box((2, 1, 1), cells=(2, 1, 1)).points
    mode = np.cos(5 * points + np.arange(points.shape[1]))

    def value(s: float) -> float:
        return made(points + s * mode).solve(newton=EXACT).reaction("left")["u_y"]

    result = made(points).solve(newton=EXACT)
    found = result.sensitivity("u_y", reaction="left", by={"nodes": {"wavy": mode}})
    assert found["nodes", "wavy"] == pytest.approx(difference(value, 0.0, 1e-3), rel=1e-8)


def test_by_a_field_of_an_element_each(monkeypatch: pytest.MonkeyPatch) -> None:
    study = panel()
    found = both_ways(
        study.solve(newton=EXACT), monkeypatch, what="u_x", by={"body": "swell"}, at=PLACE
    )
    slopes = found["body", "swell"]

    def value(v: float) -> float:
        swell = np.array([1.1, v, 1.1, 1.1])
        other = study.varied({("body", "swell"): swell})
        return other.solve(newton=EXACT).at(PLACE)["u_x"]

    assert slopes.shape == (4,)
    assert slopes[1] == pytest.approx(difference(value, 1.1, 1e-3), rel=1e-8)


def test_of_all_unknowns_and_of_a_function() -> None:
    result = panel().solve(newton=EXACT)
    found = result.derivative(by={"body": ["K", "mu"]})
    number = result.system.numbering.nodal["u_y"][result.system.mesh.node_at(np.array(PLACE))]
    at = result.sensitivity("u_y", at=PLACE, by={"body": ["mu", "K"]})
    assert found.shape == (len(result.x), 2)
    assert found[number].tolist() == pytest.approx([at["body", "K"], at["body", "mu"]])
    energy = result.sensitivity(lambda x: (float(x @ x) / 2, x), by={"body": "mu"})
    assert energy["body", "mu"] == pytest.approx(result.x @ found[:, 1])


def test_through_ties(monkeypatch: pytest.MonkeyPatch) -> None:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 2)))
    study.add("body", rubber, mu=0.4, K=0.9, swell=1.0)
    for name, offset in (("u_x", 0.2), ("u_y", 0.0)):
        study.tie("right", "left", name, offset=offset)
    study.fix("bottom", u_y=0)
    study.fix((0.0, 0.0), u_x=0)
    study.load("top", u_x=lambda x, t: 0.05 * x[:, 0])
    by = {"body": "mu", "tie:right": "u_x"}
    found = both_ways(study.solve(newton=EXACT), monkeypatch, what="u_x", by=by, at=(1.0, 1.0))

    def value(**changes: float) -> float:
        given = {"mu": 0.4, "offset": 0.2} | changes
        other = study.varied({("body", "mu"): given["mu"], ("tie:right", "u_x"): given["offset"]})
        return other.solve(newton=EXACT).at((1.0, 1.0))["u_x"]

    for (_, slope), (name, x) in zip(
        found.items(), {"mu": 0.4, "offset": 0.2}.items(), strict=True
    ):
        expected = difference(lambda v, n=name: value(**{n: v}), x, 1e-3)  # type: ignore[misc]
        assert slope == pytest.approx(expected, rel=1e-8, abs=1e-10)


METAL = {"G": 80.0, "K": 160.0, "sy": 0.45, "H": 5.0}


def strip(**changes: float) -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 2)))
    given: Any = METAL | changes
    study.add("metal", hardening, **given)
    study.fix("left", u_x=0, u_y=0)
    study.fix("right", u_x=lambda x, t: 0.02 * np.sin(2.5 * t) * (1 + x[:, 1]))  # and back
    return study


def test_through_plasticity_and_load_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    def value(**changes: float) -> float:
        return strip(**changes).solve(steps=5, newton=EXACT).reaction("right")["u_x"]

    result = strip().solve(steps=5, newton=EXACT, record=True)
    assert result.state["metal"][:, :, 3].max() > 0.01
    found = both_ways(result, monkeypatch, what="u_x", by={"metal": [*METAL]}, reaction="right")
    for name, x in METAL.items():
        expected = difference(lambda v, n=name: value(**{n: v}), x, 1e-4 * x)  # type: ignore[misc]
        assert found["metal", name] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("method", ["euler", "bdf2"])
def test_through_time(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def last(k: float = 2.0, c: float = 0.7) -> Result:
        study = Study(Mesh.line(1.0, cells=1))
        study.add("node", relaxing(), on="right", k=k, c=c)
        study.load((1.0,), u=lambda x, t: 1 + np.sin(3 * t))
        *_, result = study.march(dt=0.1, until=0.5, method=method, newton=EXACT, record=True)
        return result

    by = {"node": ["k", "c"]}
    found = both_ways(last(), monkeypatch, what="u", by=by, at=(1.0,))
    for name, x in {"k": 2.0, "c": 0.7}.items():
        expected = difference(lambda v, n=name: last(**{n: v}).at((1.0,))["u"], x, 2e-3 * x)  # type: ignore[misc]
        assert found["node", name] == pytest.approx(expected, rel=1e-8)


@page
def sheet(m: Any) -> None:
    """Two fields that resist their slopes, by the names of the shipped contact."""
    z, r = m.scalar("u_z"), m.scalar("u_r")
    (G,) = m.parameters(G="stiffness")
    slopes = [*m.grad(z), *m.grad(r)]
    m.minimise(G / 2 * sum(s**2 for s in slopes))


def test_through_contact_with_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    def solved(G: float = 1.0, friction: float = 0.3) -> Result:
        study = Study(Mesh.rectangle(2, 1, cells=(3, 2)))
        study.add("block", sheet, G=G)
        wall: Any = {"n_z": 0, "n_r": -1, "c": lambda x: -0.95 - 0.1 * (x[:, 0] - 0.8) ** 2}
        where: Any = {"offset": 0, "area": 0.5, "rho": 1.0, **wall}
        study.add("wall", "contact_friction", on="top", friction=friction, **where)
        study.fix("bottom", u_z=lambda x, t: 0.012 * t, u_r=0)
        return study.solve(steps=3, newton=EXACT, record=True)

    result, by = solved(), {"block": "G", "wall": "friction"}
    p, tau = -result.values("lambda"), abs(result.values("tau"))
    share = tau[p > 0] / p[p > 0]
    assert 0 < len(share) < len(p)
    assert share.min() < 0.29 < 0.2999 < share.max()
    found = both_ways(result, monkeypatch, what="u_z", by=by, reaction="bottom")
    for key, (name, x) in zip(found, {"G": 1.0, "friction": 0.3}.items(), strict=True):
        expected = difference(
            lambda v, n=name: solved(**{n: v}).reaction("bottom")["u_z"],  # type: ignore[misc]
            x,
            1e-4 * x,
        )
        assert found[key] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("by", "words"),
    [
        ({"bdy": ["mu"]}, "by: there is no 'bdy' (did you mean 'body'?); there are body, load:"),
        ({"body": ["nu"]}, "by: 'body' (rubber_quad4) has no 'nu'; it has mu, K, swell"),
        ({"load:rigth": ["u_y"]}, "there is no 'load:rigth' (did you mean 'load:right'?)"),
        ({"load:right": ["u_z"]}, "by: 'load:right' has no 'u_z' (did you mean 'u_y'?)"),
        ({"fix:left": ["T"]}, "by: 'fix:left' has no 'T'; it has u_x, u_y"),
        ({"pressure:bottom": ["p"]}, "by: 'pressure:bottom' has no 'p'; it has pressure"),
        ({"nodes": ["z"]}, "by: 'nodes' has no 'z'; it has x, y, or a mode"),
        ({"nodes": {"a": np.zeros(3)}}, "the mode 'a' of the nodes has the shape (3,), must be"),
        ({"body": {"mu": 1.0}}, "by: modes are those of \"nodes\", not of 'body'"),
        ({"body": []}, "by: 'body' needs a list of names"),
        (["mu"], "by = ['mu']: say by what"),
    ],
)
def test_what_is_not_there_is_named(by: Any, words: str) -> None:
    with pytest.raises(StudyError) as error:
        solved_panel().sensitivity("u_y", at=PLACE, by=by)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@cache
def solved_panel() -> Result:
    return panel().solve()


def test_quantities_that_make_no_sense_are_refused() -> None:
    result, by = solved_panel(), {"body": "mu"}
    for words, asked in {
        "no unknown 'u_z'": {"what": "u_z", "at": PLACE},
        "give at=(x, y), a place, or reaction": {"what": "u_y"},
        "a place is a tuple of numbers": {"what": "u_y", "at": "right"},
        "has the shape (3,), must be": {"what": lambda x: (0.0, np.zeros(3))},
    }.items():
        with pytest.raises(StudyError) as error:
            result.sensitivity(by=by, **asked)  # type: ignore[arg-type]
        assert words in str(error.value)


def test_factors_solve_with_the_transpose() -> None:
    rng = np.random.default_rng(3)
    K = csc_array(np.diag(np.arange(4.0, 16.0)) + 0.3 * rng.normal(size=(12, 12)))
    turned, b = SuperLU().factorise(K).transposed(), rng.normal(size=12)
    assert turned is not None
    assert turned.solve(b) == pytest.approx(np.linalg.solve(K.toarray().T, b), rel=1e-12)


def test_factors_near_by_are_refined_or_refused() -> None:
    """Those of the last iteration give the digits of new ones; others are not taken."""
    generator = np.random.default_rng(0)
    K, b = generator.standard_normal((20, 20)) + 10 * np.eye(20), generator.standard_normal(20)
    near, far = (csc_array(K + s * generator.standard_normal(K.shape)) for s in (1e-4, 10.0))
    assert refined(SuperLU().factorise(near), csc_array(K), b) == pytest.approx(
        np.linalg.solve(K, b), rel=1e-12
    )
    assert refined(SuperLU().factorise(far), csc_array(K), b) is None


def test_a_recorded_result_needs_no_new_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    by = {"body": ["mu", "K"], "nodes": ["x"]}
    expected = panel(p=0.0).solve().sensitivity("u_y", at=PLACE, by=by)
    result = panel(p=0.0).solve(record=True)
    monkeypatch.setattr(linearised_step, "direct_solver", lambda _: pytest.fail("factorised again"))
    found = result.sensitivity("u_y", at=PLACE, by=by)
    for key, value in expected.items():
        assert np.allclose(found[key], value, rtol=1e-10, atol=1e-12)


def test_a_page_with_derivatives_of_its_own_is_refused() -> None:
    m = Model("own", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness")
    m.weak_form([(m.define("force", k * u, derivative={u: k}), u)])
    study = Study(Mesh.line(1.0, cells=1))
    study.add("node", m.finish(), on="boundary", k=2.0)
    study.load((0.0,), u=1.0)
    with pytest.raises(ValueError, match="own: gives derivatives of its own"):
        study.solve().sensitivity("u", at=(0.0,), by={"node": "k"})


def touching(mu: float = 0.4, friction: float = 0.0) -> Study:
    lower = Mesh.rectangle(2, 1, cells=(4, 2))
    upper = Mesh.rectangle(1, 1, cells=(3, 2)).map(lambda x: x + np.array([0.45, 1.0]))
    study = Study(Mesh.union(lower=lower, upper=upper))
    study.add("lower", rubber, cells="lower", mu=mu, K=0.9, swell=1)
    study.add("upper", rubber, cells="upper", mu=0.8, K=2, swell=1)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.fix("upper:top", u_x=0.02, u_y=-0.1)
    study.contact("upper:bottom", "lower:top", friction=friction, stiffness=2.0)
    return study


@pytest.mark.parametrize(("friction", "steps"), [(0.0, 2), (0.3, 1)])
def test_through_contact_of_bodies(friction: float, steps: int) -> None:
    def value(mu: float) -> float:
        other = study.varied({("lower", "mu"): mu})  # its contacts stay
        return other.solve(steps=steps, newton=EXACT).reaction("upper:top")["u_y"]

    study = touching(friction=friction)
    result = study.solve(steps=steps, newton=EXACT)
    found = result.sensitivity("u_y", reaction="upper:top", by={"lower": "mu"})
    assert found["lower", "mu"] == pytest.approx(difference(value, 0.4, 1e-4), rel=1e-7)


def test_friction_of_bodies_through_steps_is_refused() -> None:
    result = touching(friction=0.3).solve(steps=2)
    with pytest.raises(StudyError, match="friction between bodies is not followed"):
        result.sensitivity("u_y", reaction="upper:top", by={"lower": "mu"})
