"""Polynomials with exact coefficients in numbered atoms, and their values as nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from softehl.codegen.graph.graph import Graph, Node

Monomial = tuple[int, ...]
"""Numbers of the atoms, one for each factor, ascending."""
Polynomial = dict[Monomial, Fraction]


def product(p: Polynomial, q: Polynomial) -> Polynomial:
    """Product of two polynomials."""
    if len(q) == 1 and () in q:
        p, q = q, p
    if len(p) == 1 and () in p:
        (c,) = p.values()
        return {k: c * v for k, v in q.items() if c and v} if c != 1 else _nonzero(q)
    out: Polynomial = {}
    for a, x in p.items():
        for b, y in q.items():
            key = tuple(sorted((*a, *b)))
            term = y if x == 1 else x if y == 1 else x * y
            before = out.get(key)
            out[key] = term if before is None else before + term
    return _nonzero(out)


def added(p: Polynomial, q: Polynomial, sign: int) -> Polynomial:
    """p + sign q."""
    out = dict(p)
    for k, v in q.items():
        before = out.get(k)
        term = v if sign > 0 else -v
        out[k] = term if before is None else before + term
    return _nonzero(out)


def _nonzero(p: Polynomial) -> Polynomial:
    return {k: v for k, v in p.items() if v}


def value(
    g: Graph,
    p: Mapping[Monomial, Fraction],
    atoms: Mapping[int, Node] | Sequence[Node],
    order: Callable[[int], Any] | None = None,
) -> Node:
    """A polynomial as a node.

    The constant is multiplied first; with `order` the atoms are, sorted by it, so that a product
    of what does not vary with the point is one value, and the constant comes last.
    """
    result = g.zero
    for monomial, c in p.items():
        term = g.const(abs(c)) if order is None else g.one
        for i in monomial if order is None else sorted(monomial, key=order):
            term = g.mul(term, atoms[i])
        if order is not None:
            term = g.mul(g.const(abs(c)), term)
        result = g.add(result, term) if c > 0 else g.sub(result, term)
    return result
