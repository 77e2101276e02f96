"""Instruction scheduling: few live values, and no waiting for results in progress.

A C compiler keeps long straight-line code in the order in which it is written, and spills what
does not fit its registers.  `order_instructions` chooses the order by list scheduling over a
simulated register file: of everything that is ready, the piece comes next which fetches the fewest
operands from memory, uses the most of them for the last time, and waits least for results.

Sums stay open while this goes on: any term may be added next, as a multiply-add when it is a
product that nothing else uses, so that a term is consumed where it arises.

In a plan with loops and branches `order_plan` does so for each basic block, a run of plain
values. Sums are added up in another order then, so that a value that other blocks use may have
become another one: a `Same` says which.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from heapq import heappop, heappush
from itertools import groupby
from operator import or_

from softehl.codegen.emit.code_motion import If, Same, Schedule, Statement
from softehl.codegen.graph.graph import FREE, Graph, Node, Op
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.optimise.common_sums import first_difference

REGISTERS = 16
"""Values that the simulated file holds: those of AVX2."""
ADDITIONS = (Op.ADD, Op.SUB)
LATENCY = {Op.RECIP: 26, Op.RCBRT: 60, Op.CBRT: 60, Op.SQRT: 40, Op.LOG: 100, Op.EXP: 100}
"""Half cycles (two pieces start in a cycle) until a result is there."""
USUAL_LATENCY = 8
LONGEST_WAIT = 12
CANDIDATES = 1_000_000
"""Pieces that are compared in all: in very long code only those written first are candidates."""

# What a piece costs, in operands fetched: measured on the solids of `models`.
LAST_USE = -1.0
WAITING = 0.3
OPENING = 0.3
PARTIAL_SUM = 1.5
FINISHING = -0.5
DRIFT = 1.0


@dataclass(eq=False)
class _Sum:
    """A sum with its terms still to be added; `partial` is what has been added so far."""

    head: Node
    left: int = 0
    partial: Node | None = None
    waiting: list[_Piece] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Piece:
    """One instruction: a value, or one term (one or two factors) of a sum."""

    node: Node
    operands: tuple[Node, ...]
    total: _Sum | None = None
    sign: int = 1

    @cached_property
    def fetched(self) -> tuple[Node, ...]:
        """Different operands that are not written into the instruction."""
        return tuple(dict.fromkeys(a for a in self.operands if a.op not in (Op.CONST, Op.PI)))


def order_instructions(
    g: Graph,
    roots: Sequence[Node],
    inside: Collection[Node] | None = None,
    computed: Collection[Node] = (),
) -> tuple[list[Node], list[Node]]:
    """Roots of the same values, and every value below them in the order of computation.

    inside: values that are to be computed (None: all); what lies below others is known.
    computed: values that are known besides.
    """
    pieces = _pieces(roots, inside)
    run = _Scheduler(g, pieces, set(computed))
    while run.ready:
        run.step()
    return [run.new.get(r, r) for r in roots], run.order


def _pieces(roots: Sequence[Node], inside: Collection[Node] | None) -> list[_Piece]:
    """Everything below the roots taken apart: sums into terms, products of one use into sums."""
    within = None if inside is None else frozenset(inside)
    below = reachable(roots, None if within is None else lambda n: n not in within)
    nodes = [n for n in below if n.op not in FREE and (within is None or n in within)]
    uses, user = Counter(roots), {}
    for n in nodes:
        uses.update(n.args)
        user.update(dict.fromkeys(n.args, n))
    outputs, block = set(roots), set(nodes)

    def inner(n: Node) -> bool:
        alone = n in block and uses[n] == 1 and n not in outputs and user[n].op in ADDITIONS
        return alone and (n.op is Op.MUL or (n.op in ADDITIONS and not first_difference(n)))

    def terms(total: _Sum) -> list[_Piece]:
        out = []
        stack = [(total.head, 1)]
        while stack:
            a, sign = stack.pop()
            if a is total.head or (inner(a) and a.op is not Op.MUL):
                first, second = a.args
                stack += [(second, -sign if a.op is Op.SUB else sign), (first, sign)]
            else:
                out.append(_Piece(a, a.args if inner(a) else (a,), total, sign))
        return out

    pieces = []
    for n in nodes:
        if inner(n):
            continue
        if n.op in ADDITIONS:
            total = _Sum(n)
            added = terms(total)
            total.left = len(added)
            pieces += added
        else:
            pieces.append(_Piece(n, n.args))
    return pieces


@dataclass
class _Scheduler:
    g: Graph
    pieces: list[_Piece]
    printed: set[Node] = field(default_factory=set)
    new: dict[Node, Node] = field(default_factory=dict)
    order: list[Node] = field(default_factory=list)
    ready: dict[_Piece, None] = field(default_factory=dict)
    registers: OrderedDict[Node | _Sum, None] = field(default_factory=OrderedDict)
    clock: int = 0

    def __post_init__(self) -> None:
        self._window = max(8, CANDIDATES // max(len(self.pieces), 1))
        self._later: list[tuple[float, _Piece]] = []
        heads = {p.node if p.total is None else p.total.head for p in self.pieces}
        self.printed.update(a for p in self.pieces for a in p.fetched if a not in heads)
        # how early the model's author, or the chain rule, wrote a value
        ids = sorted(self.pieces, key=lambda p: p.node.id)
        self._position = {p: k / len(ids) for k, p in enumerate(ids)}
        self._drift = {p: DRIFT * k for p, k in self._position.items()}
        self._arrival: dict[Node | _Sum, int] = {}
        self._waiting: dict[Node, list[_Piece]] = {}
        self._missing: dict[_Piece, int] = {}
        self._uses: Counter[Node] = Counter()
        for p in self.pieces:
            self._uses.update(p.fetched)
            missing = [a for a in p.fetched if a in heads]
            self._missing[p] = len(missing)
            for a in missing:
                self._waiting.setdefault(a, []).append(p)
            if not missing:
                self._offer(p)

    def _offer(self, p: _Piece) -> None:
        """Mark a piece as ready, unless its sum must begin with another one."""
        if p.total is not None and p.total.partial is None and p.sign < 0:
            p.total.waiting.append(p)
        elif len(self.ready) < self._window:
            self.ready[p] = None
        else:
            heappush(self._later, (self._position[p], p))

    def step(self) -> None:
        """Take the cheapest piece that is ready."""
        p = self._cheapest()
        del self.ready[p]
        start = max([self.clock, *(self._arrival.get(a, 0) for a in p.operands)])
        done, result = self._compute(p)
        for a in p.fetched:
            self._touch(a)
            self._uses[a] -= 1
            if not self._uses[a]:
                self.registers.pop(a, None)
        self._arrival[result] = start + LATENCY.get(p.node.op, USUAL_LATENCY)
        self._touch(result)
        self.clock += 1
        for waiting in self._waiting.pop(done, []) if done is not None else []:
            self._missing[waiting] -= 1
            if not self._missing[waiting]:
                self._offer(waiting)
        while self._later and len(self.ready) < self._window:
            self.ready[heappop(self._later)[1]] = None

    def _cheapest(self) -> _Piece:
        """The piece of least cost, of equal ones that which was written first.

        Most of the time of a long kernel is spent here: nothing is called that could stand here.
        """
        registers, uses, arrivals, clock = self.registers, self._uses, self._arrival, self.clock
        best: _Piece | None = None
        lowest = 0.0
        for p in self.ready:
            cost, arrival = self._drift[p], clock
            for a in p.fetched:
                if a not in registers:
                    cost += 1.0
                if uses[a] == 1:
                    cost += LAST_USE
                at = arrivals.get(a, 0)
                if at > arrival:
                    arrival = at
            total = p.total
            if total is not None:
                if total.partial is None:
                    cost += OPENING
                else:
                    cost += PARTIAL_SUM * (total not in registers)
                    cost += FINISHING * (total.left == 1)
                    arrival = max(arrival, arrivals.get(total, 0))
            if arrival > clock:
                cost += WAITING * min(arrival - clock, LONGEST_WAIT)
            if best is None or cost < lowest or (cost == lowest and p.node.id < best.node.id):
                best, lowest = p, cost
        assert best is not None
        return best

    def _compute(self, p: _Piece) -> tuple[Node | None, Node | _Sum]:
        """Return the value that is now computed (None: an incomplete sum) and its register."""
        g, operands = self.g, [self.new.get(a, a) for a in p.operands]
        if p.total is None:
            n = self.new[p.node] = g.rebuild(p.node.op, operands, p.node.payload)
            self._print(n)
            return p.node, p.node
        term = g.mul(operands[0], operands[1]) if len(operands) == 2 else operands[0]
        self._print(term)
        total = p.total
        if total.partial is None:
            # A sum starts with a term of positive sign: there always is one.
            total.partial = term
            for waiting in total.waiting:
                self._offer(waiting)
        else:
            total.partial = (g.add if p.sign > 0 else g.sub)(total.partial, term)
            self._print(total.partial)
        total.left -= 1
        if total.left:
            return None, total
        self.registers.pop(total, None)
        self.new[total.head] = total.partial
        return total.head, total.head

    def _print(self, n: Node) -> None:
        """Append a value, after those of its operands that folding has made new."""
        if n.op in FREE or n in self.printed:
            return
        for a in n.args:
            self._print(a)
        self.printed.add(n)
        self.order.append(n)

    def _touch(self, value: Node | _Sum) -> None:
        self.registers[value] = None
        self.registers.move_to_end(value)
        while len(self.registers) > REGISTERS:
            self.registers.popitem(last=False)


PART = 64
"""Values at least, on average, of the pieces that a run is taken apart into."""


def order_plan(g: Graph, plan: Schedule, roots: Sequence[Node]) -> Schedule:
    """The plan with every run of every block arranged."""
    work = _Runs(g, plan, roots)
    stages, computed = [], set[Node]()
    for block in plan.stages:
        preamble = work.block(block.preamble, computed)
        loop = block.loop
        if loop is not None:
            loop = replace(loop, body=work.block(loop.body, set(computed)))
            computed.update(loop.sums)
        stages.append(replace(block, preamble=preamble, loop=loop))
    live = set(roots)
    for k, block in reversed(list(enumerate(stages))):
        loop = block.loop
        if loop is not None:
            live.update(loop.outputs, (s.args[0] for s in loop.sums))
            loop = replace(loop, body=_used(loop.body, live))
        stages[k] = replace(block, preamble=_used(block.preamble, live), loop=loop)
    return replace(plan, stages=tuple(stages))


def _used(block: Sequence[Statement], live: set[Node]) -> list[Statement]:
    """Statements whose values are used, of a block before which `live` grows by what they need.

    A sum that is added up in another order may be a value that is there already; what had been
    computed for it is then needed no more.
    """
    out: list[Statement] = []
    for s in reversed(block):
        if isinstance(s, If):
            live.update(a for n in s.merged for a in n.args)
            then, otherwise = (_used(side, live) for side in (s.then, s.otherwise))
            out.append(If(s.condition, s.merged, then, otherwise))
        elif isinstance(s, Same):
            if s.old in live or s.new in live:
                live.add(s.new)
                out.append(s)
        elif s in live:
            live.update(s.args)
            out.append(s)
    return out[::-1]


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
        then, otherwise = (self.block(side, set(computed)) for side in (s.then, s.otherwise))
        return If(s.condition, s.merged, then, otherwise)

    def _arranged(self, nodes: Sequence[Node], computed: set[Node]) -> Iterator[Statement]:
        outputs = [n for n in nodes if n in self.outputs]
        new, order = order_instructions(self.g, outputs, nodes, computed)
        renamed = {b: a for a, b in zip(outputs, new, strict=True) if a is not b}
        free = [Same(a, b) for b, a in renamed.items() if b.op in FREE or b in computed]
        yield from free
        computed.update(order, outputs)
        for n in order:
            yield n
            if n in renamed:
                yield Same(renamed[n], n)
