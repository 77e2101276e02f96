"""List scheduling: the same values, every operand before its user, no more work."""

from __future__ import annotations

import numpy as np

from softehl.codegen.emit.instruction_scheduling import arranged
from softehl.codegen.graph.graph import FREE, Graph, Node, Op
from softehl.codegen.graph.traversal import operations, reachable
from tests.codegen.workshop import inputs, same_value, unknowns


def matrix_product(g: Graph, size: int) -> list[Node]:
    """A B A with entries from dofs: sums of products, and products of sums."""
    x = unknowns(g, 2 * size * size)
    A = [x[i * size : (i + 1) * size] for i in range(size)]
    B = [x[(size + i) * size : (size + i + 1) * size] for i in range(size)]

    def product(P: list[list[Node]], Q: list[list[Node]]) -> list[list[Node]]:
        out = []
        for row in P:
            entries = []
            for j in range(size):
                total = g.zero
                for k, (a, b) in enumerate(zip(row, [q[j] for q in Q], strict=True)):
                    total = (g.sub if k % 2 else g.add)(total, g.mul(a, b))
                entries.append(total)
            out.append(entries)
        return out

    return [n for row in product(product(A, B), A) for n in row]


def misplaced(order: list[Node]) -> list[Node]:
    """Values that are computed before one of their operands."""
    place = {n: k for k, n in enumerate(order)}
    return [
        n
        for n in order
        if any(a.op not in FREE and place.get(a, 1 << 30) >= place[n] for a in n.args)
    ]


def test_operands_come_first_and_nothing_is_missing() -> None:
    g = Graph()
    roots, order = arranged(g, matrix_product(g, 4))
    assert not misplaced(order)
    assert {n for n in reachable(roots) if n.op not in FREE} == set(order)
    assert len(order) == len(set(order))


def test_a_wrong_order_would_be_seen() -> None:
    g = Graph()
    _, order = arranged(g, matrix_product(g, 3))
    assert misplaced(order[::-1])


def test_values_and_work_stay_the_same() -> None:
    g = Graph()
    before = matrix_product(g, 3)
    after, _ = arranged(g, before)
    at = inputs(*np.random.default_rng(8).uniform(-1, 1, 18))
    assert all(same_value(a, b, at) for a, b in zip(after, before, strict=True))
    assert operations(after) == operations(before)


def test_a_sum_of_negative_terms_and_a_repeated_root() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    root = g.neg(g.add(g.mul(x, y), g.call(Op.EXP, x)))
    after, order = arranged(g, [root, root, x])
    at = inputs(0.3, 0.7)
    assert same_value(after[0], root, at)
    assert after[0] is after[1]
    assert after[2] is x
    assert not misplaced(order)


def test_the_same_graph_gives_the_same_order() -> None:
    def once() -> list[str]:
        g = Graph()
        return [repr(n) for n in arranged(g, matrix_product(g, 3))[1]]

    assert once() == once()
