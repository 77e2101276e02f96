"""Costs of the shipped kernels stay in their budget; live temporaries are counted right."""

from __future__ import annotations

import json
from collections.abc import Sequence

import pytest

from softehl.codegen import pipeline
from softehl.codegen.emit.code_motion import Schedule, schedule
from softehl.codegen.emit.liveness import peak_live
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, output_files
from tests.codegen.budget import LARGEST_FILE, REMEDY, excess, published, shipped
from tests.codegen.workshop import unknowns


def test_no_cost_rose() -> None:
    assert excess(shipped(), published()) == [], REMEDY


def test_the_budget_is_of_the_kernels_that_ship() -> None:
    assert set(published()) == set(shipped()), REMEDY


def test_no_c_file_is_too_large() -> None:
    sizes = {p.name: p.stat().st_size for p in build.GENERATED.glob("*.[ch]")}
    assert {name: size for name, size in sizes.items() if size > LARGEST_FILE} == {}
    assert all(sizes[f"{name}.c"] == shipped()[f"{name} bytes"] for name in ALL)
    assert all(sizes.get(f"{n}_design.c", 0) == shipped()[f"{n} design_bytes"] for n in ALL)


@pytest.mark.parametrize("cost", ["operations", "temporaries", "peak_live"])
def test_one_operation_more_is_seen(cost: str) -> None:
    found = published()
    key = f"solid_q4 tangent {cost}"
    found[key] = published()[key] + 1
    assert excess(found, published()) == [f"{key}: {found[key]}, budget {found[key] - 1}"]
    assert excess({"new tangent operations": 1}, published())[0].endswith("budget missing")


# -------------------------------------------------------------------------------- live temporaries


def intervals(plan: Schedule) -> int:
    """Peak of a straight line by another count: overlaps of [computed, last read)."""
    order = plan.stages[0].before
    at = {n: k for k, n in enumerate(order)}
    last = dict(at)
    for n in order:
        assert isinstance(n, Node)
        last.update({a: at[n] for a in n.args if a in at})
    return max(sum(at[n] <= k < max(last[n], at[n] + 1) for n in at) for k in range(len(order)))


def of(*roots: Node) -> int:
    return peak_live(schedule(roots))


def test_a_product_of_sums_holds_two() -> None:
    g = Graph()
    a, b, c, d = unknowns(g, 4)
    assert of(g.mul(g.add(a, b), g.add(c, d))) == 2
    assert of(g.add(a, b)) == 1
    assert of(a) == 0


def test_a_chain_holds_one_and_a_tree_its_depth() -> None:
    g = Graph()
    x = unknowns(g, 16)
    chain = x[0]
    for y in x[1:]:
        chain = g.mul(g.add(chain, y), y)
    assert of(chain) == 1
    level: Sequence[Node] = x
    while len(level) > 1:
        level = [g.mul(a, b) for a, b in zip(level[::2], level[1::2], strict=True)]
    assert of(level[0]) == 4, "Sethi-Ullman number of a balanced tree with 16 leaves"


def test_outputs_are_stored_at_once() -> None:
    g = Graph()
    x = unknowns(g, 8)
    assert of(*(g.call(Op.EXP, y) for y in x)) == 1


def test_the_two_sides_of_a_branch_are_never_live_together() -> None:
    g = Graph()
    x, y, z, w = unknowns(g, 4)
    condition = g.compare(Op.LT, x, y)
    side = g.mul(g.add(x, y), g.add(z, w))
    other = g.mul(g.sub(x, y), g.sub(z, w))
    # two inside either side; the condition is read before
    assert of(g.branch(condition, side, other)) == 2
    # exp is needed before and after: it waits through both sides
    waiting = g.call(Op.EXP, x)
    chosen = g.branch(g.compare(Op.LT, waiting, y), side, other)
    assert of(g.mul(chosen, waiting)) == 3


def test_sums_and_what_every_turn_reads_live_through_a_loop() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    xi = g.input("rule", 0, varying=True)
    fixed = [g.call(Op.EXP, x), g.call(Op.EXP, y)]
    body = [g.mul(f, xi) for f in fixed]
    # two fixed values, two sums, and the bodies: both are added at the end of a turn
    assert of(*(g.sum(b) for b in body)) == 6


@pytest.mark.parametrize("name", ["axial_spring", "solid_q4"])
def test_the_manifest_counts_as_intervals_do(name: str) -> None:
    kernel = pipeline.compile_model(ALL[name]())
    manifest = json.loads(output_files.files([kernel])["manifest.json"])["kernels"][name]["tasks"]
    for task in ("energy", "residual", "tangent"):
        plan = kernel.functions[task].plan
        assert manifest[task]["peak_live"] == peak_live(plan) == intervals(plan) > 8
