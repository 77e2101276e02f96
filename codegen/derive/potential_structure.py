"""Structure of a potential: linear forms of its unknowns, and quadratic values of these.

Between the linear forms (displacement gradients) and the energy stand polynomials: strain
measures, traces, minors, determinants.  `through_invariants` finds a small set of quadratic values
of which all these polynomials are polynomials again.  The axisymmetric second invariant, written as
(I1^2 - tr B^2)/2 with four entries of B, is found to be d^2 + t^2 s, where s is the sum of the
squares in the plane, d the minor there and t the hoop stretch.
"""

from __future__ import annotations

import functools
import operator
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import combinations, combinations_with_replacement

from sympy import QQ
from sympy.polys.matrices import DomainMatrix

from softehl.codegen.derive.linear_interfaces import LinearInterface, linear_interface
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.polynomial import Monomial, Polynomial, added, product, value
from softehl.codegen.graph.traversal import (
    Recursion,
    always,
    reachable,
    recursion,
    strip,
    substitute,
)
from softehl.codegen.graph.value_domain import WHOLE
from softehl.codegen.language.definition import Definition

_Shape = tuple[tuple[Monomial, Fraction], ...]
"""A polynomial with 1 as its first coefficient: hashable, and equal for multiples."""

LONGEST = 128
"""Terms of the longest polynomial that is looked at."""
EXTRA = 2
"""Values that are tried beside the indispensable ones."""
ABOVE = float("inf")


def degrees(
    roots: Sequence[Node], linear: Collection[Node], constant: Collection[Node]
) -> dict[Node, float]:
    """Degree of every value below `roots` as a polynomial in `linear`; inf: it is not one."""
    degree: dict[Node, float] = {}
    linear, constant = frozenset(linear), frozenset(constant)
    for n in reachable(roots):
        inner = [degree[a] for a in n.args]
        if n in linear:
            degree[n] = 1
        elif n in constant or not any(inner):
            degree[n] = 0
        elif n.op in (Op.ADD, Op.SUB, Op.NEG):
            degree[n] = max(inner)
        elif n.op is Op.MUL:
            degree[n] = sum(inner)
        elif n.op is Op.POW and _positive_exponent(n) > 0:
            degree[n] = _positive_exponent(n) * inner[0]
        else:
            degree[n] = ABOVE
    return degree


def _positive_exponent(power: Node) -> int:
    """Exponent of a power if that is a positive integer, else 0."""
    e = power.payload if power.op is Op.POW else None
    return int(e) if isinstance(e, Fraction) and e.denominator == 1 and e > 0 else 0


def quadratic_interface(
    roots: Sequence[Node], linear: Collection[Node], constant: Collection[Node]
) -> list[Node]:
    """Quadratic values of the forms `linear` that something of higher degree uses.

    Strain measures (the entries of F F^T, minors of F) are such values: their own second
    derivatives are constants, and what lies above them sees few of them.  Of two values where
    one depends on the other, the lower one is taken.
    """
    degree = degrees(roots, linear, constant)
    frontier: dict[Node, None] = {}
    for n in reachable(roots):
        if degree[n] > 2 and n not in constant:
            frontier.update(dict.fromkeys(a for a in n.args if degree[a] == 2))
    return [
        n
        for n in sorted(frontier, key=lambda n: n.id)
        if not any(m is not n and m in frontier for m in reachable(n.args))
    ]


@dataclass(frozen=True)
class Reduced:
    """Rewritten roots and the named quadratic values through which they see the forms."""

    roots: list[Node]
    images: Mapping[Node, Node]
    squares: tuple[Node, ...]


def through_invariants(
    g: Graph, roots: Sequence[Node], linear: Collection[Node], constant: Collection[Node]
) -> Reduced | None:
    """`roots` through as few quadratic values as suffice; None where none can be saved."""
    search = _Search(g, degrees(roots, linear, constant), frozenset(linear))
    reduction = search.run(search.targets(roots))
    if reduction is None:
        return None
    recipes, terms, squares = reduction
    new: dict[Node, Node] = {}
    rebuilt: dict[int, Node] = {}
    for n in reachable(roots):
        if n in recipes:
            new[n] = recipes[n].cook(g, terms, rebuilt)
        else:
            new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
        rebuilt[n.id] = new[n]
    return Reduced([new[r] for r in roots], new, squares)


@dataclass(frozen=True)
class _Quadratic:
    """`scale` times the constants of all terms times a `shape`, which starts with 1."""

    constants: Monomial
    scale: Fraction
    shape: _Shape


@dataclass(frozen=True)
class _Recipe:
    """A polynomial again: constants and scale of `part`, times the sum over `row` of terms."""

    part: _Quadratic
    row: Mapping[tuple[int, ...], Fraction]

    def cook(self, g: Graph, terms: Sequence[Node], rebuilt: Mapping[int, Node]) -> Node:
        """The value over the new `terms`, with the constants as `rebuilt` by their old ids."""
        total = value(g, self.row, terms)
        factor = value(g, {self.part.constants: self.part.scale}, rebuilt)
        return g.mul(factor, total)


@dataclass
class _Search:
    g: Graph
    degree: Mapping[Node, float]
    forms: frozenset[Node]
    memo: dict[Node, Polynomial | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._ids = {f.id for f in self.forms}
        self._nodes = {f.id: f for f in self.forms}

    def targets(self, roots: Sequence[Node]) -> list[Node]:
        """Polynomials that a value of another kind uses, or that are roots themselves."""
        out = {r: None for r in roots if 1 < self.degree[r] < ABOVE}
        for n in reachable(roots):
            if self.degree[n] == ABOVE:
                out.update({a: None for a in n.args if 1 < self.degree[a] < ABOVE})
        return list(out)

    def run(
        self, targets: Sequence[Node]
    ) -> tuple[dict[Node, _Recipe], list[Node], tuple[Node, ...]] | None:
        """Recipe of each polynomial from its terms, and the named quadratic terms."""
        solved = [t for t in targets if self.degree[t] in (2, 4)]
        parts = [p for p in map(self.split, solved) if p is not None]
        fixed, direct = self._indispensable([t for t in targets if t not in solved])
        if (
            len(parts) < len(solved)
            or fixed is None
            or not any(self.degree[t] == 4 for t in solved)
        ):
            return None
        base = list(dict.fromkeys(q.shape for q in fixed.values()))
        squared = [(((f.id, f.id), Fraction(1)),) for f in sorted(direct, key=lambda n: n.id)]
        for extra in self._choices(solved, squared, base):
            basis = [*base, *extra]
            if len(basis) >= self._used(targets):
                return None
            rows = [
                _represent(dict(p.shape), 1 if self.degree[t] == 2 else 2, [*basis, *squared])
                for t, p in zip(solved, parts, strict=True)
            ]
            solutions = [row for row in rows if row is not None]
            if len(solutions) == len(parts):
                break
        else:
            return None
        recipes = {t: _Recipe(p, row) for t, p, row in zip(solved, parts, solutions, strict=True)}
        unit = Fraction(1)
        recipes |= {n: _Recipe(q, {(basis.index(q.shape),): unit}) for n, q in fixed.items()}
        inside = {self._nodes[i] for shape in basis for m, _ in shape for i in m}
        if not recipes.keys().isdisjoint(reachable(inside - self.forms)):
            return None
        terms = [value(self.g, dict(s), self._nodes) for s in [*basis, *squared]]
        terms = [self.g.name(f"q{k}", t) if k < len(basis) else t for k, t in enumerate(terms)]
        return recipes, terms, tuple(terms[: len(basis)])

    def _indispensable(
        self, targets: Sequence[Node]
    ) -> tuple[dict[Node, _Quadratic] | None, set[Node]]:
        """Quadratic values (None: some cannot be split) and forms in products of other degrees."""
        quadratic: dict[Node, _Quadratic] = {}
        direct: set[int] = set()
        for n in reachable(targets, stop=lambda n: self.degree[n] <= 2):
            q = self.split(n) if self.degree[n] == 2 else None
            if self.degree[n] == 1 or (q is not None and len(q.shape) == 1):
                direct.update(i for m in self.polynomial(n) or {} for i in m)
            elif q is not None:
                quadratic[n] = q
            elif self.degree[n] == 2:
                return None, set()
        return quadratic, {f for f in self.forms if f.id in direct}

    def _used(self, targets: Sequence[Node]) -> int:
        """Number of different quadratic values in the targets before the rewrite."""
        inner = reachable(targets, stop=lambda n: self.degree[n] <= 2)
        parts = [self.split(n) for n in inner if self.degree[n] == 2]
        return len({p.shape for p in parts if p is not None and len(p.shape) > 1})

    def _choices(
        self, solved: Sequence[Node], squared: Sequence[_Shape], base: Sequence[_Shape]
    ) -> Iterator[tuple[_Shape, ...]]:
        """Sets of further quadratic values to try: few before many, short before long."""
        pool: dict[_Shape, None] = {}
        hidden = {s[0][0] for s in squared}
        for n in reachable(solved):
            q = self.split(n) if self.degree[n] == 2 else None
            if q is not None:
                pool[q.shape] = None
                pool[_normalised({m: c for m, c in q.shape if m not in hidden})[1]] = None
        short = sorted((s for s in pool if s and s not in base), key=lambda s: (len(s), s))
        for count in range(EXTRA + 1):
            yield from combinations(short, count)

    def split(self, n: Node) -> _Quadratic | None:
        """A polynomial as the constants that all terms share times a shape; None: too long."""
        p = self.polynomial(n)
        if not p:
            return None
        shared = functools.reduce(operator.and_, (self._constants(m) for m in p))
        scale, shape = _normalised({_without(m, shared): c for m, c in p.items()})
        return _Quadratic(tuple(sorted(shared.elements())), scale, shape)

    def _constants(self, m: Monomial) -> Counter[int]:
        return Counter(i for i in m if i not in self._ids)

    def polynomial(self, n: Node) -> Polynomial | None:
        """Exact expansion; None where it gets long."""
        return recursion(self._polynomial(n))

    def _polynomial(self, n: Node) -> Recursion[Polynomial | None]:
        if n not in self.memo:
            self._nodes[n.id] = n
            self.memo[n] = yield self._expand(n)
        return self.memo[n]

    def _inverse_power(self, n: Node) -> Polynomial | None:
        """1/x^k as the k-th power of 1/x, so that it meets other powers of 1/x."""
        power = n.args[0] if n.op is Op.RECIP else n
        e = power.payload
        if power.op is not Op.POW or not isinstance(e, Fraction) or e.denominator != 1:
            return None
        if (e > 0) is not (n.op is Op.RECIP):
            return None
        atom = self.g.recip(power.args[0])
        self._nodes[atom.id] = atom
        return {(atom.id,) * abs(int(e)): Fraction(1)}

    def _expand(self, n: Node) -> Recursion[Polynomial | None]:
        if n.op is Op.CONST:
            return {(): n.value}
        inverse = self._inverse_power(n)
        if inverse is not None:
            return inverse
        if n in self.forms or (
            self.degree[n] == 0 and n.op not in (Op.MUL, Op.NEG) and not _positive_exponent(n)
        ):
            return {(n.id,): Fraction(1)}
        parts: list[Polynomial] = []
        for a in n.args:
            part = yield self._polynomial(a)
            if part is None:
                return None
            parts.append(part)
        if n.op in (Op.MUL, Op.POW):
            factors = parts * _positive_exponent(n) if n.op is Op.POW else parts
            out = functools.reduce(product, factors)
        else:
            sign = -1 if n.op in (Op.SUB, Op.NEG) else 1
            out = added(parts[0] if len(parts) == 2 else {}, parts[-1], sign)
        return out if len(out) <= LONGEST else None


def _without(m: Monomial, removed: Counter[int]) -> Monomial:
    left = Counter(m)
    left.subtract(removed)
    return tuple(sorted(left.elements()))


def _normalised(p: Polynomial) -> tuple[Fraction, _Shape]:
    """Leading coefficient and the polynomial divided by it, in a fixed order."""
    items = sorted(p.items())
    if not items:
        return Fraction(0), ()
    lead = items[0][1]
    return lead, tuple((m, c / lead) for m, c in items)


def _represent(
    target: Polynomial, along: int, basis: Sequence[_Shape]
) -> dict[tuple[int, ...], Fraction] | None:
    """Coefficients of a polynomial over products of `along` values of the basis."""
    products: dict[tuple[int, ...], Polynomial] = {}
    for indices in combinations_with_replacement(range(len(basis)), along):
        p: Polynomial = {(): Fraction(1)}
        for i in indices:
            p = product(p, dict(basis[i]))
        products[indices] = p
    monomials = sorted(set(target).union(*products.values()))
    columns = [*products.values(), target]
    table = [[QQ(*c.get(m, Fraction(0)).as_integer_ratio()) for c in columns] for m in monomials]
    reduced, pivots = DomainMatrix(table, (len(monomials), len(columns)), QQ).rref()
    if len(columns) - 1 in pivots:
        return None
    last = reduced.to_Matrix()[:, -1]
    keys = list(products)
    return {
        keys[c]: Fraction(int(last[r].p), int(last[r].q))
        for r, c in enumerate(pivots)
        if last[r] != 0
    }


@dataclass(frozen=True)
class PotentialStructure:
    """Potential `root` in terms of linear forms and squares, with its `constant` values.

    `interface` holds the modal coordinates and the point values, `forms` the linear forms of
    these (displacement gradients), `squares` quadratic values of the forms (strain measures);
    `invariants` is True where the squares are fewer than those of the model.
    """

    root: Node
    constant: tuple[Node, ...]
    interface: LinearInterface
    forms: tuple[Node, ...]
    squares: tuple[Node, ...] = ()
    invariants: bool = False


def linear_forms(d: Definition) -> PotentialStructure | None:
    """Rewrite the potential through linear forms of the unknowns; None if that saves nothing."""
    if d.interpolated or d.prescribed:
        return None
    g = d.graph
    (root,), constants = strip(g, [d.potential], d.constant)
    if _guarded_coefficients(root, d.directions):
        return None
    interface = linear_interface(g, [root], d.directions)
    if interface is None:
        return None
    named: dict[Node, Node] = {}
    replacement = {z: _named(g, value, named) for z, value in interface.rewritten.items()}
    (root,), new = substitute(g, [root], replacement)
    constant = _left(new, (constants[c] for c in d.constant if c in constants))
    return PotentialStructure(root, constant, interface, tuple(named.values()))


def quadratic_values(d: Definition, s: PotentialStructure) -> PotentialStructure:
    """The structure through named quadratic values of the forms: invariants where some suffice.

    In three dimensions no invariants are looked for in weak forms, where this takes ten times
    as long as all the rest and saves one operation in fourteen, and in models with history, whose
    local equations hold so many polynomials that the search takes minutes.
    """
    g = d.graph
    quick = len(d.coordinates) not in (1, 2) and (d.point is not None or bool(d.point_data))
    reduced = None if quick else through_invariants(g, [s.root], s.forms, s.constant)
    if reduced is not None:
        constant = _left(reduced.images, s.constant)
        (root,), squares = reduced.roots, reduced.squares
        return replace(s, root=root, constant=constant, squares=squares, invariants=True)
    reduction = quadratic_interface([s.root], s.forms, s.constant)
    named = {q: g.name(f"q{k}", q) for k, q in enumerate(reduction)}
    (root,), new = substitute(g, [s.root], named)
    constant = _left(new, s.constant)
    return replace(s, root=root, constant=constant, squares=tuple(named.values()))


def _left(new: Mapping[Node, Node], constant: Iterable[Node]) -> tuple[Node, ...]:
    """New nodes of the constant values; one that is now inside a named form needs no freezing.

    Forms have coefficients that do not depend on the unknowns.
    """
    return tuple(new[c] for c in constant if c in new)


def structure_of(d: Definition) -> PotentialStructure | None:
    """Both, one after the other."""
    forms = linear_forms(d)
    return None if forms is None else quadratic_values(d, forms)


def _named(g: Graph, form: Node, named: dict[Node, Node]) -> Node:
    """The name of a linear form; a form and its negative share one."""
    negative = g.neg(form)
    if negative in named:
        return g.neg(named[negative])
    return named.setdefault(form, g.name(f"z{len(named)}", form))


_PARTIAL = frozenset({Op.RECIP, Op.POW, Op.POWER, Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP})


def _guarded_coefficients(root: Node, sources: Sequence[Node]) -> bool:
    """True where a polynomial of the unknowns holds what has a value on one side of a branch only.

    An interface would take such a coefficient out of its branch.  Other values, such as the
    logarithm of a volume ratio, stand above all interfaces and stay there.
    """
    unguarded = set(always([root]))
    degree = degrees([root], sources, ())
    polynomials = [n for n in degree if 0 < degree[n] < ABOVE]
    below = (n for n in reachable(polynomials) if n.op in _PARTIAL and n not in unguarded)
    return any(n.op is not Op.POW or n.payload not in WHOLE for n in below)
