"""Traversal of a graph and its reconstruction with changed nodes.

A model may name ten thousand intermediates, each made of the one before, and Python's stack does
not hold as many calls.  A recursive function is therefore written as a generator that
yields its inner calls, and run by `recursion`, which keeps the stack in a list.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any, TypeVar

from softehl.codegen.graph.graph import FREE, Graph, Node, Op

T = TypeVar("T")
Recursion = Generator[Any, T, T]
"""A recursive function under way: `value = yield function(arguments)` is a call of itself."""
_BY_ID = attrgetter("id")


def recursion(outermost: Recursion[T]) -> T:
    """The result of a recursive function, however deep its calls."""
    stack: list[Recursion[Any]] = [outermost]
    value: Any = None
    while stack:
        try:
            inner = stack[-1].send(value)
        except StopIteration as done:
            stack.pop()
            value = done.value
        else:
            stack.append(inner)
            value = None
    result: T = value
    return result


def reachable(roots: Iterable[Node], stop: Callable[[Node], bool] | None = None) -> list[Node]:
    """All nodes below `roots` (operands of nodes that satisfy `stop` excluded), ids ascending."""
    seen = set(roots)
    stack = list(seen)
    while stack:
        n = stack.pop()
        if stop is None or not stop(n):
            for a in n.args:
                if a not in seen:
                    seen.add(a)
                    stack.append(a)
    return sorted(seen, key=_BY_ID)


def always(roots: Iterable[Node], *, conditions: bool = True) -> list[Node]:
    """Nodes that are computed whichever side is taken of every branch, ids ascending.

    conditions: those that only decide a branch as well.
    """
    seen: dict[int, Node] = {}
    stack = list(roots)
    while stack:
        n = stack.pop()
        if n.id not in seen:
            seen[n.id] = n
            branch = n.op is Op.BRANCH
            stack += n.args[: int(conditions)] if branch else n.args
    return [seen[i] for i in sorted(seen)]


def operations(roots: Iterable[Node]) -> int:
    """Number of run-time operations below `roots` (each shared value counted once)."""
    free = (Op.SUM, Op.ITEM)
    return sum(1 for n in reachable(roots) if n.op not in FREE and n.op not in free)


Rule = Callable[[Graph, Node, tuple[Node, ...]], Node]


def rewrite(g: Graph, roots: Sequence[Node], rule: Rule) -> list[Node]:
    """Rebuild bottom-up: `rule` gets each old node with its rebuilt operands."""
    new: dict[Node, Node] = {}
    for n in reachable(roots):
        new[n] = rule(g, n, tuple(new[a] for a in n.args))
    return [new[r] for r in roots]


def strip(
    g: Graph, roots: Sequence[Node], keep: Collection[Node]
) -> tuple[list[Node], dict[Node, Node]]:
    """Return the roots without names except those of `keep`, and the new node of each of these."""
    new: dict[Node, Node] = {}
    for n in reachable(roots):
        args = tuple(new[a] for a in n.args)
        named = n.op is Op.NAME and n not in keep
        new[n] = args[0] if named else g.rebuild(n.op, args, n.payload)
    return [new[r] for r in roots], {n: new[n] for n in keep if n in new}


def substitute(
    g: Graph, roots: Sequence[Node], replacement: Mapping[Node, Node]
) -> tuple[list[Node], dict[Node, Node]]:
    """Roots with the keys of `replacement` replaced; also what every old node became."""
    new: dict[Node, Node] = {}
    for n in reachable(roots, stop=replacement.__contains__):
        if n in replacement:
            new[n] = replacement[n]
        else:
            new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
    return [new[r] for r in roots], new


def written_out(
    g: Graph,
    roots: Sequence[Node],
    points: int,
    leaf: Callable[[Node, int], Node],
    inside: Collection[Node] | None = None,
) -> list[Node]:
    """Roots with sums over points as one term for each of the `points`.

    leaf: what an argument that varies is at a point. inside: values that do not vary and are not
    among these stay as they are, with the sums below them; None: nothing stays.
    """
    new: dict[Node, Node] = {}
    copies: list[dict[Node, Node]] = [{} for _ in range(points)]

    def at(n: Node, q: int) -> Node:
        return copies[q][n] if n.varying else new[n]

    for n in reachable(roots):
        if not n.varying and inside is not None and n not in inside:
            new[n] = n
        elif n.op is Op.SUM:
            new[n] = g.zero
            for q in range(points):
                new[n] = g.add(new[n], at(n.args[0], q))
        elif not n.varying:
            new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
        else:
            for q, copy in enumerate(copies):
                args = tuple(at(a, q) for a in n.args)
                copy[n] = g.rebuild(n.op, args, n.payload) if args else leaf(n, q)
    return [new[r] for r in roots]
