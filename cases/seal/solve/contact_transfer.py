"""The contact state of a mesh from that of another, without a path.

Displacements, multipliers and element pressures are carried over and corrected by Newton's method,
which holds on to the pressures in its tangent (`runtime.fem.lagged_pressure`). The multipliers are
unknowns, so contact is stiff from the first iteration on. What is solved is the same as on the
path of `cases.seal.solve.path`; only the start is another one.
"""

from __future__ import annotations

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.contact import contact_problem, correction_stage
from softehl.cases.seal.solve.path import Stage
from softehl.cases.seal.solve.pressure_newton import lagged
from softehl.runtime.arrays import Array
from softehl.runtime.fem.lagged_pressure import element_pressures
from softehl.runtime.mesh.transfer import (
    transfer_boundary,
    transfer_chain,
    transfer_elements,
    transfer_nodes,
)


def carried_contact(
    old: SealSystem,
    new: SealSystem,
    x: Array,
    sealed_pressure: float,
    name: str = "",
) -> tuple[Stage, Array]:
    """A stage of one step that solves for contact on another mesh of a section, and its start.

    x: unknowns of the contact state on the old mesh, under a sealed pressure, MPa. name: of the
    stage, by the density if left out.
    """
    pressures = element_pressures(contact_problem(old, sealed_pressure), old.solids, x)
    y = carried_unknowns(old, new, x)
    bare = contact_problem(new, sealed_pressure).since(y)
    problem = lagged(new, bare, transfer_elements(old.mesh, new.mesh, pressures))
    stage = correction_stage(new, problem, method="newton, carried from another mesh", name=name)
    return stage, y


def carried_unknowns(old: SealSystem, new: SealSystem, x: Array) -> Array:
    """Every field that contact knows, (n',), on another mesh; those of the film are zero."""
    y, meshes = new.at_rest(), (old.mesh, new.mesh)
    for field in old.contact_fields():
        values = x[old.layout.part(field.name)]
        if field.on == "nodes":
            values = transfer_nodes(*meshes, values.reshape(-1, 2)).ravel()
        elif field.on != "section":
            here, there = (system.section.chains[field.on][0] for system in (old, new))
            if len(here) == len(old.mesh.boundary):
                values = transfer_boundary(*meshes, values)
            else:
                values = transfer_chain(*meshes, here, there, values)
        y[new.layout.part(field.name)] = values
    return y
