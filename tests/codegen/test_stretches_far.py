"""Twelve energies of stretches at sixty states against the spectral formula in 100 digits.

The error is measured by the change that a rounding of C makes, and some roundings of the result.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.model import Model
from tests.codegen.workshop import compiled

ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
PAIRS = ((0, 1), (0, 2), (1, 2))
Energy = Callable[[Any, Any, Any], Any]


def separate(f: Callable[[Any], Any]) -> Energy:
    return lambda a, b, c: f(a) + f(b) + f(c)


ENERGIES: dict[str, Energy] = {
    "ogden": separate(lambda x: x ** sp.Rational(13, 10) + x**5 / 100 - 2 * sp.log(x) + x**-2),
    "hencky": lambda a, b, c: (
        sp.log(a) ** 2 + sp.log(b) ** 2 + sp.log(c) ** 2 + 3 * sp.log(a * b * c) ** 2
    ),
    "limiting": separate(lambda x: -sp.log(1 - x / 2)),
    "split": separate(lambda x: sp.Max((x**2 - 1) / 2, 0) ** 2),
    "gent": lambda a, b, c: -sp.log(1 - (a**2 + b**2 + c**2 - 3) / 40) - sp.log(a * b * c),
    "invariants": lambda a, b, c: (
        (a * b + b * c + c * a) ** 2 + (a * b * c - 1) ** 2 + sp.sqrt(a**2 + b**2 + c**2)
    ),
    "isochoric": lambda a, b, c: (
        (a * b * c) ** sp.Rational(-1, 2) * sum(x ** sp.Rational(3, 2) for x in (a, b, c))
        + sp.exp(sp.log(a * b * c) ** 2)
    ),
    "exponential": lambda a, b, c: sp.exp(2 * sum(sp.log(x) ** 2 for x in (a, b, c)) / 5),
    "library": separate(
        lambda x: sp.sin(x) + sp.cos(3 * x) + sp.atan(x) * sp.tanh(x) + sp.asinh(x) + sp.erf(x)
    ),
    "split_volume": lambda a, b, c: (
        sp.Max(a * b * c - 1, 0) ** 2
        + sum(sp.Piecewise((sp.log(x) ** 2, x > 1), (0, True)) for x in (a, b, c))
    ),
    "absolute": separate(lambda x: sp.Abs(x - sp.Rational(6, 5)) ** 3),
    "roots": lambda a, b, c: (
        sp.cosh(a + b + c - 3) + sum(sp.erfc(x) + sp.acosh(2 + x) + sp.cbrt(x) for x in (a, b, c))
    ),
}
STATES = [
    *((1.25 * (1 + g), 1.25, 0.8) for g in (0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.024, 0.1)),
    *((1.1 * (1 + g), 1.1, 1.1 * (1 - g / 2)) for g in (0, 1e-9, 1e-5, 1e-2)),
    *((1 + g, 1 - g / 3, 1.1) for g in (1e-6, 1e-4, 1e-2, 0.05, 0.3)),
    *((1.9, 1.87, 1.0), (1.96, 1.93, 1.1), (1.99, 1.945, 1.2), (1.999, 1.998, 1.9)),
    *((1.21, 1.19, 1.0), (30.0, 0.05, 0.6), (1.5, 1.5e-5, 1e-2), (1e3, 1e-2, 0.9e3)),
]


def slopes_of(energy: Energy) -> Callable[..., Any]:
    """First and second derivatives by the eigenvalues, by SymPy, for mpmath."""
    c = sp.symbols("c1:4", positive=True)
    w = energy(*map(sp.sqrt, c)).rewrite(sp.Piecewise)
    first = [sp.diff(w, x) for x in c]
    second = [[sp.diff(f, x) for x in c] for f in first]
    function: Callable[..., Any] = sp.lambdify(c, [first, second], modules="mpmath")
    return function


def spectral(slopes: Callable[..., Any], C: Any) -> Any:
    """Gradient (6) and second derivatives (6, 6) by the entries of C; None if not real."""
    c, Q = mpmath.eigsy(C)
    try:
        g, h = slopes(*c)
    except (ZeroDivisionError, ValueError, TypeError):
        return None
    if any(isinstance(v, mpmath.mpc) for v in g):
        return None
    E = {
        (a, b): np.array(
            [(Q[i, a] * Q[j, b] + Q[i, b] * Q[j, a]) / (2 if i == j else 1) for i, j in ENTRIES]
        )
        for a in range(3)
        for b in range(a, 3)
    }
    R = sum(g[a] * E[a, a] for a in range(3))
    K = sum(h[a][b] * np.outer(E[a, a], E[b, b]) for a in range(3) for b in range(3))
    for a, b in PAIRS:
        gap = c[a] - c[b]
        close = abs(gap) < mpmath.mpf(10) ** -50 * (c[a] + c[b])
        D = (h[a][a] - 2 * h[a][b] + h[b][b]) / 2 if close else (g[a] - g[b]) / gap
        K = K + 2 * D * np.outer(E[a, b], E[a, b])
    return R, K


def largest(values: Any) -> float:
    return float(max(abs(v) for v in np.ravel(values)))


def allowed(slopes: Callable[..., Any], C: Any, R: Any, K: Any) -> tuple[float, float]:
    """Changes of R and K when C is rounded: each entry of a diagonal C, whose eigenvalues have no
    error, else the rounding of the largest entry in each of them.
    """
    rounding = mpmath.mpf(2) ** -53
    size = max(abs(v) for v in C)
    diagonal = all(C[i, j] == 0 for i, j in PAIRS)
    changes = np.array([largest(R) * 8 * 2.0**-53, largest(K) * 8 * 2.0**-53])
    for i, j in ENTRIES:
        if diagonal and i != j:
            continue
        P = C.copy()
        P[i, j] += rounding * (C[i, j] if diagonal else size)
        P[j, i] = P[i, j]
        moved = spectral(slopes, P)
        if moved is None:
            return np.inf, np.inf
        changes += [largest(moved[0] - R), largest(moved[1] - K)]
    return float(changes[0]), float(changes[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ENERGIES)
def test_stress_and_tangent_are_exact_to_rounding(name: str, tmp_path: Path) -> None:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    u = [m.unknown(n) for n in ("c11", "c22", "c33", "c12", "c13", "c23")]
    where = {p: k for k, p in enumerate(ENTRIES)}
    C = sp.Matrix(3, 3, lambda i, j: u[where[min(i, j), max(i, j)]])
    m.potential(m.principal("W", C, ENERGIES[name]))
    kernel, slopes = compiled(m.finish(), tmp_path, "-O2"), slopes_of(ENERGIES[name])
    Q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    compared = 0
    with mpmath.workdps(100):
        for stretches in STATES:
            for turn in (np.eye(3), Q) if min(stretches) > 0.02 else (np.eye(3),):
                at = turn @ np.diag(np.square(stretches)) @ turn.T
                at = (at + at.T) / 2
                exact = mpmath.matrix(at.tolist())
                right = spectral(slopes, exact)
                if right is None or largest(right[1]) > 1e300:
                    continue
                limits = allowed(slopes, exact, *right)
                given = np.array([[at[i, j] for i, j in ENTRIES]])
                R, K = kernel.tangent(np.zeros((1, 0)), given)
                assert largest(R[0] - right[0]) <= 8 * limits[0], stretches
                assert largest(K[0] - right[1]) <= 8 * limits[1], stretches
                compared += 1
    assert compared > 30
