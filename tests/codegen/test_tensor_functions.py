"""Functions of symmetric tensors against 120 digits: values, first and second derivatives.

The oracle has the formula of Daleckii and Krein with plain quotients in so many digits that what
they lose does not matter; it shares no code with the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.model import Model
from softehl.codegen.language.weak_form import page as made
from softehl.codegen.tools import build
from softehl.codegen.verify import verification
from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.workshop import compiled, write

PAIRS = {2: ((0, 0), (1, 1), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))}
DIRECTION = (0.31, -0.27, 0.73, 0.52, 0.16, -0.64)
ALONG = (0.45, 0.62, -0.38, -0.71, 0.29, 0.57)

Scalar = Callable[[Any, Any], Any]
FUNCTIONS: dict[str, Scalar] = {
    "log": lambda _, x: _.log(x),
    "sqrt": lambda _, x: _.sqrt(x),
    "decay": lambda _, x: _.exp(-x),
    "power": lambda _, x: x ** _.Rational(17, 10),
    "inverse": lambda _, x: 1 / x,
    "cubic": lambda _, x: x**3 - 2 * x,
    "entropy": lambda _, x: x * _.log(x),
    "wave": lambda _, x: _.sin(x) * _.tanh(x),
    "bell": lambda _, x: _.erf(x - 1) + _.atan(x),
    "tension": lambda _, x: _.Max(x - 1, 0),
    "kinked": lambda _, x: _.Abs(x - 1) * x,
    "pieces": lambda _, x: _.Piecewise((_.log(x), x < 1), (x - 1, True)),
}


class Digits:
    """The functions of the page in the arithmetic of mpmath."""

    log, sqrt, exp, sin, tanh = mpmath.log, mpmath.sqrt, mpmath.exp, mpmath.sin, mpmath.tanh
    erf, atan, Abs, Max = mpmath.erf, mpmath.atan, abs, max

    @staticmethod
    def Rational(p: int, q: int) -> Any:
        return mpmath.mpf(p) / q

    @staticmethod
    def Piecewise(first: Any, last: Any) -> Any:
        return first[0] if first[1] else last[0]


def page(name: str, functions: dict[str, Scalar], size: int = 3) -> Definition:
    """P : f(C) for a direction P, with a factor for each function; the entries are unknowns."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    e = [m.unknown(f"c_{i}{j}") for i, j in PAIRS[size]]
    C = sp.Matrix(size, size, lambda i, j: e[PAIRS[size].index((min(i, j), max(i, j)))])
    p = m.parameters(**{f"p_{k}": "direction" for k in range(len(e))})
    chosen = m.parameters(**{f"is_{f}": "choice" for f in functions})
    values: dict[str, Any] = {}
    total = sp.Integer(0)
    for on, (f, function) in zip(chosen, functions.items(), strict=True):
        Y = m.isotropic(C, partial(function, sp))
        total += on * sum(a * Y[i, j] for a, (i, j) in zip(p, PAIRS[size], strict=True))
        values |= {f"{f}_{i}{j}": Y[i, j] for i, j in PAIRS[size]}
    m.potential(total)
    m.fields(**values)
    m.offer(tasks=["tangent", "fields"])
    return m.finish()


@dataclass(frozen=True)
class Exact:
    """Eigenvalues and vectors of one matrix in many digits."""

    c: Any
    Q: Any

    @staticmethod
    def of(C: Any) -> Exact:
        return Exact(*mpmath.eigsy(C))

    def value(self, f: Callable[[Any], Any]) -> Any:
        return self.Q * mpmath.diag([f(x) for x in self.c]) * self.Q.T

    def slope(self, f: Callable[[Any], Any], P: Any) -> Any:
        """Derivative along P: the same as the gradient of P : f(C)."""
        c, n = self.c, len(self.c)
        hat = self.Q.T * P * self.Q
        for i in range(n):
            for j in range(n):
                hat[i, j] *= mpmath.diff(f, c[i]) if i == j else (f(c[i]) - f(c[j])) / (c[i] - c[j])
        return self.Q * hat * self.Q.T


def full(entries: Any) -> Any:
    pairs = PAIRS[2 if len(entries) == 3 else 3]
    size = pairs[len(pairs) - 1][1] + 1
    return mpmath.matrix(
        [
            [mpmath.mpf(entries[pairs.index((min(i, j), max(i, j)))]) for j in range(size)]
            for i in range(size)
        ]
    )


def of_entries(A: Any, twice: bool) -> list[Any]:
    pairs = PAIRS[A.rows]
    return [A[i, j] * (2 if twice and i != j else 1) for i, j in pairs]


def expected(entries: list[float], functions: dict[str, Scalar]) -> dict[str, tuple[Any, ...]]:
    """Values, gradient of P : f(C) and its derivative along a direction, by entries."""
    n = len(entries)
    pairs = PAIRS[2 if n == 3 else 3]
    with mpmath.workdps(120):
        P = full([x / (1 if i == j else 2) for x, (i, j) in zip(DIRECTION, pairs, strict=False)])
        V, C = full(ALONG[:n]), full(entries)
        size = mpmath.mpf(min(abs(x) for x in mpmath.eigsy(C, eigvals_only=True))) or 1
        h = mpmath.mpf(10) ** -28 * size
        noise = full([mpmath.mpf(10) ** -50 * size * (k + 2) ** 2 for k in range(n)])
        at = [Exact.of(C + t * h * V + noise) for t in (0, 1, -1)]
        out = {}
        for name, function in functions.items():

            def f(x: Any, function: Scalar = function) -> Any:
                return function(Digits, x)

            first = at[0].slope(f, P)
            second = (at[1].slope(f, P) - at[2].slope(f, P)) / (2 * h)
            out[name] = (
                of_entries(at[0].value(f), False),
                of_entries(first, True),
                of_entries(second, True),
            )
    return out


def errors(
    kernel: Kernel, functions: dict[str, Scalar], entries: list[float]
) -> dict[str, tuple[float, ...]]:
    """Errors relative to the largest entry of value, first and second derivatives."""
    n, out = len(entries), dict[str, tuple[float, ...]]()
    right = expected(entries, functions)
    nowhere, u = np.zeros((1, 0)), np.array([entries])
    for k, name in enumerate(functions):
        choice = [float(k == i) for i in range(len(functions))]
        parameters = [*DIRECTION[:n], *choice]
        Y = kernel.fields_at(nowhere, u, parameters=parameters)[0, 0, n * k : n * k + n]
        R, K = kernel.tangent(nowhere, u, parameters=parameters)
        found = (Y, R[0], K[0] @ np.array(ALONG[:n]))
        assert np.abs(K[0] - K[0].T).max() <= 1e-15 * np.abs(K[0]).max()
        out[name] = tuple(
            float(max(abs(mpmath.mpf(a) - b) for a, b in zip(*pair, strict=True)))
            / max(float(max(map(abs, pair[1]))), 1e-30)
            for pair in zip(found, right[name], strict=True)
        )
    return out


def turned(*c: float) -> list[float]:
    n = len(c)
    Q, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(n, n)))
    C: Array = Q @ np.diag(c) @ Q.T
    return [float((C[i, j] + C[j, i]) / 2) for i, j in PAIRS[n]]


GAPS = [10.0**-k for k in range(1, 13)]
STATES: dict[str, list[float]] = {
    "multiple of the unit tensor": [1.25, 1.25, 1.25, 0.0, 0.0, 0.0],
    "two equal": [1.5, 1.5, 0.7, 0.0, 0.0, 0.0],
    "diagonal": [0.4, 2.5, 1.7, 0.0, 0.0, 0.0],
    **{f"two, gap {g:.0e}": turned(1.44 * (1 + g), 1.44, 0.7) for g in GAPS},
    **{f"three, gap {g:.0e}": turned(1.3 * (1 + g), 1.3, 1.3 * (1 - g / 2)) for g in GAPS[::3]},
    "kink between, wide": turned(2.0, 0.5, 0.9),
    "kink between, 1e-1": turned(1.05, 0.95, 1.3),
    "kink between, 1e-2": turned(1.005, 0.995, 0.6),
    "kink, one and two": turned(1.4, 0.8, 0.8 * (1 + 1e-9)),
    "kink, two and one": turned(1.4 * (1 + 1e-7), 1.4, 0.8),
    "large": turned(5.0, 0.05, 1.6),
}
WIDE = {
    f"stretches to {r:.0e}": [turned(r, 1 / r, 1.3), turned(r, 1.2 / r, 1 / r)]
    for r in (1e2, 1e3, 1e4, 1e5)
}


QUICK = {k: FUNCTIONS[k] for k in ("log", "tension")}


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(page("tensors", QUICK), tmp_path_factory.mktemp("tensors"))


@pytest.mark.parametrize(
    "state",
    [
        "multiple of the unit tensor",
        "two equal",
        "two, gap 1e-01",
        "two, gap 1e-06",
        "kink between, 1e-1",
    ],
)
def test_log_and_tension(state: str, kernel: Kernel) -> None:
    found = errors(kernel, QUICK, STATES[state])
    assert max(x for v in found.values() for x in v) < 1e-14


def test_stretches_to_100000(kernel: Kernel) -> None:
    """Small eigenvalues keep their digits: the matrix is known to more of them."""
    for entries in WIDE["stretches to 1e+05"]:
        assert max(errors(kernel, QUICK, entries)["log"]) < 1e-14


@pytest.mark.slow
def test_twelve_functions_at_all_states(tmp_path: Path) -> None:
    kernel = compiled(page("tensors", FUNCTIONS), tmp_path)
    for state, entries in STATES.items():
        found = errors(kernel, FUNCTIONS, entries)
        assert max(x for v in found.values() for x in v) < 1e-13, state
    for ratio, states in WIDE.items():
        for entries in states:
            found = errors(kernel, FUNCTIONS, entries)
            assert max(x for v in found.values() for x in v) < 1e-8, ratio


def test_the_rules_of_second_differences_are_needed(tmp_path: Path) -> None:
    """With quotients of close values alone the tangent is far off: the oracle says so."""
    log = {"log": FUNCTIONS["log"]}
    write(page("tensors", log), tmp_path)
    source = tmp_path / "tensors.c"
    text = source.read_text()
    assert text.count("width <= 0.1 *") == 1
    source.write_text(text.replace("width <= 0.1 *", "width <= 0.0 *"))
    build.build(tmp_path, extra=("-O0",))
    naive = load_kernel("tensors", tmp_path)
    value, first, second = errors(naive, log, STATES["two, gap 1e-06"])["log"]
    assert max(value, first) < 1e-14
    assert second > 1e-11


def mixed() -> Definition:
    """All functions in plane, in products with each other, with parameters and a derivative."""
    m = Model("mixed_tensors", nodes=1, rule=quadrature.point_rule())
    F = sp.Matrix(2, 2, [m.unknown(f"F_{k}") for k in range(4)])
    mu, n = m.parameters(mu="factor", n="exponent")
    C = m.define("C", F.T * F)
    L, P, A = m.log(C), m.power(C, n), m.exp(F / 4)
    T = m.isotropic(C - sp.eye(2), lambda x: mu * sp.Max(x, 0) ** 2)
    first, second = m.eigenvalues(C)
    total = mu * (L * L).trace() + P.trace() / n + (A.T * A).trace()
    S = m.derivative("S", (L * L * C).trace(), L)
    m.potential(total + T[0, 0] * P[0, 1] + first**2 * second + (S * C).trace() / 10)
    m.fields(L_01=L[0, 1], A_10=A[1, 0], first=first)
    m.offer(tasks=["tangent", "fields"], product=True, pseudo_load=True, fields_rate=True)
    return m.finish()


def test_all_tasks_of_a_page(tmp_path: Path) -> None:
    d = mixed()
    compiled(d, tmp_path)
    tasks = ("tangent", "fields", "product", "pseudo_load", "fields_rate")
    checked = verification.check(d, tasks, tmp_path / build.LIBRARY, seconds=1)
    assert max(checked.errors.values()) <= verification.BOUND


def exponential(size: int) -> Definition:
    """P : exp(A) of a matrix with independent entries."""
    m = Model(f"exponential_{size}", nodes=1, rule=quadrature.point_rule())
    A = sp.Matrix(size, size, [m.unknown(f"a_{k}") for k in range(size**2)])
    p = m.parameters(**{f"p_{k}": "direction" for k in range(size**2)})
    E = m.exp(A)
    m.potential(sum(a * b for a, b in zip(p, E, strict=True)))
    m.fields(**{f"E_{k}": v for k, v in enumerate(E)})
    m.offer(tasks=["tangent", "fields"])
    return m.finish()


@pytest.mark.parametrize("scale", [0.0, 1e-6, 0.3, 4.0])
def test_exponential_of_an_unsymmetric_matrix(scale: float, exponentials: Kernel) -> None:
    """Derivatives in the corner of the exponential of a block matrix (Mathias 1996)."""
    rng = np.random.default_rng(2)
    A, P, D, V = (rng.uniform(-1, 1, (3, 3)) for _ in range(4))
    A *= scale
    at = np.zeros((1, 0)), A.reshape(1, 9)
    Y = exponentials.fields_at(*at, parameters=P.ravel())[0, 0]
    R, K = exponentials.tangent(*at, parameters=P.ravel())
    with mpmath.workdps(40):
        a, d, v = (mpmath.matrix(x.tolist()) for x in (A, D, V))
        block = mpmath.zeros(12, 12)
        for k in range(4):
            block[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = a
        for k, entry in ((0, d), (6, d)):
            block[k : k + 3, k + 3 : k + 6] = entry
        block[0:3, 6:9] = v
        block[3:6, 9:12] = v
        E = mpmath.expm(block, method="taylor")
        right = [E[0:3, 0:3], E[0:3, 3:6], E[0:3, 9:12]]
        exact = [np.array(x.tolist(), dtype=float) for x in right]
    size = np.exp(3 * scale)
    assert np.abs(Y.reshape(3, 3) - exact[0]).max() < 1e-15 * size
    assert abs(R[0] @ D.ravel() - (P * exact[1]).sum()) < 3e-15 * size
    assert abs(D.ravel() @ K[0] @ V.ravel() - (P * exact[2]).sum()) < 1e-14 * size
    assert np.abs(K[0] - K[0].T).max() < 1e-14 * size


@pytest.fixture(scope="module")
def exponentials(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(exponential(3), tmp_path_factory.mktemp("exponential"))


def split(m: Fields) -> None:
    """Tension and compression apart, the latter undamaged (Miehe 2010)."""
    (d,) = m.parameters(d="damage")
    u = m.vector("u")
    e = (m.grad(u) + m.grad(u).T) / 2
    tension = m.isotropic(e, lambda x: sp.Max(x, 0))
    compression = m.isotropic(e, lambda x: sp.Min(x, 0))
    m.minimise((1 - d) ** 2 * (tension**2).trace() + (compression**2).trace())


def test_split_of_a_phase_field(tmp_path: Path) -> None:
    """Undamaged it is Hooke's law; without strain, and in pure shear, the tangent is right."""
    definition = made(split).definition("quad4")
    kernel = compiled(definition, tmp_path)
    X = np.array([[0.0, 0, 1, 0, 1, 1, 0, 1]])
    u = np.zeros((1, 8))
    hooke = kernel.tangent(X, u, parameters=[0.0])[1][0]
    shear = 0.01 * X[:, [1, 0, 3, 2, 5, 4, 7, 6]]
    for state in (u, shear, -0.02 * X):
        K = kernel.tangent(X, state, parameters=[0.0])[1][0]
        np.testing.assert_allclose(K, hooke, rtol=0, atol=1e-14)
    energy = kernel.energy(X, shear, parameters=[1.0])
    np.testing.assert_allclose(energy, 1e-4, rtol=1e-13)  # what compression has: one of two


def test_a_tensor_function_on_a_side_that_is_not_taken(tmp_path: Path) -> None:
    m = Model("guarded_log", nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("a"), m.unknown("b")
    L = m.log(sp.Matrix([[a, b], [b, a]]))
    m.potential(sp.Piecewise((L.trace(), a > sp.Abs(b)), (a**2 + b**2, True)))
    kernel = compiled(m.finish(), tmp_path)
    R, K = kernel.tangent(np.zeros((2, 0)), np.array([[2.0, 1.0], [1.0, 2.0]]))
    np.testing.assert_allclose(R, np.array([[4 / 3, -2 / 3], [2.0, 4.0]]), rtol=1e-14)
    np.testing.assert_allclose(K[1], 2 * np.eye(2), rtol=1e-14)


def test_mistakes() -> None:
    m = Model("wrong", nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("a"), m.unknown("b")
    with pytest.raises(
        ModelError, match=r"m.log: C has shape \(1, 2\), must be \(2, 2\) or \(3, 3"
    ):
        m.log(sp.Matrix([[a, b]]))
    with pytest.raises(ModelError, match=r"m.sqrt: C is not symmetric, C\[0, 1\] is not C\[1, 0\]"):
        m.sqrt(sp.Matrix([[a, b], [a, b]]))
    with pytest.raises(ModelError, match=r"m.exp: a is a scalar, must be a matrix \(2, 2\) or"):
        m.exp(a)
    with pytest.raises(ModelError, match=r"m.eigenvalues: C is a list.* write sp.Matrix"):
        m.eigenvalues([[a, b], [b, a]])
    C = sp.Matrix([[a, b], [b, a]])
    with pytest.raises(ModelError, match=r"m.isotropic: .* is no function; write `lambda x:"):
        m.isotropic(C, sp.Max(a, 0))
    with pytest.raises(ModelError, match=r"m.isotropic: atan2 has no second divided difference"):
        m.isotropic(C, lambda x: sp.atan2(x, a))
    with pytest.raises(ModelError, match="holds a function of another tensor"):
        m.isotropic(C, lambda x: m.log(x * C)[0, 0])


def test_third_derivatives_are_refused() -> None:
    m = Model("third", nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("a"), m.unknown("b")
    c = m.define("c", a * b)
    L = m.log(sp.Matrix([[c, a], [a, b]]))
    m.potential(m.derivative("S", L[0, 0] ** 2, c) ** 2)
    with pytest.raises(SoftehlError, match=r"third derivative of m.log is needed; there are two"):
        pipeline.compile_model(m.finish())
