"""Equations of a model: integrals over the parent element, and potentials, which add up."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy as sp

from softehl.codegen.graph.graph import Node
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.complaints import Empty, ModelError, warn_page
from softehl.codegen.language.record import Integral
from softehl.codegen.language.symbols import Symbols


class Equations:
    """Potentials with what they freeze, and what their integrands are measured by."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self._potentials: list[tuple[Node, list[Node]]] = []
        self._factors = 0
        self._measures: set[Node] = set()
        self._gradients: set[Node] = set()

    def numbered(self, label: str) -> str:
        """A label for the next factor of a weak form."""
        self._factors += 1
        return f"{label}_{self._factors - 1}"

    def label_of_work(self) -> str:
        """A label for the integral of the next weak form."""
        return f"virtual_work_{len(self._potentials)}" if self._potentials else "virtual_work"

    def measure(self, detJ: Any, gradients: Iterable[Any]) -> None:
        """Note what an integrand is multiplied by, and which names only divide by it."""
        self._measures.add(self._symbols.lower(detJ))
        self._gradients.update(self._symbols.lower(v) for v in gradients)

    def integral(
        self, name: str, integrand: Any, weight: sp.Symbol, directions: Sequence[Node]
    ) -> sp.Symbol:
        """Sum of `integrand` times `weight` over the points.

        It is warned of if it moves with `directions` and has no measure.
        """
        symbols = self._symbols
        density = symbols.lower(integrand)
        inside = reachable([density], stop=self._gradients.__contains__)
        moves = any(n in directions for n in reachable([density]))
        if moves and self._measures and not self._measures & set(inside):
            warn_page(
                f"the integrand of {name} has no factor detJ: the sum is over the parent element; "
                "multiply by e.detJ"
            )
        node = symbols.graph.sum(symbols.lower(integrand * weight))
        symbol: sp.Symbol = symbols.record.define(
            symbols.name(name, node, integrand, known=False), Integral(integrand)
        )
        return symbol

    def potential(self, expression: Any, constant: Iterable[Any]) -> None:
        """One more term of the potential, with the symbols that are frozen in it."""
        constant, symbols = list(constant), self._symbols
        symbols.record.potentials.append((expression, tuple(constant)))
        value, frozen = symbols.lower(expression), [symbols.lower(s) for s in constant]
        if value.varying:
            raise ModelError(
                f"the potential of {symbols.model} varies with the point: wrap it in integral(...)"
            )
        self._potentials.append((value, frozen))

    def total(self) -> tuple[Node, tuple[Node, ...]]:
        """The sum of all potentials and weak forms, and what is frozen in it."""
        model = self._symbols.model
        if not self._potentials:
            raise Empty(f"model {model} has neither a potential nor a weak form")
        total = self._symbols.graph.zero
        constant = dict.fromkeys(n for _, frozen in self._potentials for n in frozen)
        for value, frozen in self._potentials:
            total = self._symbols.graph.add(total, value)
            shared = set(constant) - set(frozen)
            # what lies below a frozen value is frozen with it
            met = [n for n in reachable([value], stop=frozen.__contains__) if n in shared]
            if met:
                label = self._symbols.label_of(met[0]) or "a value"
                raise ModelError(
                    f"{label} is constant in one potential of {model} and varies in another: "
                    f"freeze a name of its own, m.define('{label}_frozen', {label})"
                )
        return total, tuple(constant)
