"""Differentiation on the graph: reverse for gradients, forward through a waist for tangents.

`gradient` is reverse mode.  `Linearisation` is forward mode in two levels: values at a quadrature
point are differentiated with respect to the few intermediates (the *waist*: strains, film
thickness, ...) through which they depend on the unknowns, and the chain rule is closed with the
derivatives of those.  Both know AceGen's exceptions (Korelc 2002): an intermediate may be held
`constant`, or have a `given` derivative with respect to chosen nodes, for one differentiation.

A branch is differentiated side by side and stays a branch, so that nothing of the side that is
not taken is ever evaluated.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from softehl.codegen.graph.graph import BOOLEAN, Graph, Node, Op, Routine, reachable

Partials = list[tuple[Node, Node]]
Given = Mapping[Node, Mapping[Node, Node]]


class DifferentiationError(ValueError):
    """The model asks for a derivative that has no meaning in a kernel."""


def partials(g: Graph, n: Node) -> Partials:
    """Local derivatives of `n` with respect to its operands (not for BRANCH and SUM)."""
    if not n.args or n.op in BOOLEAN or n.op is Op.CALL:
        return []
    if n.op is Op.ITEM:
        routine = n.args[0].payload
        assert isinstance(routine, Routine)
        return routine.partials(g, n)
    a = n.args[0]
    match n.op:
        case Op.NAME:
            return [(a, g.one)]
        case Op.ADD:
            return [(a, g.one), (n.args[1], g.one)]
        case Op.SUB:
            return [(a, g.one), (n.args[1], g.neg(g.one))]
        case Op.MUL:
            b = n.args[1]
            return [(a, g.mul(g.const(2), a))] if a is b else [(a, b), (b, a)]
        case Op.NEG:
            return [(a, g.neg(g.one))]
        case Op.ATAN2:
            x = n.args[1]
            scale = g.recip(g.add(g.mul(a, a), g.mul(x, x)))
            return [(a, g.mul(x, scale)), (x, g.neg(g.mul(a, scale)))]
        case _:
            return [(a, _derivative_of_call(g, n, a))]


def _derivative_of_call(g: Graph, n: Node, a: Node) -> Node:
    match n.op:
        case Op.RECIP:
            return g.neg(g.mul(n, n))
        case Op.POW:
            assert isinstance(n.payload, Fraction)
            return g.mul(g.const(n.payload), g.power(a, n.payload - 1))
        case Op.SQRT:
            return g.mul(g.const(Fraction(1, 2)), g.recip(n))
        case Op.CBRT:
            return g.mul(g.const(Fraction(1, 3)), g.recip(g.mul(n, n)))
        case Op.RCBRT:
            return g.neg(g.mul(g.const(Fraction(1, 3)), g.mul(n, g.recip(a))))
        case Op.LOG:
            return g.recip(a)
        case Op.EXP:
            return n
        case Op.SIN:
            return g.call(Op.COS, a)
        case Op.COS:
            return g.neg(g.call(Op.SIN, a))
        case Op.TAN:
            return g.add(g.one, g.mul(n, n))
        case Op.ASIN:
            return g.recip(g.call(Op.SQRT, _one_minus_square(g, a)))
        case Op.ACOS:
            return g.neg(g.recip(g.call(Op.SQRT, _one_minus_square(g, a))))
        case Op.ATAN:
            return g.recip(g.add(g.one, g.mul(a, a)))
        case Op.SINH:
            return g.call(Op.COSH, a)
        case Op.COSH:
            return g.call(Op.SINH, a)
        case Op.TANH:
            return g.sub(g.one, g.mul(n, n))
        case _:
            raise DifferentiationError(f"no derivative rule for {n.op}")


def _one_minus_square(g: Graph, a: Node) -> Node:
    """(1 - a)(1 + a), which keeps its digits near a = 1."""
    return g.mul(g.sub(g.one, a), g.add(g.one, a))


@dataclass
class Dependence:
    """Which nodes depend on chosen ones, given the exceptions of one differentiation."""

    sources: Collection[Node]
    constant: Collection[Node] = ()
    given: Given = field(default_factory=dict)
    _known: dict[Node, bool] = field(default_factory=dict)

    def __call__(self, n: Node) -> bool:
        for m in reachable([n], stop=self._known.__contains__):
            if m not in self._known:
                self._known[m] = self._decide(m)
        return self._known[n]

    def _decide(self, m: Node) -> bool:
        if m in self.sources:
            return True
        if m in self.constant:
            return False
        operands: Iterable[Node] = self.given.get(m, m.args)
        return any(self(a) for a in operands)


def gradient(
    g: Graph,
    root: Node,
    wrt: Sequence[Node],
    *,
    constant: Collection[Node] = (),
    given: Given | None = None,
    named: Collection[Node] = (),
) -> dict[Node, Node]:
    """Adjoints of every node on the way from `wrt` to the scalar `root` (reverse mode).

    The adjoints of `named` nodes get a name of their own, so that a second differentiation
    meets them as they are and not merged into other expressions.

    For a node that varies with the quadrature point the adjoint is that of the summand: it is
    to be contracted with the node's own dependence and summed by the caller.
    """
    sweep = _Reverse(g, Dependence(tuple(wrt), constant, given or {}), named=named)
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

    def run(self, root: Node) -> dict[Node, Node]:
        self.adjoint[root] = self.g.one
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
        return self.adjoint

    def _hidden(self) -> list[Node]:
        """Nodes that only a given derivative refers to."""
        return [k for pairs in self.depends.given.values() for k in pairs]

    def _propagate(self, n: Node, seed: Node) -> None:
        if n.op is Op.SUM:
            self._accumulate(self.adjoint, n.args[0], seed)
            return
        for a, p in self._local(n):
            if self.depends(a):
                into = self.summands if n.varying > a.varying and not self.flat else self.adjoint
                self._accumulate(into, a, guarded(self.g, seed, p))

    def _local(self, n: Node) -> Partials:
        if n in self.depends.given:
            return list(self.depends.given[n].items())
        if n.op is Op.BRANCH:
            return self._branch(n)
        return partials(self.g, n)

    def _branch(self, n: Node) -> Partials:
        """Both sides differentiated with respect to the nearest named values and inputs."""
        condition, then, otherwise = n.args

        def leaf(m: Node) -> bool:
            named = m.op in (Op.NAME, Op.INPUT, Op.SUM) or m in self.depends.sources
            return m is not n and (named or m in self.stop)

        frontier = [m for m in reachable([then, otherwise], stop=leaf) if leaf(m)]
        frontier = [m for m in frontier if self.depends(m)]
        sides = [
            _Reverse(self.g, self.depends, flat=True, stop=frontier).run(side)
            for side in (then, otherwise)
        ]
        zero = self.g.zero
        return [
            (f, self.g.branch(condition, sides[0].get(f, zero), sides[1].get(f, zero)))
            for f in frontier
        ]

    def _accumulate(self, into: dict[Node, Node], n: Node, value: Node) -> None:
        into[n] = _plus(self.g, into[n], value) if n in into else value


@dataclass
class Linearisation:
    """Forward derivatives with respect to `directions`, through the nodes of `waist`.

    `symmetric` maps the adjoint of a waist node (of one and the same potential) to that node:
    mixed second derivatives are then taken once.  `upper` holds further waists above the first,
    lowest first; `gates` maps the adjoint of a node of `upper` to the number of its waist
    (1, 2, ...): such a value is differentiated with respect to that waist and the chain rule then
    leads down, so that a narrow waist is never crossed in full width.
    """

    g: Graph
    directions: Sequence[Node]
    waist: Collection[Node] = ()
    symmetric: Mapping[Node, Node] = field(default_factory=dict)
    constant: Collection[Node] = ()
    given: Given = field(default_factory=dict)
    upper: Sequence[Collection[Node]] = ()
    gates: Mapping[Node, int] = field(default_factory=dict)
    _totals: dict[tuple[Node, int], Node] = field(default_factory=dict)
    _locals: dict[tuple[Node, int], dict[Node, Node]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._depends = Dependence(tuple(self.directions), self.constant, self.given)
        self._adjoint_of = {z: a for a, z in self.symmetric.items()}
        self._points = [j for j, d in enumerate(self.directions) if d.varying]
        self._level = {n: k for k, w in enumerate((self.waist, *self.upper)) for n in w}

    def derivative(self, n: Node, j: int) -> Node:
        """dn/d(direction j).  Varies when `n` or the direction does (then: of the summand)."""
        if n.varying and n not in self.waist:
            return self._over(self.local(n), j)
        return self._total(n, j)

    def _total(self, n: Node, j: int) -> Node:
        if n is self.directions[j]:
            return self.g.one
        if not self._depends(n) or n in self.directions:
            return self.g.zero
        key = (n, j)
        if key not in self._totals:
            self._totals[key] = self._compute_total(n, j)
        return self._totals[key]

    def _compute_total(self, n: Node, j: int) -> Node:
        g = self.g
        if n.varying:  # a waist node: through the next waist below it
            return self._over(self._below(n, 0), j)
        if n.op is Op.SUM:
            inner = self._over(self.local(n.args[0]), j)
            return inner if j in self._points else g.sum(inner)
        if n.op is Op.BRANCH:
            c, a, b = n.args
            return g.branch(c, self._total(a, j), self._total(b, j))
        result = g.zero
        for a, p in self._chain(n):
            result = _plus(g, result, guarded(g, p, self._total(a, j)))
        return result

    def _below(self, n: Node, level: int) -> dict[Node, Node]:
        """Derivatives of a named value with respect to what lies below it."""
        return dict(self.given[n]) if n in self.given else self.local(n.args[0], level)

    def _over(self, local: Mapping[Node, Node], j: int) -> Node:
        """Chain rule over the waist: sum of d n/d z times d z/d(direction)."""
        result = self.g.zero
        for z, p in local.items():
            if j in self._points and not z.varying and self._total(z, j) is not self.g.zero:
                raise DifferentiationError(
                    "a value summed over points may not enter a sum again when it depends on an "
                    "interpolated unknown"
                )
            result = _plus(self.g, result, guarded(self.g, p, self._total(z, j)))
        return result

    def _chain(self, n: Node) -> Partials:
        pairs = list(self.given[n].items()) if n in self.given else partials(self.g, n)
        return [(a, p) for a, p in pairs if self._depends(a)]

    def local(self, n: Node, level: int = 0) -> dict[Node, Node]:
        """Derivatives of a value at the point with respect to the waist `level` and those below."""
        for m in reachable([n], stop=lambda m: self._ends(m, level)):
            if (m, level) not in self._locals:
                self._locals[m, level] = self._compute_local(m, level)
        return self._locals[n, level]

    def _ends(self, n: Node, level: int) -> bool:
        gate = self.gates.get(n, 0) > level
        return (n, level) in self._locals or gate or self._is_key(n, level)

    def _is_key(self, n: Node, level: int) -> bool:
        waist = self._level.get(n)
        return not n.varying or n in self.directions or (waist is not None and waist <= level)

    def _compute_local(self, n: Node, level: int) -> dict[Node, Node]:
        g = self.g
        if not self._depends(n):
            return {}
        if self._is_key(n, level):
            return {n: g.one}
        gate = self.gates.get(n, 0)
        if gate > level:
            return self._mirrored(n, self._lowered(self.local(n, gate), level), level)
        if n.op is Op.BRANCH:
            c, a, b = n.args
            keys = _merged(self.local(a, level), self.local(b, level))
            return {
                z: g.branch(
                    c, self.local(a, level).get(z, g.zero), self.local(b, level).get(z, g.zero)
                )
                for z in keys
            }
        pairs = [(p, self.local(a, level)) for a, p in self._chain(n)]
        return self._mirrored(n, self._combined(pairs), level)

    def _lowered(self, above: Mapping[Node, Node], level: int) -> dict[Node, Node]:
        """Derivatives with respect to an upper waist carried down to the waist `level`."""
        pairs = []
        for z, p in above.items():
            down = {z: self.g.one} if self._is_key(z, level) else self._below(z, level)
            pairs.append((p, down))
        return self._combined(pairs)

    def _combined(self, pairs: Iterable[tuple[Node, Mapping[Node, Node]]]) -> dict[Node, Node]:
        result: dict[Node, Node] = {}
        for p, derivatives in pairs:
            for z, q in derivatives.items():
                term = guarded(self.g, p, q)
                result[z] = _plus(self.g, result[z], term) if z in result else term
        return result

    def _mirrored(self, n: Node, result: dict[Node, Node], level: int) -> dict[Node, Node]:
        """Schwarz: d(dW/dz_k)/dz_l is d(dW/dz_l)/dz_k, taken for the earlier of the two."""
        own = self.symmetric.get(n)
        if own is None or self._level.get(own) != level:
            return result
        for z in list(result):
            other = self._adjoint_of.get(z)
            peers = self._level.get(z) == level and z.id < own.id
            if other is not None and peers and self._depends(other):
                result[z] = self.local(other, level).get(own, self.g.zero)
        return result


def directional(
    g: Graph, roots: Sequence[Node], seeds: Mapping[Node, Node], given: Given | None = None
) -> list[Node]:
    """Derivatives of `roots` when each key of `seeds` moves at the rate of its value (forward)."""
    depends = Dependence(tuple(seeds), (), given or {})
    rate: dict[Node, Node] = {}
    for n in reachable([*roots, *(k for pairs in depends.given.values() for k in pairs)]):
        if n in seeds:
            rate[n] = seeds[n]
        elif not depends(n):
            rate[n] = g.zero
        elif n.op is Op.SUM:
            rate[n] = g.sum(rate[n.args[0]])
        elif n.op is Op.BRANCH:
            rate[n] = g.branch(n.args[0], rate[n.args[1]], rate[n.args[2]])
        else:
            rate[n] = g.zero
            pairs = list(depends.given[n].items()) if n in depends.given else partials(g, n)
            for a, p in pairs:
                rate[n] = _plus(g, rate[n], guarded(g, p, rate[a]))
    return [rate[r] for r in roots]


def guarded(g: Graph, a: Node, b: Node) -> Node:
    """Product that goes inside a branch with a zero side: what is not taken is never evaluated."""
    for x, y in ((a, b), (b, a)):
        if x.op is Op.NEG and x.args[0].op is Op.BRANCH:
            return g.neg(guarded(g, x.args[0], y))
        if x.op is Op.BRANCH and g.zero in x.args[1:]:
            c, then, otherwise = x.args
            return g.branch(c, guarded(g, then, y), guarded(g, otherwise, y))
    return g.mul(a, b)


def _plus(g: Graph, a: Node, b: Node) -> Node:
    """Sum that joins two branches with a zero on the same side of the same condition."""
    if a.op is Op.BRANCH and b.op is Op.BRANCH and a.args[0] is b.args[0]:
        for k in (1, 2):
            if a.args[k] is g.zero and b.args[k] is g.zero:
                return g.branch(
                    a.args[0], _plus(g, a.args[1], b.args[1]), _plus(g, a.args[2], b.args[2])
                )
    return g.add(a, b)


def _merged(a: Mapping[Node, Node], b: Mapping[Node, Node]) -> list[Node]:
    return [*a, *(k for k in b if k not in a)]
