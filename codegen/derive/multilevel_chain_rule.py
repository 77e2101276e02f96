"""Forward derivatives through interfaces: the chain rule in two or more levels.

Values at a quadrature point are differentiated with respect to the few intermediates (the
*interface*: strains, film thickness, ...) through which they depend on the unknowns, and the chain
rule is closed with the derivatives of those.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from softehl.codegen.graph.differentiation import Dependence, PrescribedDerivatives
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.guarded_products import Certain, guarded, plus, shielded
from softehl.codegen.graph.length_derivatives import square_of
from softehl.codegen.graph.partial_derivatives import DifferentiationError, Partials, partials
from softehl.codegen.graph.traversal import Recursion, reachable, recursion


@dataclass
class Linearisation:
    """Forward derivatives with respect to `directions`, through the nodes of `interface`.

    `symmetric` maps the adjoint of an interface node (of one and the same potential) to that node:
    mixed second derivatives are then taken once.  `upper` holds further interfaces above the
    first, lowest first; `gates` maps the adjoint of a node of `upper` to the number of its
    interface (1, 2, ...): such a value is differentiated with respect to that interface and the
    chain rule then leads down, so that no more derivatives are taken than it has values.  `certain`
    are values that every side of branches needs.
    """

    g: Graph
    directions: Sequence[Node]
    interface: Collection[Node] = ()
    symmetric: Mapping[Node, Node] = field(default_factory=dict)
    constant: Collection[Node] = ()
    prescribed: PrescribedDerivatives = field(default_factory=dict)
    upper: Sequence[Collection[Node]] = ()
    gates: Mapping[Node, int] = field(default_factory=dict)
    certain: Certain = field(default_factory=Certain)
    _totals: dict[tuple[Node, int], Node] = field(default_factory=dict)
    _locals: dict[tuple[Node, int], dict[Node, Node]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._depends = Dependence(tuple(self.directions), self.constant, self.prescribed)
        self._adjoint_of = {z: a for a, z in self.symmetric.items()}
        self._points = [j for j, d in enumerate(self.directions) if d.varying]
        self._interface, self._ends_in = frozenset(self.interface), frozenset(self.directions)
        self._level = {n: k for k, w in enumerate((self.interface, *self.upper)) for n in w}

    def derivative(self, n: Node, j: int) -> Node:
        """dn/d(direction j).  Varies when `n` or the direction does (then: of the summand)."""
        if n.varying and n not in self._interface:
            return recursion(self._over(self.local(n), j))
        return recursion(self._total(n, j))

    def _total(self, n: Node, j: int) -> Recursion[Node]:
        if n is self.directions[j]:
            return self.g.one
        if not self._depends(n) or n in self._ends_in:
            return self.g.zero
        key = (n, j)
        if key not in self._totals:
            self._totals[key] = yield self._compute_total(n, j)
        return self._totals[key]

    def _compute_total(self, n: Node, j: int) -> Recursion[Node]:
        g = self.g
        if n.varying:  # an interface node: through the next interface below it
            return (yield self._over(self._below(n, 0), j))
        if n.op is Op.SUM:
            inner = yield self._over(self.local(n.args[0]), j)
            return inner if j in self._points else g.sum(inner)
        if n.op is Op.BRANCH and square_of(n) is None:
            c, a, b = n.args
            return g.branch(c, (yield self._total(a, j)), (yield self._total(b, j)))
        result = g.zero
        for a, p in self._chain(n):
            result = plus(g, result, guarded(g, p, (yield self._total(a, j))))
        return result

    def _below(self, n: Node, level: int) -> dict[Node, Node]:
        """Derivatives of a named value with respect to what lies below it."""
        return dict(self.prescribed[n]) if n in self.prescribed else self.local(n.args[0], level)

    def _over(self, local: Mapping[Node, Node], j: int) -> Recursion[Node]:
        """Chain rule over the interface: sum of d n/d z times d z/d(direction)."""
        result = self.g.zero
        for z, p in local.items():
            slope = yield self._total(z, j)
            if j in self._points and not z.varying and slope is not self.g.zero:
                raise DifferentiationError(
                    "a value summed over points may not enter a sum again when it depends on an "
                    "interpolated unknown"
                )
            # a value that does not vary may stand inside branches in the loop over the points
            if z.varying or z in self.certain.nodes:
                term = guarded(self.g, p, slope)
            else:
                term = shielded(self.g, p, slope, self.certain)
            result = plus(self.g, result, term)
        return result

    def _chain(self, n: Node) -> Partials:
        pairs = list(self.prescribed[n].items()) if n in self.prescribed else partials(self.g, n)
        return [(a, p) for a, p in pairs if self._depends(a)]

    def local(self, n: Node, level: int = 0) -> dict[Node, Node]:
        """Derivatives of a value at the point by the interface `level` and those below."""
        for m in reachable([n], stop=lambda m: self._stops(m, level)):
            if (m, level) not in self._locals:
                self._locals[m, level] = self._compute_local(m, level)
        return self._locals[n, level]

    def _stops(self, n: Node, level: int) -> bool:
        gate = self.gates.get(n, 0) > level
        return (n, level) in self._locals or gate or self._is_key(n, level)

    def _is_key(self, n: Node, level: int) -> bool:
        node_level = self._level.get(n)
        return (
            not n.varying or n in self._ends_in or (node_level is not None and node_level <= level)
        )

    def _compute_local(self, n: Node, level: int) -> dict[Node, Node]:
        g = self.g
        if not self._depends(n):
            return {}
        if self._is_key(n, level):
            return {n: g.one}
        gate = self.gates.get(n, 0)
        if gate > level:
            return self._mirrored(n, self._lowered(self.local(n, gate), level), level)
        if n.op is Op.BRANCH and square_of(n) is None:
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
        """Derivatives with respect to an upper interface carried down to the interface `level`."""
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
                result[z] = plus(self.g, result[z], term) if z in result else term
        return result

    def _mirrored(self, n: Node, result: dict[Node, Node], level: int) -> dict[Node, Node]:
        """Schwarz: d(dW/dz_k)/dz_l is d(dW/dz_l)/dz_k, taken for the earlier of the two."""
        mirror = self.symmetric.get(n)
        if mirror is None or self._level.get(mirror) != level:
            return result
        for z in list(result):
            other = self._adjoint_of.get(z)
            peers = self._level.get(z) == level and z.id < mirror.id
            if other is not None and peers and self._depends(other):
                result[z] = self.local(other, level).get(mirror, self.g.zero)
        return result


def _merged(a: Mapping[Node, Node], b: Mapping[Node, Node]) -> list[Node]:
    return [*a, *(k for k in b if k not in a)]
