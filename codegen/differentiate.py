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

from codegen.graph import BOOLEAN, Graph, Node, Op, reachable

Partials = list[tuple[Node, Node]]
Given = Mapping[Node, Mapping[Node, Node]]


class DifferentiationError(ValueError):
    """The model asks for a derivative that has no meaning in a kernel."""


def partials(g: Graph, n: Node) -> Partials:
    """Local derivatives of `n` with respect to its operands (not for BRANCH and SUM)."""
    if not n.args or n.op in BOOLEAN:
        return []
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
        case Op.LOG:
            return g.recip(a)
        case Op.EXP:
            return n
        case Op.SIN:
            return g.call(Op.COS, a)
        case Op.COS:
            return g.neg(g.call(Op.SIN, a))
        case _:
            raise DifferentiationError(f"no derivative rule for {n.op}")


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
) -> dict[Node, Node]:
    """Adjoints of every node on the way from `wrt` to the scalar `root` (reverse mode).

    For a node that varies with the quadrature point the adjoint is that of the summand: it is
    to be contracted with the node's own dependence and summed by the caller.
    """
    sweep = _Reverse(g, Dependence(tuple(wrt), constant, given or {}))
    adjoint = sweep.run(root)
    return {**dict.fromkeys(wrt, g.zero), **adjoint}


@dataclass
class _Reverse:
    g: Graph
    depends: Dependence
    flat: bool = False
    stop: Collection[Node] = ()
    adjoint: dict[Node, Node] = field(default_factory=dict)
    summands: dict[Node, Node] = field(default_factory=dict)

    def run(self, root: Node) -> dict[Node, Node]:
        self.adjoint[root] = self.g.one
        for n in reversed(reachable([root])):
            if not self.depends(n):
                continue
            if n in self.summands:
                self._accumulate(self.adjoint, n, self.g.sum(self.summands.pop(n)))
            seed = self.adjoint.get(n)
            if seed is not None and n not in self.stop and n not in self.depends.sources:
                self._propagate(n, seed)
        return self.adjoint

    def _propagate(self, n: Node, seed: Node) -> None:
        if n.op is Op.SUM:
            self._accumulate(self.adjoint, n.args[0], seed)
            return
        for a, p in self._local(n):
            if self.depends(a):
                into = self.summands if n.varying > a.varying and not self.flat else self.adjoint
                self._accumulate(into, a, self.g.mul(seed, p))

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
            return m is not n and (m.op in (Op.NAME, Op.INPUT, Op.SUM) or m in self.stop)

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
        into[n] = self.g.add(into[n], value) if n in into else value


@dataclass
class Linearisation:
    """Forward derivatives with respect to `directions`, through the nodes of `waist`.

    `symmetric` maps the adjoint of a waist node (of one and the same potential) to that node:
    mixed second derivatives are then taken once.
    """

    g: Graph
    directions: Sequence[Node]
    waist: Collection[Node] = ()
    symmetric: Mapping[Node, Node] = field(default_factory=dict)
    constant: Collection[Node] = ()
    given: Given = field(default_factory=dict)
    _totals: dict[tuple[Node, int], Node] = field(default_factory=dict)
    _locals: dict[Node, dict[Node, Node]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._depends = Dependence(tuple(self.directions), self.constant, self.given)
        self._adjoint_of = {z: a for a, z in self.symmetric.items()}
        self._points = [j for j, d in enumerate(self.directions) if d.varying]

    def derivative(self, n: Node, j: int) -> Node:
        """dn/d(direction j).  Varies when `n` or the direction does (then: of the summand)."""
        if n.varying and n not in self.waist:
            return self._lift(n, j)
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
            return self._over(self._below(n), j)
        if n.op is Op.SUM:
            inner = self._lift(n.args[0], j)
            return inner if j in self._points else g.sum(inner)
        if n.op is Op.BRANCH:
            c, a, b = n.args
            return g.branch(c, self._total(a, j), self._total(b, j))
        result = g.zero
        for a, p in self._chain(n):
            result = g.add(result, g.mul(p, self._total(a, j)))
        return result

    def _lift(self, n: Node, j: int) -> Node:
        """Chain rule over the waist: sum of d n/d z times d z/d(direction)."""
        return self._over(self.local(n), j)

    def _below(self, n: Node) -> dict[Node, Node]:
        if n in self.given:
            return dict(self.given[n])
        return self.local(n.args[0])

    def _over(self, local: Mapping[Node, Node], j: int) -> Node:
        result = self.g.zero
        for z, p in local.items():
            if j in self._points and not z.varying and self._total(z, j) is not self.g.zero:
                raise DifferentiationError(
                    "a value summed over points may not enter a sum again when it depends on an "
                    "interpolated unknown"
                )
            result = self.g.add(result, self.g.mul(p, self._total(z, j)))
        return result

    def _chain(self, n: Node) -> Partials:
        pairs = list(self.given[n].items()) if n in self.given else partials(self.g, n)
        return [(a, p) for a, p in pairs if self._depends(a)]

    def local(self, n: Node) -> dict[Node, Node]:
        """Derivatives of a value at the point with respect to the waist below it."""
        if n in self._locals:
            return self._locals[n]
        for m in reachable([n], stop=self._is_known):
            if m not in self._locals:
                self._locals[m] = self._compute_local(m)
        return self._locals[n]

    def _is_known(self, n: Node) -> bool:
        return n in self._locals or n in self.waist or not n.varying

    def _compute_local(self, n: Node) -> dict[Node, Node]:
        g = self.g
        if not self._depends(n):
            return {}
        if n in self.waist or n in self.directions or not n.varying:
            return {n: g.one}
        if n.op is Op.BRANCH:
            c, a, b = n.args
            keys = _merged(self.local(a), self.local(b))
            return {
                z: g.branch(c, self.local(a).get(z, g.zero), self.local(b).get(z, g.zero))
                for z in keys
            }
        result: dict[Node, Node] = {}
        for a, p in self._chain(n):
            for z, q in self.local(a).items():
                term = g.mul(p, q)
                result[z] = g.add(result[z], term) if z in result else term
        return self._mirrored(n, result)

    def _mirrored(self, n: Node, result: dict[Node, Node]) -> dict[Node, Node]:
        """Schwarz: d(dW/dz_k)/dz_l is d(dW/dz_l)/dz_k, taken for the earlier of the two."""
        own = self.symmetric.get(n)
        if own is None:
            return result
        for z in list(result):
            other = self._adjoint_of.get(z)
            if other is not None and z.id < own.id and self._same_potential(other):
                result[z] = self.local(other).get(own, self.g.zero)
        return result

    def _same_potential(self, adjoint: Node) -> bool:
        return self.symmetric.get(adjoint) is not None and self._depends(adjoint)


def _merged(a: Mapping[Node, Node], b: Mapping[Node, Node]) -> list[Node]:
    return [*a, *(k for k in b if k not in a)]
