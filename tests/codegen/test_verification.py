"""The check of `softehl generate`: what it must see, what it must not mind, what it must say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import pytest
import sympy as sp

import softehl
from softehl.codegen import pipeline
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import reachable, rewrite
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.optimise import passes
from softehl.codegen.tools import kernel_cache, output_files
from softehl.codegen.tools.build import LIBRARY
from softehl.codegen.verify import verification

# --- The check of `softehl generate`: what it must see, what it must not mind, what it must say ---


Rule = Callable[[Graph, Node, tuple[Node, ...]], Node]
TASKS = ("energy", "residual", "tangent")


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that are wrong on purpose go nowhere else."""
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def check(
    d: Definition, tasks: tuple[str, ...] = TASKS, seconds: float = 10
) -> verification.Report:
    """The check of kernels that are derived now, past the memory of earlier ones."""
    folder, _ = kernel_cache.compiled(output_files.files([pipeline.compile_model(d)]))
    return verification.check(d, tasks, folder / LIBRARY, seconds=seconds)


def seen(report: verification.Report) -> bool:
    return any(e > verification.BOUND for e in report.errors.values())


def one(energy: Callable[..., Any], *, unroll: bool = True) -> Definition:
    """A page of one unknown u and one parameter k with a point."""
    m = Model("one", nodes=1, rule=quadrature.gauss(2, 1), unroll=unroll, doc="One unknown.")
    u = m.unknown("u")
    (k,) = m.parameters(k="stiffness")
    (xi,) = m.point()
    m.potential(m.integral("Pi", energy(u, k) * (2 + xi * u)))
    return m.finish()


# ---------------------------------------------------------------------------------- wrong passes


def saturated(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
    """tanh(50 (u + 2)) is 1 to 80 digits near u = 0."""
    return g.one if n.op is Op.TANH else g.rebuild(n.op, args, n.payload)


def one_side(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
    """The side of a branch that small unknowns take."""
    return args[2] if n.op is Op.BRANCH else g.rebuild(n.op, args, n.payload)


def folded(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
    """asin(sin(a)) is a only up to pi / 2."""
    same = n.op is Op.ASIN and args[0].op is Op.SIN
    return args[0].args[0] if same else g.rebuild(n.op, args, n.payload)


def energy(u: Any, k: Any) -> Any:
    side = sp.Piecewise((u**4, u > 300), (u**2, True))
    return k * u**2 * (1 + sp.tanh(50 * (u + 2))) + side + u * sp.asin(sp.sin(u + k / 9))


LOOPED = [p.name for p in passes.STANDARD]
STRAIGHT = [p.name for p in passes.straight_line([[]])]


@pytest.mark.parametrize(
    ("unroll", "place", "rule"),
    [
        (unroll, place, (saturated, one_side, folded)[place % 3])
        for unroll, names in ((False, LOOPED), (True, STRAIGHT))
        for place in range(len(names))
    ],
)
def test_a_wrong_pass_is_seen(
    unroll: bool, place: int, rule: Rule, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Right near the ordinary state to all digits, wrong far from it."""

    def wrong(before: tuple[passes.Pass, ...]) -> tuple[passes.Pass, ...]:
        p = before[place]
        both = passes.Pass(p.name, lambda g, roots: rewrite(g, p.apply(g, roots), rule))
        return (*before[:place], both, *before[place + 1 :])

    straight = passes.straight_line
    monkeypatch.setattr(passes, "merge_equal_values", lambda _, roots: roots)
    if unroll:
        monkeypatch.setattr(passes, "straight_line", lambda *a: wrong(straight(*a)))
    else:
        monkeypatch.setattr(passes, "STANDARD", wrong(passes.STANDARD))
    assert seen(check(one(energy, unroll=unroll)))


def bar() -> Definition:
    m = Model("bar", nodes=2, rule=quadrature.gauss(2, 1), doc="Conduction.")
    (X,) = m.coordinates("X")
    (T,) = m.nodal_unknowns("T")
    (xi,) = m.point()
    L = X[1] - X[0]
    T_q = m.define("T_q", (1 - xi) / 2 * T[0] + (1 + xi) / 2 * T[1])
    k = m.define("k", 1 + 9 / (1 + sp.exp(-(T_q - 1000) / 10)))
    T_x = m.define("T_x", (T[1] - T[0]) / L)
    m.weak_form([(k * T_x * L / 2, T_x)])
    return m.finish()


def test_a_conductivity_that_is_constant_near_the_ordinary_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A pass that merges 9 / (1 + exp(100)) with 0 makes another function."""

    def merged(g: Graph, roots: list[Node]) -> list[Node]:
        def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
            small = n.op is Op.RECIP and any(a.op is Op.EXP for a in reachable(args))
            return g.zero if small else g.rebuild(n.op, args, n.payload)

        return rewrite(g, roots, rule)

    monkeypatch.setattr(passes, "merge_equal_values", merged)
    assert seen(check(bar(), TASKS[1:]))
    monkeypatch.setattr(passes, "merge_equal_values", lambda _, roots: roots)
    report = check(bar(), TASKS[1:])
    assert not seen(report)
    assert not report.tasks


# ------------------------------------------------------------------------------------ right pages


@pytest.mark.parametrize(
    "value",
    [
        lambda u, k: (1 - sp.cos(u)) / u**2 * k,  # cancels six digits and more at 1e-3
        lambda u, k: k * sp.sqrt(u**2 - 10 * u + 25),
        lambda u, k: k * sp.exp(sp.cosh(u)) / (1 + sp.exp(sp.cosh(u))),  # overflows far away
        lambda u, k: k * sp.atan2(sp.sin(u), sp.cos(u)) * u,
        lambda u, k: sp.Piecewise((sp.log(u), u > k), (u - k, True)) * sp.erf(u),
        lambda u, k: sp.Piecewise((sp.sqrt(sp.log(u)), u > 2), (k * u, True)),
        lambda u, k: sp.Max(sp.Abs(u - 40), k) ** sp.Rational(3, 2) + sp.sign(u + 9),
    ],
)
def test_a_right_page_passes(value: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passes, "merge_equal_values", lambda _, roots: roots)
    report = check(one(value))
    assert not seen(report)
    assert not report.tasks
    assert report.compared - report.unclear >= 10


# ----------------------------------------------------------------------------------- what is said


def test_both_sides_of_a_condition_are_reached_and_what_is_not_is_said() -> None:
    report = check(one(lambda u, k: sp.Piecewise((u**2, u + k > 800), (k * u**2, True))))
    assert report.missing == []
    report = check(one(lambda u, k: sp.Piecewise((u**4, sp.sin(u) > 2), (k * u**2, True))))
    assert any("true" in text or "false" in text for text in report.missing)
    report = check(one(lambda u, k: sp.log(k + u) * u))
    assert report.unreal > 0
    assert f"{report.unreal} without a real value" in report.summary(10)


def test_the_check_ends_in_time_and_says_so() -> None:
    d = one(energy)
    folder = kernel_cache.library([d]).folder
    start = process_time()
    report = verification.check(d, TASKS, folder / LIBRARY, seconds=0.03)
    assert process_time() - start < 1
    assert report.late
    assert "--check-seconds gives more" in report.summary(0.03)


AT = """
import sympy as sp
from softehl import Definition, Model, quadrature

def at() -> Definition:
    m = Model("at", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    m.potential(sp.atan2(sp.acosh(x), sp.sqrt(2 * x)))
    return m.finish()
"""


def test_an_error_of_mpmath_is_no_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("at.py")
    path.write_text(AT)
    assert softehl.main(["generate", "at.py", "--check-seconds", "5"]) == 2
    assert "at cannot be checked" in capsys.readouterr().err
    path.write_text(AT.replace("    return", "    m.example(x=3)\n    return"))
    assert softehl.main(["generate", "at.py", "--check-seconds", "5"]) == 0
    assert "at: compared with its page at" in capsys.readouterr().out
    assert softehl.main(["generate", "at.py", "--check-seconds", "0"]) == 2
