"""Costs of the shipped kernels stay in their budget; live temporaries are counted right."""

from __future__ import annotations

import json

import pytest

from softehl.codegen import pipeline
from softehl.codegen.emit.code_motion import Schedule, schedule
from softehl.codegen.emit.liveness import peak_live
from softehl.codegen.graph.graph import Node
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, output_files
from tests.codegen.budget import LARGEST_FILE, REMEDY, excess, published, shipped


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
    order = plan.stages[0].preamble
    at = {n: k for k, n in enumerate(order)}
    last = dict(at)
    for n in order:
        assert isinstance(n, Node)
        last.update({a: at[n] for a in n.args if a in at})
    return max(sum(at[n] <= k < max(last[n], at[n] + 1) for n in at) for k in range(len(order)))


def of(*roots: Node) -> int:
    return peak_live(schedule(roots))


@pytest.mark.parametrize("name", ["axial_spring", "solid_q4"])
def test_the_manifest_counts_as_intervals_do(name: str) -> None:
    kernel = pipeline.compile_model(ALL[name]())
    manifest = json.loads(output_files.files([kernel])["manifest.json"])["kernels"][name]["tasks"]
    for task in ("energy", "residual", "tangent"):
        plan = kernel.functions[task].plan
        assert manifest[task]["peak_live"] == peak_live(plan) == intervals(plan) > 8
