"""Unknowns of a problem by the names that its pages give them.

A page calls its unknowns u_x1, u_y1, u_x2, ...: a name and the number of the element's node. Equal
names on equal nodes are one unknown, whichever block they come from. A name without a number
belongs to the element alone, or to all elements together where it is declared as shared.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Flags, Integers
from softehl.runtime.fem.dofs import DofLayout
from softehl.runtime.kernels import Kernel

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
        for name, found in numbers.items()
        if len(found) <= nodes and sorted(found) == list(range(1, len(found) + 1))
    }
    return tuple(
        Slot(m[1], int(m[2]) - 1) if m and m[1] in nodal else Slot(name, None)
        for name, m in zip(unknowns, matches, strict=True)
    )


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one block: nodes (n, k), what their unknowns are, which of them are shared."""

    block: str
    nodes: Integers
    slots: tuple[Slot, ...]
    shared: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Numbering:
    """Numbers of all unknowns.

    layout: a field for each name. nodal: name -> (points,) number of the unknown at each node, -1
    where there is none. dofs: block -> (n, ndof) element dof map.
    """

    layout: DofLayout
    nodal: Mapping[str, Integers]
    dofs: Mapping[str, Integers]

    @classmethod
    def of(cls, points: int, blocks: Sequence[Elements]) -> Numbering:
        """Number the unknowns of blocks of elements on so many nodes."""
        present: dict[str, Flags] = {}
        own: dict[str, list[Elements]] = {}
        for block in blocks:
            for slot in block.slots:
                if slot.node is not None:
                    there = present.setdefault(slot.name, np.zeros(points, dtype=bool))
                    there[block.nodes[:, slot.node]] = True
                else:
                    own.setdefault(slot.name, []).append(block)
        counts = {name: int(there.sum()) for name, there in present.items()}
        counts |= {name: _own(name, users) for name, users in own.items()}
        layout = DofLayout.of(**counts)
        nodal = {}
        for name, there in present.items():
            nodal[name] = np.full(points, -1)
            nodal[name][there] = layout.dofs(name)
        dofs = {b.block: _element_dofs(b, layout, nodal, own) for b in blocks}
        return cls(layout, nodal, dofs)


def _own(name: str, users: Sequence[Elements]) -> int:
    """Number of unknowns of a name without nodes."""
    shared = any(name in user.shared for user in users)
    return int(shared) + sum(len(u.nodes) for u in users if name not in u.shared)


def _element_dofs(
    block: Elements,
    layout: DofLayout,
    nodal: Mapping[str, Integers],
    own: Mapping[str, list[Elements]],
) -> Integers:
    n = len(block.nodes)
    columns = []
    for slot in block.slots:
        if slot.node is not None:
            columns.append(nodal[slot.name][block.nodes[:, slot.node]])
            continue
        users, numbers = own[slot.name], layout.dofs(slot.name)
        if slot.name in block.shared:
            columns.append(np.full(n, numbers[0]))
            continue
        first = int(any(slot.name in user.shared for user in users))
        for user in users:
            if user is block:
                break
            first += len(user.nodes) if slot.name not in user.shared else 0
        columns.append(numbers[first : first + n])
    return np.ascontiguousarray(np.stack(columns, axis=1))
