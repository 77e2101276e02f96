"""Basic blocks of a plan with loops and branches, in the order of a small register file.

A *run* is a row of plain values in one block.  `instruction_scheduling` arranges each of them for
itself; sums are added up in another order then, so that a value that something outside the run
uses may have become another one: a `Same` says which.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from itertools import groupby
from operator import or_

from softehl.codegen.emit.code_motion import If, Same, Schedule, Statement
from softehl.codegen.emit.instruction_scheduling import arranged
from softehl.codegen.graph.graph import FREE, Graph, Node, Op
from softehl.codegen.graph.traversal import reachable

PART = 64
"""Values at least, on average, of the pieces that a run is taken apart into."""


def arranged_plan(g: Graph, plan: Schedule, roots: Sequence[Node]) -> Schedule:
    """The plan with every run of every block arranged."""
    work = _Runs(g, plan, roots)
    stages, computed = [], set[Node]()
    for stage in plan.stages:
        preamble = work.block(stage.preamble, computed)
        loop = stage.loop
        if loop is not None:
            loop = replace(loop, body=work.block(loop.body, set(computed)))
            computed.update(loop.sums)
        stages.append(replace(stage, preamble=preamble, loop=loop))
    return replace(plan, stages=tuple(stages))


def _runs(block: Sequence[Statement]) -> Iterator[list[Statement]]:
    """Split a block into runs of plain values; any other statement is a run of one."""

    def plain(s: Statement) -> bool:
        return isinstance(s, Node) and s.op is not Op.CALL

    for alike, row in groupby(block, plain):
        if alike:
            yield list(row)
        else:
            yield from ([s] for s in row)


def _groups(run: Sequence[Node], outputs: Collection[Node]) -> list[list[Node]]:
    """The ends in a run, together with those that hang on the same values from outside it."""
    hangs: dict[Node, int] = {}
    bit: dict[Node, int] = {}
    for n in run:
        outside = [a for a in n.args if a not in hangs and a.op not in FREE]
        for a in outside:
            bit.setdefault(a, 1 << len(bit))
        hangs[n] = reduce(or_, (hangs.get(a, 0) | bit.get(a, 0) for a in n.args), 0)
    groups: dict[int, list[Node]] = {}
    for n in run:
        if n in outputs:
            groups.setdefault(hangs[n], []).append(n)
    return list(groups.values())


class _Runs:
    """Runs of a plan; `outputs` are the values that statements outside their run use."""

    def __init__(self, g: Graph, plan: Schedule, roots: Sequence[Node]) -> None:
        self.g = g
        self.run_of: dict[Node, int] = {}
        self.outputs = set(roots)
        self.count = 0
        blocks = [b for s in plan.stages for b in (s.preamble, s.loop.body if s.loop else [])]
        for block in blocks:
            self._number(block)
        for block in blocks:
            self._use(block)
        for loop in (s.loop for s in plan.stages if s.loop):
            self.outputs.update(loop.outputs, (s.args[0] for s in loop.sums))

    def _number(self, block: Sequence[Statement]) -> None:
        for run in _runs(block):
            self.count += 1
            for s in run:
                if isinstance(s, Node):
                    self.run_of[s] = self.count
                elif isinstance(s, If):
                    self._number(s.then)
                    self._number(s.otherwise)

    def _use(self, block: Iterable[Statement]) -> None:
        for s in block:
            if isinstance(s, Node):
                at = self.run_of[s]
                self.outputs.update(a for a in s.args if self.run_of.get(a) != at)
            elif isinstance(s, If):
                self.outputs.update([s.condition], *(n.args for n in s.merged))
                self._use(s.then)
                self._use(s.otherwise)

    def block(self, block: Sequence[Statement], computed: set[Node]) -> list[Statement]:
        """Return a block in its new order; its values are added to `computed`."""
        out: list[Statement] = []
        for run in _runs(block):
            nodes = [s for s in run if isinstance(s, Node)]
            if len(nodes) > 1:
                for part in self._parts(nodes):
                    out += self._arranged(part, computed)
            else:
                out += [self._branch(s, computed) if isinstance(s, If) else s for s in run]
                computed.update(nodes, *(s.merged for s in run if isinstance(s, If)))
        return out

    def _parts(self, run: Sequence[Node]) -> list[list[Node]]:
        """A long run in pieces, one for each of its groups of ends.

        A tangent that is carried from modes to nodes is many small matrices side by side.  One
        after the other they stay in the fastest memory; the scheduler, which sees few registers
        and no plan, has all of them under way at once.
        """
        groups = _groups(run, self.outputs)
        if len(run) < PART * len(groups):
            return [list(run)]
        parts, part_of = [], dict[Node, int]()
        position = {n: k for k, n in enumerate(run)}
        for k, some in enumerate(groups):
            below = reachable(some, stop=lambda n: n not in position or n in part_of)
            new = [n for n in below if n in position and n not in part_of]
            part_of.update(dict.fromkeys(new, k))
            parts.append(sorted(new, key=position.__getitem__))
        self.outputs.update(a for n, k in part_of.items() for a in n.args if part_of.get(a, k) != k)
        return parts

    def _branch(self, s: If, computed: set[Node]) -> If:
        sides = [self.block(side, set(computed)) for side in (s.then, s.otherwise)]
        return If(s.condition, s.merged, *sides)

    def _arranged(self, nodes: Sequence[Node], computed: set[Node]) -> Iterator[Statement]:
        outputs = [n for n in nodes if n in self.outputs]
        new, order = arranged(self.g, outputs, nodes, computed)
        renamed = {b: a for a, b in zip(outputs, new, strict=True) if a is not b}
        free = [Same(a, b) for b, a in renamed.items() if b.op in FREE or b in computed]
        yield from free
        computed.update(order, outputs)
        for n in order:
            yield n
            if n in renamed:
                yield Same(renamed[n], n)
