"""A weak form with sums over the nodes of a cell or side: what both have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from softehl.codegen.elements.cells import linear
from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.elements.shapes import interpolate
from softehl.codegen.language.definition import Component, Definition
from softehl.codegen.language.fields import Fields, FieldTrace
from softehl.codegen.language.model import Model


class NodalFields(Fields):
    """Values are sums over nodes, densities are integrated over the parent cell."""

    def __init__(
        self,
        name: str,
        cell: Element,
        geometry: str,
        rule: QuadratureRule,
        doc: str,
        *,
        dimension: int,
    ) -> None:
        super().__init__(name, cell, geometry, self._count_of_nodes(cell), rule, doc)
        self.dimension = dimension
        self._X = self.coordinates(*"XYZ"[:dimension])
        self._at = self.point()
        self._values: dict[int, list[Any]] = {}
        self._along: list[tuple[list[Any], list[Any]]] = []

    def _count_of_nodes(self, cell: Element) -> int:
        """Nodes of one element."""
        return len(cell.nodes)

    @abstractmethod
    def _slopes_of(self, component: Component, column: Sequence[Any]) -> list[Any]:
        """Slopes of a component at the point from its values at the nodes."""

    def point(self) -> list[sp.Symbol]:
        """Parent coordinates, under names that a model does not use."""
        names = (f"parent_{k}" for k in range(self.rule.dimension))
        return [self._symbols.input(s, "rule", k, varying=True) for k, s in enumerate(names)]

    @property
    def weight(self) -> sp.Symbol:
        """Weight of the quadrature point, under such a name, too."""
        return self._symbols.input("parent_weight", "rule", self.rule.dimension, varying=True)

    def finish(self) -> Definition:
        """Return the definition with its cell."""
        return replace(super().finish(), cell=self.cell.name)

    def _element(self, order: int) -> Element:
        """The cell, or the one of its corners."""
        return self.cell if order == self.order else linear(self.cell)

    def _shape(self, order: int) -> list[Any]:
        """Shape functions of an order."""
        if order not in self._values:
            label = "" if order == self.order else f"_of_order_{order}"
            values = self._parent(order)[0] if order else [sp.Integer(1)]
            named = [self.define(f"shape{label}_{a}", v) for a, v in enumerate(values)]
            self._values[order] = named
        return self._values[order]

    def _parent(self, order: int) -> tuple[list[Any], list[tuple[Any, ...]]]:
        """Shape functions of an order and their gradients by the parent coordinates.

        Shape functions of high order are products of names: without them SymPy needs minutes.
        """
        cell = self._element(order)
        if cell.lines is None:
            return cell.shape(*self._at), cell.gradient(*self._at)
        along = self._along
        if not along:
            for k, x in enumerate(self._at):
                N = cell.along(x)
                dN = [sp.diff(v, x) for v in N]
                label = f"along_{'xyz'[k]}"
                values = [self.define(f"{label}_{a}", v) for a, v in enumerate(N)]
                gradients = [self.define(f"{label}_slope_{a}", v) for a, v in enumerate(dN)]
                along.append((values, gradients))
        axes = range(cell.dimension)

        def product(node: tuple[int, ...], by: int | None) -> Any:
            return sp.Mul(*(along[k][k == by][node[k]] for k in axes))

        values = [product(node, None) for node in cell.lines]
        return values, [tuple(product(node, by) for by in axes) for node in cell.lines]

    def _components_of(self, components: Sequence[Component]) -> list[FieldTrace]:
        N = self._shape(components[0].order)
        names = [c.name for c in components]
        if not components[0].order:
            columns: Any = [[self.unknown(name)] for name in names]
        elif components[0].is_data:
            columns = self.nodal_data(*names, nodes=len(N))
        else:
            columns = self.nodal_unknowns(*names, nodes=len(N))
        traced = []
        for component, column in zip(components, columns, strict=True):
            name = component.name
            value = column[0] if not component.order else self.define(name, interpolate(N, column))
            zero = [sp.Integer(0)] * self.dimension
            gradient = self._slopes_of(component, column) if component.order else zero
            named = tuple(self.define(f"grad_{name}_{k}", v) for k, v in enumerate(gradient))
            traced.append(FieldTrace(component, value, named))
        return traced

    def _position(self) -> list[Any]:
        N = self._shape(self.order)
        names = (f"at_{axis}" for axis in "XYZ")
        return [self.define(n, interpolate(N, x)) for n, x in zip(names, self._X, strict=False)]

    def _total_of(self, name: str, density: Any) -> Any:
        return Model.integral(self, name, density)
