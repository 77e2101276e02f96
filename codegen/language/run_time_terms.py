"""Reductions over terms on a page: arrays whose length is known at run time, and their sums."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy as sp

from softehl.codegen.graph.graph import Node, Op
from softehl.codegen.graph.routines import LocalisedValues, localise
from softehl.codegen.graph.run_time_arrays import ArraySymbol
from softehl.codegen.graph.term_reductions import Kind, TermsLayout, reduction
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import TermHistory
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import Entries, call_function
from softehl.codegen.language.sympy_lowering import Symbols

Groups: TypeAlias = "dict[tuple[str, ...], None]"
"""Names of arrays of equal lengths."""


class TermArray:
    """Array of a page with one number for each term; made by `Model.array`.

    Attributes
    ----------
    name : str
        Name of the array, by which `Study.add` gets its numbers.
    lengths : str
        Name of the array whose length it has: itself, but for history of terms.
    """

    def __init__(self, name: str, number: int, amount: sp.Symbol, lengths: str = "") -> None:
        self.name, self.number, self.amount = name, number, amount
        self.lengths = lengths or name

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<TermArray {self.name}>"

    def _sympy_(self) -> Any:
        raise ModelError(
            f"{self.name} is an array of terms, no number: write m.sum({self.name}, lambda "
            f"{self.name}: ...), or m.product, m.minimum, m.maximum"
        )

    def _refused(self, *_: Any) -> Any:
        return self._sympy_()

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = _refused
    __truediv__ = __rtruediv__ = __pow__ = __rpow__ = __neg__ = __getitem__ = __iter__ = _refused


def array(
    symbols: Symbols,
    declare: Callable[[ArraySymbol], tuple[int, sp.Symbol]],
    name: str,
    meaning: str,
) -> TermArray:
    """An array with one number for each term; see `Model.array`."""
    if name in symbols:
        raise ModelError(
            f"the name {name} is used twice in model {symbols.model}: rename the array"
        )
    record = ArraySymbol(
        name, " ".join(meaning.split()) or "one number for each term", TermsLayout()
    )
    return TermArray(name, *declare(record))


@dataclass(frozen=True, eq=False, repr=False)
class NewTerms:
    """New history of terms as a page writes it: result `index` of a function of the entries.

    Made by `Model.each`, for `Model.history`.
    """

    loop: TermLoop
    index: int

    def __repr__(self) -> str:
        """The call, as a page writes it."""
        return "m.each(...), one value for each term, for m.history,"

    def _sympy_(self) -> Any:
        raise ModelError("m.each has one value for each term, no number: m.history(h=m.each(...))")

    def _refused(self, *_: Any) -> Any:
        return self._sympy_()

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = _refused
    __truediv__ = __rtruediv__ = __pow__ = __rpow__ = __neg__ = _refused


@dataclass(frozen=True, eq=False)
class TermLoop:
    """A function of the entries of arrays, as a page writes it.

    label: its name. entries: symbols of the entries. written: what the function returns.
    """

    label: str
    arrays: list[TermArray]
    entries: list[Any]
    written: Entries
    system: LocalisedValues

    @staticmethod
    def of(symbols: Symbols, groups: Groups, kind: Kind, arguments: Sequence[Any]) -> TermLoop:
        """The function at the end of some arguments.  groups: see `reduced`."""
        call = f"m.{kind}(g, tau, lambda g, tau: ...)"
        if len(arguments) < 2 or not callable(arguments[-1]):
            raise ModelError(f"{kind}: give arrays, then a function of their entries: {call}")
        *operands, function = arguments
        arrays = [a for g in operands for a in (g if isinstance(g, (list, tuple)) else [g])]
        for a in arrays:
            if not isinstance(a, TermArray):
                raise ModelError(f"{kind}: {a!r} is no array: declare it, g = m.array('g'); {call}")
        groups[tuple(dict.fromkeys(a.lengths for a in arrays))] = None
        entries = Entries([sp.Dummy(a.name, real=True) for a in arrays], ("",) * len(arrays), list)
        label = symbols.numbered(str(kind))
        local = symbols.placeholders(label, entries)
        remaining = iter(entries.values)
        shaped = [
            [next(remaining) for _ in g] if isinstance(g, (list, tuple)) else next(remaining)
            for g in operands
        ]
        written = Entries.of(call_function(label, function, *shaped))
        values = [symbols.lower(e) for e in written.values]
        _check(kind, values)
        system = localise(symbols.graph, values, local)
        return TermLoop(label, arrays, list(entries.values), written, system)

    def run(
        self, symbols: Symbols, kind: Kind, selected: Sequence[int], targets: tuple[int, ...] = ()
    ) -> list[Node]:
        """Results of a reduction of some of the returned values."""
        terms = [self.system.values[k] for k in selected]
        numbers = [a.number for a in self.arrays]
        count = len(self.system.external)
        routine = reduction(symbols.graph, self.label, kind, numbers, terms, count, targets=targets)
        return symbols.graph.run(routine, [*self.system.external, *self._amounts(symbols)])

    def _amounts(self, symbols: Symbols) -> list[Node]:
        return [symbols.lower(a.amount) for a in self.arrays]

    def note(
        self, symbols: Symbols, kind: Kind, selected: Sequence[int], names: Sequence[Any]
    ) -> None:
        """Note names of some of the returned values in the record of the page."""
        written = [self.written.values[k] for k in selected]
        amounts = [a.amount for a in self.arrays]
        symbols.record.reduction(str(kind), self.entries, amounts, written, names)


def point_array(
    symbols: Symbols,
    declare: Callable[[TermHistory], tuple[int, sp.Symbol]],
    name: str,
    of: Any,
    meaning: str,
) -> TermArray:
    """Data of a point with one number for each term of an array; see `Model.point_array`."""
    if not isinstance(of, TermArray) or of.number < 0:
        raise ModelError(
            f"{name}: {of!r} is no array of terms: g = m.array('g'), m.point_array({name!r}, g)"
        )
    if name in symbols:
        raise ModelError(
            f"the name {name} is used twice in model {symbols.model}: rename the array"
        )
    text = " ".join(meaning.split()) or "history of each term"
    number, amount = declare(TermHistory(name, text, of.number, of.name))
    return TermArray(name, -1 - number, amount, of.name)


def reduced(symbols: Symbols, groups: Groups, kind: Kind, arguments: Sequence[Any]) -> Any:
    """Names of reductions over the terms of arrays; see `Model.sum`.

    groups: names of arrays of equal lengths; those of this call are added.
    """
    loop = TermLoop.of(symbols, groups, kind, arguments)
    every = range(len(loop.written.values))
    nodes = loop.run(symbols, kind, every)
    below = [*loop.written.values, *(a.amount for a in loop.arrays)]
    result = symbols.named(loop.label, loop.written, nodes, below)
    loop.note(symbols, kind, every, Entries.of(result).values)
    return result


def each(symbols: Symbols, groups: Groups, arguments: Sequence[Any]) -> Any:
    """New history for each term; see `Model.each`."""
    loop = TermLoop.of(symbols, groups, Kind.EACH, arguments)
    new = [NewTerms(loop, k) for k in range(len(loop.written.values))]
    scalar = list(loop.written.suffixes) == [""]
    return new[0] if scalar else new


def updates(
    symbols: Symbols, history: Sequence[TermHistory], new: Mapping[str, Any]
) -> dict[str, Node]:
    """New values of history of terms; those of one call of `each` are computed in one loop."""
    names = [h.name for h in history]
    by_loop: dict[TermLoop, list[tuple[str, int]]] = {}
    for name, value in new.items():
        if not isinstance(value, NewTerms):
            raise ModelError(
                f"history: {name} has one number for each term: {name}=m.each(..., lambda ...: new)"
            )
        by_loop.setdefault(value.loop, []).append((name, value.index))
    nodes = {}
    for loop, pairs in by_loop.items():
        lengths = {a.lengths for a in loop.arrays}
        slots = tuple(names.index(name) for name, _ in pairs)
        selected = [k for _, k in pairs]
        for name, _ in pairs:
            array = history[names.index(name)].terms_of
            if array not in lengths:
                raise ModelError(
                    f"history: {name} has a number for each term of {array}: loop over it"
                )
        results = loop.run(symbols, Kind.EACH, selected, slots)
        dummies = [sp.Dummy(real=True) for _ in selected]
        loop.note(symbols, Kind.EACH, selected, dummies)
        for (name, _), node, dummy in zip(pairs, results, dummies, strict=True):
            nodes[name] = node
            symbols.record.updates.append((names.index(name), dummy))
    return nodes


def _check(kind: Kind, values: Sequence[Any]) -> None:
    """Refuse integrals of the terms themselves."""
    for n in reachable(values):
        if n.op is Op.SUM:
            raise ModelError(
                f"{kind}: a term holds an integral; give it a name outside of the terms, or sum "
                "inside of the integral"
            )
