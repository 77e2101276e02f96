"""Invariants found by polynomial decomposition: fewer of them, and the same values."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from softehl.codegen.derive.potential_structure import Reduced, through_invariants
from softehl.codegen.graph.graph import Graph, Node, Op
from tests.codegen.workshop import inputs, same_value, unknowns


def axisymmetric(g: Graph, F: list[Node], factor: Node | None = None) -> Node:
    """An energy of I1 = tr B, I2 = (I1^2 - tr B^2)/2 and det F, as a paper prints it."""
    F = [g.mul(factor, x) for x in F] if factor is not None else F
    zz, zr, rz, rr, t = F
    b = [
        g.add(g.mul(zz, zz), g.mul(zr, zr)),
        g.add(g.mul(rz, rz), g.mul(rr, rr)),
        g.add(g.mul(zz, rz), g.mul(zr, rr)),
        g.power(t, 2),
    ]
    I1 = g.add(g.add(b[0], b[1]), b[3])
    square = [g.power(x, 2) for x in b]
    trace = g.add(g.add(square[0], square[1]), g.add(g.mul(g.const(2), square[2]), square[3]))
    I2 = g.mul(g.const(Fraction(1, 2)), g.sub(g.power(I1, 2), trace))
    J = g.mul(g.sub(g.mul(zz, rr), g.mul(zr, rz)), t)
    scale = g.call(Op.RCBRT, g.power(J, 2))
    return g.add(g.mul(scale, I1), g.mul(g.mul(scale, scale), I2))


def reduced(factor: bool = False) -> tuple[Graph, Node, Reduced]:
    g = Graph()
    F = unknowns(g, 5)
    a = g.call(Op.EXP, g.input("dofs", 5)) if factor else None
    root = axisymmetric(g, F, a)
    found = through_invariants(g, [root], F, [a] if a is not None else [])
    assert found is not None
    return g, root, found


@pytest.mark.parametrize("factor", [False, True], ids=["F", "scaled F"])
def test_the_second_invariant_needs_the_minor_and_the_sum_of_squares_only(factor: bool) -> None:
    _, root, found = reduced(factor)
    rng = np.random.default_rng(5)
    at = inputs(*(np.array([1, 0, 0, 1, 1, 0]) + 0.3 * rng.uniform(-1, 1, 6)))
    assert len(found.squares) == 2
    assert same_value(found.roots[0], root, at)


def test_a_wrong_decomposition_would_be_seen() -> None:
    g, root, found = reduced()
    at = inputs(1.1, 0.2, -0.1, 0.9, 1.2)
    assert not same_value(g.mul(found.roots[0], g.const(Fraction(1001, 1000))), root, at)


def test_nothing_is_done_where_nothing_is_saved() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    assert (
        through_invariants(g, [g.call(Op.EXP, g.add(g.mul(x, x), g.mul(y, y)))], [x, y], []) is None
    )


def test_a_polynomial_of_other_values_is_left_alone() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    quartic = g.add(g.mul(g.power(x, 3), y), g.mul(x, x))
    assert through_invariants(g, [g.call(Op.EXP, quartic)], [x, y], []) is None


def test_constants_may_stand_inside_the_invariants() -> None:
    """F = 1 + G/A with A from the geometry, some entries without it: as SymPy leaves them."""
    g = Graph()
    x = unknowns(g, 6)
    a = g.recip(x[5])
    F = [g.mul(a, x[0]), x[1], x[2], g.mul(a, x[3]), x[4]]
    root = axisymmetric(g, F)
    found = through_invariants(g, [root], x[:5], [])
    assert found is not None
    assert len(found.squares) == 2
    assert same_value(found.roots[0], root, inputs(1.9, 0.1, 0.2, 2.1, 1.1, 2.0))
