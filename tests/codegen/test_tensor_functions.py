"""Functions of symmetric tensors against 120 digits: values, first and second derivatives.

The oracle has the formula of Daleckii and Krein with plain quotients in so many digits that what
they lose does not matter; it shares no code with the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel
from tests.codegen.workshop import compiled

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
    total, values = sp.Integer(0), {}
    for on, (f, function) in zip(chosen, functions.items(), strict=True):
        Y = m.isotropic(C, lambda x, function=function: function(sp, x))
        total += on * sum(a * Y[i, j] for a, (i, j) in zip(p, PAIRS[size], strict=True))
        values |= {f"{f}_{i}{j}": Y[i, j] for i, j in PAIRS[size]}
    m.potential(total)
    m.fields(**values)
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
    with mpmath.workdps(120):
        P = full([x / (1 if k < (n + 1) // 2 else 2) for k, x in enumerate(DIRECTION[:n])])
        if n == 6:
            P = full([x / (1 if k < 3 else 2) for k, x in enumerate(DIRECTION)])
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
) -> dict[str, tuple[float, float, float]]:
    """Errors relative to the largest entry of value, first and second derivatives."""
    n, out = len(entries), {}
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
    "unit": [1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
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


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(page("tensors", FUNCTIONS), tmp_path_factory.mktemp("tensors"))


@pytest.mark.parametrize("state", STATES)
def test_value_and_two_derivatives(state: str, kernel: Kernel) -> None:
    found = errors(kernel, FUNCTIONS, STATES[state])
    print(state, {k: " ".join(f"{x:.0e}" for x in v) for k, v in found.items()})
    assert max(x for v in found.values() for x in v) < 1e-13
