"""Loads, pressures, springs, supports and ties that are added to a definition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.definition import argument_checks as read
from softehl.runtime.definition.problem_definition import (
    Load,
    PrescribedValues,
    ProblemDefinition,
    RigidBody,
    StudyError,
    Where,
    display_name,
)
from softehl.runtime.definition.rigid_bodies import resolved
from softehl.runtime.discretisation.loads import (
    Amount,
    DeadLoad,
    NodalForce,
    Pressure,
    RigidMoment,
    Spring,
    Tie,
)
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Predicate


def add_load(definition: ProblemDefinition, where: Where, components: Mapping[str, Amount]) -> None:
    """Add dead loads or nodal forces; see `Study.load`."""
    mesh = definition.mesh
    context = f"load({display_name(where)})"
    read.require_unknowns(context, components, "u_x=1")
    rigid = resolved(definition, where, context, components)
    if rigid is not None:
        _load_body(definition, *rigid)
        return
    for name, component in components.items():
        value = read.amount(context, name, component)
        if isinstance(where, str) or callable(where):
            for kind, faces in mesh.faces(where).items():
                kernel = DeadLoad(CELLS[kind], value, definition.axisymmetric)
                _add_force(definition, "load", where, kernel, faces, (name,))
        else:
            nodes = mesh.own(read.nodes_of(mesh, where))
            _add_force(definition, "load", where, NodalForce(value), nodes[:, None], (name,))


def _load_body(
    definition: ProblemDefinition, body: RigidBody, amounts: Mapping[str, Amount]
) -> None:
    """Forces and moments at the reference point of a rigid body."""
    node = np.array([[body.node]])
    turning = [body.unknown(c) for c in body.components if c.startswith("theta_")]
    for name, value in amounts.items():
        if name in turning and body.finite:
            law = load_kernel("rigid_moment")
            kernel: NodalForce = RigidMoment(value, axis=turning.index(name), law=law)
            _add_force(definition, "load", body.name, kernel, node, (*turning,))
        else:
            _add_force(definition, "load", body.name, NodalForce(value), node, (name,))


def add_pressure(
    definition: ProblemDefinition, where: str | Predicate, value: Amount, of: Sequence[str] | None
) -> None:
    """Add a follower pressure; see `Study.pressure`."""
    mesh = definition.mesh
    value = read.amount(f"pressure({display_name(where)})", "pressure", value)
    axes = "xyz"[: mesh.dimension]
    names = tuple(f"u_{axis}" for axis in axes) if of is None else tuple(of)
    if len(names) != mesh.dimension or len(names) == 1:
        raise StudyError(
            f"pressure({display_name(where)}, of={list(names)}): a displacement for each of "
            f"{mesh.dimension} coordinates is needed, in 2-D or 3-D"
        )
    for kind, faces in mesh.outer_faces(where).items():
        kernel = Pressure(CELLS[kind], value, definition.axisymmetric)
        _add_force(definition, "pressure", where, kernel, faces, names)


def add_springs(
    definition: ProblemDefinition, where: Where, stiffness: Mapping[str, float]
) -> None:
    """Add springs to the ground; see `Study.spring`."""
    mesh = definition.mesh
    context = f"spring({display_name(where)})"
    read.require_unknowns(context, stiffness, "u_x=2")
    rigid = resolved(definition, where, context, stiffness)
    if rigid is not None:
        body, springs = rigid
        for name, value in springs.items():
            kernel = Spring(read.finite(name, value))
            _add_force(definition, "spring", where, kernel, np.array([[body.node]]), (name,))
        return
    for name, value in stiffness.items():
        kernel = Spring(read.finite(name, value))
        nodes = mesh.own(read.nodes_of(mesh, where))
        _add_force(definition, "spring", where, kernel, nodes[:, None], (name,))


def add_conditions(
    definition: ProblemDefinition, where: Where, values: Mapping[str, Amount]
) -> None:
    """Prescribe unknowns at nodes; see `Study.fix`."""
    mesh = definition.mesh
    context = f"fix({display_name(where)})"
    read.require_unknowns(context, values, "u_x=0")
    rigid = resolved(definition, where, context, values)
    if rigid is not None:
        body, amounts = rigid
        for name, amount in amounts.items():
            condition = PrescribedValues(where, np.array([body.node]), name, amount)
            definition.conditions.append(condition)
        return
    for name, prescribed in values.items():
        value = read.amount(context, name, prescribed)
        condition = PrescribedValues(where, read.nodes_of(mesh, where), name, value)
        definition.conditions.append(condition)


def add_ties(
    definition: ProblemDefinition,
    where: Where,
    to: Where,
    names: tuple[str, ...],
    *,
    offset: Amount,
    tolerance: float,
) -> None:
    """Tie unknowns of one side to those of another; see `Study.tie`."""
    mesh = definition.mesh
    context = f"tie({display_name(where)}, {display_name(to)})"
    mesh.require_whole(context)
    read.require_unknowns(
        context, names, f'tie({display_name(where)}, {display_name(to)}, "u_x", "u_y")'
    )
    offset = read.amount(context, "offset", offset)
    side_nodes, partner_nodes = read.nodes_of(mesh, where), read.nodes_of(mesh, to)
    if len(partner_nodes) == 1 < len(side_nodes):
        if offset == 0.0:
            side_nodes = side_nodes[side_nodes != partner_nodes[0]]  # a node of the side itself
        if partner_nodes[0] in side_nodes:
            raise StudyError(f"{context}: the place is a node of the side: offset must be 0")
        partners = np.repeat(partner_nodes, len(side_nodes))
    elif len(side_nodes) != len(partner_nodes):
        raise StudyError(
            f"{context}: {len(side_nodes)} and {len(partner_nodes)} nodes; sides of equal nodes "
            "but for a shift are tied, or a side to one place"
        )
    else:
        partners = read.node_partners(mesh, side_nodes, partner_nodes, tolerance)
    for name in names:
        pairs = np.stack([side_nodes, partners], axis=1)
        _add_force(definition, "tie", where, Tie(offset), pairs, (name,))


def _add_force(
    definition: ProblemDefinition,
    what: str,
    where: Where,
    kernel: DeadLoad | NodalForce | Pressure | Spring | Tie,
    nodes: Integers,
    names: tuple[str, ...],
) -> None:
    forces = definition.forces
    label = f"{what} {len(forces) + 1}: {what}({display_name(where)}, {', '.join(names)})"
    location = where if isinstance(where, str) else display_name(where)
    forces.append(Load(label, kernel, nodes, names, what, location))
