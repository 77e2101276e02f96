"""Quadrature rules and pressure shape functions against exact integrals and polynomials."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from softehl.runtime.discretisation.quadrature import (
    facet_rule,
    film_rule,
    gauss,
    lobatto,
    pressure_nodes,
    trace_rule,
)


def _error(points: np.ndarray, weights: np.ndarray, degree: int) -> float:
    exact = 2.0 / (degree + 1) if degree % 2 == 0 else 0.0
    return float(abs(weights @ points**degree - exact))


@pytest.mark.parametrize("n", range(1, 13))
def test_gauss_is_exact_to_its_degree_and_no_further(n: int) -> None:
    rule = gauss(n)
    x = rule.points[:, 0]
    assert max(_error(x, rule.weights, k) for k in range(2 * n)) < 2e-14
    # the error of x^(2n) shrinks like 4^-n, so it stays far from rounding here
    assert _error(x, rule.weights, 2 * n) > 1e-8


@pytest.mark.parametrize("n", range(2, 13))
def test_lobatto_is_exact_to_its_degree_and_no_further(n: int) -> None:
    rule = lobatto(n)
    x = rule.points[:, 0]
    assert x[0] == -1.0
    assert x[-1] == 1.0
    assert max(_error(x, rule.weights, k) for k in range(2 * n - 2)) < 2e-14
    assert _error(x, rule.weights, 2 * n - 2) > 1e-8


@pytest.mark.parametrize("m_p", range(1, 8))
@pytest.mark.parametrize("kind", ["gauss", "lobatto"])
def test_shape_functions_reproduce_polynomials_and_their_slopes(m_p: int, kind: str) -> None:
    rule = film_rule(m_p, kind)
    assert rule.basis is not None
    polynomial = Polynomial(np.linspace(1.0, -0.7, m_p + 1))
    nodal = polynomial(pressure_nodes(m_p))
    x = rule.points[:, 0]
    assert rule.basis[:, :, 0] @ nodal == pytest.approx(polynomial(x), abs=1e-13)
    assert rule.basis[:, :, 1] @ nodal == pytest.approx(polynomial.deriv()(x), abs=1e-12)


@pytest.mark.parametrize("m_p", range(1, 6))
@pytest.mark.parametrize("kind", ["gauss", "lobatto"])
def test_automatic_rule_is_the_smallest_that_is_exact(m_p: int, kind: str) -> None:
    rule = film_rule(m_p, kind)
    degree = 2 * m_p + 1
    assert _error(rule.points[:, 0], rule.weights, degree - 1) < 1e-14
    fewer = film_rule(m_p, kind, len(rule.weights) - 1)
    assert _error(fewer.points[:, 0], fewer.weights, degree - 1) > 1e-6


@pytest.mark.parametrize("m_p", range(1, 8))
def test_a_facet_sees_the_end_of_one_segment_and_the_start_of_the_next(m_p: int) -> None:
    basis = facet_rule(m_p).basis
    assert basis is not None
    minus, plus = Polynomial(np.linspace(1.0, -0.7, m_p + 1)), Polynomial(np.arange(m_p + 1.0))
    nodes = pressure_nodes(m_p)
    traces = np.concatenate([minus(nodes), plus(nodes)]) @ basis[0]
    expected = [minus(1.0), minus.deriv()(1.0), plus(-1.0), plus.deriv()(-1.0)]
    assert traces == pytest.approx(expected, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("kind", ["gauss", "lobatto"])
def test_the_trace_rule_adds_the_missing_ends_without_weight(kind: str) -> None:
    plain, traces = film_rule(3, kind), trace_rule(3, kind)
    assert traces.points[[0, -1], 0].tolist() == [-1.0, 1.0]
    assert traces.weights.sum() == pytest.approx(2.0)
    assert set(plain.points[:, 0]) <= set(traces.points[:, 0])
    assert len(traces.weights) == len(plain.weights) + (2 if kind == "gauss" else 0)
    assert traces.basis is not None
    assert traces.basis.shape == (len(traces.weights), 4, 2)


def test_impossible_rules_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 point"):
        gauss(0)
    with pytest.raises(ValueError, match="at least 2 points"):
        lobatto(1)
    with pytest.raises(ValueError, match="at least 1"):
        film_rule(0)
    with pytest.raises(ValueError, match="at least 1"):
        facet_rule(0)
