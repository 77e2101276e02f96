"""Quadrature rules on [-1, 1] and the pressure shape functions of the film, eqs. (23) and (27)."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
from numpy.polynomial import legendre

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Rule

Kind = Literal["gauss", "lobatto"]
_SUBCELL = 2  # points of a subcell: h^3 times a slope is integrated exactly


def _line(points: Array, weights: Array, basis: Array | None = None) -> Rule:
    return Rule(np.ascontiguousarray(points)[:, None].copy(), np.ascontiguousarray(weights), basis)


@cache
def gauss(n: int) -> Rule:
    """Gauss-Legendre rule with n >= 1 points, exact for polynomials of degree 2 n - 1."""
    if n < 1:
        raise ValueError(f"gauss({n}): a Gauss rule has at least 1 point")
    points, weights = legendre.leggauss(n)
    return _line(points, weights)


@cache
def lobatto(n: int) -> Rule:
    """Gauss-Lobatto-Legendre rule with n >= 2 points, ends included, exact for degree 2 n - 3."""
    if n < 2:
        raise ValueError(f"lobatto({n}): a Lobatto rule has at least 2 points")
    highest = legendre.Legendre.basis(n - 1)
    derivative, curvature = highest.deriv(1), highest.deriv(2)
    inner = np.sort(np.real(derivative.roots()))
    for _ in range(3):  # companion-matrix roots carry about 1e-14: polish them
        inner = inner - derivative(inner) / curvature(inner)
    points = np.concatenate([[-1.0], 0.5 * (inner - inner[::-1]), [1.0]])
    weights = 2.0 / (n * (n - 1) * highest(points) ** 2)
    return _line(points, weights)


def pressure_nodes(m_p: int) -> Array:
    """The m_p + 1 pressure nodes of a segment (Gauss-Lobatto-Legendre), from end 1 to end 2."""
    return lobatto(m_p + 1).points[:, 0]


def lagrange(nodes: Array, points: Array) -> Array:
    """Lagrange polynomials of `nodes` (modes,) at `points` (q,): (q, modes, 2), value and slope."""
    vandermonde = legendre.legvander(nodes, len(nodes) - 1)
    coefficients = np.linalg.inv(vandermonde)  # column i: Legendre coefficients of shape function i
    value = legendre.legval(points, coefficients).T
    slope = legendre.legval(points, legendre.legder(coefficients, axis=0)).T
    return np.ascontiguousarray(np.stack([value, slope], axis=2))


def automatic_points(m_p: int, kind: Kind) -> int:
    """Fewest points that integrate h^3 dp/dx d(dp)/dx exactly: degree 2 m_p + 1, alpha = 0."""
    return m_p + 1 if kind == "gauss" else m_p + 2


@cache
def film_rule(m_p: int, kind: Kind = "gauss", points: int | None = None) -> Rule:
    """Rule of the film segment for pressures of order m_p >= 1; points None: automatic_points."""
    if m_p < 1:
        raise ValueError(f"film_rule: pressure order {m_p} is not allowed, it is at least 1")
    count = automatic_points(m_p, kind) if points is None else points
    rule = gauss(count) if kind == "gauss" else lobatto(count)
    return Rule(rule.points, rule.weights, lagrange(pressure_nodes(m_p), rule.points[:, 0]))


@cache
def facet_rule(m_p: int) -> Rule:
    """Traces at a facet between two segments of order m_p >= 1: one point, 2 (m_p + 1) modes.

    The first m_p + 1 modes are those of the segment that ends at the facet (minus), then come
    those of the segment that begins there (plus); basis (1, modes, 4): value and d/dxi of the trace
    from minus, then of the trace from plus.
    """
    if m_p < 1:
        raise ValueError(f"facet_rule: pressure order {m_p} is not allowed, it is at least 1")
    end_values = lagrange(pressure_nodes(m_p), np.array([1.0, -1.0]))
    basis = np.zeros((1, 2 * (m_p + 1), 4))
    basis[0, : m_p + 1, :2] = end_values[0]
    basis[0, m_p + 1 :, 2:] = end_values[1]
    return Rule(np.empty((1, 0)), np.ones(1), basis)


def several(*rules: Rule) -> Rule:
    """The rule of an element with several interpolated fields, from one rule with basis for each.

    The modes of the first field come first; each is zero in the components of the other fields.
    All rules have the same points.  Raises ValueError.
    """
    first, bases = rules[0], [rule.basis for rule in rules if rule.basis is not None]
    alike = all(np.array_equal(r.points, first.points) for r in rules)
    if len(bases) < len(rules) or not alike:
        raise ValueError("several(...): each rule needs a basis, and all the same points")
    count = [b.shape[1] for b in bases]
    basis = np.zeros((len(first.weights), sum(count), sum(b.shape[2] for b in bases)))
    mode = component = 0
    for b in bases:
        basis[:, mode : mode + b.shape[1], component : component + b.shape[2]] = b
        mode, component = mode + b.shape[1], component + b.shape[2]
    return Rule(first.points, first.weights, basis)


@cache
def trace_rule(m_p: int, kind: Kind = "gauss", points: int | None = None) -> Rule:
    """The film rule with both ends of the segment added, of weight 0 where they were missing.

    For looking at fields that differ between the sides of a facet.
    """
    rule = film_rule(m_p, kind, points)
    inner = rule.points[:, 0]
    missing = [end for end in (-1.0, 1.0) if end not in inner]
    xi = np.concatenate([inner, missing])
    order = np.argsort(xi)
    weights = np.concatenate([rule.weights, np.zeros(len(missing))])
    return _line(xi[order], weights[order], lagrange(pressure_nodes(m_p), xi[order]))


@cache
def subcells(m_p: int) -> tuple[Rule, Array]:
    """Gauss points on the m_p subcells between neighbouring pressure nodes, and their subcells.

    The rule has no basis; subcells (points,): number of the subcell of each point, from 0.
    """
    if m_p < 1:
        raise ValueError(f"subcells: pressure order {m_p} is not allowed, it is at least 1")
    nodes, inner = pressure_nodes(m_p), gauss(_SUBCELL)
    half, middle = 0.5 * np.diff(nodes), 0.5 * (nodes[1:] + nodes[:-1])
    points = (middle[:, None] + half[:, None] * inner.points[:, 0]).ravel()
    weights = (half[:, None] * inner.weights).ravel()
    return _line(points, weights), np.repeat(np.arange(m_p), len(inner.weights))


def _hats(m_p: int) -> Array:
    """Piecewise linear shape functions at the points of `subcells`: (points, m_p + 1, 2)."""
    rule, cell = subcells(m_p)
    nodes, xi = pressure_nodes(m_p), rule.points[:, 0]
    width, rows = np.diff(nodes)[cell], np.arange(len(cell))
    basis = np.zeros((len(cell), m_p + 1, 2))
    basis[rows, cell] = np.stack([(nodes[cell + 1] - xi) / width, -1.0 / width], axis=1)
    basis[rows, cell + 1] = np.stack([(xi - nodes[cell]) / width, 1.0 / width], axis=1)
    return basis


@cache
def rupture_rule(m_p: int, *, polynomial: bool = True) -> Rule:
    """Rule of a film that may rupture: points (q, 3) with the ends of their subcells.

    Basis (points, 2 (m_p + 1), 8), pressures first, then void fractions: value and d/dxi of the
    polynomial p through all pressures (of the linear one without `polynomial`), of p linear on the
    subcell, of v at the lower end of the subcell, and of v at its upper end.
    """
    rule, cell = subcells(m_p)
    nodes, n, rows = pressure_nodes(m_p), m_p + 1, np.arange(len(cell))
    basis, hats = np.zeros((len(cell), 2 * n, 8)), _hats(m_p)
    basis[:, :n, :2] = lagrange(nodes, rule.points[:, 0]) if polynomial else hats
    basis[:, :n, 2:4] = hats
    basis[rows, n + cell, 4] = 1.0
    basis[rows, n + cell + 1, 6] = 1.0
    points = np.stack([rule.points[:, 0], nodes[cell], nodes[cell + 1]], axis=1)
    return Rule(points, rule.weights, basis)


@cache
def content_rule(m_p: int) -> Rule:
    """Rule with its points at the m_p + 1 pressure nodes, of the weight of half of their subcells.

    Basis (points, 2 (m_p + 1), 4): value and d/dxi of p, then of v; slopes are left out.
    """
    nodes, n = pressure_nodes(m_p), m_p + 1
    weights = np.zeros(n)
    weights[:-1] += 0.5 * np.diff(nodes)
    weights[1:] += 0.5 * np.diff(nodes)
    basis = np.zeros((n, 2 * n, 4))
    basis[np.arange(n), np.arange(n), 0] = 1.0
    basis[np.arange(n), n + np.arange(n), 2] = 1.0
    rule = _line(nodes, weights)
    return Rule(rule.points, rule.weights, basis)
