"""Search for linear interfaces: the few values through which a potential depends on its unknowns.

Element unknowns enter an energy through linear forms (displacement gradients).  A form is
expanded, exactly, into

    z = z_0 + sum over g of  geometry_g * y_g,      y_g = sum over k of  parent_gk(xi) * m_k,

where the *modal coordinates* m_k are combinations of the nodal unknowns with constant
coefficients (found, not chosen: for the 4-node quadrilateral they are the Walsh-Hadamard modes),
`parent` holds polynomials in the coordinates of the quadrature point, and `geometry` what depends
on the shape of the element.  Derivatives are taken with respect to the y_g, of which there are
few, and carried to the unknowns by constant coefficients (the two-level chain rule).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from softehl.codegen.graph.graph import Graph, InputEntry, Node, Op
from softehl.codegen.graph.polynomial import Monomial, Polynomial, added, product, value
from softehl.codegen.graph.traversal import reachable

Vector = tuple[tuple[int, Fraction], ...]
"""A sparse constant vector over sources: (id of the source, coefficient), ids ascending."""

LINEAR = frozenset({Op.ADD, Op.SUB, Op.NEG, Op.MUL})
LIMIT = 64
"""Longest polynomial that is expanded; a longer one stays what it is."""


def degrees(roots: Iterable[Node], sources: Collection[Node]) -> dict[Node, int]:
    """0: independent of `sources`, 1: affine in them, 2: anything else."""
    degree: dict[Node, int] = {}
    sources = frozenset(sources)
    for n in reachable(roots):
        inner = [degree[a] for a in n.args]
        if n in sources:
            degree[n] = 1
        elif not any(inner):
            degree[n] = 0
        elif n.op in (Op.ADD, Op.SUB, Op.NEG):
            degree[n] = max(inner)
        elif n.op is Op.MUL:
            degree[n] = min(2, sum(inner))
        else:
            degree[n] = 2
    return degree


def forms(roots: Sequence[Node], degree: Mapping[Node, int]) -> list[Node]:
    """Affine values that something not affine uses: the linear interface, ids ascending."""
    out: dict[Node, None] = {}
    for n in reachable(roots):
        if degree[n] == 2:
            out.update(dict.fromkeys(a for a in n.args if degree[a] == 1))
    out.update(dict.fromkeys(r for r in roots if degree[r] == 1))
    return sorted(out, key=lambda n: n.id)


def _parent(n: Node) -> bool:
    return isinstance(n.payload, InputEntry) and n.payload.array == "rule"


@dataclass
class _Expansion:
    """Exact expansion of one form in the sources."""

    nodes: dict[int, Node]
    degree: Mapping[Node, int]
    atoms: Collection[Node] = ()
    memo: dict[Node, Polynomial] = field(default_factory=dict)
    pure: dict[Node, bool] = field(default_factory=dict)

    def linear(self, form: Node) -> dict[int | None, Polynomial]:
        """Coefficients by source id; None holds the constant part."""
        coefficients: dict[Node, dict[int | None, Polynomial]] = {}
        for n in reachable([form], stop=lambda n: self.degree[n] == 0 or n.op is Op.NAME):
            coefficients[n] = self._linear(n, coefficients)
        return coefficients[form]

    def _linear(
        self, n: Node, coefficients: Mapping[Node, dict[int | None, Polynomial]]
    ) -> dict[int | None, Polynomial]:
        if self.degree[n] == 0:
            return {None: self.polynomial(n)}
        match n.op:
            case Op.INPUT | Op.NAME:
                return {n.id: {(): Fraction(1)}}
            case Op.NEG:
                return _combined(coefficients[n.args[0]], {}, -1, -1)
            case Op.ADD | Op.SUB:
                a, b = (coefficients[x] for x in n.args)
                return _combined(a, b, 1, 1 if n.op is Op.ADD else -1)
        factor, inner = n.args if self.degree[n.args[0]] == 0 else tuple(reversed(n.args))
        p = self.polynomial(factor)
        return {k: product(p, q) for k, q in coefficients[inner].items()}

    def polynomial(self, n: Node) -> Polynomial:
        """A value of degree 0 as a polynomial in atoms."""
        if n not in self.memo:
            for m in reachable([n], stop=lambda m: m in self.memo or self._atom(m)):
                if m not in self.memo:
                    self.memo[m] = self._polynomial(m)
        return self.memo[n]

    def _atom(self, n: Node) -> bool:
        return n.op not in LINEAR or (n in self.atoms and not self._is_pure(n))

    def _polynomial(self, n: Node) -> Polynomial:
        self.nodes[n.id] = n
        if n.op is Op.CONST:
            return {(): n.value}
        if self._atom(n):
            return {(n.id,): Fraction(1)}
        args = [self.memo[a] for a in n.args]
        if n.op is Op.MUL:
            out = product(args[0], args[1])
        else:
            sign = -1 if n.op in (Op.SUB, Op.NEG) else 1
            first, second = (args[0], args[1]) if len(args) == 2 else ({}, args[0])
            out = added(first, second, sign)
        return out if len(out) <= LIMIT else {(n.id,): Fraction(1)}

    def _is_pure(self, n: Node) -> bool:
        if n not in self.pure:
            for m in reachable([n], stop=self.pure.__contains__):
                linear = bool(m.args) and m.op in LINEAR
                self.pure[m] = (
                    m.op is Op.CONST or _parent(m) or (linear and all(self.pure[a] for a in m.args))
                )
        return self.pure[n]


def _combined(
    a: dict[int | None, Polynomial], b: dict[int | None, Polynomial], sa: int, sb: int
) -> dict[int | None, Polynomial]:
    keys = [*a, *(k for k in b if k not in a)]
    scaled = a if sa > 0 else {k: added({}, p, sa) for k, p in a.items()}
    return {k: added(scaled.get(k, {}), b.get(k, {}), sb) for k in keys}


def _common_factors(n: Node, degree: Mapping[Node, int]) -> set[Node]:
    """Values of degree 0 that multiply *every* source of the form `n`: never taken apart."""
    sources: dict[Node, frozenset[int]] = {}
    for m in reachable([n], stop=lambda m: degree[m] == 0 or m.op is Op.NAME):
        if degree[m] == 1:
            leaf = not m.args or m.op is Op.NAME
            inner = [sources[a] for a in m.args if degree[a] == 1]
            sources[m] = frozenset([m.id]) if leaf else frozenset().union(*inner)
    multiplied: dict[Node, frozenset[int]] = {}
    for m in sources:
        if m.op is Op.MUL:
            a, b = m.args if degree[m.args[0]] == 0 else tuple(reversed(m.args))
            for value in reachable([a]):
                multiplied[value] = multiplied.get(value, frozenset()) | sources[b]
    return {m for m, by in multiplied.items() if by == sources[n]}


@dataclass(frozen=True)
class LinearInterface:
    """Result of the search.

    `rewritten` maps each linear form to its expanded self, in terms of the `point` interface (y_g,
    varying or not); `modes` are the modal coordinates and `matrix` their exact coefficients.
    """

    rewritten: dict[Node, Node]
    point: tuple[Node, ...]
    modes: tuple[Node, ...]
    matrix: tuple[Vector, ...]


def linear_interface(
    g: Graph, roots: Sequence[Node], sources: Sequence[Node]
) -> LinearInterface | None:
    """Expand every linear form below `roots`; None where nothing is gained."""
    degree = degrees(roots, sources)
    expanded = _Forms(g, degree)
    linear = forms(roots, degree)
    rewritten = {z: expanded.rewrite(z) for z in linear}
    if len(expanded.modes) > len(sources):
        return None
    if sum(y.varying for y in expanded.point.values()) > sum(z.varying for z in linear):
        wide = _Forms(g, degree, by_mode=True)
        rewritten = {z: wide.rewrite(z) for z in linear}
        return LinearInterface(rewritten, (), tuple(wide.modes.values()), tuple(wide.modes))
    return LinearInterface(
        rewritten,
        tuple(expanded.point.values()),
        tuple(expanded.modes.values()),
        tuple(expanded.modes),
    )


@dataclass
class _Forms:
    g: Graph
    degree: Mapping[Node, int]
    by_mode: bool = False
    nodes: dict[int, Node] = field(default_factory=dict)
    modes: dict[Vector, Node] = field(default_factory=dict)
    point: dict[tuple[tuple[Monomial, int, Fraction], ...], Node] = field(default_factory=dict)

    def rewrite(self, z: Node) -> Node:
        g = self.g
        e = _Expansion(self.nodes, self.degree, _common_factors(z, self.degree))
        linear = e.linear(z)
        for n in reachable([z]):
            self.nodes[n.id] = n
        groups = self._groups(linear)
        result = self._value(linear.get(None, {}))
        if self.by_mode:
            for mode, coefficient in self._by_mode(groups).items():
                result = g.add(result, g.mul(self._value(coefficient), mode))
            return result
        for geometry, columns in groups.items():
            y, scale = self._point_value(columns)
            term = g.mul(self._value({geometry: scale}), y)
            result = g.add(result, term)
        return result

    def _groups(
        self, linear: dict[int | None, Polynomial]
    ) -> dict[Monomial, dict[Monomial, dict[int, Fraction]]]:
        """[geometry part][parent part] -> constant vector over the sources."""
        groups: dict[Monomial, dict[Monomial, dict[int, Fraction]]] = {}
        for source in sorted(k for k in linear if k is not None):
            for monomial, c in linear[source].items():
                parent = tuple(i for i in monomial if _parent(self.nodes[i]))
                geometry = tuple(i for i in monomial if not _parent(self.nodes[i]))
                groups.setdefault(geometry, {}).setdefault(parent, {})[source] = c
        return groups

    def _by_mode(
        self, groups: dict[Monomial, dict[Monomial, dict[int, Fraction]]]
    ) -> dict[Node, Polynomial]:
        out: dict[Node, Polynomial] = {}
        for geometry, columns in groups.items():
            for parent, vector in columns.items():
                mode, factor = self._mode(vector)
                term = {tuple(sorted((*geometry, *parent))): factor}
                out[mode] = added(out.get(mode, {}), term, 1)
        return out

    def _point_value(self, columns: dict[Monomial, dict[int, Fraction]]) -> tuple[Node, Fraction]:
        """The interface value of one geometry group and the factor in front of it."""
        terms = []
        for parent in sorted(columns, key=lambda p: (len(p), p)):
            mode, factor = self._mode(columns[parent])
            terms.append((parent, mode.id, factor))
        lead = terms[0][2]
        key = tuple((p, m, f / lead) for p, m, f in terms)
        if key not in self.point:
            value = self.g.zero
            for p, m, f in key:
                value = self.g.add(value, self.g.mul(self._value({p: f}), self.nodes[m]))
            self.point[key] = self.g.name(f"y{len(self.point)}", value)
        return self.point[key], lead

    def _mode(self, vector: dict[int, Fraction]) -> tuple[Node, Fraction]:
        """Modal coordinate of a constant vector: an existing one up to a factor, or a new one."""
        items = sorted(vector.items())
        lead = items[0][1]
        key = tuple((s, c / lead) for s, c in items)
        if key not in self.modes:
            value = self.g.zero
            for s, c in key:
                value = self.g.add(value, self.g.mul(self.g.const(c), self.nodes[s]))
            mode = value if len(key) == 1 else self.g.name(f"m{len(self.modes)}", value)
            self.modes[key] = mode
        mode = self.modes[key]
        self.nodes[mode.id] = mode
        return mode, lead

    def _value(self, p: Polynomial) -> Node:
        """A polynomial in atoms as a node."""
        return value(self.g, p, self.nodes, order=lambda i: (self.nodes[i].varying, i))
