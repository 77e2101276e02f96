"""Unknowns eliminated at the point: values, derivatives, failure, history."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.evaluation import evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.routines import NewtonRoutine, inverse
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.graph.verifier import IllegalGraphError, check
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, output_files
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.workshop import compiled, difference, element_state, off, tangent_errors

HISTORY = np.array([[0.3], [0.5]])
DEFAULT_CELL = np.zeros((1, 0))


def coupled(n: int, *, unroll: bool, name: str = "coupled") -> Definition:
    """n coupled cubic equations at each point; the first has no diagonal slope at s_0 = 0."""
    m = Model(f"{name}_{n}", nodes=1, rule=quadrature.gauss(2, 1), unroll=unroll)
    x, y = m.unknown("x"), m.unknown("y")
    (k,) = m.parameters(k="stiffness")
    (h,) = m.point_data(h="history")
    (xi,) = m.point()
    e = m.define("e", x * (1 + xi) + y**2)

    def equations(s: list[Any]) -> list[Any]:
        mixed = [s[(i + 1) % n] for i in range(n)]
        pairs = enumerate(zip(s, mixed, strict=True))
        return [a**3 + min(i, 1) * a + k * b - e - h for i, (a, b) in pairs]

    s = m.implicit("s", equations, start=[sp.Integer(0)] * n)
    m.potential(m.integral("Pi", x * sum((i + 1) * a**2 for i, a in enumerate(s)) + e**2))
    m.fields(first=s[0], last=s[-1])
    return m.finish()


def one(equation: Callable[..., Any], *, start: Any = 1, name: str = "one", **given: Any) -> Model:
    """A model with one unknown x and one local unknown s; the page goes on from there."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    m.s = m.implicit("s", lambda s: equation(s, x), start=start, **given)  # type: ignore[attr-defined]
    return m


def test_the_text_does_not_depend_on_symbols_made_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """SymPy's name of a Dummy is the number of those before it, and orders terms by names."""

    def text(count: int) -> str:
        monkeypatch.setattr(sp.Dummy, "_count", count)
        m = Model("ordered", nodes=1, rule=quadrature.point_rule())
        x = m.unknown("x")

        def equations(s: list[Any]) -> list[Any]:
            return [sp.exp(s[0]) + sp.exp(s[1]) - x, s[0] - s[1] / 2]

        s = m.implicit("s", equations, start=[0, 0])
        m.potential(s[0] ** 2)
        return pipeline.compile_model(m.finish()).text

    assert text(998) == text(999)  # Dummy_998 is before Dummy_999, but 999 behind 1000


# ------------------------------------------------------------------------------------- the values


SIZES = [(1, False), (2, True), (3, False), (5, True)]


@pytest.fixture(scope="module")
def family(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Definition, Kernel]]:
    """One library of systems of all sizes, looped and written out."""
    directory = tmp_path_factory.mktemp("coupled")
    models = {d.name: d for d in (coupled(n, unroll=u) for n, u in SIZES)}
    texts = output_files.files([pipeline.compile_model(d) for d in models.values()])
    for name, text in texts.items():
        (directory / name).write_text(text, encoding="utf-8")
    build.build(directory, extra=(*build.STRICT, "-O0"))
    return {name: (d, load_kernel(name, directory)) for name, d in models.items()}


@pytest.mark.parametrize("n", [n for n, _ in SIZES])
def test_systems_against_the_oracle(n: int, family: Any) -> None:
    d, kernel = family[f"coupled_{n}"]
    given: dict[str, Any] = {"parameters": [2.0], "point_data": HISTORY}
    assert max(tangent_errors(d, kernel, (), [0.7, 0.4], **given)) <= 1e-13
    at = element_state(kernel, (), [0.7, 0.4], **given)
    u = np.array([[0.7, 0.4]])
    named = {**given, "point_data": HISTORY[None]}
    assert off(kernel.energy(DEFAULT_CELL, u, **named), [Oracle(d).potential(at)]) <= 1e-14
    assert off(kernel.fields_at(DEFAULT_CELL, u, **named)[0], Oracle(d).fields(at)) <= 1e-14


def test_a_forgotten_dependence_of_the_equation_is_refused(tmp_path: Path) -> None:
    """With dg/dp of one operand taken for zero, residual and tangent must both be found wrong."""
    d = coupled(1, unroll=False)
    (call,) = (n for n in reachable([d.potential]) if n.op is Op.CALL)
    routine = call.payload
    assert isinstance(routine, NewtonRoutine)
    spoilt = (d.graph.zero,) * len(routine.by_external[0])
    object.__setattr__(routine, "by_external", (spoilt,))
    kernel = compiled(d, tmp_path)
    errors = tangent_errors(d, kernel, (), [0.7, 0.4], parameters=[2.0], point_data=HISTORY)
    assert min(errors) > 1e-3


# --------------------------------------------------------------------------------------- failure


def test_an_equation_without_a_solution_spoils_its_element_only(tmp_path: Path) -> None:
    m = one(lambda s, x: s**2 + x, name="rootless")
    s, x = m.s, sp.Symbol("x", real=True)  # type: ignore[attr-defined]
    # a comparison would swallow the not-a-number: the energy must not come out as x^2
    m.potential(sp.Piecewise((s * x, s > 0), (x**2, True)))
    m.fields(constant=sp.Integer(3), s=s)
    kernel = compiled(m.finish(), tmp_path)
    X, u = np.zeros((3, 0)), np.array([[-4.0], [1.0], [-9.0]])
    R, K = kernel.tangent(X, u)
    results = (
        kernel.energy(X, u)[:, None],
        kernel.residual(X, u),
        R,
        K[0:, 0],
        *([kernel.fields_at(X, u)[:, 0]]),
    )
    for values in results:
        assert np.isfinite(values[[0, 2]]).all()
        assert np.isnan(values[1]).all()
    np.testing.assert_allclose(kernel.fields_at(X, u)[[0, 2], 0, 1], [2.0, 3.0], rtol=1e-15)


def test_a_singular_system_is_a_failure(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="s: unknown 0 does not occur in the equations"):
        one(lambda s, x: (s - s) * x + x)
    m = one(lambda s, x: (s - x) ** 2 + x, start=sp.Symbol("x", real=True), name="flat")
    m.potential(m.s)  # type: ignore[attr-defined]
    kernel = compiled(m.finish(), tmp_path)
    assert np.isnan(kernel.residual(np.zeros((1, 0)), np.array([[2.0]]))).all()


# ----------------------------------------------------------------------------- inverse and graph


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_the_inverse_and_its_derivative(n: int) -> None:
    g = Graph()
    A = [[g.input("dofs", n * i + j) for j in range(n)] for i in range(n)]
    X = inverse(g, A)
    check([x for row in X for x in row])
    rng = np.random.default_rng(7)
    numbers = rng.uniform(-1, 1, (n, n))
    numbers[0, 0] = 0.0 if n > 1 else 0.3  # needs pivoting
    at = {("dofs", k): float(v) for k, v in enumerate(numbers.ravel())}
    found = np.array([[float(evaluate(x, at)) for x in row] for row in X])
    np.testing.assert_allclose(found @ numbers, np.eye(n), atol=1e-13)
    slopes = gradient(g, X[-1][0], [a for row in A for a in row])
    for k in (0, n * n - 1):
        exact = difference(X[-1][0], at, k)
        assert abs(evaluate(slopes[A[k // n][k % n]], at) - exact) <= 1e-30 * (1 + abs(exact))


def test_a_routine_is_taken_by_its_items() -> None:
    d = coupled(2, unroll=False)
    check([d.potential])
    (call,) = (n for n in reachable([d.potential]) if n.op is Op.CALL)
    wrong: list[Node] = [
        d.graph.node(Op.NEG, (call,)),
        d.graph.node(Op.CALL, call.args[:-1], call.payload),
        d.graph.node(Op.CALL, call.args),
        d.graph.node(Op.ITEM, (call.args[0],), d.graph.run(call.payload, call.args)[0].payload),  # type: ignore[arg-type]
    ]
    for n in wrong:
        with pytest.raises(IllegalGraphError, match=f"#{n.id} "):
            check([n])


# ------------------------------------------------------------------------------------- arguments


def test_as_many_equations_as_unknowns() -> None:
    m = Model("short", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    with pytest.raises(ModelError, match="s: 1 equations for 2 unknowns"):
        m.implicit("s", lambda s: [s[0] - x], start=[x, x])
    with pytest.raises(ModelError, match="0 must be a number > 0"):
        m.implicit("t", lambda t: t - x, start=x, tolerance=0)


# ----------------------------------------------------------------------------------- small unknowns


def small(name: str, equation: Callable[..., Any], start: Any, **given: Any) -> Definition:
    m = one(equation, start=start, name=name, **given)
    s, x = m.s, sp.Symbol("x", real=True)  # type: ignore[attr-defined]
    m.potential(s * x)
    m.fields(s=s)
    return m.finish()


@pytest.mark.parametrize("x", [1e-3, 1e-7, 1e-10, 1e-11, 1e-14, 1e-16])
def test_unknowns_of_any_size_are_found_to_their_last_digits(tmp_path: Path, x: float) -> None:
    """Five decades below a tolerance of 1e-10 a first step must not pass for a solution."""
    k = sp.Rational(10) ** 10
    d = small("small", lambda s, x: s + k * s**2 - x / 5, start=sp.Symbol("x", real=True))
    kernel = compiled(d, tmp_path)
    found = kernel.fields_at(np.zeros((1, 0)), np.array([[x]]))[0, 0, 0]
    with mpmath.workdps(150):
        exact = (mpmath.sqrt(1 + mpmath.mpf(4e10) * mpmath.mpf(x) / 5) - 1) / mpmath.mpf(2e10)
        oracle = Oracle(d).fields(element_state(kernel, (), [x]))[0][0]
        assert abs(oracle - exact) <= 1e-35 * abs(exact)
        assert abs(mpmath.mpf(float(found)) - exact) <= 1e-14 * abs(exact)
    assert max(tangent_errors(d, kernel, (), [x])) <= 1e-13


def test_rounding_of_large_terms_ends_the_iteration(tmp_path: Path) -> None:
    """s is what is left of terms a billion times larger; no step is small compared with it."""

    def equation(s: Any, x: Any) -> Any:
        return s**3 + s - x - 10**9 * sp.cos(x) + 10**9 * sp.sqrt(1 - sp.sin(x) ** 2)

    d = small("rest", equation, start=0)
    kernel = compiled(d, tmp_path)
    u = np.array([[1e-7], [3e-4], [0.1], [0.0]])
    found = kernel.fields_at(np.zeros((4, 0)), u)[:, 0, 0]
    assert np.abs(found**3 + found - u[:, 0]).max() <= 5e-7


def crystal() -> Definition:
    """A cubic crystal with the twelve slips of octahedral planes, whose rate is a ninth power."""
    m = Model("crystal", nodes=1, rule=quadrature.point_rule())
    e = [m.unknown(f"e_{k}") for k in range(6)]
    strain = sp.Matrix([[e[0], e[3], e[4]], [e[3], e[1], e[5]], [e[4], e[5], e[2]]])
    planes = [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)]
    along = [(0, 1, -1), (1, 0, -1), (1, -1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0)]
    pairs = [(sp.Matrix(n), sp.Matrix(s)) for n in planes for s in along]
    schmid = [(n * s.T + s * n.T) / (2 * sp.sqrt(6)) for n, s in pairs if n.dot(s) == 0]

    def stress(slips: Any) -> sp.Matrix:
        elastic = strain - sum((g * P for g, P in zip(slips, schmid, strict=True)), sp.zeros(3))
        return 1500 * elastic + 1000 * elastic.trace() * sp.eye(3)  # of the shear resistance

    def flow(slips: Any) -> list[Any]:
        sigma = stress(slips)
        rates = [sum(sigma.multiply_elementwise(P)) ** 9 for P in schmid]
        return [g - rate / 1000 for g, rate in zip(slips, rates, strict=True)]

    slips = m.implicit("g", flow, start=[sp.Integer(0)] * 12, iterations=60)
    sigma = stress(slips)
    m.weak_form([(sigma[i, j], x) for (i, j), x in zip(SYMMETRIC, e, strict=True)])
    return m.finish()


SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def test_slips_that_are_nothing_but_rounding_end_the_iteration(tmp_path: Path) -> None:
    """Pulled along an edge, four systems have no resolved stress but the rounding of its terms."""
    kernel = compiled(crystal(), tmp_path)
    rng = np.random.default_rng(0)
    pulled = np.linspace(0.0, 2e-3, 200)[:, None] * [1.0, -0.3, -0.3, 0.0, 0.0, 0.0]
    noise = 1e-19 * rng.standard_normal(pulled.shape)
    r, K = kernel.tangent(np.zeros((200, 0)), pulled + noise)
    assert np.isfinite(r).all()
    assert np.isfinite(K).all()
    assert np.abs(r[:, 0]).max() < 3.0  # it flows: 3.8 if it did not


@pytest.mark.parametrize("vector", [False, True])
def test_a_side_that_is_not_taken_is_cut_out_of_the_derivatives(
    vector: bool, tmp_path: Path
) -> None:
    """A flow rule with the norm of a strain, which has no derivative where the strain is zero."""
    m = Model("flow", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    norm = m.define("norm", sp.sqrt(x**2 + y**2))

    def flow(s: Any, e: Any) -> Any:
        return sp.Piecewise((s + s**3 - e * (1 - 1 / (2 * norm)), norm > 1), (s - e / 10, True))

    if vector:
        a, b = m.implicit("s", lambda s: [flow(s[0], x), flow(s[1], y)], start=[x, y])
    else:
        a = b = m.implicit("s", lambda s: flow(s, x), start=x)
    m.potential(x**2 + y**2 + a * x + b * y)
    d = m.finish()
    kernel = compiled(d, tmp_path)
    for u in ([0.0, 0.0], [0.3, 0.2], [2.0, 1.0]):
        assert max(tangent_errors(d, kernel, (), u)) <= 1e-14


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"size": -1}, "-1 must be a number >= 0"),
        ({"iterations": 0}, "iterations = 0 must be an integer > 0"),
        ({"iterations": 2.5}, "iterations = 2.5 must be an integer > 0"),
    ],
)
def test_settings_of_the_iteration_are_checked(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        one(lambda s, x: s - x, name="set", **given)
