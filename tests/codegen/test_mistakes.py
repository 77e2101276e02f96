"""What a page says by mistake: rules of other cells, no detJ, comparisons, counts, indices."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

from softehl.codegen.elements import cells, quadrature, shapes
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.language import kinematics
from softehl.codegen.language.errors import ModelError, ModelWarning
from softehl.codegen.language.model import Model

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
