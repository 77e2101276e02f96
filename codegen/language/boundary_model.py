"""A page of fields on a side: values at the point, the area and the normal, seen from outside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.elements.shapes import interpolate
from softehl.codegen.language.definition import Component
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.fields import AXISYMMETRIC
from softehl.codegen.language.flatten import Entries
from softehl.codegen.language.nodal_fields import NodalFields


class NeedsTraces(ModelError):  # noqa: N818 (named after what it is)
    """Error of a weak form on faces that needs traces of cells, as on "quad4_side"."""

    traces = True

    def __init__(self, what: str) -> None:
        remedy = 'on a side there are values of fields, no gradients, but with cell="quad4_side"'
        super().__init__(f"{what}: {remedy}")


class BoundaryModel(NodalFields):
    """Weak form on faces of a mesh; gradients are along the parent coordinates of the face."""

    def __init__(
        self, name: str, cell: Element, geometry: str, rule: QuadratureRule, doc: str
    ) -> None:
        super().__init__(name, cell, geometry, rule, doc, dimension=cell.dimension + 1)
        self._tangents = self._derived(self._X, self._parent(self.order)[1])
        vector = self.define("reference_area", sp.Matrix(self._crossed(self._tangents)))
        self._area = self.define("size_of_area", sp.sqrt(vector.dot(vector)))
        self._unit = vector / self._area

    @property
    def normal(self) -> Any:
        """Unit normal (dimension, 1) of the undeformed side, outwards."""
        return self._unit

    def area_vector(self, u: Any) -> Any:
        """Area vector (dimension, 1) of the side displaced by u, outwards, per undeformed area.

        A pressure p that follows the side is `m.weak(p * m.area_vector(u), u)`.
        """
        if getattr(u, "shape", None) != (self.dimension, 1):
            raise ModelError(f"area_vector: a vector of {self.dimension} is needed, as of m.vector")
        traces = [self._traced.get(v) for v in Entries.of(u).values]
        if any(t is None for t in traces):
            raise ModelError(f"area_vector: {u} is no field")
        moved = [
            [x[k] + t.gradient[k] for x, t in zip(self._tangents, traces, strict=True) if t]
            for k in range(self.cell.dimension)
        ]
        columns = list(map(list, zip(*moved, strict=True)))
        area = sp.Matrix(self._crossed(columns)) / self._area
        if self.geometry == AXISYMMETRIC:
            radius = self._position()[1]
            area = area * (radius + u[1]) / radius
        return area

    def grad(self, value: Any) -> Any:
        """Raise `NeedsTraces`: a face has no gradients."""
        raise NeedsTraces(f"grad of {value}")

    @property
    def size(self) -> Any:
        """Raise `NeedsTraces` likewise."""
        raise NeedsTraces("m.size")

    def jump(self, value: Any) -> Any:
        """Raise `NeedsTraces` likewise."""
        raise NeedsTraces(f"m.jump({value})")

    def average(self, value: Any) -> Any:
        """Raise `NeedsTraces` likewise."""
        raise NeedsTraces(f"m.average({value})")

    def _derived(self, columns: Sequence[Sequence[Any]], parent: Sequence[Sequence[Any]]) -> Any:
        """Derivatives of nodal values by the parent coordinates, [component][direction]."""
        size = range(self.cell.dimension)
        return [[interpolate([g[k] for g in parent], c) for k in size] for c in columns]

    def _crossed(self, t: Sequence[Sequence[Any]]) -> list[Any]:
        """Area vector of tangents [component][direction]; 2-D has the cell on the left."""
        if self.dimension == 2:
            return [t[1][0], -t[0][0]]
        return list(sp.Matrix([c[0] for c in t]).cross(sp.Matrix([c[1] for c in t])))

    def _slopes_of(self, component: Component, column: Sequence[Any]) -> list[Any]:
        parent = self._parent(component.order)[1]
        return list(self._derived([column], parent)[0])

    def _volume(self) -> Any:
        if self.geometry == AXISYMMETRIC:
            return self.define("area_of_ring", 2 * sp.pi * self._position()[1] * self._area)
        return self._area
