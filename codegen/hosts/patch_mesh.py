"""A small patch of standard cells, for the tests and the input decks of hosts.

Two or more cells a direction in the unit square (cube), moved by 1 from the axes and distorted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import permutations, product

from softehl.codegen.elements.element import Element
from softehl.codegen.hosts.element_interface import ElementInterface

Place = tuple[Fraction, ...]
Map = Callable[[Place], Place]
CELLS = {1: 4, 2: 3, 3: 2}
"""Cells a direction, by the dimension."""
PULL = 0.05
"""Value of the first unknown on the right side, where the others are zero."""


@dataclass(frozen=True)
class Patch:
    """Nodes of a mesh, cells by the numbers of their nodes, and nodes of its ends."""

    points: list[list[float]]
    cells: list[list[int]]
    left: list[int]
    right: list[int]


def patch(kind: Element, count: int | None = None) -> Patch:
    """The patch of a kind of cell."""
    count = count or CELLS[kind.dimension]
    number: dict[Place, int] = {}
    cells = []
    for corner in product(range(count), repeat=kind.dimension):
        for to_cube in _parts(kind):
            points = [to_cube(_exact(p)) for p in kind.nodes]
            moved = [tuple((c + x) / count for c, x in zip(corner, p, strict=True)) for p in points]
            cells.append([number.setdefault(p, len(number)) for p in moved])
    end_nodes = [[k for p, k in number.items() if p[0] == end] for end in (0, 1)]
    return Patch([_distorted(p) for p in number], cells, end_nodes[0], end_nodes[1])


def _exact(point: tuple[object, ...]) -> Place:
    return tuple(Fraction(str(c)) for c in point)


def _parts(kind: Element) -> Iterator[Map]:
    """Maps from the parent cell to its parts of the unit cube."""
    if kind.cell.name == "wedge":
        for part in _simplices(2):
            yield lambda p, part=part: (*part(p[:2]), (1 + p[2]) / 2)  # type: ignore[misc]
    elif kind.cell.name == "pyramid":
        yield from _pyramids()
    elif any(kind.cell.collapse):
        yield from _simplices(kind.dimension)
    else:
        yield lambda p: tuple((1 + c) / 2 for c in p)


def _pyramids() -> Iterator[Map]:
    """Maps of the pyramid to the six of the cube that have its faces and its middle."""
    half = Fraction(1, 2)
    for axis, end in product(range(3), (0, 1)):

        def affine(p: Place, axis: int = axis, end: int = end) -> Place:
            x, y, height = p if end == 0 else (p[1], p[0], p[2])
            point = [half * (1 + x), half * (1 + y)]
            point.insert(axis, half * height if end == 0 else 1 - half * height)
            if axis == 1:
                point[0], point[2] = point[2], point[0]
            return tuple(point)

        yield affine


def _simplices(d: int) -> Iterator[Map]:
    """Maps of the unit simplex to the d! ones that fill the cube, none turned inside out."""
    for order in permutations(range(d)):
        corners = [tuple(Fraction(k in order[:n]) for k in range(d)) for n in range(d + 1)]
        if sum(a > b for k, b in enumerate(order) for a in order[:k]) % 2:
            corners[1], corners[2] = corners[2], corners[1]

        def affine(p: Place, corners: list[Place] = corners) -> Place:
            weights = (1 - sum(p), *p)
            return tuple(
                sum((w * c[k] for w, c in zip(weights, corners, strict=True)), Fraction(0))
                for k in range(d)
            )

        yield affine


def _distorted(point: Place) -> list[float]:
    """A smooth map of the unit cube that keeps the ends of the first direction apart."""
    x = [float(c) for c in point]
    bend = 0.1 * sum((k + 1) * c * (1 - c) for k, c in enumerate(x))
    return [1 + c + bend * (0.3 if k == 0 else c) for k, c in enumerate(x)]


@dataclass(frozen=True)
class Held:
    """Node, number of the name in `ElementInterface.nodal`, and value at the end."""

    node: int
    field: int
    value: float


def starts(interface: ElementInterface) -> list[float]:
    """Value at rest of each name: that of the model's example at node 1, else zero."""
    example = dict(interface.definition.example)
    names = interface.definition.unknowns
    return [example.get(names[f.dofs[0]], 0.0) for f in interface.nodal]


def prescribed(interface: ElementInterface, mesh: Patch) -> list[Held]:
    """Prescribed values on both sides, for every name with unknowns at all nodes."""
    full = [k for k, f in enumerate(interface.nodal) if len(f.dofs) == interface.definition.nodes]
    initial = starts(interface)
    first = full[0] if full else -1
    pulled = {
        k: PULL * max(1.0, abs(initial[k])) for k in full if k == first or k not in interface.vector
    }
    sides = ((mesh.left, dict.fromkeys(full, 0.0)), (mesh.right, pulled))
    return [
        Held(node, k, initial[k] + values.get(k, 0.0))
        for nodes, values in sides
        for node in nodes
        for k in full
    ]


def numbers(interface: ElementInterface, mesh: Patch) -> dict[tuple[int, int], int]:
    """Equation of each (node, number of the name), node after node."""
    occupied: dict[tuple[int, int], None] = {}
    for cell in mesh.cells:
        for node, dof in enumerate(cell):
            occupied.update(
                {(dof, k): None for k, f in enumerate(interface.nodal) if node < len(f.dofs)}
            )
    return {key: n for n, key in enumerate(sorted(occupied))}
