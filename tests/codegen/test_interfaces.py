"""Automatic interfaces: what is found, what it saves, and that no value changes."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.derive import potential_structure
from softehl.codegen.derive.linear_interfaces import LinearInterface, linear_interface
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.evaluation import State
from softehl.codegen.graph.traversal import strip
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import ALL
from softehl.codegen.verify.graph_oracle import Oracle
from tests.codegen.workshop import compiled, linearised

QUAD = ((1, 1, 1, 1), (-1, 1, 1, -1), (-1, -1, 1, 1), (1, -1, 1, -1))
"""Constant, xi, eta and hourglass mode of a quadrilateral, counterclockwise."""


def interface_of(d: Definition) -> LinearInterface:
    (root,), _ = strip(d.graph, [d.potential], d.constant)
    found = linear_interface(d.graph, [root], d.directions)
    assert found is not None
    return found


def without_interface(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(potential_structure, "linear_interface", lambda g, roots, sources: None)


# ----------------------------------------------------------------------------------- what is found


@pytest.mark.parametrize("name", ["solid_q4", "solid_fbar", "solid_taylor", "solid_taylor_mean"])
def test_modes_of_a_quadrilateral_are_those_of_walsh_and_hadamard(name: str) -> None:
    d = ALL[name]()
    interface = interface_of(d)
    at = {u.id: k for k, u in enumerate(d.directions)}
    found = set()
    for vector in interface.matrix:
        row = [Fraction(0)] * 8
        for source, c in vector:
            row[at[source]] = c
        parts = [tuple(int(c) for c in row[k::2]) for k in (0, 1)]
        assert parts[0] == (0,) * 4 or parts[1] == (0,) * 4, "one displacement in a mode"
        mode, component = (parts[0], 0) if any(parts[0]) else (parts[1], 1)
        found.add((component, max(mode, tuple(-c for c in mode))))
    # a rigid shift along the axis strains nothing, one along the radius does
    shapes = [max(m, tuple(-c for c in m)) for m in QUAD]
    assert found == {(0, m) for m in shapes[1:]} | {(1, m) for m in shapes}


# --------------------------------------------------------------------------------- what it saves

SAVED = {
    "solid_q4": {"residual": (831, 570), "tangent": (3074, 1572)},
}
"""Operations without and with the interface."""


def counts(name: str) -> list[int]:
    d = ALL[name]()
    return [pipeline.compile_task(d, t).plan.operations_once for t in ("residual", "tangent")]


@pytest.mark.parametrize("name", SAVED)
def test_the_interface_saves_operations(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    through = counts(name)
    without_interface(monkeypatch)
    direct = counts(name)
    assert list(zip(direct, through, strict=True)) == list(SAVED[name].values())


# ---------------------------------------------------------------------------- what it leaves alone


def bar() -> Definition:
    """Two nodes in the plane, a stretch energy with a square root, a logarithm and a constant."""
    m = Model("bar", nodes=2, rule=quadrature.gauss(2, 1))
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    (k,) = m.parameters(k="stiffness")
    (xi,) = m.point()
    z, r = (X[c][1] - X[c][0] + u[c][1] - u[c][0] for c in (0, 1))
    radius = sum(X[1][a] + u[1][a] * (1 + (-1) ** (a + 1) * xi) for a in (0, 1)) / 2
    stretch = m.define("stretch", sp.sqrt(z**2 + r**2 + radius**2 / 9))
    a = m.define("a", radius**2 * z)
    m.potential(m.integral("Pi", k * sp.log(stretch) ** 2 * radius + a * stretch), constant=[a])
    return m.finish()


STATE = State(["0.1", "1.2", "0.9", "1.5"], ["0.05", "-0.1", "0.2", "0.07"], (), ["2.5"])


def at_rule(state: State) -> State:
    with mpmath.workdps(90):
        root = 1 / mpmath.sqrt(3)
        return replace(state, rule=((-root, 1), (root, 1)))


def close(a: Any, b: Any) -> bool:
    return bool(np.abs(np.array(a, dtype=object) - np.array(b, dtype=object)).max() < 1e-30)


def test_values_are_those_of_direct_differentiation(monkeypatch: pytest.MonkeyPatch) -> None:
    state = at_rule(STATE)
    R, K = linearised(bar(), state)
    assert potential_structure.found_in(bar())
    assert close(R, Oracle(bar()).residual(state))
    assert close(K, Oracle(bar()).tangent(state))
    without_interface(monkeypatch)
    direct_R, direct_K = linearised(bar(), state)
    assert close(R, direct_R)
    assert close(K, direct_K)
    assert not close(K, np.array(K, dtype=object).T), "the constant makes it unsymmetric"


def test_a_wrong_interface_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A matrix that is off by 1e-9 in one coefficient."""

    def off(g: Any, roots: Any, sources: Any) -> LinearInterface | None:
        found = linear_interface(g, roots, sources)
        assert found is not None
        (source, c), *rest = found.matrix[0]
        first = ((source, c * (1 + Fraction(1, 10**9))), *rest)
        return replace(found, matrix=(first, *found.matrix[1:]))

    monkeypatch.setattr(potential_structure, "linear_interface", off)
    state = at_rule(STATE)
    R, K = linearised(bar(), state)
    assert not close(R, Oracle(bar()).residual(state))
    assert not close(K, Oracle(bar()).tangent(state))


# ------------------------------------------------------------------------------------- branches


def guarded() -> Definition:
    """A logarithm that exists on one side only multiplies an unknown there."""
    m = Model("guarded", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    (k,) = m.parameters(k="positive or not")
    m.potential(sp.Piecewise((x * sp.log(k), k > 0), (x**2, True)) + x * y**2)
    return m.finish()


@pytest.mark.parametrize("k", [0.7, -0.7])
def test_an_interface_takes_nothing_out_of_its_branch(k: float, tmp_path: Path) -> None:
    d = guarded()
    assert not potential_structure.found_in(d)
    kernel = compiled(d, tmp_path)
    u = [0.4, -1.3]
    R, K = kernel.tangent(np.zeros((1, 2)), np.array([u]), parameters=[k])
    state = State((), u, (), [k])
    np.testing.assert_allclose(R[0], np.array(Oracle(d).residual(state), dtype=float), rtol=1e-14)
    np.testing.assert_allclose(K[0], np.array(Oracle(d).tangent(state), dtype=float), atol=1e-14)


def test_branches_without_such_values_keep_their_interface() -> None:
    m = Model("harmless", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    m.potential(sp.Max(x + y, 0) ** 3 + (x - y) ** 4)
    assert potential_structure.found_in(m.finish())
