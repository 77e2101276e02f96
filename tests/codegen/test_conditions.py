"""Conditions on parameters and data: declared on the page, checked at every call."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.runtime.kernels.kernel import ArgumentError, Kernel
from tests.codegen.workshop import compiled


def spring(*conditions: Any) -> Definition:
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness")
    (gap,) = m.data(gap="where it closes")
    m.require(*(c(k, gap, x) for c in conditions))
    m.potential(k * (x - gap) ** 2)
    return m.finish()


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    d = spring(
        lambda k, g, x: k > 0, lambda k, g, x: g <= sp.Rational(1, 2), lambda k, g, x: g >= 0
    )
    return compiled(d, tmp_path_factory.mktemp("spring"), "-O0")


def call(kernel: Kernel, k: float, gap: float) -> float:
    given = {"parameters": [k], "data": np.array([[0.1], [gap]])}
    return float(kernel.residual(np.empty((2, 0)), np.ones((2, 1)), **given)[1, 0])


def test_what_is_allowed_passes(kernel: Kernel) -> None:
    assert call(kernel, 2.0, 0.5) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("k", "gap", "words"),
    [
        (0.0, 0.1, "spring: k = 0, must be > 0"),
        (float("nan"), 0.1, "spring: k = nan, must be > 0"),
        (1.0, 0.75, "spring: gap = 0.75, must be <= 0.5"),
        (1.0, -0.5, "spring: gap = -0.5, must be >= 0"),
    ],
)
def test_what_is_not_is_named_with_the_line(
    kernel: Kernel, k: float, gap: float, words: str
) -> None:
    with pytest.raises(ArgumentError) as error:
        call(kernel, k, gap)
    assert str(error.value).startswith(words)
    assert f"({Path(__file__).name}:" in str(error.value)


@pytest.mark.parametrize(
    "condition", [lambda k, g, x: x > 0, lambda k, g, x: k > g, lambda k, g, x: sp.Ne(k, 0)]
)
def test_other_conditions_are_refused(condition: Any) -> None:
    with pytest.raises(ModelError, match="compare one parameter or datum with a number"):
        spring(condition)
