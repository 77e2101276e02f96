"""Reductions over terms on a page: arrays whose length is known at run time, and their sums."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.routines import localise
from softehl.codegen.graph.run_time_arrays import RunTimeArray
from softehl.codegen.graph.term_reductions import Kind, TermsLayout, reduction
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import Entries, call_function
from softehl.codegen.language.sympy_lowering import Symbols


class TermArray:
    """Array of a page with one number for each term; made by `Model.array`.

    Attributes
    ----------
    name : str
        Name of the array, by which `Study.add` gets its numbers.
    """

    def __init__(self, name: str, number: int, amount: sp.Symbol) -> None:
        self.name, self.number, self.amount = name, number, amount

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
    declare: Callable[[RunTimeArray], tuple[int, sp.Symbol]],
    name: str,
    meaning: str,
) -> TermArray:
    """An array with one number for each term; see `Model.array`."""
    if name in symbols:
        raise ModelError(
            f"the name {name} is used twice in model {symbols.model}: rename the array"
        )
    record = RunTimeArray(
        name, " ".join(meaning.split()) or "one number for each term", TermsLayout()
    )
    return TermArray(name, *declare(record))


def reduced(
    symbols: Symbols, groups: dict[tuple[str, ...], None], kind: Kind, arguments: Sequence[Any]
) -> Any:
    """Names of reductions over the terms of arrays; see `Model.sum`.

    groups: names of arrays of equal lengths; those of this call are added.
    """
    call = f"m.{kind}(g, tau, lambda g, tau: ...)"
    if len(arguments) < 2 or not callable(arguments[-1]):
        raise ModelError(f"{kind}: give arrays, then a function of their entries: {call}")
    *arrays, function = arguments
    for a in arrays:
        if not isinstance(a, TermArray):
            raise ModelError(f"{kind}: {a!r} is no array: declare it, g = m.array('g'); {call}")
    groups[tuple(a.name for a in arrays)] = None
    entries = Entries([sp.Dummy(a.name, real=True) for a in arrays], ("",) * len(arrays), list)
    label = symbols.numbered(str(kind))
    local = symbols.placeholders(label, entries)
    written = Entries.of(call_function(label, function, *entries.values))
    values = [symbols.lower(e) for e in written.values]
    _check(kind, values)
    system = localise(symbols.graph, values, local)
    routine = reduction(
        symbols.graph, label, kind, [a.number for a in arrays], system.values, len(system.external)
    )
    args = [*system.external, *(symbols.lower(a.amount) for a in arrays)]
    result = symbols.named(
        label,
        written,
        symbols.graph.run(routine, args),
        [*written.values, *(a.amount for a in arrays)],
    )
    symbols.record.reduction(
        kind, entries.values, [a.amount for a in arrays], written.values, Entries.of(result).values
    )
    return result


def _check(kind: Kind, values: Sequence[Any]) -> None:
    """Refuse integrals of the terms themselves."""
    for n in reachable(values):
        if n.op is Op.SUM:
            raise ModelError(
                f"{kind}: a term holds an integral; give it a name outside of the terms, or sum "
                "inside of the integral"
            )
