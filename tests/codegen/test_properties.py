"""Properties of random models: C, derivatives, passes and schedules against 50 digits.

hypothesis draws the models (always the same ones); all of one target are compiled into one library.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, Phase, given, settings

from softehl.codegen import pipeline
from softehl.codegen.abi import Target, Task
from softehl.codegen.derive import task_outputs
from softehl.codegen.emit.code_motion import If, Same, Schedule, Statement, schedule
from softehl.codegen.emit.instruction_scheduling import order_plan
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.graph.graph import Graph, InputEntry, Node, Op
from softehl.codegen.graph.precise_arithmetic import number
from softehl.codegen.graph.traversal import rewrite
from softehl.codegen.graph.verifier import check
from softehl.codegen.language.definition import Definition
from softehl.codegen.optimise import passes
from softehl.codegen.tools import build, output_files
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.random_models import (
    DIGITS,
    UNKNOWNS,
    Digits,
    K,
    Meaning,
    OutsideError,
    Recipe,
    recipes,
)
from tests.codegen.workshop import at_points, value

MODELS = 30
LIMIT = 1e-12
"""Error of C, relative to the first-order rounding bound of the expression as it was written."""
STATES = ((0.7, -0.4, 1.3, 0.9), (-1.1, 0.6, 0.35, -0.8))


@cache
def population() -> dict[str, Recipe]:
    """Different recipes by the name of their model."""
    found: dict[str, Recipe] = {}

    @settings(
        derandomize=True,
        max_examples=MODELS,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(recipes())
    def collect(recipe: Recipe) -> None:
        if recipe not in found.values():
            found[f"random_{len(found)}"] = recipe

    collect()
    return found


@cache
def library(target: Target) -> dict[str, Kernel]:
    """Every random model compiled for a target, in one shared library."""
    directory = Path(tempfile.mkdtemp(prefix="random_models_"))
    models = [r.definition(name) for name, r in population().items()]
    texts = output_files.files([pipeline.compile_model(d, target) for d in models])
    for name, text in texts.items():
        (directory / name).write_text(text, encoding="utf-8")
    build.build(directory, extra=(*build.STRICT, "-O0"))
    return {d.name: load_kernel(d.name, directory) for d in models}


def expected(recipe: Recipe, state: Sequence[float]) -> dict[str, Any]:
    """Potential, residual and tangent as (value, rounding bound); raises `OutsideError`."""
    meaning = Meaning(recipe)
    digits = Digits(meaning, dict(zip((*UNKNOWNS, K), state, strict=True)))
    three = range(len(UNKNOWNS))
    return {
        "energy": [digits(meaning.potential)],
        "residual": [digits(meaning.residual(i)) for i in three],
        "tangent": [digits(meaning.tangent(i, j)) for i in three for j in three],
    }


@cache
def exact(name: str) -> tuple[dict[str, Any], ...]:
    """What the model says at every state where it says something; () for none."""
    out = []
    for state in STATES:
        try:
            out.append({"state": state, **expected(population()[name], state)})
        except OutsideError:
            continue
    return tuple(out)


def worst(found: Any, pairs: Sequence[Any]) -> float:
    """Largest error in units of the rounding bound; not-a-number counts as infinite."""
    errors = [
        abs(mpmath.mpf(float(f)) - v) / (b + abs(v) + mpmath.mpf("1e-30"))
        for f, (v, b) in zip(np.ravel(found), pairs, strict=True)
    ]
    return max(float(e) if mpmath.isfinite(e) else np.inf for e in errors)


def error(kernel: Kernel, at: Mapping[str, Any]) -> float:
    """Largest error of all tasks on a batch of five equal elements (one is left over)."""
    *dofs, k = at["state"]
    X, u, given_k = np.zeros((5, kernel.nodes * 2)), np.tile(dofs, (5, 1)), {"parameters": [k]}
    R, tangent = kernel.tangent(X, u, **given_k)
    found = [("residual", R), ("residual", kernel.residual(X, u, **given_k)), ("tangent", tangent)]
    if "energy" in kernel.tasks:
        found.append(("energy", kernel.energy(X, u, **given_k)))
    return max(worst(row, at[task]) for task, rows in found for row in rows)


# ---------------------------------------------------------------------------- values of the C code


@pytest.mark.parametrize("target", [Target.SIMD, Target.SCALAR])
def test_c_is_the_model_as_it_was_written(target: Target) -> None:
    kernels = library(target)
    errors = {name: error(kernels[name], at) for name in population() for at in exact(name)}
    assert {name: e for name, e in errors.items() if not e <= LIMIT} == {}
    assert len(errors) > 0.6 * MODELS


def test_the_population_is_what_it_claims_to_be() -> None:
    recipes_ = list(population().values())
    assert len(recipes_) > 0.6 * MODELS
    assert {r.exception for r in recipes_} == {"", "constant", "constant inside", "given"}
    assert {r.unroll for r in recipes_} == {True, False}
    parts = [e for r in recipes_ for e in (r.integrand, r.potential, *(n[1] for n in r.named))]
    for kind in (sp.Piecewise, sp.log, sp.exp, sp.Abs):
        assert any(e.has(kind) for e in parts), kind
    powers = {p.exp for e in parts for p in e.atoms(sp.Pow)}
    assert {sp.Rational(1, 3), sp.Rational(1, 2), sp.Integer(-1)} < powers
    texts = [pipeline.compile_model(r.definition("one")).text for r in recipes_[:6]]
    assert any("if (" in t for t in texts)


def test_a_wrong_derivative_is_refused() -> None:
    """A residual that differs by 2e-9 x; derivatives that ignore the exception of the model."""
    kernels = library(Target.SCALAR)
    name = next(n for n, r in population().items() if not r.exception and exact(n))
    good = exact(name)[0]
    assert error(kernels[name], good) <= LIMIT
    r = population()[name]
    tiny = sp.Rational(1, 10**9) * UNKNOWNS[0] ** 2
    wrong = Recipe(**{**vars(r), "potential": r.potential + tiny})
    assert error(kernels[name], {"state": good["state"], **expected(wrong, good["state"])}) > LIMIT
    for exception in ("constant", "constant inside", "given"):
        name = next(n for n, r in population().items() if r.exception == exception and exact(n))
        at = exact(name)[0]
        plain = Recipe(**{**vars(population()[name]), "exception": ""})
        assert error(kernels[name], at) <= LIMIT
        ignored = {"state": at["state"], **expected(plain, at["state"])}
        assert error(kernels[name], ignored) > LIMIT, exception


def test_the_meaning_is_its_own_difference_quotient() -> None:
    """SymPy's derivatives of the models against differences of 50-digit potentials."""
    h = mpmath.mpf(10) ** -15
    checked = 0
    for name, r in population().items():
        if r.exception or not exact(name):
            continue
        state, meaning = exact(name)[0]["state"], Meaning(r)
        with mpmath.workdps(DIGITS):
            for i in range(3):
                moved = [[v + s * h * (i == j) for j, v in enumerate(state)] for s in (1, -1)]
                plus, minus = (
                    Digits(meaning, dict(zip((*UNKNOWNS, K), m, strict=True)))(r.potential)[0]
                    for m in moved
                )
                slope, bound = exact(name)[0]["residual"][i]
                assert abs((plus - minus) / (2 * h) - slope) <= 1e-20 * (1 + bound)
        checked += 1
    assert checked > 5


# --------------------------------------------------------------------------- graphs: passes, order


def cases() -> Iterator[tuple[str, Definition, EvaluationState]]:
    """A third of the models, each at a state where it has a value."""
    for name in [n for n in population() if exact(n)][::3]:
        *dofs, k = exact(name)[0]["state"]
        with mpmath.workdps(90):
            third = 1 / mpmath.sqrt(3)
            rule = ((-third, 1), (third, 1))
        yield name, population()[name].definition(name), EvaluationState((), dofs, (), [k], rule)


def values(d: Definition, roots: Sequence[Node], state: EvaluationState) -> list[list[Any]]:
    return [at_points(d, r, state) if r.varying else [value(d, r, state)] for r in roots]


def same(a: list[list[Any]], b: list[list[Any]]) -> bool:
    with mpmath.workdps(DIGITS):
        return all(
            abs(x - y) <= mpmath.mpf(10) ** -30 * (1 + abs(y))
            for p, q in zip(a, b, strict=True)
            for x, y in zip(p * (len(q) // len(p)), q, strict=True)
        )


def test_every_pass_keeps_every_value() -> None:
    """Also in an order of its own: each pass on what all before it left.

    `literals` rounds to doubles on purpose; the C code above is what it is held to.
    """
    for name, d, state in cases():
        points = [[rounded(x) for x in row] for row in state.rule]
        for chosen in (passes.STANDARD, passes.straight_line(points)):
            roots = [x.node for x in task_outputs.outputs(d, Task.TANGENT)]
            check(roots)
            before = values(d, roots, state)
            for p in chosen:
                roots = p.apply(d.graph, roots)
                check(roots, names=p.name == "tensor functions")
                if p.name != "literals":
                    assert same(values(d, roots, state), before), f"{name}: {p.name}"


def rounded(x: Any) -> Any:
    """A coordinate of the rule as the compiler takes it: to 60 digits."""
    with mpmath.workdps(90):
        return Fraction(int(mpmath.mpf(x) * mpmath.mpf(10) ** 60), 10**60)


def test_a_wrong_pass_is_refused() -> None:
    """Branches swapped in one model; a factor lost in all."""
    refused = 0
    for _, d, state in cases():
        roots = [x.node for x in task_outputs.outputs(d, Task.TANGENT)]

        def wrong(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
            if n.op is Op.MUL and args[0].op is Op.CONST:
                return args[1]
            return g.rebuild(n.op, args, n.payload)

        lost = rewrite(d.graph, roots, wrong)
        refused += not same(values(d, lost, state), values(d, roots, state))
    assert refused > 3


class _Machine:
    """Executes a plan statement by statement; reading what is not stored yet is a KeyError."""

    def __init__(self, state: EvaluationState) -> None:
        self.state = state
        self.store: dict[Node, Any] = {}
        self.point: Sequence[Any] = ()

    def read(self, n: Node) -> Any:
        if n.op is Op.CONST:
            return mpmath.mpf(n.value.numerator) / n.value.denominator
        if n.op is Op.PI:
            return +mpmath.pi
        if isinstance(n.payload, InputEntry):
            array: Any = {"dofs": self.state.dofs, "parameters": self.state.parameters}
            source = self.point if n.payload.array == "rule" else array[n.payload.array]
            return mpmath.mpf(source[n.payload.index])
        return self.store[n]

    def block(self, statements: Sequence[Statement]) -> None:
        for s in statements:
            if isinstance(s, If):
                side = 1 if self.read(s.condition) else 2
                self.block(s.then if side == 1 else s.otherwise)
                self.store.update({n: self.read(n.args[side]) for n in s.merged})
            elif isinstance(s, Same):
                self.store[s.old] = self.read(s.new)
            else:
                assert s.op is not Op.BRANCH
                self.store[s] = number(s, [self.read(a) for a in s.args])

    def run(self, plan: Schedule) -> None:
        for stage in plan.stages:
            self.block(stage.preamble)
            if stage.loop is None:
                continue
            self.store.update(dict.fromkeys(stage.loop.sums, mpmath.mpf(0)))
            for point in self.state.rule:
                self.point = point
                kept = dict(self.store)
                self.block(stage.loop.body)
                sums = {s: kept[s] + self.read(s.args[0]) for s in stage.loop.sums}
                self.store = {**kept, **sums}  # nothing of a turn is left for the next


def executed(plan: Schedule, roots: Sequence[Node], state: EvaluationState) -> list[list[Any]]:
    with mpmath.workdps(DIGITS):
        machine = _Machine(state)
        machine.run(plan)
        return [[machine.read(r)] for r in roots]


def test_a_schedule_stores_before_it_loads() -> None:
    for name, d, state in cases():
        for task in (Task.RESIDUAL, Task.TANGENT):
            roots = [x.node for x in task_outputs.outputs(d, task)]
            roots, _ = passes.run(d.graph, roots, passes.STANDARD)
            plan, exact = schedule(roots), values(d, roots, state)
            assert same(executed(plan, roots, state), exact), name
            ordered = order_plan(d.graph, plan, roots)
            assert same(executed(ordered, roots, state), exact), f"{name}, arranged"


def test_a_wrong_order_is_refused() -> None:
    """Two statements of a straight line exchanged: the machine reads what is not there."""
    g = Graph()
    x = g.input("dofs", 0)
    root = g.mul(g.call(Op.EXP, g.call(Op.SIN, x)), x)
    plan = schedule([root])
    state = EvaluationState((), ["0.3"])
    assert executed(plan, [root], state)
    first, second, *_ = plan.stages[0].preamble
    plan.stages[0].preamble[:2] = [second, first]
    with pytest.raises(KeyError):
        executed(plan, [root], state)
