"""Named intermediates of a model: definitions, lengths, derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import sympy as sp

from softehl.codegen.graph.differentiate import gradient
from softehl.codegen.graph.graph import Node, Op
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.entries import Entries, Matrix
from softehl.codegen.language.symbols import Symbols


class Intermediates:
    """Names for values. interface: those that derivatives are taken through.

    given: derivatives that a page gives instead of the true ones.
    """

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self.interface: list[Node] = []
        self.given: dict[Node, dict[Node, Node]] = {}
        self._norms = 0

    def define(
        self,
        name: str,
        expression: Any,
        *,
        interface: bool = False,
        derivative: Mapping[sp.Symbol, Any] | None = None,
    ) -> Any:
        """Name of a scalar, or a matrix of names."""
        if isinstance(expression, sp.MatrixBase):
            if derivative is not None:
                raise ModelError(f"{name}: give the derivative of each entry, not of the matrix")
            rows, columns = expression.shape
            return Matrix(
                rows,
                columns,
                lambda i, j: self.define(f"{name}_{i}{j}", expression[i, j], interface=interface),
            )
        symbols, lower = self._symbols, self._symbols.lower
        node = symbols.graph.name(name, lower(expression))
        if interface:
            self.interface.append(node)
        if derivative is not None:
            self.given[node] = {lower(s): lower(e) for s, e in derivative.items()}
        return symbols.record.define(
            symbols.name(name, node, expression, given=derivative), sp.sympify(expression)
        )

    def norm(self, values: Any) -> Any:
        """Name of the root of the sum of squares.

        Its derivatives are zero where it is zero; see `graph.norms` for those of what it is in.
        """
        self._norms += 1
        squares = sum(v**2 for v in Entries.of(values).values)
        square = self.define(f"norm_{self._norms}_squared", squares)
        root = sp.Piecewise((sp.sqrt(square), square > 0), (sp.Integer(0), True))
        return self.define(f"norm_{self._norms}", root)

    def derivative(self, name: str, value: Any, by: Any) -> Any:
        """Names of the derivatives of a scalar, arranged like `by`.

        Entries of a matrix that are one symbol share its derivative, so that dW = P_ij dF_ij.
        """
        symbols = Entries.of(by)
        lower = self._symbols.lower
        sources = [lower(s) for s in symbols.values]
        root = lower(value)
        # at a point, a symbol that is the same for all points is differentiated by there too
        local = root.varying and not all(s.varying for s in sources)
        if local and any(n.op is Op.SUM for n in reachable([root], stop=sources.__contains__)):
            raise ModelError(f"{name}: {value} depends on an integral; give it a name of its own")
        slopes = gradient(self._symbols.graph, root, sources, given=self.given, flat=local)
        below = [value, *symbols.values]
        matrix = isinstance(by, sp.MatrixBase)
        times = [sources.count(s) if matrix else 1 for s in sources]
        graph = self._symbols.graph
        parts = [
            graph.mul(graph.const(Fraction(1, n)), slopes[s])
            for s, n in zip(sources, times, strict=True)
        ]
        derivatives = self._symbols.named(name, symbols, parts, below)
        named = Entries.of(derivatives).values
        self._symbols.record.slopes(value, symbols.values, named, times)
        return derivatives
