"""Places of unknowns, data and quantities of a weak form, in the cell and at the point."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from softehl.codegen.derive.output_entries import OutputEntry
from softehl.codegen.elements.cells import ELEMENTS, linear
from softehl.codegen.emit.points import basis_tables
from softehl.codegen.emit.points.basis_tables import BasisTable
from softehl.codegen.graph.graph import InputEntry
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Component, Definition, PointForm, PointQuantity
from softehl.codegen.language.fields import order_of
from softehl.codegen.language.weak_form import rule_of


@dataclass(frozen=True)
class StridedEntries:
    """Entries of a component in an array of the element: start + stride * node."""

    start: int
    stride: int

    def at(self, node: str) -> str:
        """Index of the entry of a node, in C."""
        return (
            f"{self.start} + {self.stride} * {node}"
            if self.stride > 1
            else f"{self.start} + {node}"
        )


@dataclass(frozen=True, eq=False)
class PointLayout:
    """A family `d` with its form at a point. centroid: whether the only point is the centroid."""

    d: Definition
    form: PointForm
    centroid: bool = False

    @property
    def site(self) -> Definition:
        """The model at the point."""
        return self.form.definition

    @property
    def place_of_points(self) -> str:
        """In a word."""
        return "centroid" if self.centroid else "point"

    @property
    def tables(self) -> str:
        """Beginning of the names of tables of constants."""
        return self.d.cell + ("_centroid" if self.centroid else "")

    def at_centroid(self) -> PointLayout:
        """This family with the centroid as its only point."""
        rule = rule_of(ELEMENTS[self.d.cell], 1)
        return PointLayout(replace(self.d, rule=rule), self.form, centroid=True)

    @property
    def points(self) -> int:
        """Quadrature points."""
        return len(self.d.rule.points)

    @property
    def dimension(self) -> int:
        """Of the cell."""
        return self.d.rule.dimension

    @cached_property
    def components(self) -> list[Component]:
        """Unknown components, in the order of the model."""
        some = [q for k, q in enumerate(self.form.all) if k not in self.form.centroid]
        return list(dict.fromkeys(q.component for q in some))

    def entries(self, c: Component) -> StridedEntries:
        """Place of a component among the unknowns, or the data, of the element."""
        if c.is_data:
            names = [a.name for a in self.d.data]
            numbers = [names.index(f"{c.name}{a + 1}") for a in range(self.shape(c.order).nodes)]
        else:
            numbers = [k for k, (name, _) in enumerate(self.d.dof_nodes) if name == c.name]
        stride = numbers[1] - numbers[0] if len(numbers) > 1 else 1
        assert all(n == numbers[0] + stride * a for a, n in enumerate(numbers))
        return StridedEntries(numbers[0], stride)

    def field(self, c: Component) -> int:
        """Unknowns before those of the field that a component belongs to."""
        entries = self.entries(c)
        inside = [
            self.entries(o).start
            for o in self.components
            if self.entries(o).stride == entries.stride
        ]
        return min(s for s in inside if entries.start - s in range(entries.stride))

    def shape(self, order: int) -> BasisTable:
        """Shape functions of an order."""
        if order == 0:
            return basis_tables.constant(self.points, self.dimension)
        if order not in self._shapes:
            element = ELEMENTS[self.d.cell]
            cell = linear(element) if order == 1 else element
            self._shapes[order] = basis_tables.shape(order, cell, self.d.rule)
        return self._shapes[order]

    @property
    def long_orders(self) -> list[int]:
        """Orders of shape functions whose tables are long."""
        every = [*self.form.all, *self.form.data.values()]
        used_orders = {self.geometry.order, *orders(every)}
        return sorted(order for order in used_orders if self.shape(order).long)

    @cached_property
    def _shapes(self) -> dict[int, BasisTable]:
        return {}

    @cached_property
    def geometry(self) -> BasisTable:
        """Shape functions of the map from the parent cell."""
        return self.shape(order_of(ELEMENTS[self.d.cell]))


@dataclass(frozen=True)
class Needs:
    """Inputs of a task at a point: numbers of entries by array."""

    arrays: dict[str, tuple[int, ...]]

    @staticmethod
    def of(entries: Iterable[OutputEntry]) -> Needs:
        """Inputs of some outputs."""
        numbers: dict[str, set[int]] = {}
        for n in reachable([x.node for x in entries]):
            if isinstance(n.payload, InputEntry):
                numbers.setdefault(n.payload.array, set()).add(n.payload.index)
        return Needs({array: tuple(sorted(some)) for array, some in numbers.items()})

    def __getitem__(self, array: str) -> tuple[int, ...]:
        return self.arrays.get(array, ())


def orders(quantities: Sequence[PointQuantity]) -> list[int]:
    """Orders of shape functions that occur, the highest first."""
    return sorted({q.component.order for q in quantities}, reverse=True)
