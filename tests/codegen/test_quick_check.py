"""Kernels that contradict themselves are refused when they are first loaded."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

import softehl
from softehl.codegen.abi import Task
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.graph import Graph, Node
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.optimise import passes
from softehl.codegen.verify import quick_check
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.kernels.shared_library import library_of

Last = Callable[[Graph, Node], Node]


def spring(name: str, tasks: list[str]) -> Definition:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    u, v = m.unknown("u"), m.unknown("v")
    (k,) = m.parameters(k="stiffness")
    m.potential(k * sp.exp(u) * sp.cos(v) + u**2 * v**2 / 2)
    m.offer(tasks=tasks)
    return m.finish()


@pytest.fixture
def fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Last], None]:
    """Change the last value of every task after the passes."""
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    right = passes.run

    def install(last: Last) -> None:
        def run(g: Graph, roots: list[Node], rewrites: Any) -> Any:
            new, trace = right(g, roots, rewrites)
            return [*new[:-1], last(g, new[-1])], trace

        monkeypatch.setattr(passes, "run", run)

    return install


@pytest.mark.parametrize(
    ("tasks", "words"),
    [
        ([Task.ENERGY, Task.RESIDUAL], "its residual contradicts differences"),
        ([Task.RESIDUAL, Task.TANGENT], "its tangent contradicts differences"),
    ],
)
def test_a_wrong_derivative_is_refused_and_not_remembered(
    fault: Callable[[Last], None], tasks: list[str], words: str
) -> None:
    # the last entry of a residual, of a tangent and of the residual that stands before it
    fault(lambda g, n: g.mul(g.const(2), n))
    for _ in range(2):
        with pytest.raises(quick_check.WrongKernelError, match=f"spring: {words}"):
            softehl.load_kernel(spring("spring", tasks))


def test_a_value_that_is_not_a_number_is_refused(fault: Callable[[Last], None]) -> None:
    fault(lambda g, n: g.power(g.sub(g.neg(g.one), g.mul(n, n)), sp.Rational(1, 2)))
    with pytest.raises(
        quick_check.WrongKernelError, match="spring: residual is not a number where"
    ):
        softehl.load_kernel(spring("spring", [Task.RESIDUAL]))


def test_a_checked_kernel_is_not_checked_again(
    fault: Callable[[Last], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    right = quick_check.check

    def check(d: Definition, *given: Any) -> None:
        calls.append(d.name)
        right(d, *given)

    monkeypatch.setattr(quick_check, "check", check)
    for name in ("once", "once", "other"):
        softehl.load_kernel(spring(name, [Task.RESIDUAL]))
    assert calls == ["once", "other"]


def test_rounding_and_kinks_are_no_contradiction(fault: Callable[[Last], None]) -> None:
    m = Model("kinks", nodes=1, rule=quadrature.point_rule())
    u = [m.unknown(f"u{k}") for k in range(6)]
    big = 10**9
    steps = [
        sp.Max(v, 0) + sp.Abs(v - w) + sp.Piecewise((v**2, v > w), (w, True))
        for v, w in pairwise(u)
    ]
    m.weak_form([(big * (1 + s) - big * (1 + v), w) for s, v, w in zip(steps, u, u, strict=False)])
    m.weak_form([(u[-1], u[-1])])
    softehl.load_kernel(m.finish())


@pytest.mark.slow
def test_shipped_kernels_pass() -> None:
    from softehl.codegen.models import ALL

    library = library_of().path
    for name, make in ALL.items():
        kernel = load_kernel(name)
        quick_check.check(make(), list(kernel.tasks), library)
