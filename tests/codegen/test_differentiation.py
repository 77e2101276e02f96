"""Derivatives of graphs, at kinks of lengths and where a value is not a number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softehl import Mesh, Study, page
from softehl.codegen import pipeline
from softehl.codegen.abi import Target, Task
from softehl.codegen.derive import task_outputs
from softehl.codegen.derive.multilevel_chain_rule import Linearisation
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.evaluation import EvaluationState, evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.workshop import (
    close,
    difference,
    inputs,
    linearised,
    same_value,
    unknowns,
)

# --- Derivatives on the graph against central differences in 90 digits, and their exceptions ------


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


def bar_state() -> EvaluationState:
    return EvaluationState((0, 0), ("0.13", "-0.2", "0.35"), (), ("2.5",), RULE)


def matrices_agree(a: Any, b: Any, tolerance: float = 1e-28) -> bool:
    (Ra, Ka), (Rb, Kb) = a, b
    rows = [(Ra, Rb), *zip(Ka, Kb, strict=True)]
    return all(close(x, y, tolerance) for p, q in rows for x, y in zip(p, q, strict=True))


def exact(d: Definition, state: EvaluationState) -> tuple[Any, Any]:
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
    state = EvaluationState((0, 0), ("0.4", "-0.3"), (), (), RULE)
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
    d, state = pseudo(frozen=True), EvaluationState((0, 0), ("0.4", "-0.3"), (), (), RULE)
    R, K = exact(d, state)
    assert matrices_agree((R, K), (R, K))
    with mpmath.workdps(50):
        slightly = [[K[0][0] * (1 + mpmath.mpf(10) ** -20), K[0][1]], K[1]]
    transposed = [list(c) for c in zip(*K, strict=True)]
    for wrong in (slightly, transposed):
        assert not matrices_agree((R, wrong), (R, K))
    assert not matrices_agree(([-r for r in R], K), (R, K))


# --- Derivatives at and near zero: of what lengths are in, and of powers by base and exponent -----


Q = sp.Rational
ALONG = np.array([0.6, 0.0, 0.8])
SIZES = (0.0, 1e-300, 1e-160, 1e-90, 1e-61, 1e-20, 1e-3)
SMOOTH: dict[str, Callable[[Any, Any], Any]] = {
    "cosh": lambda n, p: sp.cosh(n),
    "parameter": lambda n, p: n**p,
    "mixed": lambda n, p: sp.sqrt(1 + n) * n**2,
    "cube": lambda n, p: n**3,
    "halves": lambda n, p: n ** Q(5, 2),
    "pieces": lambda n, p: sp.Piecewise((n**2 / 2, n < 1), (n - Q(1, 2), True)),
}
"""Energies of a length n, with f'(0) = 0; p is 2."""
KINKED: dict[str, Callable[[Any, Any], Any]] = {
    "kink": lambda n, p: n + n**2,
    "one": lambda n, p: n ** (p / 2),
}
POWERS: dict[str, tuple[Callable[[Any, Any, Any], Any], float]] = {
    "abs_halves": (lambda a, b, p: sp.Abs(a) ** Q(5, 2), 2.5),
    "abs_cube": (lambda a, b, p: sp.Abs(a) ** 3, 3.0),
    "squares": (lambda a, b, p: (a**2 + b**2) ** Q(5, 4), 2.5),
    "squares_parameter": (lambda a, b, p: (a**2 + b**2) ** (p / 2), np.nan),
}
"""Energies of |a| where b is zero, with their exponents; nan: p."""
NESTED: dict[str, tuple[Callable[[Any, Any, Any], Any], Callable[[float], float]]] = {
    "named": (
        lambda m, n, p: n**2 + p * n**2 + m.define("w", n**2) ** Q(3, 2),
        lambda p: 2 + 2 * p,
    ),
    "powers": (lambda m, n, p: n**2 + (n**p) ** Q(3, 2), lambda p: 2),
    "cosh_of_root": (lambda m, n, p: n**2 + sp.cosh(sp.sqrt(m.define("w", n**2))), lambda p: 3),
    "root_of_powers": (
        lambda m, n, p: n**2 + sp.sqrt((n**p) ** Q(3, 2) + n**4),
        lambda p: 4 if p > 8 / 3 else 0,
    ),
    "log_in_pieces": (
        lambda m, n, p: (
            n**2 + sp.Piecewise((sp.log(1 + m.define("w", n**2) ** Q(3, 2)), n < 1), (n, True))
        ),
        lambda p: 2,
    ),
    "nested_kink": (lambda m, n, p: n**2 + sp.sqrt(m.define("w", n**2)), lambda p: 0),
    "nested_halves": (lambda m, n, p: n**2 + m.define("w", n**2) ** Q(3, 4), lambda p: 0),
}
"""Energies with f'' = inf * 0 at zero, and the closed form of f''(0); 0 where it is infinite."""


class Plain:
    """A model whose names are their values."""

    def define(self, label: str, value: Any) -> Any:
        return value


def of_nested(name: str, f: Callable[[Any, Any, Any], Any]) -> Model:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    s = [m.unknown(u) for u in "abc"]
    (p,) = m.parameters(p="exponent")
    m.potential(f(m, m.norm(s), p) + p * s[1] ** 4)
    return m


def of_length(name: str, f: Callable[[Any, Any], Any]) -> Model:
    m = of_nested(name, lambda m, n, p: f(n, p))
    m.offer(pseudo_load=True, product=True)
    return m


def of_power(name: str, f: Callable[[Any, Any, Any], Any]) -> Model:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("a"), m.unknown("b")
    (p,) = m.parameters(p="exponent")
    m.potential(f(a, b, p) + p * b**4)
    m.offer(pseudo_load=True, derivatives=[p])
    return m


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("zero")
    models = [of_length(k, f) for k, f in (SMOOTH | KINKED).items()]
    models += [of_power(k, f) for k, (f, _) in POWERS.items()]
    models += [of_nested(k, f) for k, (f, _) in NESTED.items()]
    made = [pipeline.compile_model(m.finish(), Target.SIMD) for m in models]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O0"))
    return folder


def at(kernel: Kernel, u: np.ndarray, p: float) -> tuple[np.ndarray, np.ndarray]:
    R, K = kernel.tangent(np.empty((1, 0)), u[None], parameters=[p])
    return R[0], K[0]


def slopes(f: Callable[[Any, Any], Any], n: float, p: float) -> tuple[float, float, float]:
    """f', f'' and f'/n by SymPy in 60 digits; the limits at zero."""
    x = sp.Symbol("x", positive=True)
    first, second = (sp.diff(f(x, sp.nsimplify(p)), x, k) for k in (1, 2))
    size = sp.Rational(n) if n else sp.Rational(1, 10**320)
    with mpmath.workdps(60):
        d, dd = (e.subs(x, size).evalf(60, maxn=2000) for e in (first, second))
        return float(d), float(dd), float(d / size)


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("size", SIZES)
def test_the_tangent_of_a_smooth_function_of_a_length(
    kernels: Path, name: str, size: float
) -> None:
    R, K = at(load_kernel(name, kernels), size * ALONG, 2.0)
    first, second, ratio = slopes(SMOOTH[name], size, 2.0)
    outer = np.outer(ALONG, ALONG)
    # below 2^-200 f' is f'' n; where f''(0) = 0, that is right in size only
    least = 1e-30 if size < 2.0**-200 else 1e-15 * ratio
    np.testing.assert_allclose(R, first * ALONG, rtol=1e-12, atol=max(least * size, 1e-300))
    expected = ratio * (np.eye(3) - outer) + second * outer
    np.testing.assert_allclose(K, expected, rtol=1e-12, atol=least)


@pytest.mark.parametrize("name", KINKED)
def test_a_kink_has_zero_derivatives_at_zero_and_those_of_the_length_elsewhere(
    kernels: Path, name: str
) -> None:
    kernel = load_kernel(name, kernels)
    assert [not v.any() for v in at(kernel, np.zeros(3), 2.0)] == [True, True]
    for size in (1e-90, 1e-8, 1.0):
        R, _ = at(kernel, size * ALONG, 2.0)
        first, _, _ = slopes(KINKED[name], size, 2.0)
        np.testing.assert_allclose(R, first * ALONG, rtol=1e-14)


@pytest.mark.parametrize("name", NESTED)
@pytest.mark.parametrize("p", [2.0, 3.0, 4.0])
def test_a_power_of_a_power_has_the_tangent_of_its_limit(
    kernels: Path, name: str, p: float
) -> None:
    kernel, bent = load_kernel(name, kernels), NESTED[name][1](p)
    smooth = [1e-300, 1e-120, 1e-70] if bent else []  # of a kink, the tangent is infinite there
    for size in (0.0, *smooth):
        R, K = at(kernel, size * ALONG, p)
        np.testing.assert_allclose(R, bent * size * ALONG, rtol=1e-6, atol=1e-306)
        np.testing.assert_allclose(K, bent * np.eye(3), rtol=1e-6, atol=1e-14)
    size = 2.0**-20
    R, _ = at(kernel, size * ALONG, p)
    x = sp.Symbol("x", positive=True)
    energy = NESTED[name][0](Plain(), x, sp.nsimplify(p))
    np.testing.assert_allclose(R, float(sp.diff(energy, x).subs(x, Q(size))) * ALONG, rtol=1e-12)


@pytest.mark.parametrize("name", POWERS)
@pytest.mark.parametrize("size", [0.0, 1e-20, -1e-8, 0.5])
@pytest.mark.parametrize("p", [2.0, 2.5, 3.0, 4.0])
def test_powers_by_base_and_exponent(kernels: Path, name: str, size: float, p: float) -> None:
    kernel, e = load_kernel(name, kernels), POWERS[name][1]
    n = p if np.isnan(e) else e
    u = np.array([size, 0.0])
    R, K = at(kernel, u, p)
    d = abs(size)
    assert R[0] == pytest.approx(n * d ** (n - 1) * np.sign(size), rel=1e-13)
    assert K[0, 0] == pytest.approx(n * (n - 1) * d ** (n - 2), rel=1e-13)
    across = n * d ** (n - 2) if "squares" in name else 0.0
    assert K[1, 1] == pytest.approx(across, rel=1e-13)
    by_p = d ** (n - 1) * np.sign(size) * (1 + n * np.log(d)) if np.isnan(e) and d else 0.0
    nowhere = np.empty((1, 0))
    found = kernel.derivative("p", nowhere, u[None], parameters=[p])
    assert found[0, 0] == pytest.approx(by_p, rel=1e-12)
    moved = kernel.pseudo_load(nowhere, u[None], np.array([[1.0]]), parameters=[p])
    np.testing.assert_allclose(moved, found, rtol=1e-13)


@page
def by_norm(m: Fields) -> None:
    """Conduction, written with the norm of the gradient."""
    T = m.scalar("T")
    k, p = m.parameters(k="conductivity", p="exponent")
    n = m.norm(m.grad(T))
    m.minimise(k / 2 * n**2 + k / 2 * n**p - T)


def conduction() -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 2)))
    study.add("body", by_norm, k=0.5, p=2.0)
    study.fix("left", T=0.0)
    return study


def test_conduction_by_a_norm_is_solved_from_rest() -> None:
    """k (n^2 + n^2) / 2 with k = 1/2 is one conductivity: T = 2 x - x^2 / 2."""
    study = conduction()
    x, result = study.mesh.points[:, 0], study.solve()
    np.testing.assert_allclose(result.values("T"), 2 * x - x**2 / 2, atol=1e-13)
    assert result.iterations == 1


def test_sensitivities_at_points_without_a_gradient() -> None:
    """T is as 1 / k; the exponent and the places of nodes have sensitivities, too."""
    result = conduction().solve()
    found = result.sensitivity("T", at=(2.0, 0.5), by={"body": ["k", "p"], "nodes": ["x"]})
    assert found["body", "k"] == pytest.approx(-4.0, rel=1e-12)
    assert np.isfinite(found["body", "p"])
    # moving the body sideways changes nothing
    assert np.sum(found["nodes", "x"]) == pytest.approx(0.0, abs=1e-12)


# --- Branches whose conditions compare what is not-a-number, and powers with any exponent ---------


u, v, k = sp.symbols("u v k", real=True)
SPOILT = [
    sp.Min(5 + u, sp.sqrt(u)),
    sp.Min(5 + u, sp.log(u)),
    sp.Max(-5, u ** sp.Rational(3, 4)) * v,
    sp.sign(sp.log(u)) * v,
    sp.Heaviside(sp.sqrt(u), 0) * v,
    sp.Piecewise((u * v, sp.sqrt(u) < v), (v, True)),
    sp.Piecewise((u * v, sp.Or(sp.sqrt(u) < v, v < 0)), (v, True)),
    sp.Piecewise((u * v, sp.Ne(sp.log(u), v)), (v, True)),
    sp.Abs(sp.sqrt(u)),
]
"""Not-a-number at u = -1, v = 0.5; numbers at u = 1.5."""
SOUND = [
    sp.Piecewise((v**2, sp.And(u > 0, sp.sqrt(u) < 1)), (u * v, True)),
    sp.Piecewise((u * v, sp.Or(sp.sqrt(u) < v, v < 1)), (v, True)),
    sp.Piecewise((sp.sqrt(u), u > 0), (u * v, True)),
]
"""What decides has a value: u v at u = -1."""
POWERS_OF_C = [u**k, v * sp.Abs(u) ** k]


def model(name: str, density: sp.Expr) -> Model:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    symbols = {u: m.unknown("u"), v: m.unknown("v")}
    (symbols[k],) = m.parameters(k="exponent")
    m.potential(density.xreplace(symbols) + symbols[v] * symbols[k] + symbols[u])
    return m


def local(name: str) -> Model:
    """A local unknown s with a minimum in its equation."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("u"), m.unknown("v")
    (e,) = m.parameters(k="exponent")
    s = m.implicit("s", lambda s: s - sp.Min(5 + s, sp.sqrt(a + s)) - b, start=b)
    m.potential(s**2 + e * a)
    return m


@pytest.fixture(scope="module", params=[Target.SIMD, Target.SCALAR])
def undefined_kernels(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp(str(request.param))
    models = [
        *(model(f"spoilt_{i}", e) for i, e in enumerate(SPOILT)),
        *(model(f"sound_{i}", e) for i, e in enumerate(SOUND)),
        *(model(f"power_{i}", e) for i, e in enumerate(POWERS_OF_C)),
        local("local"),
    ]
    made = [pipeline.compile_model(m.finish(), request.param) for m in models]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O0"))
    return folder


def values(kernel: Kernel, at: float, exponent: float = 2.0) -> list[np.ndarray]:
    """Energy, residual and tangent of the second of five elements, at u = `at`, v = 1/2."""
    dofs = np.array([[1.5, 0.5], [at, 0.5], [1.5, 0.5], [1.5, 0.5], [1.5, 0.5]])
    nowhere, given = np.empty((5, 0)), {"parameters": [exponent]}
    found = [kernel.energy(nowhere, dofs, **given), *kernel.tangent(nowhere, dofs, **given)]
    assert all(np.isfinite(x[[0, 2, 3, 4]]).all() for x in found)
    return [x[1] for x in found]


@pytest.mark.parametrize("name", [*(f"spoilt_{i}" for i in range(len(SPOILT))), "local"])
def test_a_condition_on_not_a_number_spoils_energy_residual_and_tangent(
    undefined_kernels: Path, name: str
) -> None:
    kernel = load_kernel(name, undefined_kernels)
    assert [bool(np.isnan(x).any()) for x in values(kernel, -1.0)] == [True] * 3


@pytest.mark.parametrize("i", range(len(SOUND)))
def test_a_condition_that_is_decided_takes_its_side(undefined_kernels: Path, i: int) -> None:
    energy, R, K = values(load_kernel(f"sound_{i}", undefined_kernels), -1.0, 0.0)
    assert energy == -1.5
    assert R.tolist() == [1.5, -1.0]
    assert K.tolist() == [[0, 1], [1, 0]]


@pytest.mark.parametrize(
    ("i", "at", "exponent", "energy", "slope", "curvature"),
    [
        (0, -3.0, 2.0, 9.0, -6.0, 2.0),
        (0, -2.0, 3.0, -8.0, 12.0, -12.0),
        (0, 0.0, 2.5, 0.0, 0.0, 0.0),
        (0, 0.0, 2.0, 0.0, 0.0, 2.0),
        (0, -2.0, 2.5, np.nan, np.nan, np.nan),
        (0, 4.0, 0.5, 2.0, 0.25, -1 / 32),
        (1, 0.0, 2.5, 0.0, 0.0, 0.0),
        (1, -4.0, 2.5, 16.0, -10.0, 3.75),
        (1, 0.0, 1.5, 0.0, 0.0, np.inf),
    ],
)
def test_a_power_is_that_of_c(
    undefined_kernels: Path,
    i: int,
    at: float,
    exponent: float,
    energy: float,
    slope: float,
    curvature: float,
) -> None:
    found, R, K = values(load_kernel(f"power_{i}", undefined_kernels), at, exponent)
    assert found - at - exponent / 2 == pytest.approx(energy, rel=1e-14, nan_ok=True)
    assert R[0] - 1 == pytest.approx(slope, rel=1e-14, nan_ok=True)
    assert K[0, 0] == pytest.approx(curvature, rel=1e-14, nan_ok=True)
