"""Outputs of a task at a point: fluxes, moduli, and their rates along what moves an element."""

from __future__ import annotations

from softehl.codegen.abi import Task, derivative_task
from softehl.codegen.derive import variants
from softehl.codegen.derive.outputs import Entry, Slot
from softehl.codegen.derive.variants import moved_arguments, moved_unknowns
from softehl.codegen.graph.differentiate import directional
from softehl.codegen.graph.graph import Node
from softehl.codegen.language.definition import Definition

_KNOWN = frozenset(map(str, Task))
RATES = 1000
"""First row of the rates of fluxes, which the task `pseudo_load` needs beside the fluxes."""


def outputs(d: Definition, task: str) -> list[Entry]:
    """Output nodes of a task of the model at a point.

    Of `pseudo_load` the fluxes, and from the row `RATES` on their rates when coordinates, data,
    parameters and unknowns move along `direction`, in this order.
    """
    if task in _KNOWN - {Task.PSEUDO_LOAD}:
        return next(variants.variants(d, task, None)).entries
    rows = next(variants.variants(d, Task.RESIDUAL, None)).entries
    if task != Task.PSEUDO_LOAD:
        by = argument(d, task)
        assert by is not None
        rates = directional(d.graph, [x.node for x in rows], {by: d.graph.one}, d.given)
        return [Entry(x.row, None, n) for x, n in zip(rows, rates, strict=True)]
    first = d.coordinate_width + len(d.data) + len(d.parameters)
    seeds = {**moved_arguments(d), **moved_unknowns(d, first)}
    rates = directional(d.graph, [x.node for x in rows], seeds, d.given)
    return rows + [Entry(Slot(False, RATES + k), None, n) for k, n in enumerate(rates)]


def argument(d: Definition, task: str) -> Node | None:
    """The parameter or datum at the point by which a task derives, None if there is none."""
    places = [("parameters", a.name, k) for k, a in enumerate(d.parameters)]
    places += [("data", a.name, k) for k, a in enumerate(d.data)]
    found = [d.graph.input(array, k) for array, n, k in places if derivative_task(n) == task]
    return found[0] if found else None
