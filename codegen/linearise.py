"""From a model's potential to the outputs of each task."""

from __future__ import annotations

from codegen.abi import Task
from codegen.differentiate import Linearisation, gradient
from codegen.emit_c import Entry, Slot
from codegen.graph import Node
from codegen.model import Definition


def tasks(d: Definition) -> list[Task]:
    """What a model offers: an energy only where the residual is its gradient."""
    offered = [Task.RESIDUAL, Task.TANGENT]
    if d.conservative:
        offered.insert(0, Task.ENERGY)
    return [*offered, Task.FIELDS] if d.fields else offered


def outputs(d: Definition, task: Task) -> list[Entry]:
    """Output nodes of a task, before any pass."""
    if task is Task.ENERGY:
        return [Entry(Slot(False, 0), None, d.potential)]
    if task is Task.FIELDS:
        return [Entry(Slot(False, k), None, node) for k, (_, node) in enumerate(d.fields)]
    adjoint = gradient(d.graph, d.potential, d.directions, constant=d.constant, given=d.given)
    slots = _slots(d)
    rows = [Entry(s, None, adjoint[u]) for s, u in zip(slots, d.directions, strict=True)]
    if task is Task.RESIDUAL:
        return rows
    return rows + _tangent(d, rows, slots, adjoint)


def _slots(d: Definition) -> list[Slot]:
    direct = len(d.unknowns)
    return [Slot(u.varying, k - direct if u.varying else k) for k, u in enumerate(d.directions)]


def _tangent(
    d: Definition, rows: list[Entry], slots: list[Slot], adjoint: dict[Node, Node]
) -> list[Entry]:
    waist = [z for z in d.waist if z.varying]
    mirror = {adjoint[z]: z for z in waist if z in adjoint} if d.conservative else {}
    forward = Linearisation(d.graph, d.directions, d.waist, symmetric=mirror, given=d.given)
    entries: dict[tuple[int, int], Node] = {}
    for i, row in enumerate(rows):
        for j in range(len(slots)):
            if d.conservative and j < i and not d.interpolated:
                entries[i, j] = entries[j, i]
            else:
                entries[i, j] = forward.derivative(row.node, j)
    return [
        Entry(slots[i], slots[j], n)
        for (i, j), n in entries.items()
        if not (slots[i].basis or slots[j].basis) or n is not d.graph.zero
    ]
