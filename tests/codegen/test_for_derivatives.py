"""Kernels of derivatives follow history too: against differences of the page's own kernel."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl import element, load_kernel, page
from softehl.runtime.arrays import Array


@page
def ageing(m: Any) -> None:
    """Rubber whose stiffness and memory depend on two point data, the second kept."""
    u = m.vector("u")
    G, K = m.parameters(G="shear", K="bulk")
    a, b = m.point_data(a="memory", b="given")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = m.define("I1", (F.T * F).trace())
    m.minimise(G / 2 * (1 + a**2) * (I1 - 3 - 2 * sp.log(J)) + K / 2 * (1 + a * b) * (J - 1) ** 2)
    m.fields(J=J)
    m.history(a=I1 / 3 * (1 - a) + b**2)


@pytest.mark.parametrize("cell", ["quad4", "hex8"])  # written out, and loops around a point
def test_residual_and_history_along_a_variation(cell: str) -> None:
    kernel, moving = (
        load_kernel(ageing, cell=cell),
        load_kernel(ageing, cell=cell, derivatives=True),
    )
    assert moving.tasks == ("pseudo_load", "fields_rate")
    assert moving.point_data == ("a", "b", "rate_a", "rate_b")
    generator = np.random.default_rng(0)
    nodes = np.array(element(cell).nodes, dtype=np.float64).ravel()
    X = nodes + 0.05 * generator.standard_normal((3, len(nodes)))
    u = 0.05 * generator.standard_normal(X.shape)
    h = 0.1 * generator.standard_normal((3, len(kernel.default_rule.weights), 2))
    p, step = np.array([1.2, 3.0]), 1e-3
    dX, du, dh = (generator.standard_normal(v.shape) for v in (X, u, h))
    dp = generator.standard_normal(2)
    rows = np.hstack([dX, np.tile(dp, (3, 1))])
    given: Any = {"parameters": p, "point_data": np.concatenate([h, dh], axis=2)}

    def residual(s: float) -> Array:
        moved: Any = {"parameters": p + s * dp, "point_data": h + s * dh}
        return kernel.residual(X + s * dX, u, **moved)

    def fields(s: float) -> Array:
        moved: Any = {"parameters": p + s * dp, "point_data": h + s * dh}
        return kernel.fields_at(X + s * dX, u + s * du, **moved)

    load = moving.pseudo_load(X, u, rows, **given)
    rates = moving.fields_rate(X, u, np.hstack([rows, du]), **given)
    for found, value in ((load, residual), (rates, fields)):
        rises = [value(k * step) - value(-k * step) for k in (1, 2, 3)]
        expected = (45 * rises[0] - 9 * rises[1] + rises[2]) / (60 * step)
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    still = {**given, "point_data": np.concatenate([h, 0 * dh], axis=2)}
    assert not np.allclose(moving.pseudo_load(X, u, rows, **still), load, rtol=1e-3)


def lagrangian(points: Any, arguments: Any, adjoint: Any, adjoint_of_history: Any) -> Any:
    """L of `ageing` on a triangle: adjoint . residual + adjoint of history . history."""
    X, p, u, h = arguments[:6], arguments[6:8], arguments[8:14], arguments[14:]

    def slopes(values: Any) -> Any:
        a = [[X[2 * k + i] - X[i] for k in (1, 2)] for i in (0, 1)]
        b = [[values[2 * k + i] - values[i] for k in (1, 2)] for i in (0, 1)]
        A, B = mpmath.matrix(a), mpmath.matrix(b)
        return B * A**-1, mpmath.det(A)

    def energy(s: Any) -> Any:
        F, area = slopes([x + v + s * w for x, v, w in zip(X, u, adjoint, strict=True)])
        J, I1 = mpmath.det(F), sum(f**2 for f in F) + 1
        total = 0
        for q, weight in enumerate(points):
            a, b = h[2 * q : 2 * q + 2]
            total += weight * p[0] / 2 * (1 + a**2) * (I1 - 3 - 2 * mpmath.log(J))
            total += weight * p[1] / 2 * (1 + a * b) * (J - 1) ** 2
        return area * total

    F, _ = slopes([x + v for x, v in zip(X, u, strict=True)])
    I1 = sum(f**2 for f in F) + 1
    history = 0
    for q in range(len(points)):
        a, b = h[2 * q : 2 * q + 2]
        history += adjoint_of_history[2 * q] * (I1 / 3 * (1 - a) + b**2)
    step = mpmath.mpf(10) ** -18
    return (energy(step) - energy(-step)) / (2 * step) + history


def test_second_derivatives_are_those_of_a_triangle_in_70_digits() -> None:
    """Mixed differences of the energy, written down once more: rates of the gradient of L."""
    kernel, generator = load_kernel(ageing, cell="tri3", derivatives=2), np.random.default_rng(1)
    assert kernel.tasks == ("adjoint_rate", "point_adjoint_rate")
    weights = kernel.default_rule.weights
    count = 2 * len(weights)
    triangle = np.array([0.0, 0.0, 1.0, 0.1, 0.2, 0.9])
    base = np.concatenate(
        [triangle, [1.2, 3.0], 0.1 * generator.standard_normal(6), generator.uniform(0, 1, count)]
    )
    along = generator.standard_normal(len(base))
    left, left_rate = generator.standard_normal((2, 6))
    mu, mu_rate = generator.standard_normal((2, count))
    with mpmath.workdps(70):
        step = mpmath.mpf(10) ** -18

        def rate(e: Any, k: int) -> Any:
            ends = []
            for s in (step, -step):
                moved = [
                    mpmath.mpf(v) + s * mpmath.mpf(w) for v, w in zip(base, along, strict=True)
                ]
                moved[k] += e
                adjoints = [
                    [mpmath.mpf(v) + s * mpmath.mpf(w) for v, w in zip(*pair, strict=True)]
                    for pair in ((left, left_rate), (mu, mu_rate))
                ]
                ends.append(lagrangian([mpmath.mpf(w) for w in weights], moved, *adjoints))
            return (ends[0] - ends[1]) / (2 * step)

        expected = np.array(
            [float((rate(step, k) - rate(-step, k)) / (2 * step)) for k in range(len(base))]
        )
    of_points = [v.reshape(1, -1, 2) for v in (base[14:], along[14:], mu, mu_rate)]
    given: Any = {"parameters": base[6:8], "point_data": np.concatenate(of_points, axis=2)}
    direction = np.concatenate([along[:14], left, left_rate])[None]
    call: Any = (base[None, :6], base[None, 8:14], direction)
    found = np.concatenate(
        [kernel.adjoint_rate(*call, **given)[0], kernel.point_adjoint_rate(*call, **given).ravel()]
    )
    size = np.abs(expected).max()
    assert np.abs(found - expected).max() < 1e-13 * size
    still: Any = (*call[:2], np.concatenate([along[:14], left, 0 * left_rate])[None])
    assert np.abs(kernel.adjoint_rate(*still, **given)[0] - expected[:14]).max() > 1e-3 * size
