"""Number of temporaries of a plan that are live at once: a compiler keeps them in registers.

Counted backwards over the statements in the plan's order.  A temporary is live from where it is
computed to where it is last read on a path that is taken; constants and arguments are not
temporaries, and an output counts as stored the moment it is computed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from softehl.codegen.emit.code_motion import If, Loop, Schedule, Statement
from softehl.codegen.graph.graph import Node, Op

_NEVER = frozenset({Op.CONST, Op.PI, Op.INPUT, Op.NAME})


def peak_live(plan: Schedule) -> int:
    """Largest number of temporaries that are live at the same time."""
    walk = _Backwards()
    live: frozenset[Node] = frozenset()
    for group in reversed(plan.stages):
        if group.loop is not None:
            live = walk.loop(group.loop, live)
        live = walk.block(group.preamble, live)
    return walk.peak


class _Backwards:
    """Sets of live temporaries before a piece of the plan, from those after it."""

    def __init__(self) -> None:
        self.peak = 0

    def block(self, statements: Sequence[Statement], live: frozenset[Node]) -> frozenset[Node]:
        now = set(live)
        for s in reversed(statements):
            if isinstance(s, If):
                now = set(self.branch(s, frozenset(now)))
            elif isinstance(s, Node):
                self.peak = max(self.peak, len(now) + (s not in now))
                now.discard(s)
                now.update(a for a in s.args if a.op not in _NEVER)
                self.peak = max(self.peak, len(now))
            elif s.old in now:
                now.remove(s.old)
                now |= _temporaries([s.new])
        return frozenset(now)

    def branch(self, s: If, live: frozenset[Node]) -> frozenset[Node]:
        self.seen(live | set(s.merged))
        after = live - set(s.merged)
        sides = [
            self.block(inner, self.seen(after | _temporaries(n.args[k] for n in s.merged)))
            for k, inner in ((1, s.then), (2, s.otherwise))
        ]
        return self.seen(sides[0] | sides[1] | _temporaries([s.condition]))

    def loop(self, loop: Loop, live: frozenset[Node]) -> frozenset[Node]:
        """Count through a loop: sums and values that every iteration reads stay live."""
        once = _Backwards()
        through = live | set(loop.sums)
        summed = _temporaries(s.args[0] for s in loop.sums)
        loop_results = summed | _temporaries(loop.outputs)
        read = once.block(loop.body, through | loop_results)
        again = self.block(loop.body, self.seen(read | through | loop_results))
        return self.seen(again | read | through) - set(loop.sums)

    def seen(self, live: frozenset[Node]) -> frozenset[Node]:
        self.peak = max(self.peak, len(live))
        return live


def _temporaries(nodes: Iterable[Node]) -> frozenset[Node]:
    return frozenset(n for n in nodes if n.op not in _NEVER)
