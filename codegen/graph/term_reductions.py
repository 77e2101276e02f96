"""Sums, products, minima and maxima over terms whose number is known at run time only.

A term is an expression of the entries that run-time arrays have for it (`run_time_arrays`), of its
history at the point, and of values from outside that are the same for all terms. A reduction is a
routine: one loop over the terms. Its derivatives are reductions of derivatives of the term, in the
same loop. A routine of the kind `EACH` reduces nothing: it writes new history, one number a term.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations
from typing import Any, ClassVar

from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.graph import Graph, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.partial_derivatives import DifferentiationError, Partials
from softehl.codegen.graph.run_time_arrays import ArrayLayout

Number = Any
Entry = tuple[int, tuple[int, ...]]
"""Number of a term function, and the operands by which its reduction is differentiated, sorted."""
TERMS = 3
"""Terms of the checks of kernels."""


class Kind(StrEnum):
    """Reductions that there are."""

    SUM = "sum"
    PRODUCT = "product"
    MINIMUM = "minimum"
    MAXIMUM = "maximum"
    EACH = "each"


EMPTY = {
    **{Kind.SUM: 0.0, Kind.PRODUCT: 1.0, Kind.EACH: 0.0},
    **{Kind.MINIMUM: float("inf"), Kind.MAXIMUM: -float("inf")},
}
"""Reductions of no terms."""


@dataclass(frozen=True)
class TermsLayout(ArrayLayout):
    """One number for each term; arrays of one `group` have equal lengths."""

    kind: ClassVar[str] = "terms"

    def sample(self, rng: random.Random) -> list[float]:
        """Numbers about 1."""
        return [rng.uniform(0.5, 1.5) for _ in range(TERMS)]

    def value(
        self,
        array: Sequence[Number],
        args: Sequence[Number],
        f: Mapping[str, Callable[[Number], Number]],
    ) -> Number:
        """Refuse: the terms themselves are no function."""
        raise TypeError("an array of terms is no function")


@dataclass(frozen=True, eq=False)
class Reduction(Routine):
    """Reductions of term functions; operands: values from outside, then amounts of the arrays.

    arrays: numbers of the run-time arrays, -1, -2, ... for the first, second, ... history of terms.
    terms: functions of local inputs, the entries of the arrays and then their rates, and of
    external ones. entries: what the results are. targets: of the kind `EACH`, the history that
    each term function is new for; the results themselves are zero then.
    """

    kind: Kind
    arrays: tuple[int, ...]
    terms: tuple[Node, ...]
    entries: tuple[Entry, ...]
    graph: Graph = field(compare=False, repr=False)
    targets: tuple[int, ...] = ()
    _derivatives: dict[Entry, Node] = field(default_factory=dict)
    _family: dict[tuple[Entry, ...], Reduction] = field(default_factory=dict)

    def partials(self, g: Graph, item: Node) -> Partials:
        """Reductions of the slopes of the terms."""
        call, payload = item.args[0], item.payload
        assert isinstance(payload, ResultIndex)
        if self.kind is Kind.EACH:
            raise DifferentiationError(f"{self.name}: new history of terms is no value of the page")
        k, by = self.entries[payload.index]
        pairs = []
        for i, a in enumerate(call.args):
            entry = k, tuple(sorted((*by, i)))
            moved = self.slope(g, entry if self.kind is Kind.SUM else (k, (i,)))
            if moved is not g.zero:
                derivative = g.node(Op.CALL, call.args, self.with_entries((entry,)))
                pairs.append((a, g.node(Op.ITEM, (derivative,), ResultIndex(0))))
        return pairs

    def along(self, g: Graph, item: Node, rates: Mapping[Node, Node]) -> Node | None:
        """Rate of the new history of every term, which is written in its place."""
        if self.kind is not Kind.EACH:
            return None
        call, payload = item.args[0], item.payload
        assert isinstance(payload, ResultIndex)
        k, outside = self.entries[payload.index][0], self.inputs - len(self.arrays)
        moving = [(i, rates[a]) for i, a in enumerate(call.args) if rates[a] is not g.zero]
        total, more = g.zero, list[Node]()
        for i, rate in moving:
            factor = rate if rate.op is Op.CONST else g.input("external", outside + len(more))
            more += [] if rate.op is Op.CONST else [rate]
            total = g.add(total, g.mul(self.slope(g, (k, (i,))), factor))
        routine = reduction(
            g,
            f"{self.name}_rate_{k}",
            Kind.EACH,
            self.arrays,
            [total],
            outside + len(more),
            targets=(self.targets[k],),
        )
        return g.run(routine, [*call.args[:outside], *more, *call.args[outside:]])[0]

    def divided(self, between: Any, call: Node) -> list[Node]:
        """Refuse terms that hold single stretches."""
        raise DifferentiationError(
            f"{self.name}: reductions over terms in m.principal and m.isotropic may see symmetric "
            "functions of the stretches only, such as invariants, not a stretch alone: sum the "
            "energies, m.sum(mu, lambda mu: m.principal(...))"
        )

    def slope(self, g: Graph, entry: Entry) -> Node:
        """Derivative of a term function."""
        k, by = entry
        if not by:
            return self.terms[k]
        if entry not in self._derivatives:
            below = self.slope(g, (k, by[:-1]))
            count, i = len(self.arrays), by[-1]
            outside = self.inputs - count
            if i < outside:
                source = g.input("external", i)
                value = gradient(g, below, [source])[source]
            else:
                source, rate = (g.input("local", i - outside + n) for n in (0, count))
                value = g.mul(gradient(g, below, [source])[source], rate)
            self._derivatives[entry] = value
        return self._derivatives[entry]

    def with_entries(self, entries: tuple[Entry, ...]) -> Reduction:
        """Return the reduction with other results."""
        if entries not in self._family:
            root = next(iter(self._family.values()), self)
            self._family[entries] = Reduction(
                f"{root.name}_{len(self._family)}",
                self.inputs,
                len(entries),
                self.kind,
                self.arrays,
                self.terms,
                entries,
                self.graph,
                self.targets,
                self._derivatives,
                self._family,
            )
        return self._family[entries]

    @property
    def root(self) -> int:
        """Identity of the reduction, whatever its results are."""
        return id(self._family)

    def needed(self) -> list[Entry]:
        """Derivatives of term functions that the loop needs, lower ones first."""
        required = dict.fromkeys(self.entries)
        if self.kind is Kind.PRODUCT:
            required = dict.fromkeys(
                (k, part)
                for k, by in self.entries
                for n in range(len(by) + 1)
                for part in combinations(by, n)
            )
        elif self.kind not in (Kind.SUM, Kind.EACH):
            required = dict.fromkeys([*((k, ()) for k, _ in self.entries), *self.entries])
        return sorted(required, key=lambda e: (len(e[1]), e))

    def results(
        self,
        g: Graph,
        arrays: Sequence[tuple[Sequence[Number], Sequence[Number]]],
        args: Sequence[Number],
        evaluate: Callable[[Sequence[Node], list[Number], list[Number]], list[Number]],
    ) -> list[Number]:
        """Results in the arithmetic of `args`; arrays: entries and rates of each."""
        outside = self.inputs - len(self.arrays)
        needed = self.needed()
        bodies = [self.slope(g, e) for e in needed]
        moved = [
            [v + t * r for v, r in zip(a, b, strict=True)] if t else list(a)
            for t, (a, b) in zip(args[outside:], arrays, strict=True)
        ]
        state: dict[Entry, Number] = {}
        for k, row in enumerate(zip(*moved, strict=True)):
            rates = [b[k] if len(b) else 0 * v for v, (_, b) in zip(row, arrays, strict=True)]
            values = evaluate(bodies, [*row, *rates], list(args[:outside]))
            term = dict(zip(needed, values, strict=True))
            state = self._joined(state, term) if state else term
        zero = {e: float(EMPTY[self.kind]) if not e[1] else 0.0 for e in needed}
        return [(state or zero)[e] for e in self.entries]

    def _joined(
        self, state: Mapping[Entry, Number], term: Mapping[Entry, Number]
    ) -> dict[Entry, Number]:
        if self.kind in (Kind.SUM, Kind.EACH):
            return {e: state[e] + term[e] for e in state}
        if self.kind is Kind.PRODUCT:
            return {e: sum(state[a] * term[b] for a, b in splits(e)) for e in state}
        new = {}
        for k, by in state:
            first, other = state[k, ()], term[k, ()]
            better = other < first if self.kind is Kind.MINIMUM else other > first
            new[k, by] = (term if better else state)[k, by]
        return new


def splits(entry: Entry) -> Iterator[tuple[Entry, Entry]]:
    """Pairs of derivatives in Leibniz' rule for a product of two."""
    k, by = entry
    indices = range(len(by))
    for n in range(len(by) + 1):
        for selected in combinations(indices, n):
            remaining = tuple(by[p] for p in indices if p not in selected)
            yield (k, tuple(by[p] for p in selected)), (k, remaining)


def reduction(
    g: Graph,
    name: str,
    kind: Kind,
    arrays: Sequence[int],
    terms: Sequence[Node],
    outside: int,
    *,
    targets: tuple[int, ...] = (),
) -> Reduction:
    """The routine of reductions of localised terms with so many values from outside."""
    entries: tuple[Entry, ...] = tuple((k, ()) for k in range(len(terms)))
    family: dict[tuple[Entry, ...], Reduction] = {}
    made = Reduction(
        name,
        outside + len(arrays),
        len(terms),
        kind,
        tuple(arrays),
        tuple(terms),
        entries,
        g,
        targets,
        _family=family,
    )
    family[entries] = made
    return made
