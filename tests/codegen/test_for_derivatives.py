"""Kernels of derivatives follow history too: against differences of the page's own kernel."""

from __future__ import annotations

from typing import Any

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
