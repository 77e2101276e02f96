"""Differentiation on the graph: reverse for gradients, forward along one direction.

Both know AceGen's exceptions (Korelc 2002): an intermediate may be held `constant`, or have a
`given` derivative with respect to chosen nodes, for one differentiation.

A branch is differentiated side by side and stays a branch, so that nothing of the side that is
not taken is ever evaluated.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from softehl.codegen.graph.graph import Graph, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.guarded_products import Certain, exists, guarded, plus, shielded
from softehl.codegen.graph.length_derivatives import by_square, slope, square_of
from softehl.codegen.graph.partial_derivatives import Partials, partials
from softehl.codegen.graph.traversal import reachable

PrescribedDerivatives = Mapping[Node, Mapping[Node, Node]]
"""Derivatives that a model gives: of a node with respect to others."""


@dataclass
class Dependence:
    """Dependence of nodes on selected ones, under the exceptions of one differentiation."""

    sources: Collection[Node]
    constant: Collection[Node] = ()
    prescribed: PrescribedDerivatives = field(default_factory=dict)
    _memo: dict[Node, bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sources, self.constant = frozenset(self.sources), frozenset(self.constant)

    def __call__(self, n: Node) -> bool:
        memo = self._memo
        stack = [] if n in memo else [n]
        while stack:
            m = stack[-1]
            if m in memo:
                stack.pop()
            elif m in self.sources or m in self.constant:
                memo[m] = m in self.sources
            else:
                operands = self.prescribed.get(m, m.args)
                unknown = [a for a in operands if a not in memo]
                stack += unknown
                if not unknown:
                    memo[m] = any(memo[a] for a in operands)
        return memo[n]


def gradient(
    g: Graph,
    root: Node,
    wrt: Sequence[Node],
    *,
    constant: Collection[Node] = (),
    prescribed: PrescribedDerivatives | None = None,
    named: Collection[Node] = (),
    flat: bool = False,
) -> dict[Node, Node]:
    """Adjoints of every node on the way from `wrt` to the scalar `root` (reverse mode).

    The adjoints of `named` nodes get a name of their own, so that a second differentiation
    meets them as they are and not merged into other expressions.

    For a node that varies with the quadrature point the adjoint is that of the summand: it is
    to be contracted with the node's own dependence and summed by the caller.  With `flat` it is
    that of a value at a point for the other nodes too, instead of its sum over the points.
    """
    depends = Dependence(tuple(wrt), constant, prescribed or {})
    sweep = _Reverse(g, depends, flat, named=frozenset(named))
    adjoint = sweep.run(root)
    return {**dict.fromkeys(wrt, g.zero), **adjoint}


@dataclass
class _Reverse:
    g: Graph
    depends: Dependence
    flat: bool = False
    stop: Collection[Node] = ()
    named: Collection[Node] = ()
    adjoint: dict[Node, Node] = field(default_factory=dict)
    summands: dict[Node, Node] = field(default_factory=dict)
    _certain: Certain = field(default_factory=Certain)
    _results: dict[Node, dict[int, Node]] = field(default_factory=dict)

    def run(self, root: Node) -> dict[Node, Node]:
        self.adjoint[root] = self.g.one
        self._certain = Certain([root])
        for n in reversed(reachable([root, *self._hidden()])):
            if not self.depends(n):
                continue
            if n in self.summands:
                self._accumulate(self.adjoint, n, self.g.sum(self.summands.pop(n)))
            seed = self.adjoint.get(n)
            if seed is not None and n in self.named and seed.op is not Op.NAME:
                seed = self.adjoint[n] = self.g.name(f"d_{n.payload}", seed)
            if seed is not None and n not in self.stop and n not in self.depends.sources:
                self._propagate(n, seed)
            if n in self._results:
                self._pull(n, self._results.pop(n))
        return self.adjoint

    def _hidden(self) -> list[Node]:
        """Nodes that occur only in a prescribed derivative."""
        return [k for pairs in self.depends.prescribed.values() for k in pairs]

    def _propagate(self, n: Node, seed: Node) -> None:
        if n.op is Op.SUM:
            self._accumulate(self.adjoint, n.args[0], seed)
            return
        if square_of(n) is not None and n not in self.depends.prescribed:
            self._accumulate(self.adjoint, n.args[0].args[1], self._by_square(n, seed))
            return
        if n.op is Op.ITEM and self._is_joint(n):
            assert isinstance(n.payload, ResultIndex)
            self._results.setdefault(n.args[0], {})[n.payload.index] = seed
            return
        for a, p in self._local(n):
            if self.depends(a):
                self._accumulate(self._into(n, a), a, self._times(n, seed, p))

    def _into(self, n: Node, a: Node) -> dict[Node, Node]:
        return self.summands if n.varying > a.varying and not self.flat else self.adjoint

    def _is_joint(self, n: Node) -> bool:
        """True for a result of a routine that takes the adjoints of all results at once."""
        routine = n.args[0].payload
        assert isinstance(routine, Routine)
        return n not in self.depends.prescribed and routine.joint

    def _pull(self, call: Node, seeds: dict[int, Node]) -> None:
        """Adjoints of the operands of a routine; in a branch if all its results are."""
        g, routine = self.g, call.payload
        assert isinstance(routine, Routine)
        sides = [_side(g, seed) for seed in seeds.values()]
        c, zero_side, _ = sides[0]
        common = c is not None and all(s[:2] == (c, zero_side) for s in sides)
        if common:
            seeds = {k: inside for k, (_, _, inside) in zip(seeds, sides, strict=True)}
        for a, value in routine.pullback(g, call, seeds):
            if self.depends(a):
                if common and c is not None:
                    value = g.branch(c, *((g.zero, value) if zero_side == 1 else (value, g.zero)))
                self._accumulate(self._into(call, a), a, value)

    def _times(self, n: Node, seed: Node, p: Node) -> Node:
        """Adjoint of a value times one of its derivatives."""
        if n in self._certain.nodes:  # where it is not-a-number, the root is as well
            return guarded(self.g, seed, p)
        return shielded(self.g, seed, p, self._certain)

    def _local(self, n: Node) -> Partials:
        if n in self.depends.prescribed:
            return list(self.depends.prescribed[n].items())
        if n.op is Op.BRANCH:
            return self._branch(n)
        return partials(self.g, n)

    def _by_square(self, n: Node, seed: Node) -> Node:
        """Adjoint of the square of a length, from that of the length."""
        g = self.g
        if seed.op is Op.NEG:
            return g.neg(self._by_square(n, seed.args[0]))
        if seed.op is Op.BRANCH and g.zero in seed.args[1:] and seed.args[0] is not n.args[0]:
            c, *sides = seed.args
            return g.branch(c, *(s if s is g.zero else self._by_square(n, s) for s in sides))
        (curvature,) = directional(g, [seed], {n: g.one}, self.depends.prescribed)
        if curvature is g.zero:  # a kink
            return self._times(n, seed, slope(g, n))
        inverse = g.mul(g.const(Fraction(1, 2)), g.recip(n.args[1]))
        weighted = self._times(n, seed, inverse)
        certain, fixed = exists(g, curvature), self.depends.prescribed
        return by_square(g, n, (seed, curvature), weighted, exists=certain, fixed=fixed)

    def _branch(self, n: Node) -> Partials:
        """Both sides differentiated with respect to the nearest named values and inputs."""
        condition, then, otherwise = n.args

        def leaf(m: Node) -> bool:
            named = m.op in (Op.NAME, Op.INPUT, Op.SUM) or m in self.depends.sources
            return m is not n and (named or m in self.stop or square_of(m) is not None)

        frontier = [m for m in reachable([then, otherwise], stop=leaf) if leaf(m)]
        frontier = [m for m in frontier if self.depends(m)]
        sides = [
            _Reverse(self.g, self.depends, flat=True, stop=frozenset(frontier)).run(side)
            for side in (then, otherwise)
        ]
        zero = self.g.zero
        return [
            (f, self.g.branch(condition, sides[0].get(f, zero), sides[1].get(f, zero)))
            for f in frontier
        ]

    def _accumulate(self, into: dict[Node, Node], n: Node, value: Node) -> None:
        into[n] = plus(self.g, into[n], value) if n in into else value


def _side(g: Graph, seed: Node) -> tuple[Node | None, int, Node]:
    """Condition of a value that is zero on one side, which side, and the value of the other."""
    inner = seed.args[0] if seed.op is Op.NEG else seed
    if inner.op is not Op.BRANCH or g.zero not in inner.args[1:]:
        return None, 0, seed
    k = inner.args.index(g.zero, 1)
    value = inner.args[3 - k]
    return inner.args[0], k, g.neg(value) if seed.op is Op.NEG else value


def _along(g: Graph, n: Node, rate: Mapping[Node, Node]) -> Node | None:
    """Rate of a result of a routine that says it itself."""
    routine = n.args[0].payload if n.op is Op.ITEM else None
    return routine.along(g, n, rate) if isinstance(routine, Routine) else None


def directional(
    g: Graph,
    roots: Sequence[Node],
    seeds: Mapping[Node, Node],
    prescribed: PrescribedDerivatives | None = None,
) -> list[Node]:
    """Derivatives of `roots` when each key of `seeds` moves at the rate of its value (forward)."""
    depends = Dependence(tuple(seeds), (), prescribed or {})
    rate: dict[Node, Node] = {}
    for n in reachable([*roots, *(k for pairs in depends.prescribed.values() for k in pairs)]):
        if n in seeds:
            rate[n] = seeds[n]
        elif not depends(n):
            rate[n] = g.zero
        elif n.op is Op.SUM:
            rate[n] = g.sum(rate[n.args[0]])
        elif n.op is Op.BRANCH and square_of(n) is None:
            rate[n] = g.branch(n.args[0], rate[n.args[1]], rate[n.args[2]])
        elif (moved := _along(g, n, rate)) is not None:
            rate[n] = moved
        else:
            rate[n] = g.zero
            pairs = (
                list(depends.prescribed[n].items()) if n in depends.prescribed else partials(g, n)
            )
            for a, p in pairs:
                term = guarded(g, p, rate[a])
                if n.op is Op.POWER and a is n.args[1] and rate[a].op is not Op.CONST:
                    # of a negative base it does not exist, and is not needed where a stays
                    term = g.branch(g.compare(Op.EQ, rate[a], g.zero), g.zero, term)
                rate[n] = plus(g, rate[n], term)
    return [rate[r] for r in roots]
