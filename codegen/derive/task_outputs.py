"""From a model's potential to the outputs of each task."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from softehl.codegen.abi import ADJOINT, AT_POINTS, Task, derivative_task
from softehl.codegen.derive import invariant_chain_rule
from softehl.codegen.derive.multilevel_chain_rule import Linearisation
from softehl.codegen.derive.output_entries import OutputEntry, OutputSlot
from softehl.codegen.derive.potential_structure import PotentialStructure, structure_of
from softehl.codegen.graph.differentiation import directional, gradient
from softehl.codegen.graph.graph import InputEntry, Node
from softehl.codegen.graph.guarded_products import Certain, guarded, plus
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition

SMALL = 100
"""Values of a potential so simple that its interfaces may cost more than they save."""


def tasks(d: Definition) -> list[str]:
    """Tasks that a model offers: those it chose; else all, an energy only for a potential."""
    offered: list[str] = [Task.RESIDUAL, Task.TANGENT]
    if d.conservative:
        offered.insert(0, Task.ENERGY)
    if d.fields or d.term_updates:
        offered.append(Task.FIELDS)
    if d.product:
        offered.append(Task.PRODUCT)
    if d.tasks is not None:
        offered = [t for t in offered if t in d.tasks]
    optional = {Task.PSEUDO_LOAD: d.pseudo_load, Task.FIELDS_RATE: d.fields_rate}
    optional[Task.ADJOINT_RATE] = d.adjoint_rate
    optional[Task.POINT_ADJOINT_RATE] = d.adjoint_rate and bool(d.point_data)
    offered += [task for task, requested in optional.items() if requested]
    return offered + [derivative_task(name) for name, _ in d.derivatives]


@dataclass(frozen=True)
class Variant:
    """The outputs of a task by one chain rule, which has a name."""

    rule: str
    entries: list[OutputEntry]


def _at_points(d: Definition) -> list[Node]:
    """Fields, then new history of terms, whose routines write it themselves."""
    return [*(n for _, n in d.fields), *d.term_updates]


def outputs(d: Definition, task: str) -> list[OutputEntry]:
    """Output nodes of a task, before any pass: the first of its `variants`."""
    return next(variants(d, task, structure_of(d))).entries


def is_differentiated(task: str) -> bool:
    """False for what the model writes down itself, and for the rates of it."""
    return task not in (Task.ENERGY, *AT_POINTS, *ADJOINT)


def variants(d: Definition, task: str, structure: PotentialStructure | None) -> Iterator[Variant]:
    """The outputs of a task by different chain rules: passes will tell which is the cheapest."""
    if task in ADJOINT:
        yield Variant("reverse, over forward, over reverse", _adjoint_rates(d, task))
    elif task == Task.FIELDS_RATE:
        values = [OutputEntry(OutputSlot(False, k), None, n) for k, n in enumerate(_at_points(d))]
        yield Variant("along a variation", _rates(d, task, values))
    elif not is_differentiated(task):
        nodes = [d.potential] if task == Task.ENERGY else _at_points(d)
        yield Variant(
            "none, the page writes it down",
            [OutputEntry(OutputSlot(False, k), None, n) for k, n in enumerate(nodes)],
        )
    elif task in (Task.RESIDUAL, Task.TANGENT):
        yield from _rules(d, task, structure)
    elif task == Task.PSEUDO_LOAD:
        for rule in _rules(d, Task.RESIDUAL, structure):
            yield Variant(f"along a variation, {rule.rule}", _rates(d, task, rule.entries))
    else:
        residual = next(_rules(d, Task.RESIDUAL, structure))
        yield Variant(f"along one direction, {residual.rule}", _rates(d, task, residual.entries))


def _rules(d: Definition, task: str, structure: PotentialStructure | None) -> Iterator[Variant]:
    if structure is not None:
        rules = {
            "level by level": invariant_chain_rule.by_levels(d, structure),
            "by slopes of what the potential sees": invariant_chain_rule.by_derivatives(
                d, structure
            ),
        }
        for rule, chain_rule in rules.items():
            yield Variant(
                rule, chain_rule.residual() + (chain_rule.tangent() if task == Task.TANGENT else [])
            )
    if structure is None or len(reachable([d.potential])) <= SMALL:
        yield Variant("through the values that the page names", _plain(d, task))


def _plain(d: Definition, task: str) -> list[OutputEntry]:
    """Reverse mode, and forward over it through the interfaces that the model names."""
    adjoint = gradient(
        d.graph, d.potential, d.directions, constant=d.constant, prescribed=d.prescribed
    )
    slots = _slots(d)
    rows = [OutputEntry(s, None, adjoint[u]) for s, u in zip(slots, d.directions, strict=True)]
    return rows + (_tangent(d, rows, slots, adjoint) if task == Task.TANGENT else [])


def _rates(d: Definition, task: str, rows: list[OutputEntry]) -> list[OutputEntry]:
    """The derivative of the residual `rows` along `direction` or with respect to one argument."""
    g = d.graph
    if task == Task.PRODUCT:
        seeds = unknown_seeds(d, 0)
    elif task == Task.PSEUDO_LOAD:
        seeds = argument_seeds(d)
    elif task == Task.FIELDS_RATE:
        first = d.coordinate_width + len(d.data) + len(d.parameters)
        seeds = {**argument_seeds(d), **unknown_seeds(d, first)}
    else:
        by_task = {derivative_task(name): node for name, node in d.derivatives}
        seeds = {by_task[task]: g.one}
    rates = directional(g, [x.node for x in rows], seeds, d.prescribed)
    return [OutputEntry(x.row, None, n) for x, n in zip(rows, rates, strict=True)]


def _adjoint_rates(d: Definition, task: str) -> list[OutputEntry]:
    """Rates of the derivatives of L = adjoint . residual + adjoints . history by all arguments.

    The rate of L along a variation is one value, whose derivatives are taken in reverse. The
    adjoints themselves move, too.
    """
    g, first = d.graph, d.coordinate_width + len(d.data) + len(d.parameters)
    unknowns, count = d.directions, d.page_point_data
    adjoint = gradient(g, d.potential, unknowns, constant=d.constant)
    arguments = {n: rate for n, rate in argument_seeds(d).items() if _array(n) != "arrays"}
    seeds = {**arguments, **unknown_seeds(d, first)}
    lagrangian = g.zero
    for k, u in enumerate(unknowns):
        left, rate = (g.input("direction", first + s * len(unknowns) + k) for s in (1, 2))
        seeds[left] = rate
        lagrangian = plus(g, lagrangian, guarded(g, adjoint[u], left))
    history, values = g.zero, dict(d.fields)
    names = [a.name for a in d.point_data[:count]]
    for name in d.history:
        k = names.index(name)
        left, rate = (g.input("point data", s * count + k, varying=True) for s in (2, 3))
        seeds[left] = rate
        history = plus(g, history, guarded(g, values[f"new_{name}"], left))
    lagrangian = g.add(lagrangian, g.sum(history))
    (along,) = directional(g, [lagrangian], seeds)
    if task == Task.POINT_ADJOINT_RATE:
        sources = [g.input("point data", k, varying=True) for k in range(count)]
    else:
        sources = [n for n in arguments if _array(n) != "point data"] + list(unknowns)
    derivatives = gradient(g, along, sources)
    return [OutputEntry(OutputSlot(False, k), None, derivatives[n]) for k, n in enumerate(sources)]


def _array(n: Node) -> str:
    assert isinstance(n.payload, InputEntry)
    return n.payload.array


def unknown_seeds(d: Definition, first: int) -> dict[Node, Node]:
    """Unknowns that move along `direction`, where theirs begin at the entry `first`."""
    array = {"dofs": ("direction", first), "interpolated": ("interpolated direction", 0)}
    seeds = {}
    for u in d.directions:
        assert isinstance(u.payload, InputEntry)
        name, offset = array[u.payload.array]
        seeds[u] = d.graph.input(name, offset + u.payload.index, varying=u.varying)
    return seeds


def argument_seeds(d: Definition) -> dict[Node, Node]:
    """Coordinates, data and parameters that move along `direction`, in this order, point data that
    move as the model says, and run-time arrays that move at their rates.
    """
    widths = {
        "coordinates": d.coordinate_width,
        "data": len(d.data),
        "parameters": len(d.parameters),
    }
    inputs = ((array, k) for array, width in widths.items() for k in range(width))
    g = d.graph
    seeds = {g.input(array, k): g.input("direction", n) for n, (array, k) in enumerate(inputs)}
    count = d.page_point_data if d.point_rates else 0
    for k, varying in product(range(count), (False, True)):
        value = g.input("point data", k, varying=varying)
        seeds[value] = g.input("point data", count + k, varying=varying)
    seeds |= {g.input("arrays", k): g.one for k in range(len(d.arrays))}
    for k, varying in product(range(len(d.term_history)), (False, True)):
        if d.point_rates:
            seeds[g.input("term history", k, varying=varying)] = g.one
    return seeds


def _slots(d: Definition) -> list[OutputSlot]:
    direct = len(d.unknowns)
    return [
        OutputSlot(u.varying, k - direct if u.varying else k) for k, u in enumerate(d.directions)
    ]


def _tangent(
    d: Definition, rows: list[OutputEntry], slots: list[OutputSlot], adjoint: dict[Node, Node]
) -> list[OutputEntry]:
    interface = [z for z in d.interface if z.varying]
    mirror = {adjoint[z]: z for z in interface if z in adjoint} if d.conservative else {}
    forward = Linearisation(
        d.graph,
        d.directions,
        d.interface,
        symmetric=mirror,
        prescribed=d.prescribed,
        certain=Certain([d.potential]),
    )
    entries: dict[tuple[int, int], Node] = {}
    for i, row in enumerate(rows):
        for j in range(len(slots)):
            if d.conservative and j < i and not d.interpolated:
                entries[i, j] = entries[j, i]
            else:
                entries[i, j] = forward.derivative(row.node, j)
    return [
        OutputEntry(slots[i], slots[j], n)
        for (i, j), n in entries.items()
        if not (slots[i].basis or slots[j].basis) or n is not d.graph.zero
    ]
