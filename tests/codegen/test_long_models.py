"""Long pages: thousands of names, long sums and deep expressions need no deep stack."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.graph.graph import Graph
from softehl.codegen.graph.traversal import Recursion, recursion
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.language.sympy_lowering import Lowering
from softehl.codegen.verify.graph_oracle import Oracle
from tests.codegen.workshop import compiled

STATE = EvaluationState((), (0.7, -0.4))


def chain(names: int, *tasks: str) -> Definition:
    """Each name is made of the one before: a_k+1 = a_k + (y - a_k^2 / (k + 3)) / names."""
    m = Model("chain", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    a = x
    for k in range(names):
        a = m.define(f"a{k}", a + (y - a**2 / (k + 3)) / names)
    m.potential(a * x)
    m.offer(tasks=tasks)
    return m.finish()


def addition(terms: int, *tasks: str) -> Definition:
    m = Model("addition", nodes=1, rule=quadrature.point_rule())
    x, y = m.unknown("x"), m.unknown("y")
    m.potential(sp.Add(*[sp.exp(x / (k + 1)) * y / (k + 1) for k in range(terms)]))
    m.offer(tasks=tasks)
    return m.finish()


def test_recursion_is_that_of_python_but_deeper() -> None:
    def total(n: int) -> Recursion[int]:
        return n + (yield total(n - 1)) if n else 0

    assert recursion(total(10)) == 55
    assert recursion(total(100_000)) == 100_000 * 100_001 // 2


@pytest.mark.parametrize("make", [chain, addition])
def test_values_of_a_long_page_are_those_of_the_oracle(
    make: Callable[..., Definition], tmp_path: Path
) -> None:
    d = make(60, "residual", "tangent")
    kernel = compiled(d, tmp_path)
    R, K = kernel.tangent(np.zeros((1, 2)), np.array([STATE.dofs]))
    oracle = Oracle(d)
    np.testing.assert_allclose(R[0], np.array(oracle.residual(STATE), dtype=float), rtol=1e-12)
    tangent = np.array(oracle.tangent(STATE), dtype=float)
    np.testing.assert_allclose(K[0], tangent, rtol=1e-12, atol=1e-20)


@pytest.mark.slow
def test_ten_thousand_names() -> None:
    functions = pipeline.compile_model(chain(10_000, "residual")).functions
    assert functions["residual"].best.operations > 10_000


def test_where_sympy_gives_up_the_page_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    g = Graph()
    x = sp.Symbol("x", real=True)

    def deep(expression: object) -> object:
        raise RecursionError

    monkeypatch.setattr(sp, "sympify", deep)
    with pytest.raises(ModelError, match=r"test_long_models.py:\d+: .* too deeply .*m\.define"):
        Lowering(g, {})(x)
