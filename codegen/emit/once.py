"""Values that are used once, which are printed inside the line that uses them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from softehl.codegen.emit.schedule import If, Same, Schedule, Statement, flat
from softehl.codegen.graph.graph import Node, Op

ARITHMETIC = frozenset({Op.ADD, Op.SUB, Op.MUL, Op.NEG, Op.RECIP})


def used_once(
    plan: Schedule, outputs: Iterable[Node], stored: Iterable[Node] = ()
) -> frozenset[Node]:
    """Sums and products whose only use is in the block that computes them.

    outputs: every use of a value after all stages and loops. stored: those that are read once, at
    a store in the block that computes them.
    """
    uses = Counter(outputs)
    for stage in plan.stages:
        _count(uses, stage.before)
        if stage.loop is not None:
            _count(uses, stage.loop.body)
            uses.update(s.args[0] for s in stage.loop.sums)
    near = set(stored)
    for block, sums in _blocks(plan):
        here = {s for s in block if isinstance(s, Node)}
        near |= here & {s.args[0] for s in sums}
        near |= {a for n in here if n.op is not Op.CALL for a in n.args if a in here}
    return frozenset(n for n in near if uses[n] == 1 and n.op in ARITHMETIC)


def _count(uses: Counter[Node], block: Iterable[Statement]) -> None:
    for s in flat(block):
        # a value with two names keeps its line
        uses.update([s.old, s.old, s.new, s.new] if isinstance(s, Same) else s.args)


def _blocks(plan: Schedule) -> Iterator[tuple[list[Statement], tuple[Node, ...]]]:
    """Every block of statements, with the sums that a loop adds up from it."""
    for stage in plan.stages:
        yield from ((b, ()) for b in _nested(stage.before))
        if stage.loop is not None:
            yield stage.loop.body, stage.loop.sums
            yield from ((b, ()) for s in stage.loop.body if isinstance(s, If) for b in _sides(s))


def _nested(block: list[Statement]) -> Iterator[list[Statement]]:
    yield block
    for s in block:
        if isinstance(s, If):
            yield from _sides(s)


def _sides(s: If) -> Iterator[list[Statement]]:
    yield from _nested(s.then)
    yield from _nested(s.otherwise)
