"""Outputs of a task at a point: fluxes, moduli, and their rates along what moves an element."""

from __future__ import annotations

from softehl.codegen.abi import Task
from softehl.codegen.derive import variants
from softehl.codegen.derive.outputs import Entry, Slot
from softehl.codegen.derive.variants import moved_arguments, moved_unknowns
from softehl.codegen.graph.differentiate import directional
from softehl.codegen.language.definition import Definition

RATES = 1000
"""First row of the rates of fluxes, which the task `pseudo_load` needs beside the fluxes."""


def outputs(d: Definition, task: str) -> list[Entry]:
    """Output nodes of a task of the model at a point.

    Of `pseudo_load` the fluxes, and from the row `RATES` on their rates when coordinates, data,
    parameters and unknowns move along `direction`, in this order.
    """
    if task != Task.PSEUDO_LOAD:
        return next(variants.variants(d, task, None)).entries
    rows = next(variants.variants(d, Task.RESIDUAL, None)).entries
    first = d.coordinate_width + len(d.data) + len(d.parameters)
    seeds = {**moved_arguments(d), **moved_unknowns(d, first)}
    rates = directional(d.graph, [x.node for x in rows], seeds, d.given)
    return rows + [Entry(Slot(False, RATES + k), None, n) for k, n in enumerate(rates)]
