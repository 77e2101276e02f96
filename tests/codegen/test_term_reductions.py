"""Sums, products, minima and maxima over terms of run-time number: one kernel for every number."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Mesh, Model, Study, quadrature
from softehl.codegen import pipeline
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.language.errors import ModelError
from softehl.codegen.tools import build, kernel_cache, user_kernels
from softehl.codegen.verify import verification
from softehl.runtime.kernels.kernel_call import ArgumentError
from softehl.runtime.study import StudyError

KINDS: dict[str, Callable[[Any], Any]] = {
    "sum": mpmath.fsum,
    "product": mpmath.fprod,
    "minimum": min,
    "maximum": max,
}


def term(u: Any, d: Any, g: Any, tau: Any, exp: Any) -> Any:
    """A term of all arguments."""
    return g * (1 + u**2 * d) + exp(-u / tau) - u**4 * g


@cache
def spring(kind: str) -> Any:
    """A kernel of one unknown."""
    m = Model(f"{kind}_of_terms", nodes=1, rule=quadrature.point_rule())
    u = m.unknown("u")
    (d,) = m.parameters(d="factor")
    g, tau = m.array("g"), m.array("tau", meaning="times [s]")
    reduced = getattr(m, kind)(g, tau, lambda g, tau: term(u, d, g, tau, sp.exp))
    m.potential(reduced + u**2)
    m.fields(reduced=reduced)
    m.offer(product=True, derivatives=[d], pseudo_load=True, fields_rate=True)
    return m.finish()


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_against_mpmath(kind: str) -> None:
    """Zero factors and negative ones, 1 to 30 terms, lanes with a rest."""
    kernel = softehl.load_kernel(spring(kind))
    X, u = np.empty((5, 0)), np.array([[-0.4], [0.0], [0.3], [0.7], [1.1]])
    for count in (1, 2, 30):
        rng = np.random.default_rng(count)
        g, tau = rng.uniform(0.1, 0.5, count), rng.uniform(0.5, 3, count)
        g[: (count + 1) // 2] *= -1
        if kind == "product":
            g[0] = -1.0  # the factor is zero at u = 0
        given = {"d": 0.7, "g": g, "tau": tau}
        R, K = kernel.tangent(X, u, parameters=given)
        S = kernel.derivative("d", X, u, parameters=given)

        def value(u: Any, d: Any, g: Any = g, tau: Any = tau) -> Any:
            pairs = zip(g, tau, strict=True)
            terms = [term(u, d, mpmath.mpf(a), mpmath.mpf(b), mpmath.exp) for a, b in pairs]
            return KINDS[kind](terms) + u**2

        with mpmath.workdps(40):
            for k, v in enumerate(u[:, 0]):
                for found, n in ((R[k, 0], (1, 0)), (K[k, 0, 0], (2, 0)), (S[k, 0], (1, 1))):
                    expected = mpmath.diff(value, (mpmath.mpf(v), mpmath.mpf(0.7)), n)
                    assert abs(found - expected) <= 1e-14 * max(1, abs(expected))


@pytest.mark.parametrize("kind", KINDS)
def test_its_check_in_90_digits(kind: str) -> None:
    """All tasks, also along variations of the arrays, by an evaluation of the page as written."""
    d = spring(kind)
    library = kernel_cache.library([d])
    tasks = list(user_kernels._entries(library.files)[d.name]["tasks"])
    report = verification.check(d, tasks, library.folder / build.LIBRARY, seconds=3)
    assert set(report.errors) == set(tasks)
    assert max(report.errors.values()) < 1e-13


def test_one_loop_computes_all_results() -> None:
    made = pipeline.compile_model(spring("product"))
    tangent = made.functions["tangent"].text
    assert tangent.count("_lanes(softehl_mask(1)") == 1


def test_a_matrix_in_a_local_iteration() -> None:
    """A @ s = u with A = sum of g (1 + tau s s^T): residual and tangent by numbers."""
    m = Model("slips", nodes=1, rule=quadrature.point_rule())
    u = [m.unknown("u"), m.unknown("v")]
    g, tau = m.array("g"), m.array("tau")

    def equations(s: Any) -> Any:
        A = m.sum(g, tau, lambda g, tau: g * (sp.eye(2) + tau * sp.Matrix(s) * sp.Matrix(s).T))
        return list(A * sp.Matrix(s) - sp.Matrix(u))

    s = m.implicit("s", equations, start=[0, 0])
    m.weak_form(list(zip(s, u, strict=True)))
    kernel = softehl.load_kernel(m.finish())
    given = {"g": [0.5, 0.3, 0.4], "tau": [0.2, 0.1, 0.6]}
    R, K = kernel.tangent(np.empty((1, 0)), np.array([[0.3, -0.5]]), parameters=given)
    a, b = 1.2, 0.5 * 0.2 + 0.3 * 0.1 + 0.4 * 0.6
    s = R[0]
    assert np.allclose(a * s + b * (s @ s) * s, [0.3, -0.5], rtol=1e-14, atol=0)
    slope = a * np.eye(2) + b * ((s @ s) * np.eye(2) + 2 * np.outer(s, s))
    assert np.allclose(K[0], np.linalg.inv(slope), rtol=1e-13, atol=0)


LAW = """
#include <complex.h>
int law(const double complex *x, double complex *y, double complex *dy, double complex *ddy)
{
    y[0] = cexp(x[0] * x[1]);
    if (dy) dy[0] = x[1] * y[0], dy[1] = x[0] * y[0];
    return 0;
}
"""


def test_terms_hold_what_a_page_may_say() -> None:
    """A sum of sums, local unknowns, curves, C functions, stretches and names, in 90 digits."""
    m = Model("everything", nodes=1, rule=quadrature.point_rule())
    u = m.unknown("u")
    (d,) = m.parameters(d="factor")
    g, n = m.array("g"), m.array("n")
    C = m.define("C", sp.diag(1 + u**2, 1 + d * u / 10, 1))

    def outer(g1: Any, n1: Any) -> Any:
        inner = m.sum(g, n, lambda g2, n2: g2 * sp.exp(-u * n1 * n2))
        s = m.implicit("s", lambda s: s + n1 * s**3 - u * d, start=0)
        named = m.define("named", n1 * u)
        foreign = m.external("law", [named, d], source=LAW, derivatives=1)
        stretched = m.principal("W", C, lambda a, b, c: (a**n1 + b**n1 + c**n1) / n1)
        return g1 * (inner + s**2 + named * m.table("k", 1 + n1 * u) + foreign + stretched)

    m.potential(m.sum(g, n, outer))
    d = m.finish()
    library = kernel_cache.library([d])
    tasks = list(user_kernels._entries(library.files)[d.name]["tasks"])
    report = verification.check(d, tasks, library.folder / build.LIBRARY, seconds=3)
    assert set(report.errors) == set(tasks)
    assert max(report.errors.values()) < 1e-10


def test_what_does_not_fit_is_refused() -> None:
    kernel = softehl.load_kernel(spring("sum"))
    X, u = np.empty((1, 0)), np.zeros((1, 1))
    for given, message in (
        ({"g": [1.0, 2.0], "tau": [1.0]}, "g has 2, tau has 1 terms"),
        ({"g": [], "tau": []}, "one finite number for each term"),
        ({"g": 3.0, "tau": [1.0]}, "one finite number for each term"),
        ({"g": [np.nan], "tau": [1.0]}, "one finite number for each term"),
        ({"g": [1.0]}, "needs tau"),
    ):
        with pytest.raises(ArgumentError, match=message):
            kernel.residual(X, u, parameters={"d": 1.0, **given})
    m = Model("wrong", nodes=1, rule=quadrature.point_rule())
    x, g = m.unknown("x"), m.array("g")
    for write, message in (
        (lambda: g * x, "is an array of terms, no number"),
        (lambda: x + g, "is an array of terms, no number"),
        (lambda: sp.sin(g), "is an array of terms, no number"),
        (lambda: m.sum(g), "give arrays, then a function"),
        (lambda: m.sum(x, lambda x: x), "x is no array: declare it"),
        (lambda: m.sum(g, lambda g, h: g), "gets 1 argument"),
        (lambda: m.array("x"), "used twice"),
    ):
        with pytest.raises(ModelError, match=message):
            write()
    C = sp.diag(*(m.unknown(f"c{k}") for k in range(3)))
    squares = lambda *stretches: sum(m.sum(g, lambda g, s=s: g * s**2) for s in stretches)  # noqa: E731
    W = m.principal("W", C, lambda a, b, c: squares(a, b, c))
    m.potential(W + x)
    with pytest.raises(DifferentiationError, match="symmetric functions of the stretches"):
        pipeline.compile_model(m.finish())


@softehl.page
def diffusion(m):
    """Fluxes of several carriers."""
    T = m.scalar("T")
    g, n = m.array("g"), m.array("n")
    q = m.grad(T)
    W = m.sum(g, n, lambda g, n: g / (2 * n) * (1 + n * (q.T * q)[0]))
    m.minimise(W)


def test_a_study_tells_different_lengths() -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    with pytest.raises(StudyError, match="'body': g has 2, n has 3 terms"):
        study.add("body", diffusion, g=[1, 2], n=[1, 2, 3])
    study.add("body", diffusion, g=[1, 2], n=[1, 2])
    study.fix("left", T=0)
    study.load("right", T=0.5)
    assert study.solve().at((1.0, 0.5))["T"] == pytest.approx(0.5 / 3)
