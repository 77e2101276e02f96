"""Weak form at one point: a model whose unknowns are values and gradients.

Its residual is the fluxes, its tangent the moduli; nothing of a cell is in it but its dimension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import point_rule
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.graph import InputEntry, Node, Op
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Component, PointForm, PointQuantity
from softehl.codegen.language.errors import NeedsElementError
from softehl.codegen.language.fields import AXISYMMETRIC, Fields, FieldTrace
from softehl.codegen.language.flatten import Entries


class PointModel(Fields):
    """Model of a point: values and gradients are unknowns, densities are per volume."""

    _varying_points = False

    def __init__(self, name: str, cell: Element, geometry: str, doc: str) -> None:
        super().__init__(name, cell, geometry, 1, point_rule(), doc)
        self._X = [x[0] for x in self.coordinates(*"XYZ"[: cell.dimension])]
        self._quantities: list[PointQuantity] = []
        self._data_at_point: dict[int, PointQuantity] = {}
        self._centroid: dict[int, Node] = {}

    def form(self) -> PointForm:
        """The finished model with the meaning of its unknowns and data."""
        d = self.finish()
        used = set(reachable([d.potential]))
        directions = tuple(n for n in d.directions if n in used)
        unknowns = tuple(self._quantities[_index(n)] for n in directions)
        others = [n for n in directions if _index(n) in self._centroid]
        varied = gradient(
            d.graph, d.potential, others, constant=d.constant, prescribed=d.prescribed
        )
        if any(varied[n] is not d.graph.zero for n in others):
            raise NeedsElementError("m.centroid of what is varied")
        d = replace(d, directions=directions)
        return PointForm(
            definition=d,
            unknowns=unknowns,
            all=tuple(self._quantities),
            data=dict(self._data_at_point),
            axisymmetric=self.geometry == AXISYMMETRIC,
            centroid=self._centroid,
        )

    def centroid(self, value: Any) -> Any:
        """See `Fields`: unknowns of their own, where fields and places alone say what they are."""
        entries, named = Entries.of(value), []
        for v in entries.values:
            node = self._symbols.lower(v)
            met = reachable([node])
            inputs = [n.payload for n in met if isinstance(n.payload, InputEntry)]
            allowed = all(
                i.array == "coordinates" or (i.array == "dofs" and i.index not in self._centroid)
                for i in inputs
            )
            if not allowed or any(n.op is Op.CALL for n in met):
                raise NeedsElementError(f"m.centroid({value})")
            label = f"centroid_{len(self._centroid)}"
            self._centroid[len(self._quantities)] = node
            self._quantities.append(PointQuantity(Component(label, 0), None))
            named.append(self.unknown(label))
        return entries.arrange(named)

    def _components_of(self, components: Sequence[Component]) -> list[FieldTrace]:
        traced = []
        for component in components:
            labels = [
                component.name,
                *(f"grad_{component.name}_{k}" for k in range(self.dimension)),
            ]
            quantities = [PointQuantity(component, k) for k in (None, *range(self.dimension))]
            if component.is_data:
                start = len(self._arguments.lists["data"])
                symbols = self.data(**dict.fromkeys(labels, "at the point"))
                self._data_at_point.update(enumerate(quantities, start))
            else:
                symbols = [self.unknown(label) for label in labels]
                self._quantities += quantities
            traced.append(FieldTrace(component, symbols[0], tuple(symbols[1:])))
        return traced

    def _position(self) -> list[Any]:
        return self._X

    def _volume(self) -> Any:
        return sp.Integer(1)

    def _total_of(self, name: str, density: Any) -> Any:
        return self.define(name, density)

    def point_data(self, /, **meanings: str) -> list[sp.Symbol]:
        """Declare point data; they do not vary, as there is one point."""
        return self._arguments.declare("point data", meanings)

    def _check_use(self, potential: Node) -> None:
        """Accept unused values and gradients: which of them occur is the result."""


def _index(n: Node) -> int:
    assert isinstance(n.payload, InputEntry)
    return n.payload.index
