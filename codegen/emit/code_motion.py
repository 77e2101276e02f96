"""Place of each computation: before the loop over points, in it, after it, inside a branch.

A kernel is a sequence of stages.  A stage computes what does not vary with the point and is known
by then, and then runs one loop over the points that feeds the sums of the next stage.  Inside a
stage or a loop, a value that only one side of a branch needs is placed inside that side.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from softehl.codegen.graph.graph import Node, Op
from softehl.codegen.graph.traversal import reachable


@dataclass
class If:
    """`if (condition)`; `merged` are the branch nodes whose value it decides."""

    condition: Node
    merged: list[Node] = field(default_factory=list)
    then: list[Statement] = field(default_factory=list)
    otherwise: list[Statement] = field(default_factory=list)


@dataclass(frozen=True)
class Same:
    """`old` is the value that has just been computed as `new`."""

    old: Node
    new: Node


Statement = Node | If | Same


def flat(block: Iterable[Statement]) -> Iterator[Node | Same]:
    """Every value and every other name in a block, those inside branches included."""
    for s in block:
        if isinstance(s, If):
            yield from s.merged
            yield from flat([*s.then, *s.otherwise])
        else:
            yield s


@dataclass(frozen=True)
class Loop:
    """One loop over the quadrature points: its body and the sums that it feeds."""

    body: list[Statement]
    sums: tuple[Node, ...]
    outputs: tuple[Node, ...]


@dataclass(frozen=True)
class PlanStage:
    """Values that do not vary with the point, then a loop (or none)."""

    preamble: list[Statement]
    loop: Loop | None


@dataclass(frozen=True)
class Schedule:
    """All stages of a kernel, in order, and how much work is in and out of the loops."""

    stages: tuple[PlanStage, ...]
    operations_once: int
    operations_per_point: int


def schedule(roots: Sequence[Node]) -> Schedule:
    """Place every value that `roots` need; varying roots are outputs of a loop."""
    nodes = reachable(roots)
    level = _levels(nodes)
    top = max([level[n] for n in nodes], default=0)
    sums = [n for n in nodes if n.op is Op.SUM]
    varying = [r for r in dict.fromkeys(roots) if r.varying]
    stages, once, looped = [], 0, 0
    for k in range(top + 1):
        fixed = [n for n in nodes if not n.varying and level[n] == k and _computed(n)]
        preamble = place_in_branches(depth_first(fixed, roots), fixed_roots(fixed, nodes, roots))
        feeds = tuple(s for s in sums if level[s] == k + 1)
        outputs = tuple(r for r in varying if level[r] == k)
        loop_roots = [*(s.args[0] for s in feeds), *outputs]
        loop = None
        once += sum(n.op is not Op.ITEM for n in fixed)
        if loop_roots:
            inside = [n for n in _in_loop(loop_roots) if _computed(n)]
            loop = Loop(
                place_in_branches(depth_first(inside, loop_roots), set(loop_roots)), feeds, outputs
            )
            looped += sum(n.op is not Op.ITEM for n in inside) + len(feeds)
        stages.append(PlanStage(preamble, loop))
    return Schedule(tuple(stages), once, looped)


def straight_line(order: Sequence[Node]) -> Schedule:
    """A kernel without loops and branches, in the given order."""
    return Schedule((PlanStage(list(order), None),), len(order), 0)


def is_straight(plan: Schedule) -> bool:
    """True for a kernel without loops, branches and routines."""
    return (
        len(plan.stages) == 1
        and plan.stages[0].loop is None
        and all(isinstance(s, Node) and s.op is not Op.CALL for s in plan.stages[0].preamble)
    )


def depth_first(nodes: Sequence[Node], roots: Sequence[Node]) -> list[Node]:
    """`nodes` in an order that finishes one result before it begins the next: few live values.

    Of two operands the one that needs more values of its own goes first (Sethi and Ullman).
    """
    inside = set(nodes)
    need: dict[Node, int] = {}
    for n in nodes:
        ranks = sorted((need[a] for a in n.args if a in inside), reverse=True)
        need[n] = max([1, *(r + k for k, r in enumerate(ranks))])
    order: list[Node] = []
    seen: set[Node] = set()
    root_set = set(roots)
    inner = [n for n in reversed(nodes) if n not in root_set]
    stack = [*inner, *(r for r in reversed(roots) if r in inside)]
    opened: set[Node] = set()
    while stack:
        n = stack[-1]
        if n in seen:
            stack.pop()
        elif n in opened:
            stack.pop()
            seen.add(n)
            order.append(n)
        else:
            opened.add(n)
            pending = [a for a in n.args if a in inside and a not in seen]
            stack += sorted(pending, key=lambda a: (need[a], a.id))
    return order


def _computed(n: Node) -> bool:
    return n.op not in (Op.CONST, Op.PI, Op.INPUT, Op.NAME, Op.SUM)


def _in_loop(roots: Iterable[Node]) -> list[Node]:
    return [n for n in reachable(roots, stop=lambda n: not n.varying) if n.varying]


def _levels(nodes: Sequence[Node]) -> dict[Node, int]:
    level: dict[Node, int] = {}
    for n in nodes:
        deepest = max((level[a] for a in n.args), default=0)
        level[n] = deepest + 1 if n.op is Op.SUM else deepest
    return level


def fixed_roots(fixed: Sequence[Node], nodes: Sequence[Node], roots: Sequence[Node]) -> set[Node]:
    """Values of a stage that something outside it uses: never hidden inside a branch."""
    inside = set(fixed)
    used = {a for n in nodes if n not in inside for a in n.args}
    return {n for n in fixed if n in used} | (inside & set(roots))


Path = tuple[tuple[int, bool], ...]


class _Placement:
    """Regions of one straight-line block: the lowest common branch side of all users."""

    def __init__(self, nodes: Sequence[Node], roots: set[Node], group: dict[Node, int]) -> None:
        self.group = group
        self.path: dict[Node, Path] = {}
        uses: dict[Node, list[Path]] = {n: [] for n in nodes}
        for n in sorted(nodes, key=lambda n: -n.id):
            paths = [*uses[n], ()] if n in roots else uses[n]
            self.path[n] = _common(paths)
            for k, a in enumerate(n.args):
                if a in uses:
                    uses[a].append(self.use(n, k))

    def use(self, n: Node, k: int) -> Path:
        """Region in which `n` reads its k-th operand."""
        if n.op is Op.BRANCH and k > 0:
            return (*self.path[n], (self.group[n], k == 1))
        return self.path[n]


def _common(paths: Sequence[Path]) -> Path:
    first, *others = paths
    length = len(first)
    for p in others:
        length = min(
            length,
            next(
                (i for i, (a, b) in enumerate(zip(first, p, strict=False)) if a != b),
                min(len(first), len(p)),
            ),
        )
    return first[:length]


def place_in_branches(nodes: Sequence[Node], roots: set[Node]) -> list[Statement]:
    """Statements of one block in an order that computes operands first."""
    try:
        return _place_groups(nodes, roots, _grouped(nodes))
    except _CycleError:
        return _place_groups(nodes, roots, {n: n.id for n in nodes if n.op is Op.BRANCH})


class _CycleError(Exception):
    pass


def _grouped(nodes: Sequence[Node]) -> dict[Node, int]:
    """Branch nodes on one condition share an `if` unless one needs the other's value."""
    group: dict[Node, int] = {}
    latest: dict[Node, list[Node]] = {}
    for n in sorted(nodes, key=lambda n: n.id):
        if n.op is not Op.BRANCH:
            continue
        mates = latest.get(n.args[0], [])
        if mates and not set(mates) & set(reachable(n.args)):
            mates.append(n)
        else:
            latest[n.args[0]] = mates = [n]
        group[n] = mates[0].id
    return group


def _place_groups(
    nodes: Sequence[Node], roots: set[Node], group: dict[Node, int]
) -> list[Statement]:
    placement = _Placement(nodes, roots, group)
    members: dict[Path, list[Node]] = {}
    for n in nodes:
        members.setdefault(placement.path[n], []).append(n)

    def item(n: Node, path: Path, region: Path) -> Node | tuple[int, ...]:
        """Statement that stands for `n` (used or placed at `path`) in `region`."""
        if len(path) > len(region):
            return (path[len(region)][0],)
        return (group[n],) if n.op is Op.BRANCH else n

    needs: dict[Path, dict[object, list[object]]] = {}
    for n in nodes:
        for k, a in enumerate(n.args):
            if a not in placement.path:
                continue
            user, source = placement.use(n, k), placement.path[a]
            region = _common([user, source])
            x = item(n, user, region)
            y = item(a, source, region)
            if x != y:
                needs.setdefault(region, {}).setdefault(x, []).append(y)

    def build(region: Path) -> list[Statement]:
        out: list[Statement] = []
        state: dict[object, int] = {}

        def visit(x: object) -> None:
            if state.get(x) == 2:
                return
            if state.get(x) == 1:
                raise _CycleError
            state[x] = 1
            for y in needs.get(region, {}).get(x, []):
                visit(y)
            state[x] = 2
            out.append(x if isinstance(x, Node) else make_if(x))

        def make_if(x: object) -> If:
            assert isinstance(x, tuple)
            merged = [n for n in members[region] if n.op is Op.BRANCH and group[n] == x[0]]
            return If(
                merged[0].args[0],
                merged,
                build((*region, (x[0], True))),
                build((*region, (x[0], False))),
            )

        for n in members.get(region, []):
            visit((group[n],) if n.op is Op.BRANCH else n)
        return out

    return build(())
