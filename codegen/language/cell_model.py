"""Weak form integrated over one cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.elements.shapes import interpolate
from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Component
from softehl.codegen.language.fields import AXISYMMETRIC
from softehl.codegen.language.flatten import Entries, Matrix
from softehl.codegen.language.model import PARENT_NAMES
from softehl.codegen.language.nodal_fields import NodalFields


class CellModel(NodalFields):
    """Model of a cell: values and gradients are sums over nodes, densities are integrated."""

    _parent_names = PARENT_NAMES

    def __init__(
        self, name: str, cell: Element, geometry: str, rule: QuadratureRule, doc: str
    ) -> None:
        super().__init__(name, cell, geometry, rule, doc, dimension=cell.dimension)
        gradients = self._parent(self.order)[1]
        self._map = kinematics.isoparametric(self, self._X, gradients, "parent_")
        self._centroids = 0
        self._slopes_by_order = {self.order: self._map.dN}

    @property
    def parent(self) -> Any:
        """Parent coordinates of the point, (dimension, 1)."""
        return Matrix(self._at)

    @property
    def jacobian(self) -> Any:
        """Slopes of the reference coordinates (rows) along the parent ones (columns)."""
        return self._map.matrix

    def centroid(self, value: Any) -> Any:
        """Value of a scalar, list or matrix at the centroid of the parent cell."""
        linear = self._element(1) if self.order > 1 else self.cell
        middle = [sum(x) / sp.Integer(len(linear.nodes)) for x in zip(*linear.nodes, strict=True)]
        at_centroid = dict(zip(self._at, middle, strict=True))
        self._centroids += 1
        label, entries = f"centroid_{self._centroids}", Entries.of(value)
        moved = [sp.sympify(v).xreplace(at_centroid) for v in entries.values]
        named = [
            self.define(label + suffix, v)
            for suffix, v in zip(entries.suffixes, moved, strict=True)
        ]
        return entries.arrange(named)

    def _of_cell(self, order: int) -> list[list[Any]]:
        """Gradients of the shape functions of an order."""
        if order not in self._slopes_by_order:
            parent = self._parent(order)[1]
            rows = [sp.Matrix([list(g)]) * self._map.inverse for g in parent]
            dN = [
                [self.define(f"slope_of_order_{order}_{a}{k}", v) for k, v in enumerate(row)]
                for a, row in enumerate(rows)
            ]
            self.measure(self._map.detJ, [v for row in dN for v in row])
            self._slopes_by_order[order] = dN
        return self._slopes_by_order[order]

    def _slopes_of(self, component: Component, column: Sequence[Any]) -> list[Any]:
        dN = self._of_cell(component.order)
        return [interpolate([g[k] for g in dN], column) for k in range(self.dimension)]

    def _volume(self) -> Any:
        if self.geometry == AXISYMMETRIC:
            return self.define("volume_of_ring", 2 * sp.pi * self._position()[1] * self._map.detJ)
        return self._map.detJ
