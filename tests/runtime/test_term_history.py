"""History of each term of a number that is known at run time: Prony series, slip systems."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Mesh, Model, Study, quadrature
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.weak_form import CellOptions
from softehl.codegen.tools import build, host_files, kernel_cache, user_kernels
from softehl.codegen.verify import verification
from softehl.runtime.definition import page_loader
from softehl.runtime.results.result import Result

DT, STEPS = 0.1, 6


def branch(h: Any, e: Any, g: Any, tau: Any, dt: Any) -> Any:
    """Stress of a branch after a step, by implicit Euler."""
    return (h + g * e) / (1 + dt / tau)


@softehl.page
def series(m):
    """Flux with branches that relax; history of the strain, too."""
    u = m.scalar("u")
    E, dt = m.parameters(E="modulus", dt="step [s]")
    (old,) = m.point_data(old="strain before the step")
    g, tau = m.array("g"), m.array("tau")
    h = m.point_array("h", g, "stress of a branch")
    grad = m.grad(u)
    e = m.define("e", grad[0])
    new = m.each(g, tau, h, lambda g, tau, h: branch(h, e - old, g, tau, dt))
    viscous = m.sum(g, tau, h, lambda g, tau, h: branch(h, e - old, g, tau, dt))
    m.weak(sp.Matrix([E * e + viscous, grad[1]]), grad)
    m.history(h=new, old=e)
    m.fields(viscous=viscous)


def written(count: int) -> Any:
    """The same page with so many branches."""

    def page(m):
        u = m.scalar("u")
        E, dt = m.parameters(E="modulus", dt="step [s]")
        g = m.parameters(**{f"g{k}": "modulus" for k in range(count)})
        tau = m.parameters(**{f"tau{k}": "time" for k in range(count)})
        (old,) = m.point_data(old="strain before the step")
        h = m.point_data(**{f"h{k}": "stress" for k in range(count)})
        grad = m.grad(u)
        e = m.define("e", grad[0])
        new = [branch(h[k], e - old, g[k], tau[k], dt) for k in range(count)]
        m.weak(sp.Matrix([E * e + sum(new), grad[1]]), grad)
        m.history(old=e, **{f"h{k}": v for k, v in enumerate(new)})
        m.fields(viscous=sum(new))

    page.__name__ = f"written_{count}"
    return softehl.page(page)


def study(page: Any = series, E: float = 1.0, **given: Any) -> Study:
    bar = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    bar.add("body", page, E=E, **given)
    bar.fix("left", u=0)
    bar.load("right", u=lambda x, t: np.sin(3 * t))
    return bar


def march(page: Any, record: bool = False, **given: Any) -> Result:
    *_, last = study(page, **given).march(dt=DT, until=DT * STEPS, record=record)
    return last


@pytest.mark.parametrize("count", [3, 10, 30])
def test_one_kernel_for_every_length(count: int) -> None:
    """The values of the page that writes all branches out, to rounding."""
    rng = np.random.default_rng(count)
    g, tau = rng.uniform(0.1, 0.4, count), np.geomspace(0.03, 20, count)
    found = march(series, g=g, tau=tau)
    names = {f"g{k}": v for k, v in enumerate(g)} | {f"tau{k}": v for k, v in enumerate(tau)}
    expected = march(written(count), **names)
    assert np.abs(found.values("u") - expected.values("u")).max() < 1e-14
    fields = [r.fields("body")["viscous"] for r in (found, expected)]
    assert np.abs(fields[0] - fields[1]).max() < 1e-14 * np.abs(fields[1]).max()


def test_lengths_share_a_library() -> None:
    kernel = page_loader.load_page(series, None, cell="quad4")
    short, long = (kernel.with_lengths((n, n)) for n in (3, 30))
    assert short.library is long.library
    assert short.point_data == ("old", "h[0]", "h[1]", "h[2]")
    assert len(long.fields) == len(long.history) + 1 == 32
    assert pickle.loads(pickle.dumps(short)).point_data == short.point_data


@pytest.mark.parametrize("form", ["whole", "point"])
def test_its_check_in_90_digits(form: Any) -> None:
    """Two histories, one inside of a local iteration, and a sum over other terms."""

    @softehl.page(form=form)
    def crystal(m):
        u = m.scalar("u")
        (dt,) = m.parameters(dt="step")
        (old,) = m.point_data(old="another history")
        n, c = m.array("n"), m.array("c")
        h = m.point_array("h", n)
        f = m.point_array("f", c)
        q = m.grad(u)

        def slip(s: Any, n: Any, h: Any) -> Any:
            return (h + dt * (s * n) ** 3) / (1 + dt)

        s = m.implicit(
            "s",
            lambda s: s - q[0] - old + m.sum(n, h, lambda n, h: n * slip(s, n, h)),
            start=q[0],
        )
        new = m.each(n, h, lambda n, h: slip(s, n, h))
        more = m.each(c, f, lambda c, f: f + c * s)
        fatigue = m.maximum(c, f, lambda c, f: c * f * s)
        m.weak(sp.Matrix([s + fatigue, q[1]]), q)
        m.history(h=new, f=more, old=s)
        m.offer(product=True, pseudo_load=True, fields_rate=True)

    (d,) = crystal.definitions(CellOptions(("quad4",)))
    library = kernel_cache.library([d])
    tasks = list(user_kernels._entries(library.files)[d.name]["tasks"])
    report = verification.check(d, tasks, library.folder / build.LIBRARY, seconds=3)
    assert set(report.errors) == set(tasks)
    assert max(report.errors.values()) < 1e-10


G, TAU = np.array([0.3, 0.2, 0.4]), np.array([0.05, 0.4, 3.0])


def test_sensitivities_of_the_path() -> None:
    """By numbers of every branch and by the modulus, forward and by the adjoint."""
    at, by = (2.0, 0.5), {"body": ["g", "tau", "E"]}
    result = march(series, record=True, g=G, tau=TAU)
    direct = result.sensitivity("u", at=at, by=by)
    for name, values in (("g", G), ("tau", TAU)):
        for k in range(3):
            step = 1e-5 * np.eye(3)[k]
            given = [{"g": G, "tau": TAU} | {name: values + s * step} for s in (1, -1)]
            plus, minus = (march(series, **some).at(at)["u"] for some in given)
            assert np.ravel(direct["body", name])[k] == pytest.approx(
                (plus - minus) / 2e-5, rel=1e-7
            )


def test_a_fit_of_the_branches() -> None:
    at = (2.0, 0.5)
    truth = study(g=G, tau=TAU).march(dt=DT, until=DT * STEPS)
    measured = [r.at(at)["u"] for r in truth]
    start = study(g=[0.35, 0.25, 0.3], tau=TAU)
    fit = start.fit({at: {"u": measured}}, by={"body": ["g"]}, dt=DT, until=DT * STEPS)
    assert fit.values["body", "g"] == pytest.approx(G, rel=1e-6)


def test_what_a_page_may_not_say() -> None:
    def model(write: Any) -> None:
        m = Model("terms", nodes=1, rule=quadrature.point_rule())
        u = m.unknown("u")
        g, c = m.array("g"), m.array("c")
        h = m.point_array("h", g)
        W = m.sum(g, h, c, lambda g, h, c: g * h * u**2 * c)
        m.potential(m.integral("total", W))
        write(m, g, c, h)
        m.finish()

    for write, message in (
        (lambda m, g, c, h: None, "h is never renewed: m.history"),
        (lambda m, g, c, h: m.history(h=g.name), "h has one number for each term"),
        (
            lambda m, g, c, h: m.history(h=m.each(c, lambda c: c)),
            "a number for each term of g: loop over it",
        ),
        (lambda m, g, c, h: m.each(g, lambda g: g) + 1, "one value for each term, no number"),
        (lambda m, g, c, h: m.point_array("k", h), "is no array of terms"),
        (lambda m, g, c, h: m.point_array("h", g), "used twice"),
    ):
        with pytest.raises(ModelError, match=message):
            model(write)


def test_what_has_no_place_for_it_refuses() -> None:
    (d,) = series.definitions(CellOptions(("quad4",)))
    with pytest.raises(softehl.TargetError, match="run time"):
        host_files.files(d, "c")
    with pytest.raises(ModelError, match="second derivatives of results know none"):
        d.for_second_derivatives()


def test_the_start_and_copies() -> None:
    """A value at the start is that of all terms; a copy of a study marches alike."""
    bar = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    bar.add("body", series, E=1.0, g=G, tau=TAU, h=0.25)
    bar.fix("left", u=0)
    first = next(iter(copy.deepcopy(bar).march(dt=DT, until=DT)))
    decay = 1 / (1 + DT / TAU)
    e = first.at((2.0, 0.5))["u"] / 2
    assert e == pytest.approx(-0.25 * decay.sum() / (1 + (G * decay).sum()), rel=1e-12)
    explained = first.explain(0, block="body")
    assert "sum_1" in str(explained)
