"""Fields and blocks as they are declared, and what becomes of them on a section.

A `Field` becomes `Unknowns` with a row for every element of the sets that it can stand on, a
`Block` a dof map of such rows side by side. `cases.seal.equations.system` lists them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.section import SealSection
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import ElementBlock
from softehl.runtime.fem.dofs import (
    DofLayout,
    chain_dofs,
    displacement_dofs,
    gather_rows,
    separate_dofs,
)
from softehl.runtime.kernels import Rule, load_kernel

Place = Literal["nodes", "film", "arc_nodes", "outer_nodes", "wall_nodes", "section"]
Group = Literal["solid", "load", "contact", "film", "squeeze", "support"]


@dataclass(frozen=True)
class Field:
    """A field of unknowns.

    on: what has one of them: each node (two displacements), each segment of the film (the
    coefficients of a polynomial), each node of the arc, of the other boundary or of what may touch
    a wall, or the section.
    scale: reference size of its residuals. order: of a film field, None for the case's m_p.
    needed: whether a case has it.
    """

    name: str
    on: Place
    scale: Callable[[Seal], float]
    order: int | None = None
    needed: Callable[[Seal], bool] = lambda _: True


@dataclass(frozen=True)
class Block:
    """Elements of one kernel.

    kernel: its name; {solid} stands for the solid of its region, "" where it is the case's, {oil}
    for how the oil thins.
    elements: a set of `SealSection.elements`. fields: whose unknowns its dof map holds, in this
    order. group: which values its parameters are taken from. layer: whether it belongs to the film
    in the modified Newton iteration, which then treats it exactly. needed: whether a case has it.
    rule: its quadrature for a case and an order of the pressure, None for the kernel's own.
    constant: the tangent depends on parameters alone.
    """

    name: str
    kernel: str
    elements: str
    fields: tuple[str, ...]
    group: Group
    layer: bool = False
    needed: Callable[[Seal], bool] = lambda _: True
    rule: Callable[[Seal, int], Rule] | None = None
    constant: bool = False
    region: str = ""

    def kernel_of(self, p: Seal) -> str:
        """Name of the kernel in a case."""
        solid = p.rubber(self.region).solid_kernel(p.solid)
        return self.kernel.format(solid=solid, oil=p.film_suffix)


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Unknowns of a field, counted from 0, with the rows (n, k) of each set of elements."""

    field: Field
    count: int
    rows: Mapping[str, Integers]

    @property
    def order(self) -> int:
        """Order of the polynomials on the segments of the film."""
        return int(self.rows["arc"].shape[1]) - 1


def number_unknowns(field: Field, p: Seal, section: SealSection) -> Unknowns:
    """Places of the unknowns of a field.

    Pressures: m_p a segment and one more where they are continuous, m_p + 1 a segment in (22).
    """
    elements = section.elements
    if field.on == "nodes":
        rows = {name: displacement_dofs(nodes) for name, nodes in elements.items()}
        return Unknowns(field, 2 * len(section.mesh.points), rows)
    if field.on == "film":
        number = chain_dofs if p.reynolds == "fe" else separate_dofs
        arc = number(section.mesh.arc, field.order or p.pressure_order, 0)
        facets = np.concatenate([arc[:-1], arc[1:]], axis=1)
        count = int(arc.max()) + 1
        single = np.arange(count)[:, None]
        return Unknowns(field, count, {"arc": arc, "facets": facets, "film_nodes": single})
    if field.on == "section":
        rows = {name: np.zeros((len(nodes), 1), np.int64) for name, nodes in elements.items()}
        return Unknowns(field, 1, rows)
    n = len(elements[field.on])
    return Unknowns(field, n, {field.on: np.arange(n)[:, None]})


@dataclass(frozen=True, eq=False)
class Numbering:
    """All unknowns of a section in one vector."""

    section: SealSection
    unknowns: Mapping[str, Unknowns]
    layout: DofLayout

    @classmethod
    def of(cls, fields: tuple[Field, ...], p: Seal, section: SealSection) -> Numbering:
        """Fields that the case has, one after another."""
        present = [field for field in fields if field.needed(p)]
        unknowns = {field.name: number_unknowns(field, p, section) for field in present}
        layout = DofLayout.of(**{name: u.count for name, u in unknowns.items()})
        return cls(section, unknowns, layout)

    def rows(self, field: str, elements: str) -> Integers:
        """Unknowns (n, k) of a field on the elements of a set."""
        return np.asarray(self.unknowns[field].rows[elements] + self.layout.part(field).start)

    def columns(self, block: Block, field: str) -> slice:
        """Columns of the unknowns of a field in the dof map of a block."""
        widths = [self.unknowns[f].rows[block.elements].shape[1] for f in block.fields]
        position = block.fields.index(field)
        first = sum(widths[:position])
        return slice(first, first + widths[position])

    def element_block(self, block: Block, p: Seal, data: Array | None) -> ElementBlock:
        """The elements of a block; data: their constants (n, k)."""
        films = [f for f in block.fields if self.unknowns[f].field.on == "film"]
        kernel = load_kernel(block.kernel_of(p))
        numbers = gather_rows(*(self.rows(field, block.elements) for field in block.fields))
        rule, n = block.rule(p, self.unknowns[films[0]].order) if block.rule else None, len(numbers)
        places = self.section.coordinates(block.elements) if kernel.coordinates else None
        at_rest = np.zeros((n, len(kernel.data))) if kernel.data and data is None else data
        points = np.zeros((n, len(rule.weights), len(kernel.point_data))) if rule else None
        return ElementBlock(
            name=block.name,
            kernel=kernel,
            coordinates=np.empty((n, 0)) if places is None else places,
            dofs=numbers,
            data=at_rest,
            rule=rule,
            constant=block.constant,
            point_data=points if kernel.point_data else None,
        )
