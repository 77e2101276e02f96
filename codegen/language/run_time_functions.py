"""Functions of a page that run-time arrays define: curves and networks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from softehl.codegen.graph import run_time_arrays
from softehl.codegen.graph.run_time_arrays import (
    ACTIVATIONS,
    ArrayRoutine,
    ArraySymbol,
    NetworkLayout,
    TableLayout,
)
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.sympy_lowering import Symbols
from softehl.codegen.language.sympy_tape import OfArray

Declare = Callable[[ArraySymbol], tuple[int, sp.Symbol]]
"""Declares an array: its number, and the symbol of the amount of its variation."""

INTERPOLATIONS = ("linear", "pchip", "spline")
OUTSIDE = ("constant", "linear", "error")


def table(
    symbols: Symbols,
    declare: Declare,
    name: str,
    argument: Any,
    *,
    meaning: str,
    interpolation: str,
    outside: str,
) -> sp.Symbol:
    """Value of the curve `name`; see `Model.table`."""
    for what, value, allowed in (
        ("interpolation", interpolation, INTERPOLATIONS),
        ("outside", outside, OUTSIDE),
    ):
        if value not in allowed:
            raise ModelError(f"table {name}: {what} = {value!r}; allowed: {', '.join(allowed)}")
    layout = TableLayout(interpolation, outside)
    record = ArraySymbol(name, " ".join(meaning.split()) or "curve", layout)
    return _value(symbols, declare, record, [argument], run_time_arrays.table)


def network(
    symbols: Symbols,
    declare: Declare,
    name: str,
    inputs: Sequence[Any],
    *,
    layers: Sequence[int],
    activation: str,
    convex: bool,
    monotone: bool,
    meaning: str,
) -> sp.Symbol:
    """Value of the network `name`; see `Model.network`."""
    if isinstance(inputs, sp.Expr):
        raise ModelError(f"network {name}: give its inputs as a list, m.network({name!r}, [...])")
    widths = list(layers) if isinstance(layers, Sequence) else [layers]
    if not widths or not all(isinstance(w, int) and w > 0 for w in widths):
        raise ModelError(
            f"network {name}: layers = {layers!r}, must be widths > 0, as in layers=(16, 16)"
        )
    if activation not in ACTIVATIONS:
        raise ModelError(
            f"network {name}: activation = {activation!r}; allowed: {', '.join(ACTIVATIONS)}"
        )
    if convex and activation not in ("softplus", "softplus_squared"):
        raise ModelError(
            f"network {name}: convex needs a convex activation that increases, softplus or "
            f"softplus_squared, not {activation}"
        )
    if monotone and not convex:
        raise ModelError(f"network {name}: monotone=True needs convex=True")
    count = len(list(inputs))
    if not count:
        raise ModelError(f"network {name}: it has no inputs")
    layout = NetworkLayout(count, tuple(widths), activation, bool(convex), bool(monotone))
    record = ArraySymbol(name, " ".join(meaning.split()) or "weights of a network", layout)
    return _value(symbols, declare, record, list(inputs), run_time_arrays.network)


def _value(
    symbols: Symbols,
    declare: Declare,
    record: ArraySymbol,
    args: Sequence[Any],
    routine: Callable[..., ArrayRoutine],
) -> sp.Symbol:
    """Name of the value at `args`: name, name_2, ... of one array."""
    number, amount = declare(record)
    if record.name not in symbols.routines:
        function = routine(f"{record.layout.kind}_{record.name}", number, record.layout)
        symbols.routines[record.name] = function, {}
    function, labels = symbols.routines[record.name]
    nodes = tuple(symbols.lower(a) for a in args)
    new = f"{record.name}_{len(labels) + 1}" if labels else record.name
    label = labels.setdefault(nodes, new)
    node = symbols.graph.run(function, [*nodes, symbols.lower(amount)])[0]
    named = symbols.graph.name(label, node)
    symbol = symbols.name(label, named, list(args), has_definition=False)
    result: sp.Symbol = symbols.record.define(
        symbol, OfArray(record.layout, amount, tuple(sp.sympify(a) for a in args))
    )
    return result
