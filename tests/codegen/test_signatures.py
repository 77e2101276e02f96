"""Merging by numeric signature: never two different values, always two equal ones."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import mpmath
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from softehl.codegen.graph.evaluate import evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.spec import check
from softehl.codegen.graph.traverse import operations, reachable
from softehl.codegen.language.lower import Lowering
from softehl.codegen.optimise.signatures import merge_equal
from tests.codegen.random_models import UNKNOWNS, Digits, K, Meaning, OutsideError, Recipe
from tests.codegen.random_models import expressions as random_expressions
from tests.codegen.workshop import inputs, same_value

x, y, z = UNKNOWNS
TINY = sp.Rational(1, 10**25)
STATES = (("1.3", "0.7", "0.9"), ("-1.3", "0.7", "-0.9"), ("0.2", "-2.1", "1.6"))


def lowered(*expressions: Any) -> tuple[Graph, list[Node]]:
    g = Graph()
    bound = {s: g.input("dofs", k) for k, s in enumerate((*UNKNOWNS, K))}
    lower = Lowering(g, bound)
    return g, [lower(e) for e in expressions]


def merged(*expressions: Any) -> tuple[list[Node], list[Node]]:
    """Roots before and after."""
    g, roots = lowered(*expressions)
    return roots, merge_equal(g, roots)


def same_everywhere(before: list[Node], after: list[Node]) -> bool:
    return all(
        same_value(a, b, inputs(*s)) for s in STATES for a, b in zip(after, before, strict=True)
    )


UNEQUAL = {
    "absolute value and itself": (sp.Abs(x), x),
    "root of a product square": (sp.Pow(x**2 * y**2, sp.Rational(1, 2), evaluate=False), x * y),
    "root of a square": (sp.Pow(x**2, sp.Rational(1, 2), evaluate=False), x),
    "logarithm of a square": (sp.log(x**2), 2 * sp.log(x)),
    "root of a product": (sp.sqrt(x * y), sp.sqrt(x) * sp.sqrt(y)),
    "equal on one side": (sp.Piecewise((x * y, x > 0), (x * z, True)), x * y),
    "equal on the other side": (sp.Piecewise((x * z, x < 0), (x * y, True)), x * y),
    "branches swapped": (
        sp.Piecewise((sp.sin(x), x < y), (sp.cos(x), True)),
        sp.Piecewise((sp.cos(x), x < y), (sp.sin(x), True)),
    ),
    "maximum and the larger": (sp.Max(x, -2), x),
    "25 digits": (x * y + sp.sin(x), (x * y + sp.sin(x)) * (1 + TINY)),
    "25 digits in an argument": (sp.exp(x * y), sp.exp(x * y + TINY)),
    "up to a constant": (x * y, x * y + TINY),
    "twice": (x * y, 2 * x * y),
    "reciprocals": (1 / (x * y), x * y),
}

EQUAL = {
    "expanded square": ((x + y) ** 2, x**2 + 2 * x * y + y**2),
    "order of a product": (x * (y * z), sp.Mul(sp.Mul(x, y, evaluate=False), z, evaluate=False)),
    "up to sign": ((x - y) * z, (y - x) * z),
    "difference of squares": ((x + y) * (x - y), x**2 - y**2),
    "sum of angles": (sp.sin(x) * sp.cos(y) + sp.cos(x) * sp.sin(y), sp.sin(x + y)),
    "exponentials": (sp.exp(x) * sp.exp(y), sp.exp(x + y)),
    "fractions": (1 / x + 1 / y, (x + y) / (x * y)),
    "cube roots": ((1 + x**2) ** sp.Rational(2, 3), ((1 + x**2) ** sp.Rational(1, 3)) ** 2),
}


@pytest.mark.parametrize("name", UNEQUAL)
def test_different_values_stay_different(name: str) -> None:
    before, after = merged(*UNEQUAL[name])
    check(after)
    assert same_everywhere(before, after)
    assert len({n.id for n in after}) == len(after)


@pytest.mark.parametrize("name", EQUAL)
def test_equal_values_are_computed_once(name: str) -> None:
    before, after = merged(*EQUAL[name])
    check(after)
    assert same_everywhere(before, after)
    first, second = (n.args[0] if n.op is Op.NEG else n for n in after)
    assert first is second
    assert operations(after) < operations(before) or before[0] is before[1]


def test_equality_with_a_branch_inside_is_found_outside_of_it() -> None:
    """What is made of one branch in two ways is equal; the branch stands for itself."""
    side = sp.Piecewise((sp.log(x), x > 0), (y, True))
    before, after = merged((side + y) * z, side * z + y * z)
    assert same_everywhere(before, after)
    assert after[0] is after[1]


def test_a_value_that_varies_is_not_one_that_does_not() -> None:
    g = Graph()
    xi, u = g.input("rule", 0, varying=True), g.input("dofs", 0)
    roots = [g.mul(g.mul(u, u), g.call(Op.EXP, u)), g.mul(xi, g.mul(u, g.call(Op.EXP, u)))]
    assert merge_equal(g, roots) == roots


def test_a_false_merge_would_be_seen() -> None:
    """What the tests above rest on refuses 25 equal digits."""
    _, (a, b) = lowered(*UNEQUAL["25 digits"])
    assert not same_everywhere([a], [b])
    assert same_everywhere([a], [a])


def value(e: Any, state: dict[Any, float]) -> Any:
    """A SymPy expression in 50 digits, without the compiler."""
    recipe = Recipe((), (), sp.Integer(0), e, "", e, False)
    return Digits(Meaning(recipe), state)(e)[0]


@settings(
    derandomize=True,
    max_examples=25,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
@given(st.lists(random_expressions((*UNKNOWNS, K), 4), min_size=2, max_size=4))
def test_merging_keeps_random_values_as_they_were_written(expressions: list[Any]) -> None:
    """Together with near copies: each times 1 + 1e-25, squared and rooted, and expanded."""
    near = [e * (1 + TINY) for e in expressions]
    again = [(e + x) ** 2 - e**2 - 2 * e * x for e in expressions]
    written = [*expressions, *near, *again]
    g, roots = lowered(*written)
    after = merge_equal(g, roots)
    check(after)
    for numbers in ((0.7, -0.4, 1.3, 0.9), (-1.1, 0.6, 0.35, -0.8)):
        state = dict(zip((*UNKNOWNS, K), numbers, strict=True))
        at = {("dofs", k): v for k, v in enumerate(numbers)}
        for e, n in zip(written, after, strict=True):
            try:
                expected = value(e, state)
            except OutsideError:
                continue
            with mpmath.workdps(50):
                assert abs(evaluate(n, at) - expected) <= mpmath.mpf(10) ** -38 * (
                    1 + abs(expected)
                )


def test_a_merge_at_two_points_only_is_not_enough() -> None:
    """Values that agree at the points of the signature are told apart at the fresh ones."""
    import softehl.codegen.optimise.signatures as s

    g = Graph()
    u = g.input("dofs", 0)
    import random

    rng = random.Random(0)
    with mpmath.workdps(s.DIGITS):
        points = [s._sample([u], rng)[u] for _ in range(s.POINTS)]
        exact = [Fraction(*map(int, mpmath.libmp.to_rational(p._mpf_))) for p in points]
    vanishing = g.one
    for p in exact:
        vanishing = g.mul(vanishing, g.sub(u, g.const(p)))
    plain = g.call(Op.EXP, u)
    roots = [plain, g.add(plain, vanishing)]
    after = merge_equal(g, roots)
    assert after[0] is not after[1]
    assert same_value(after[1], roots[1], inputs("1.9"))
    assert len(reachable(after)) > len(reachable([plain]))
