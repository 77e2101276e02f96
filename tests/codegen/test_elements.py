"""Elements of every kind: shape functions, rules, and agreement with the meshes of the runtime."""

from __future__ import annotations

from itertools import product
from math import factorial

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.elements.cells import ELEMENTS, element
from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.runtime.mesh.cells import CELLS

AT = (sp.Rational(1, 7), sp.Rational(2, 9), sp.Rational(-1, 5))


QUADRATIC = {name: kind for name, kind in ELEMENTS.items() if kind.lines is None}
"""Those of higher order are in `tests/runtime/test_cells.py`."""


@pytest.mark.parametrize("kind", QUADRATIC.values(), ids=QUADRATIC)
def test_nodal_and_the_same_as_in_meshes(kind: Element) -> None:
    h = sp.Dummy()  # at the apex of a pyramid the limit along its axis
    values = [
        [sp.sympify(N).subs(h, place[-1]) for N in kind.shape(*place[:-1], h)]
        for place in kind.nodes
    ]
    assert sp.Matrix(values) == sp.eye(len(kind.nodes))
    cell, at = CELLS[kind.name], AT[: kind.dimension]
    point = np.array([[float(x) for x in at]])
    np.testing.assert_array_equal(cell.nodes, np.array(kind.nodes, dtype=float))
    shape = np.array([float(N) for N in kind.shape(*at)])
    slope = np.array([[float(s) for s in row] for row in kind.gradient(*at)])
    np.testing.assert_allclose(cell.shape(point)[0], shape, atol=1e-14)
    np.testing.assert_allclose(cell.gradient(point)[0], slope, atol=1e-14)


def degree_of(rule: QuadratureRule, exact: dict[tuple[int, ...], sp.Rational]) -> float:
    """Largest error over some monomials."""
    worst = 0.0
    for powers, value in exact.items():
        terms = (
            w * sp.prod([x**p for x, p in zip(place, powers, strict=True)])
            for place, w in zip(rule.points, rule.weights, strict=True)
        )
        worst = max(worst, abs(float(sp.N(sum(terms) - value, 50))))
    return worst


def simplex(dimension: int, degree: int) -> dict[tuple[int, ...], sp.Rational]:
    """Integrals of monomials over the unit simplex."""
    found = {}
    for p in product(range(degree + 1), repeat=dimension):
        if sum(p) <= degree:
            top = sp.prod([factorial(k) for k in p])
            found[p] = sp.Rational(top, factorial(sum(p) + dimension))
    return found


def line(degree: int) -> dict[tuple[int, ...], sp.Rational]:
    """Integrals of monomials over [-1, 1]."""
    return {(k,): sp.Rational(2, k + 1) if k % 2 == 0 else sp.Integer(0) for k in range(degree + 1)}


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 8])
def test_simplex_rules(degree: int) -> None:
    assert degree_of(quadrature.triangle(degree), simplex(2, degree)) < 1e-40
    exact = simplex(3, degree)
    chosen = {p: exact[p] for p in exact if degree < 8 or (sum(p) == degree and min(p) > 1)}
    assert degree_of(quadrature.tetrahedron(degree), chosen) < 1e-40


def test_wedge_rule() -> None:
    rule = quadrature.wedge(3)
    exact = {(*p, *z): a * b for p, a in simplex(2, 3).items() for z, b in line(3).items()}
    assert degree_of(rule, exact) < 1e-40


def test_pyramid_rule() -> None:
    """x^a y^b z^c over the pyramid: 4 / ((a + 1) (b + 1)) times a beta function."""
    exact: dict[tuple[int, ...], sp.Rational] = {}
    for a, b, c in product((0, 1, 2), (0, 2), (0, 1, 3)):
        height = sp.beta(c + 1, a + b + 3).doit()
        area = sp.Rational(4 * (a % 2 == 0), (a + 1) * (b + 1))
        exact[a, b, c] = area * sp.nsimplify(height)
    assert degree_of(quadrature.pyramid(7), exact) < 1e-40
    assert degree_of(quadrature.pyramid(1), exact) > 1e-3


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="no element 'quad5'; there are line2"):
        element("quad5")
    with pytest.raises(ValueError, match="order = 0, must be a whole number"):
        quadrature.gauss(0, 2)
    with pytest.raises(ValueError, match="the dimension is 1, 2 or 3"):
        quadrature.gauss(2, 4)
    with pytest.raises(ValueError, match=r"degree = 2\.5"):
        quadrature.triangle(2.5)  # type: ignore[arg-type]
