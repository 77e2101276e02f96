"""Printed C: what is used once has no name, and short statements share lines."""

from __future__ import annotations

import re

from softehl.codegen import pipeline
from softehl.codegen.abi import Task
from softehl.codegen.emit.c_printer import WIDTH, filled, used_once
from softehl.codegen.emit.code_motion import schedule
from softehl.codegen.graph.graph import Graph, Op
from softehl.codegen.models import ALL


def test_a_value_without_a_name_is_used_once_in_the_block_that_computes_it() -> None:
    g = Graph()
    x, y = (g.input("dofs", k) for k in range(2))
    once, twice = g.add(x, y), g.mul(x, y)
    root = g.add(g.mul(once, twice), g.node(Op.LOG, (twice,)))
    plan = schedule([root])
    assert used_once(plan, [root]) == {once, g.mul(once, twice)}
    assert used_once(plan, [root], [root]) == {once, g.mul(once, twice), root}
    assert once not in used_once(plan, [root, once]), "an output is a use"


def test_a_value_of_a_loop_keeps_its_name_outside() -> None:
    g = Graph()
    x, at = g.input("dofs", 0), g.input("rule", 0, varying=True)
    before = g.add(x, g.const(1))
    total = g.sum(g.mul(before, at))
    assert used_once(schedule([total]), [total]) == {g.mul(before, at)}


def test_a_name_in_straight_code_is_used_again() -> None:
    text = pipeline.compile_task(ALL["solid_q4"](), Task.RESIDUAL).text
    rows = dict(re.findall(r"\b(v\d+) = ([^,;]+)[,;]", text.replace("\n", " ")))
    assert len(rows) > 50
    for name, right in rows.items():
        uses = len(re.findall(rf"\b{name}\b", text)) - 1
        assert uses > 1 or len(right) > 30 or "(" in right, name


def test_neighbours_share_lines_and_their_type() -> None:
    lines = ["    const V v1 = a;", "    const V v2 = b;", "    s1 += v1;", "    s2 += v2;"]
    loop = ["    for (int k = 0; k < 2; ++k)", "        s1 += v1;", "    }"]
    assert filled([*lines, *loop]) == [
        "    const V v1 = a, v2 = b;",
        "    s1 += v1; s2 += v2;",
        *loop,
    ]
    many = filled(f"    V s{k} = {{0}};" for k in range(100))
    assert all(len(row) <= WIDTH for row in many)
    assert len(many) < 20
    assert " ".join(many).count(" = {0}") == 100
