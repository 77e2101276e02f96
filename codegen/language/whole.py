"""A page of fields as the model of one whole element: sums over the nodes of a cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Component, Definition
from softehl.codegen.language.elements.cells import ELEMENTS, Element
from softehl.codegen.language.elements.quadrature import QuadratureRule
from softehl.codegen.language.elements.shapes import interpolate
from softehl.codegen.language.fields import AXISYMMETRIC, Fields, Traced
from softehl.codegen.language.model import Model

CORNERS = {
    "line3": "line2",
    "tri6": "tri3",
    "quad8": "quad4",
    "quad9": "quad4",
    "tet10": "tet4",
    "hex20": "hex8",
    "hex27": "hex8",
}
"""The linear element with the corners of a quadratic one."""


class Whole(Fields):
    """Values and gradients are sums over nodes, densities are integrated over the cell."""

    def __init__(
        self, name: str, cell: Element, geometry: str, rule: QuadratureRule, doc: str
    ) -> None:
        super().__init__(name, cell, geometry, len(cell.nodes), rule, doc)
        self._X = self.coordinates(*"XYZ"[: cell.dimension])
        self._at = self.point()
        self._map = kinematics.isoparametric(self, self._X, cell.gradient(*self._at))
        self._shapes: dict[int, tuple[list[Any], list[list[Any]]]] = {}

    def point(self) -> list[sp.Symbol]:
        """Parent coordinates, under names that a page does not use."""
        names = (f"parent_{k}" for k in range(self.rule.dimension))
        return [self._input(s, "rule", k, varying=True) for k, s in enumerate(names)]

    @property
    def weight(self) -> sp.Symbol:
        """Weight of the quadrature point, under such a name, too."""
        return self._input("parent_weight", "rule", self.rule.dimension, varying=True)

    def finish(self) -> Definition:
        """The frozen definition, which knows its cell."""
        return replace(super().finish(), cell=self.cell.name)

    def _shape(self, order: int) -> tuple[list[Any], list[list[Any]]]:
        """Shape functions and their gradients of an order."""
        if order not in self._shapes:
            cell = self.cell if order == self.order else ELEMENTS[CORNERS[self.cell.name]]
            label = "" if order == self.order else f"_of_order_{order}"
            N = [self.define(f"shape{label}_{a}", v) for a, v in enumerate(cell.shape(*self._at))]
            dN = self._map.dN
            if order != self.order:
                inverse = self._map.inverse
                parent = [sp.Matrix([list(g)]) * inverse for g in cell.gradient(*self._at)]
                dN = [
                    [self.define(f"slope{label}_{a}{k}", v) for k, v in enumerate(row)]
                    for a, row in enumerate(parent)
                ]
                self.measure(self._map.detJ, [v for row in dN for v in row])
            self._shapes[order] = N, dN
        return self._shapes[order]

    def _components_of(self, components: Sequence[Component]) -> list[Traced]:
        first = components[0]
        N, dN = self._shape(first.order)
        names = [c.name for c in components]
        if first.given:
            columns = self.nodal_data(*names, nodes=len(N))
        else:
            columns = self.nodal_unknowns(*names, nodes=len(N))
        traced = []
        for component, column in zip(components, columns, strict=True):
            name = component.name
            value = self.define(name, interpolate(N, column))
            slopes = [interpolate([g[k] for g in dN], column) for k in range(self.dimension)]
            named = [self.define(f"grad_{name}_{k}", v) for k, v in enumerate(slopes)]
            traced.append(Traced(component, value, tuple(named)))
        return traced

    def _place(self) -> list[Any]:
        N, _ = self._shape(self.order)
        names = (f"at_{axis}" for axis in "XYZ")
        return [self.define(n, interpolate(N, x)) for n, x in zip(names, self._X, strict=False)]

    def _volume(self) -> Any:
        if self.geometry == AXISYMMETRIC:
            return self.define("volume_of_ring", 2 * sp.pi * self._place()[1] * self._map.detJ)
        return self._map.detJ

    def _total_of(self, name: str, density: Any) -> Any:
        return Model.integral(self, name, density)
