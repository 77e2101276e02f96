"""Outputs of a task at a point: fluxes, moduli, and their rates along what moves an element."""

from __future__ import annotations

from softehl.codegen.abi import Task, derivative_task
from softehl.codegen.derive import task_outputs
from softehl.codegen.derive.output_entries import OutputEntry, OutputSlot
from softehl.codegen.derive.task_outputs import argument_seeds, unknown_seeds
from softehl.codegen.graph.differentiation import directional, gradient
from softehl.codegen.graph.graph import Node
from softehl.codegen.language.definition import Definition, PointForm

_KNOWN = frozenset(map(str, Task))
RATES = 1000
"""First row of the rates of fluxes, which the task `pseudo_load` needs beside the fluxes."""


def outputs(d: Definition, task: str) -> list[OutputEntry]:
    """Output nodes of a task of the model at a point.

    Of `pseudo_load` the fluxes, and from the row `RATES` on their rates when coordinates, data,
    parameters and unknowns move along `direction`, in this order.
    """
    if task in _KNOWN - {Task.PSEUDO_LOAD}:
        return next(task_outputs.variants(d, task, None)).entries
    rows = next(task_outputs.variants(d, Task.RESIDUAL, None)).entries
    if task != Task.PSEUDO_LOAD:
        by = argument(d, task)
        assert by is not None
        rates = directional(d.graph, [x.node for x in rows], {by: d.graph.one}, d.prescribed)
        return [OutputEntry(x.row, None, n) for x, n in zip(rows, rates, strict=True)]
    seeds = {**argument_seeds(d), **unknown_seeds(d, first_rate(d, task))}
    rates = directional(d.graph, [x.node for x in rows], seeds, d.prescribed)
    return rows + [OutputEntry(OutputSlot(False, RATES + k), None, n) for k, n in enumerate(rates)]


def first_rate(d: Definition, task: str) -> int:
    """Entries of `direction` at a point before those of its unknowns."""
    return 0 if task == Task.PRODUCT else d.coordinate_width + len(d.data) + len(d.parameters)


def at_centroid(form: PointForm, task: str) -> list[OutputEntry]:
    """Values at the centroid; for a tangent also their derivatives by what the fields are there,
    with columns numbered as in `form.all`, and for tasks along `direction` their rates.
    """
    d, values = form.definition, list(form.centroid.values())
    g, rows = d.graph, [OutputEntry(OutputSlot(False, k), None, n) for k, n in enumerate(values)]
    dofs = {k: g.input("dofs", k) for k in range(len(form.all)) if k not in form.centroid}
    if task == Task.TANGENT:
        for x in rows:
            derivatives = gradient(g, x.node, list(dofs.values()), prescribed=d.prescribed)
            rows = rows + [
                OutputEntry(x.row, OutputSlot(False, k), derivatives[n]) for k, n in dofs.items()
            ]
    elif task in (Task.PRODUCT, Task.PSEUDO_LOAD, Task.FIELDS_RATE):
        first = first_rate(d, task)
        seeds = {} if task == Task.PRODUCT else argument_seeds(d)
        seeds |= {n: g.input("direction", first + k) for k, n in dofs.items()}
        rates = directional(g, values, seeds, d.prescribed)
        rows += [OutputEntry(OutputSlot(False, RATES + k), None, n) for k, n in enumerate(rates)]
    return rows


def argument(d: Definition, task: str) -> Node | None:
    """Return the parameter or datum at the point by which a task differentiates, or None."""
    arguments = [("parameters", a.name, k) for k, a in enumerate(d.parameters)]
    arguments += [("data", a.name, k) for k, a in enumerate(d.data)]
    matches = [d.graph.input(array, k) for array, n, k in arguments if derivative_task(n) == task]
    return matches[0] if matches else None
