"""From a model's potential to the outputs of each task."""

from __future__ import annotations

from collections.abc import Iterator

from softehl.codegen.abi import Task, derivative_task
from softehl.codegen.derive.linearise import Linearisation
from softehl.codegen.derive.modal import through_interfaces
from softehl.codegen.derive.outputs import Entry, Slot
from softehl.codegen.graph.differentiate import directional, gradient
from softehl.codegen.graph.graph import Input, Node
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Definition

SMALL = 100
"""Values of a potential so simple that its interfaces may cost more than they save."""


def tasks(d: Definition) -> list[str]:
    """What a model offers: an energy only where the residual is its gradient, or what it chose."""
    offered: list[str] = [Task.RESIDUAL, Task.TANGENT]
    if d.conservative:
        offered.insert(0, Task.ENERGY)
    if d.fields:
        offered.append(Task.FIELDS)
    if d.product:
        offered.append(Task.PRODUCT)
    if d.tasks is not None:
        offered = [t for t in offered if t in d.tasks]
    return offered + [derivative_task(name) for name, _ in d.derivatives]


def outputs(d: Definition, task: str) -> list[Entry]:
    """Output nodes of a task, before any pass: the first of its `variants`."""
    return next(variants(d, task))


def variants(d: Definition, task: str) -> Iterator[list[Entry]]:
    """The same outputs by different chain rules: which one is the cheapest, passes will tell."""
    if task == Task.ENERGY:
        yield [Entry(Slot(False, 0), None, d.potential)]
    elif task == Task.FIELDS:
        yield [Entry(Slot(False, k), None, node) for k, (_, node) in enumerate(d.fields)]
    elif task not in (Task.RESIDUAL, Task.TANGENT):
        yield _rates(d, task)
    else:
        found = list(through_interfaces(d))
        for modal in found:
            yield modal.residual() + (modal.tangent() if task == Task.TANGENT else [])
        if not found or len(reachable([d.potential])) <= SMALL:
            yield _plain(d, task)


def _plain(d: Definition, task: str) -> list[Entry]:
    """Reverse mode, and forward over it through the interfaces that the model names."""
    adjoint = gradient(d.graph, d.potential, d.directions, constant=d.constant, given=d.given)
    slots = _slots(d)
    rows = [Entry(s, None, adjoint[u]) for s, u in zip(slots, d.directions, strict=True)]
    return rows + (_tangent(d, rows, slots, adjoint) if task == Task.TANGENT else [])


def _rates(d: Definition, task: str) -> list[Entry]:
    """The residual's derivative along `direction` or with respect to one argument."""
    g = d.graph
    rows = outputs(d, Task.RESIDUAL)
    if task == Task.PRODUCT:
        array = {"dofs": "direction", "interpolated": "interpolated direction"}
        seeds = {
            u: g.input(array[u.payload.array], u.payload.index, varying=u.varying)
            for u in d.directions
            if isinstance(u.payload, Input)
        }
    else:
        by_task = {derivative_task(name): node for name, node in d.derivatives}
        seeds = {by_task[task]: g.one}
    rates = directional(g, [x.node for x in rows], seeds, d.given)
    return [Entry(x.row, None, n) for x, n in zip(rows, rates, strict=True)]


def _slots(d: Definition) -> list[Slot]:
    direct = len(d.unknowns)
    return [Slot(u.varying, k - direct if u.varying else k) for k, u in enumerate(d.directions)]


def _tangent(
    d: Definition, rows: list[Entry], slots: list[Slot], adjoint: dict[Node, Node]
) -> list[Entry]:
    interface = [z for z in d.interface if z.varying]
    mirror = {adjoint[z]: z for z in interface if z in adjoint} if d.conservative else {}
    forward = Linearisation(d.graph, d.directions, d.interface, symmetric=mirror, given=d.given)
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
