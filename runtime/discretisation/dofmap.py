"""Numbering of the unknowns: named fields, one after another, in one vector.

`Numbering` is made of the names that pages give their unknowns: u_x1, u_y1, u_x2, ...: a name and
the number of the element's node. Equal names on equal nodes are one unknown, whichever block they
come from. A name without a number belongs to the element alone, or to all elements together where
it is declared as shared. A field that a page interpolates along its elements has unknowns at points
of its own, which blocks share.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Flags, Integers
from softehl.runtime.kernels.kernel import Kernel

AXES = ("x", "y", "z", "r")
"""Suffixes of the names of the components of a vector."""


@dataclass(frozen=True)
class DofLayout:
    """Numbering of named fields in the vector of unknowns.

    Parameters
    ----------
    names : tuple of str
        Fields in the order of their unknowns.
    counts : tuple of int
        Number of unknowns of each.
    """

    names: tuple[str, ...]
    counts: tuple[int, ...]

    @classmethod
    def of(cls, **counts: int) -> DofLayout:
        """Make a layout.

        Parameters
        ----------
        **counts : int
            Field -> number of unknowns, in this order.

        Returns
        -------
        DofLayout
            The layout.
        """
        return cls(tuple(counts), tuple(counts.values()))

    @property
    def total(self) -> int:
        """Number of all unknowns."""
        return sum(self.counts)

    def count(self, name: str) -> int:
        """Return the number of unknowns of a field.

        Parameters
        ----------
        name : str
            The field.

        Returns
        -------
        int
            Number.

        Raises
        ------
        UnknownNameError
            There is no such field; a KeyError.
        """
        part = self.part(name)
        return int(part.stop - part.start)

    def part(self, name: str) -> slice:
        """Return the slice of a field in the vector of unknowns.

        Parameters
        ----------
        name : str
            The field.

        Returns
        -------
        slice
            First and last number.

        Raises
        ------
        UnknownNameError
            There is no such field; a KeyError.
        """
        try:
            return self._parts[name]
        except KeyError:
            allowed = ", ".join(self.names)
            raise UnknownNameError(f"no field {name!r}; there are {allowed}") from None

    def dofs(self, name: str) -> Integers:
        """Return the numbers of the unknowns of a field.

        Parameters
        ----------
        name : str
            The field.

        Returns
        -------
        array of int (count,)
            Numbers.

        Raises
        ------
        UnknownNameError
            There is no such field; a KeyError.
        """
        part = self.part(name)
        return np.arange(part.start, part.stop)

    @cached_property
    def fields(self) -> tuple[Integers, ...]:
        """Numbers of the unknowns of each field; components u_x, u_y, ... of one are together."""
        return tuple(np.concatenate([self.dofs(n) for n in names]) for names in self.vectors)

    @cached_property
    def vectors(self) -> tuple[tuple[str, ...], ...]:
        """Names of the fields, those of the components of a vector together."""
        components: dict[str, list[str]] = {}
        for name in self.names:
            stem, _, axis = name.rpartition("_")
            components.setdefault(stem if stem and axis in AXES else name, []).append(name)
        return tuple(map(tuple, components.values()))

    @cached_property
    def _parts(self) -> dict[str, slice]:
        stops = itertools.accumulate(self.counts)
        named = zip(self.names, self.counts, stops, strict=True)
        return {name: slice(end - count, end) for name, count, end in named}


def displacement_dofs(nodes: Integers) -> Integers:
    """Displacement unknowns u_z, u_r of nodes (n, k), node by node: (n, 2 k)."""
    pairs = np.stack([2 * nodes, 2 * nodes + 1], axis=-1)
    return pairs.reshape(len(nodes), 2 * nodes.shape[-1])


def chain_dofs(segments: int, order: int, first: int) -> Integers:
    """Unknowns of a continuous piecewise polynomial along a chain: (segments, order + 1).

    Neighbours share the unknown at their common end, so `order * segments + 1` are used.
    """
    start = first + order * np.arange(segments)
    return start[:, None] + np.arange(order + 1)[None, :]


def separate_dofs(segments: int, order: int, first: int) -> Integers:
    """Unknowns of a discontinuous piecewise polynomial along a chain: (segments, order + 1).

    Neighbours share none, so `(order + 1) * segments` are used.
    """
    return first + np.arange(segments * (order + 1)).reshape(segments, order + 1)


def gather_rows(*parts: Integers) -> Integers:
    """Element dof map (n, ndof) from maps side by side; each (n, k) or (n,)."""
    columns: Sequence[Integers] = [p[:, None] if p.ndim == 1 else p for p in parts]
    return np.ascontiguousarray(np.concatenate(columns, axis=1))


_NUMBERED = re.compile(r"(.*?[^\d_]_?)(\d+)")


@dataclass(frozen=True)
class Slot:
    """One element unknown of a kernel: its name, and the number of its node or None."""

    name: str
    node: int | None


def slots(kernel: Kernel) -> tuple[Slot, ...]:
    """Field and node of each unknown of a kernel, by its page, else by the names."""
    if kernel.places:
        return tuple(Slot(name, node) for name, node in kernel.places)
    return from_names(kernel.unknowns, kernel.nodes)


def from_names(unknowns: Sequence[str], nodes: int) -> tuple[Slot, ...]:
    """A name is nodal where it comes with the numbers 1 to n of the element's first n nodes."""
    matches = [_NUMBERED.fullmatch(name) for name in unknowns]
    numbers: dict[str, list[int]] = {}
    for match in matches:
        if match:
            numbers.setdefault(match[1], []).append(int(match[2]))
    nodal = {
        name
        for name, node_numbers in numbers.items()
        if len(node_numbers) <= nodes
        and sorted(node_numbers) == list(range(1, len(node_numbers) + 1))
    }
    return tuple(
        Slot(m[1], int(m[2]) - 1) if m and m[1] in nodal else Slot(name, None)
        for name, m in zip(unknowns, matches, strict=True)
    )


@dataclass(frozen=True, eq=False)
class ElementUnknowns:
    """Elements of one block: nodes (n, k), what their unknowns are, which of them are shared.

    along: names of fields that are interpolated along the elements -> numbers (n, m) of their
    places, counted from 0 in each field; blocks that name the same place share its unknown.
    """

    block: str
    nodes: Integers
    slots: tuple[Slot, ...]
    shared: frozenset[str] = frozenset()
    along: Mapping[str, Integers] = field(default_factory=lambda: MappingProxyType({}))

    @cached_property
    def shared_names(self) -> dict[str, None]:
        """Names of the unknowns without a node, in their order."""
        return dict.fromkeys(slot.name for slot in self.slots if slot.node is None)


@dataclass(frozen=True, eq=False)
class Numbering:
    """Numbers of all unknowns.

    layout: its fields. nodal: name -> (points,) number of the unknown at each node, -1
    where there is none. dofs: block -> (n, ndof) element dof map.
    """

    layout: DofLayout
    nodal: Mapping[str, Integers]
    dofs: Mapping[str, Integers]

    @classmethod
    def of(
        cls,
        points: int,
        blocks: Sequence[ElementUnknowns],
        fields: Mapping[str, Sequence[str]] | None = None,
    ) -> Numbering:
        """Number the unknowns of blocks of elements on so many nodes.

        fields: name of a field -> names of its unknowns, which are numbered node by node. These
        fields come first, in this order, but for those that no block has; then each other name as
        a field of its own. Raises ValueError for a field of several names that are not at nodes.
        """
        has_unknown, others = _present(points, blocks), _others(blocks)
        both = sorted(has_unknown.keys() & others.keys())
        if both:
            raise ValueError(
                f"{', '.join(both)}: an unknown of nodes in one block and of elements in another; "
                "give one of them another name"
            )
        counts = {name: int(mask.sum()) for name, mask in has_unknown.items()} | others
        members = _members(counts, has_unknown.keys(), fields or {})
        layout = DofLayout.of(**{f: sum(counts[n] for n in names) for f, names in members.items()})
        nodal: dict[str, Integers] = {}
        rows: dict[str, Integers] = {}
        for name, names in members.items():
            if names[0] in others:
                rows[names[0]] = layout.dofs(name)
                continue
            numbers = np.full((points, len(names)), -1)
            numbers[np.stack([has_unknown[n] for n in names], axis=1)] = layout.dofs(name)
            nodal |= {n: np.ascontiguousarray(numbers[:, k]) for k, n in enumerate(names)}
        nodal = {name: nodal[name] for name in has_unknown}
        return cls(layout, nodal, {b.block: _dofs(b, blocks, nodal, rows) for b in blocks})

    def at(self, names: Sequence[str], nodes: Integers) -> Integers:
        """Numbers (n, k m) of m unknowns of nodes (n, k), node by node."""
        return np.stack([self.nodal[name][nodes] for name in names], axis=2).reshape(len(nodes), -1)

    def rows(self, block: str, field: str) -> Integers:
        """Numbers (n, k) of the unknowns of a field in the elements of a block."""
        part, dofs = self.layout.part(field), self.dofs[block]
        return dofs[:, ((dofs >= part.start) & (dofs < part.stop)).all(axis=0)]


def _members(
    allowed: Collection[str], at_nodes: Collection[str], fields: Mapping[str, Sequence[str]]
) -> dict[str, list[str]]:
    """Fields with the names of their unknowns: those that are given, then each other name."""
    members = {field: [n for n in names if n in allowed] for field, names in fields.items()}
    grouped = {unknown for names in members.values() for unknown in names}
    for name, names in members.items():
        if len(names) > 1 and not set(names) <= set(at_nodes):
            raise ValueError(f"field {name!r}: {', '.join(names)} are not all at nodes")
        if name in allowed and name not in grouped:
            raise ValueError(f"field {name!r}: an unknown that is not in it has this name")
    alone = {name: [name] for name in allowed if name not in grouped}
    return {name: names for name, names in (members | alone).items() if names}


def _present(points: int, blocks: Sequence[ElementUnknowns]) -> dict[str, Flags]:
    """Unknowns at nodes: name -> (points,) where there is one."""
    masks: dict[str, Flags] = {}
    for block in blocks:
        for slot in block.slots:
            if slot.node is not None:
                mask = masks.setdefault(slot.name, np.zeros(points, dtype=bool))
                mask[block.nodes[:, slot.node]] = True
    return masks


def _others(blocks: Sequence[ElementUnknowns]) -> dict[str, int]:
    """Numbers of the unknowns of elements, and of those along elements, by name."""
    element_names = dict.fromkeys(name for block in blocks for name in block.shared_names)
    offsets = {name: _first(name, blocks, None) for name in element_names}
    for block in blocks:
        for name, points in block.along.items():
            if name in element_names:
                raise ValueError(f"{name}: an unknown of elements and a field along them")
            offsets[name] = max(offsets.get(name, 0), int(points.max(initial=-1)) + 1)
    return offsets


def _first(name: str, blocks: Sequence[ElementUnknowns], until: ElementUnknowns | None) -> int:
    """Number of the unknowns of a name without nodes in the blocks before one of them.

    The one that blocks share comes first.
    """
    users = [block for block in blocks if name in block.shared_names]
    count = int(any(name in user.shared for user in users))
    for user in users:
        if user is until:
            break
        count += len(user.nodes) if name not in user.shared else 0
    return count


def _dofs(
    block: ElementUnknowns,
    blocks: Sequence[ElementUnknowns],
    nodal: Mapping[str, Integers],
    rows: Mapping[str, Integers],
) -> Integers:
    """Element dof map (n, ndof) of a block. rows: numbers of the unknowns without nodes."""
    n, columns = len(block.nodes), []
    for slot in block.slots:
        if slot.node is not None:
            columns.append(nodal[slot.name][block.nodes[:, slot.node]])
        elif slot.name in block.shared:
            columns.append(np.full(n, rows[slot.name][0]))
        else:
            first = _first(slot.name, blocks, block)
            columns.append(rows[slot.name][first : first + n])
    columns += [column for name, points in block.along.items() for column in rows[name][points].T]
    return np.ascontiguousarray(np.stack(columns, axis=1))
