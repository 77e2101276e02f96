"""Symbols of a model: the node of its graph that each stands for, and what the page says of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.graph.graph import Graph, Input, Node, Op
from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.entries import Entries
from softehl.codegen.language.lower import Lowering
from softehl.codegen.language.names import named
from softehl.codegen.language.record import Record


class Symbols:
    """All symbols of one model, its graph, and the record of the page; each label is used once."""

    def __init__(self, model: str) -> None:
        self.model = model
        self.graph = Graph()
        self.record = Record()
        self.bound: dict[sp.Symbol, Node] = {}
        self.lower = Lowering(self.graph, self.bound)
        self._by_label: dict[str, Any] = {}

    def __contains__(self, label: str) -> bool:
        return label in self._by_label

    def inputs(self) -> set[str]:
        """Labels of all arguments."""
        return {str(s) for s, n in self.bound.items() if n.op is Op.INPUT}

    def label_of(self, node: Node) -> str | None:
        """Label of the first symbol that stands for a node."""
        return next((str(s) for s, n in self.bound.items() if n is node), None)

    def input(self, label: str, array: str, index: int, *, varying: bool = False) -> sp.Symbol:
        """The symbol of an entry of an array of arguments."""
        node = self.graph.input(array, index, varying=varying)
        symbol: sp.Symbol = self._bind(sp.Symbol(label, real=True), node)
        return symbol

    def name(self, label: str, node: Node, value: Any, **how: Any) -> Any:
        """A name that SymPy differentiates through (`names.named`); the old one for an old node."""
        found = self._by_label.get(label)
        symbol = found if found is not None else named(label, value, **how)
        return self._bind(symbol, node)

    def named(self, label: str, like: Entries, nodes: Sequence[Node], below: list[Any]) -> Any:
        """Names for `nodes` that depend on `below`, arranged like other values."""
        labels = [label + suffix for suffix in like.suffixes]
        symbols = [
            self.name(entry, self.graph.name(entry, n), below, known=False)
            for entry, n in zip(labels, nodes, strict=True)
        ]
        return Entries(symbols, like.suffixes, like.arrange).shaped()

    def placeholders(self, label: str, symbols: Entries) -> list[Node]:
        """Inputs that stand for local unknowns while their equations are written."""
        nodes = [self.graph.input(f"local {label}", k) for k in range(len(symbols.values))]
        self.bound.update(zip(symbols.values, nodes, strict=True))
        return nodes

    def _bind(self, symbol: Any, node: Node) -> Any:
        label = str(symbol)
        before = self.bound.get(self._by_label.setdefault(label, symbol), node)
        if before is not node:
            kinds = " and ".join(dict.fromkeys(map(_kind, (before, node))))
            raise ModelError(
                f"the name {label} is used twice in model {self.model}, for {kinds}: rename one"
            )
        self.bound[symbol] = node
        if isinstance(node.payload, Input):
            self.record.inputs[symbol] = (node.payload.array, node.payload.index)
        return symbol


_KINDS = {
    "dofs": "an unknown",
    "coordinates": "a coordinate",
    "parameters": "a parameter",
    "rule": "the quadrature",
}


def _kind(node: Node) -> str:
    """What a name stands for, in words."""
    if not isinstance(node.payload, Input):
        return "an intermediate"
    return _KINDS.get(node.payload.array, node.payload.array)
