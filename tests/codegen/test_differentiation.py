"""Derivatives on the graph against central differences in 90 digits, and their exceptions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softehl.codegen.abi import Task
from softehl.codegen.derive import task_outputs
from softehl.codegen.derive.multilevel_chain_rule import Linearisation
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.evaluation import State, evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.verify.graph_oracle import Oracle
from tests.codegen.workshop import (
    close,
    difference,
    inputs,
    linearised,
    same_value,
    unknowns,
)

AT = inputs("1.3", "0.7", "2.9")


def reverse(g: Graph, root: Node, wrt: list[Node]) -> list[Node]:
    adjoint = gradient(g, root, wrt)
    return [adjoint[u] for u in wrt]


def forward(g: Graph, root: Node, wrt: list[Node]) -> list[Node]:
    linear = Linearisation(g, wrt)
    return [linear.derivative(root, j) for j in range(len(wrt))]


Derivative = Callable[[Graph, Node, list[Node]], list[Node]]
BOTH = pytest.mark.parametrize("derivative", [reverse, forward])


def right(rows: list[Node], root: Node, at: Any) -> bool:
    """The check all tests share: every derivative equals the central difference to 30 digits."""
    return all(close(evaluate(d, at), difference(root, at, k)) for k, d in enumerate(rows))


# ------------------------------------------------------------------------------- hand-made graphs


def expressions(g: Graph, x: Node, y: Node, z: Node) -> dict[str, Node]:
    """One expression for every rule, and some that mix them."""
    positive = g.add(g.mul(x, x), g.one)
    less = g.compare(Op.LT, x, y)
    return {
        "sum": g.sub(g.add(x, g.mul(g.const(3), y)), z),
        "product": g.mul(g.mul(x, y), g.mul(y, z)),
        "square": g.node(Op.MUL, (x, x)),
        "sign": g.node(Op.NEG, (g.mul(x, y),)),
        "quotient": g.div(g.add(x, y), g.add(z, g.const(2))),
        "power": g.power(positive, Fraction(7, 5)),
        "negative power": g.power(x, Fraction(-2, 3)),
        "square root": g.call(Op.SQRT, g.add(positive, y)),
        "cube root": g.call(Op.CBRT, g.mul(positive, z)),
        "reciprocal cube root": g.call(Op.RCBRT, g.mul(positive, z)),
        "logarithm": g.call(Op.LOG, g.mul(positive, y)),
        "exponential": g.call(Op.EXP, g.mul(x, y)),
        "sine": g.call(Op.SIN, g.mul(x, z)),
        "cosine": g.call(Op.COS, g.mul(x, z)),
        "area sine": g.call(Op.ASINH, g.mul(x, z)),
        "area cosine": g.call(Op.ACOSH, g.add(positive, g.mul(z, z))),
        "area tangent": g.call(Op.ATANH, g.div(y, g.mul(g.const(9), positive))),
        "error": g.call(Op.ERF, g.mul(x, z)),
        "complement": g.call(Op.ERFC, g.mul(x, y)),
        "named": g.mul(g.name("a", g.mul(x, y)), g.name("b", g.call(Op.SIN, x))),
        "branch": g.branch(less, g.mul(x, x), g.call(Op.EXP, g.mul(y, x))),
        "other branch": g.branch(g.compare(Op.LE, y, x), g.mul(x, z), g.recip(y)),
        "nested": g.branch(less, z, g.branch(g.compare(Op.LT, z, y), x, g.power(z, 3))),
        "used twice": g.mul(g.branch(less, x, y), g.call(Op.SIN, g.branch(less, z, x))),
        "constant": g.pi(),
    }


NAMES = list(expressions(Graph(), *unknowns(Graph(), 3)))


@BOTH
@pytest.mark.parametrize("name", NAMES)
def test_rules(derivative: Derivative, name: str) -> None:
    g = Graph()
    wrt = unknowns(g, 3)
    root = expressions(g, *wrt)[name]
    assert right(derivative(g, root, wrt), root, AT)


@BOTH
def test_second_derivatives(derivative: Derivative) -> None:
    g = Graph()
    wrt = unknowns(g, 3)
    for root in expressions(g, *wrt).values():
        rows = derivative(g, root, wrt)
        hessian = [derivative(g, row, wrt) for row in rows]
        for i in range(3):
            assert right(hessian[i], rows[i], AT)
            for j in range(i):
                assert close(evaluate(hessian[i][j], AT), evaluate(hessian[j][i], AT), 1e-40)


@BOTH
def test_wrong_derivatives_are_detected(derivative: Derivative) -> None:
    """The check refuses a sign, a dropped term, a factor, and one part in 10^20."""
    g = Graph()
    wrt = unknowns(g, 3)
    x, y, _ = wrt
    root = g.mul(g.call(Op.SIN, g.mul(x, y)), x)
    good = derivative(g, root, wrt)
    assert right(good, root, AT)
    cosine = g.call(Op.COS, g.mul(x, y))
    for wrong in (
        g.neg(good[0]),
        g.mul(g.mul(x, y), cosine),
        g.mul(g.const(Fraction(1, 2)), good[0]),
        g.mul(g.const(1 + Fraction(1, 10**20)), good[0]),
    ):
        assert not right([wrong, *good[1:]], root, AT)


# -------------------------------------------------------------------------------- random graphs


@dataclass(frozen=True)
class Step:
    """One random operation on two of the values that are there already."""

    kind: str
    first: int
    second: int
    exponent: Fraction


def _positive(g: Graph, a: Node) -> Node:
    return g.add(g.mul(a, a), g.const(Fraction(1, 3)))


MAKERS: dict[str, Callable[[Graph, Node, Node, Fraction], Node]] = {
    "add": lambda g, a, b, e: g.add(a, b),
    "sub": lambda g, a, b, e: g.sub(a, b),
    "mul": lambda g, a, b, e: g.mul(a, g.call(Op.COS, b)),
    "div": lambda g, a, b, e: g.div(a, _positive(g, b)),
    "pow": lambda g, a, b, e: g.power(_positive(g, a), e),
    "sqrt": lambda g, a, b, e: g.call(Op.SQRT, _positive(g, a)),
    "cbrt": lambda g, a, b, e: g.call(Op.CBRT, _positive(g, b)),
    "log": lambda g, a, b, e: g.call(Op.LOG, _positive(g, a)),
    "exp": lambda g, a, b, e: g.call(Op.EXP, g.call(Op.SIN, a)),
    "name": lambda g, a, b, e: g.name(f"n{a.id}", a),
    # the sides meet nowhere near 1/7, whatever the operands are
    "branch": lambda g, a, b, e: g.branch(
        g.compare(Op.LT, g.add(a, g.const(Fraction(1, 7))), b), g.mul(a, b), g.sub(b, a)
    ),
    "guard": lambda g, a, b, e: g.branch(
        g.compare(Op.LT, g.zero, a), g.call(Op.LOG, a), g.power(b, 3)
    ),
}
STEPS = st.builds(
    Step,
    st.sampled_from(sorted(MAKERS)),
    st.integers(0, 11),
    st.integers(0, 11),
    st.builds(Fraction, st.integers(-7, 7), st.sampled_from([1, 2, 3, 5])),
)
VALUES = st.integers(-300, 300).filter(lambda v: v % 100 != 0)


def grown(g: Graph, wrt: list[Node], steps: list[Step]) -> Node:
    values = list(wrt)
    for s in steps:
        a, b = values[s.first % len(values)], values[s.second % len(values)]
        values.append(MAKERS[s.kind](g, a, b, s.exponent))
    root = values[-1]
    for v in values[-3:-1]:
        root = g.add(root, g.call(Op.SIN, v))
    return root


@BOTH
@settings(max_examples=60, derandomize=True, deadline=None, database=None)
@given(steps=st.lists(STEPS, min_size=3, max_size=9), at=st.tuples(VALUES, VALUES, VALUES))
def test_random_graphs(derivative: Derivative, steps: list[Step], at: tuple[int, int, int]) -> None:
    assume(len(set(at)) == 3)  # the difference of equal values is the kink of a guard
    g = Graph()
    wrt = unknowns(g, 3)
    root = grown(g, wrt, steps)
    with mpmath.workdps(100):
        point = inputs(*(mpmath.mpf(v) / 101 for v in at))
    assert right(derivative(g, root, wrt), root, point)


# --------------------------------------------------------------------------------------- branches


# ------------------------------------------------------------------------------------ exceptions


def test_a_constant_is_not_differentiated() -> None:
    g = Graph()
    x, y, _ = wrt = unknowns(g, 3)
    frozen = g.name("a", g.mul(x, y))
    root = g.mul(frozen, g.call(Op.SIN, x))
    expected = g.mul(frozen, g.call(Op.COS, x))
    adjoint = gradient(g, root, wrt, constant=[frozen])
    linear = Linearisation(g, wrt, constant=[frozen])
    for found in (adjoint[x], linear.derivative(root, 0)):
        assert same_value(found, expected, AT)
        assert not close(evaluate(found, AT), difference(root, AT, 0)), "it is an exception"
    assert adjoint[y] is linear.derivative(root, 1) is g.zero


def test_a_constant_is_one_for_that_differentiation_only() -> None:
    g = Graph()
    x, y, _ = wrt = unknowns(g, 3)
    frozen = g.name("a", g.mul(x, y))
    row = gradient(g, g.mul(frozen, x), wrt, constant=[frozen])[x]
    assert row is frozen
    assert right(reverse(g, row, wrt), row, AT)
    assert right(forward(g, row, wrt), row, AT)


def test_a_given_derivative_replaces_the_true_one() -> None:
    g = Graph()
    x, y, _ = wrt = unknowns(g, 3)
    special = g.name("s", g.call(Op.EXP, g.mul(x, y)))
    slope = g.call(Op.SIN, y)
    given_ = {special: {x: slope}}
    root = g.add(g.mul(special, special), g.mul(x, y))
    in_x = g.add(g.mul(g.const(2), g.mul(special, slope)), y)
    adjoint = gradient(g, root, wrt, prescribed=given_)
    linear = Linearisation(g, wrt, prescribed=given_)
    for k, expected in ((0, in_x), (1, x), (2, g.zero)):
        assert same_value(adjoint[wrt[k]], expected, AT)
        assert same_value(linear.derivative(root, k), expected, AT)


# --------------------------------------------------------------------- models: sums and interfaces

RULE = [(mpmath.mpf(t), mpmath.mpf(w)) for t, w in (("-0.7", "0.6"), ("0.1", "0.9"), ("0.8", "1"))]


def bar(*, interface: bool, summed: bool = False) -> Definition:
    """Three unknowns, energy of two strains at points; `summed` puts a sum into a sum."""
    m = Model("bar", nodes=1, rule=quadrature.gauss(2, 1))
    u = [m.unknown(f"u{k}") for k in range(3)]
    (mu,) = m.parameters(mu="stiffness")
    (xi,) = m.point()
    a = m.define("a", 1 + u[0] * xi + u[1] * u[2], interface=interface)
    b = m.define("b", sp.exp(u[1] * xi / 3) + u[2] ** 2, interface=interface)
    energy = mu * (a**2 * b + sp.log(a * b) + sp.Piecewise((a**3, a > b), (sp.sqrt(b), True)))
    if summed:
        mean = m.integral("mean", a * xi**2 + b)
        energy = energy * mean + sp.sin(mean - b)
    m.potential(m.integral("Pi", energy) + u[0] * u[2])
    return m.finish()


def bar_state() -> State:
    return State((0, 0), ("0.13", "-0.2", "0.35"), (), ("2.5",), RULE)


def matrices_agree(a: Any, b: Any, tolerance: float = 1e-28) -> bool:
    (Ra, Ka), (Rb, Kb) = a, b
    rows = [(Ra, Rb), *zip(Ka, Kb, strict=True)]
    return all(close(x, y, tolerance) for p, q in rows for x, y in zip(p, q, strict=True))


def exact(d: Definition, state: State) -> tuple[Any, Any]:
    oracle = Oracle(d)
    return oracle.residual(state), oracle.tangent(state)


@pytest.mark.parametrize("interface", [False, True], ids=["direct", "interface"])
@pytest.mark.parametrize("summed", [False, True], ids=["one sum", "sum in a sum"])
def test_sums_over_points(interface: bool, summed: bool) -> None:
    d, state = bar(interface=interface, summed=summed), bar_state()
    assert matrices_agree(linearised(d, state), exact(d, state))


def pseudo(*, frozen: bool) -> Definition:
    """A weak form with a factor that depends on the unknowns, or the same as a true potential."""
    m = Model("pseudo", nodes=1, rule=quadrature.gauss(2, 1))
    u, v = m.unknown("u"), m.unknown("v")
    (xi,) = m.point()
    a = m.define("a", sp.exp(u * xi) + v**2)
    w = m.define("w", u * v + xi * u**2)
    m.potential(m.integral("Pi", a * w), constant=[a] if frozen else [])
    return m.finish()


def test_pseudo_potentials_freeze_in_the_residual_and_not_in_the_tangent() -> None:
    state = State((0, 0), ("0.4", "-0.3"), (), (), RULE)
    free, frozen = pseudo(frozen=False), pseudo(frozen=True)
    assert free.conservative
    assert not frozen.conservative
    for d in (free, frozen):
        R, K = linearised(d, state)
        assert matrices_agree((R, K), exact(d, state))
        assert close(K[0][1], K[1][0]) == d.conservative
    with mpmath.workdps(50):
        u, v = (mpmath.mpf(s) for s in state.dofs)
        by_hand = mpmath.fsum(w * (mpmath.exp(u * t) + v**2) * (v + 2 * t * u) for t, w in RULE)
    assert close(linearised(frozen, state)[0][0], by_hand)
    assert not close(linearised(free, state)[0][0], by_hand)


def line_model(term: str) -> Definition:
    """An interpolated field p with one direct unknown u."""
    m = Model("line", nodes=1, rule=quadrature.gauss(2, 1))
    u = m.unknown("u")
    p, p_xi = m.interpolated("p")
    (xi,) = m.point()
    if term == "local":
        density = sp.exp(p * u) + p_xi**2 * sp.Max(-p, 0) + xi * p**3 * u**2
        m.potential(m.integral("Pi", density))
    else:
        mean = m.integral("mean", p)
        m.potential(m.integral("Pi", mean * p**2 * u) if term == "again" else mean * u**3)
    return m.finish()


def test_a_mean_of_an_interpolated_field_may_not_enter_a_sum_again() -> None:
    """It would couple every mode at one point with every mode at another: no kernel for that."""
    d = line_model("again")
    task_outputs.outputs(d, Task.RESIDUAL)
    with pytest.raises(DifferentiationError, match="may not enter a sum again"):
        task_outputs.outputs(d, Task.TANGENT)


def test_a_wrong_tangent_graph_is_detected() -> None:
    """The comparison that these tests rest on refuses one entry off by 1e-20, or transposed."""
    d, state = pseudo(frozen=True), State((0, 0), ("0.4", "-0.3"), (), (), RULE)
    R, K = exact(d, state)
    assert matrices_agree((R, K), (R, K))
    with mpmath.workdps(50):
        slightly = [[K[0][0] * (1 + mpmath.mpf(10) ** -20), K[0][1]], K[1]]
    transposed = [list(c) for c in zip(*K, strict=True)]
    for wrong in (slightly, transposed):
        assert not matrices_agree((R, wrong), (R, K))
    assert not matrices_agree(([-r for r in R], K), (R, K))
