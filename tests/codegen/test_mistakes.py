"""Mistakes of pages, conditions on parameters, what a page says in several calls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import cells, quadrature, shapes
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError, ModelWarning
from softehl.codegen.language.model import Model
from softehl.runtime.kernels.kernel import ArgumentError, Kernel
from tests.codegen.workshop import compiled

# --- What a page says by mistake: rules of other cells, no detJ, comparisons, counts, indices -----


GAUSS, SIMPLEX = quadrature.gauss(2, 2), quadrature.triangle(2)
HALVES = QuadratureRule(2, SIMPLEX.points, tuple(2 * w for w in SIMPLEX.weights))


def page(kind: str, rule: QuadratureRule | None = None) -> tuple[Model, Any, Any]:
    """A model on an element of cells.ELEMENTS, its displacements and its geometry."""
    element = cells.element(kind)
    m = Model("page", nodes=len(element.nodes), rule=rule or element.rule)
    X = m.coordinates(*"XYZ"[: element.dimension])
    u = m.nodal_unknowns(*"uvw"[: element.dimension])
    return m, u, kinematics.isoparametric(m, X, element.gradient(*m.point()))


@pytest.mark.parametrize(
    ("nodes", "rule", "words"),
    [
        (4, SIMPLEX, "that of a triangle: points of a square .* sum to 4; .*gauss"),
        (6, quadrature.gauss(2, 3), "that of a cube: points of a wedge"),
        (8, quadrature.tetrahedron(2), "that of a tetrahedron: points of a cube"),
    ],
)
def test_the_rule_of_another_cell_is_refused(nodes: int, rule: QuadratureRule, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Model("page", nodes=nodes, rule=rule)


@pytest.mark.parametrize("kind", [n for n, e in cells.ELEMENTS.items() if e.lines is None])
def test_every_element_takes_its_own_rule(kind: str) -> None:
    page(kind)


def test_a_rule_that_fits_no_cell_is_refused_with_shapes_that_are_known() -> None:
    cube = quadrature.gauss(2, 3)
    for kind, rule in (("tri3", HALVES), ("tri3", GAUSS), ("tri6", GAUSS), ("tet4", cube)):
        with pytest.raises(ModelError, match=f"functions of {kind}, but the rule does not fit"):
            page(kind, rule)
    m = Model("own", nodes=3, rule=HALVES)  # shape functions of its own reference cell
    half = [(-sp.Rational(1, 2),) * 2, (sp.Rational(1, 2), 0), (0, sp.Rational(1, 2))]
    kinematics.isoparametric(m, m.coordinates("X", "Y"), half)


@pytest.mark.parametrize("names", [["u", "w"], ["w"]])
def test_rates_of_an_idle_unknown_need_not_be_used(names: list[str]) -> None:
    m = Model("page", nodes=2, rule=quadrature.gauss(1, 1))
    u, _ = m.nodal_unknowns("u", "w", idle=["w"])
    moving = [u, *m.rates(*names)][len(names) - 1]  # the rates of u, where there are some
    m.potential(m.integral("P", sum(a * b + a for a, b in zip(u, moving, strict=True))))
    m.finish()


def test_rates_of_another_unknown_are_missed() -> None:
    m = Model("page", nodes=2, rule=quadrature.gauss(1, 1))
    u, _ = m.nodal_unknowns("u", "w", idle=["w"])
    m.rates("u", "w")
    m.potential(m.integral("P", sum(a**2 for a in u)))
    with pytest.raises(ModelError, match="u_rate1 is never used"):
        m.finish()


def test_an_integrand_without_detJ_is_warned_of_with_the_line() -> None:
    m, u, e = page("quad4")
    F = kinematics.deformation_gradient(m, e.dN, u)
    m.integral("right", F.det() * e.detJ)
    m.integral("mean", e.dN[0][0])  # of the geometry alone: detJ may have been divided out
    with pytest.warns(ModelWarning, match="integrand of wrong has no factor detJ") as found:
        m.integral("wrong", F.det())
    assert Path(found[0].filename).name == Path(__file__).name


@pytest.mark.parametrize(
    "compared",
    [
        lambda J: J == 1,
        lambda J: J != 1.0,
        lambda J: J == 1.0,
    ],
)
def test_a_name_that_is_compared_with_a_number_raises(compared: Callable[..., bool]) -> None:
    m = Model("page", nodes=1, rule=quadrature.point_rule())
    u = m.unknown("u")
    J = m.define("J", 1 + u)
    assert u != J
    assert u in [J, u]
    with pytest.raises(ModelError, match="neither true nor false while the page is read"):
        compared(J)


def interpolated(m: Model, u: Any, e: Any) -> None:
    shapes.interpolate(shapes.quad4(*m.point()), u[0][:3])


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda m, u, e: u[2], r"\[2\] of the unknowns \(u, v\): there are 2, counted from 0"),
        (lambda m, u, e: u[1][4], r"\[4\] of the nodes of v: there are 4, counted from 0"),
        (lambda m, u, e: m.coordinates("X", "Y")[2], r"coordinates \(X, Y\): there are 2"),
        (lambda m, u, e: e.dN[4], r"\[4\] of dN, one row for each node: there are 4"),
        (interpolated, "4 shape functions and 3 nodal values; as many are needed"),
        (
            lambda m, u, e: kinematics.deformation_gradient(m, e.dN, u[:1]),
            "1 displacements, but gradients by 2 coordinates",
        ),
        (
            lambda m, u, e: kinematics.isoparametric(m, u, shapes.hex8_gradient(0, 0, 0)),
            "8 shape functions by 3 coordinates, but page has 4 nodes and 2 coordinates",
        ),
        (
            lambda m, u, e: m.principal("W", sp.eye(3), lambda a: a),
            "W: its function gets 3 arguments, and cannot take them; write `lambda a, b, c: ...`",
        ),
        (
            lambda m, u, e: m.implicit("s", lambda a, b: [a, b], start=[0, 0]),
            "s: its function gets 1 argument, and cannot take it; write `lambda a: ...`",
        ),
    ],
)
def test_counts_and_indices_are_named(mistake: Callable[..., Any], words: str) -> None:
    m, u, e = page("quad4")
    with pytest.raises(ValueError, match=words):
        mistake(m, u, e)


# --- Conditions on parameters and data: declared on the page, checked at every call ---------------


def spring(*conditions: Any) -> Definition:
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness")
    (gap,) = m.data(gap="where it closes")
    m.require(*(c(k, gap, x) for c in conditions))
    m.potential(k * (x - gap) ** 2)
    return m.finish()


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    d = spring(
        lambda k, g, x: k > 0, lambda k, g, x: g <= sp.Rational(1, 2), lambda k, g, x: g >= 0
    )
    return compiled(d, tmp_path_factory.mktemp("spring"), "-O0")


def call(kernel: Kernel, k: float, gap: float) -> float:
    given = {"parameters": [k], "data": np.array([[0.1], [gap]])}
    return float(kernel.residual(np.empty((2, 0)), np.ones((2, 1)), **given)[1, 0])


def test_what_is_allowed_passes(kernel: Kernel) -> None:
    assert call(kernel, 2.0, 0.5) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("k", "gap", "words"),
    [
        (0.0, 0.1, "spring: k = 0, must be > 0"),
        (float("nan"), 0.1, "spring: k = nan, must be > 0"),
        (1.0, 0.75, "spring: gap = 0.75, must be <= 0.5"),
        (1.0, -0.5, "spring: gap = -0.5, must be >= 0"),
    ],
)
def test_what_is_not_is_named_with_the_line(
    kernel: Kernel, k: float, gap: float, words: str
) -> None:
    with pytest.raises(ArgumentError) as error:
        call(kernel, k, gap)
    assert str(error.value).startswith(words)
    assert f"({Path(__file__).name}:" in str(error.value)


@pytest.mark.parametrize(
    "condition", [lambda k, g, x: x > 0, lambda k, g, x: k > g, lambda k, g, x: sp.Ne(k, 0)]
)
def test_other_conditions_are_refused(condition: Any) -> None:
    with pytest.raises(ModelError, match="compare one parameter or datum with a number"):
        spring(condition)


# --- Potentials, weak forms, fields and offers that a page says in several calls ------------------


def model() -> Model:
    return Model("sums", nodes=1, rule=quadrature.point_rule())


def test_potentials_weak_forms_fields_and_offers_add_up(tmp_path: Path) -> None:
    m = model()
    x, y = m.unknown("x"), m.unknown("y")
    m.potential(x**2 * y)
    m.potential(3 * x)
    m.weak_form([(x**3, x)])
    m.weak_form([(5, x), (x * y, y)])
    m.fields(a=x)
    m.fields(b=2 * y)
    m.offer(tasks=["tangent"])
    m.offer(tasks=["fields"], product=True)
    kernel = compiled(m.finish(), tmp_path, "-O0")
    assert set(kernel.tasks) == {"tangent", "fields", "product"}
    state = np.empty((1, 0)), np.array([[2.0, 7.0]])
    R, K = kernel.tangent(*state)
    assert R[0].tolist() == [28 + 3 + 8 + 5, 4 + 14]
    assert K[0].tolist() == [[14 + 12, 4], [4 + 7, 2]]
    assert kernel.fields_at(*state)[0].tolist() == [[2.0, 14.0]]


@pytest.mark.parametrize("call", ["fields", "history"])
def test_a_name_that_is_given_twice_is_refused(call: str) -> None:
    m = model()
    (old,) = m.point_data(v="history")
    getattr(m, call)(v=old)
    with pytest.raises(ModelError, match="v is given twice in model sums"):
        getattr(m, call)(v=old)


def test_what_is_frozen_in_one_potential_varies_in_another_under_its_own_name() -> None:
    m = model()
    x = m.unknown("x")
    a = m.define("a", x**2)
    m.potential(a * x, constant=[a])
    m.potential(a)
    with pytest.raises(ModelError, match=r"a is constant in one potential.*m.define\('a_frozen'"):
        m.finish()
