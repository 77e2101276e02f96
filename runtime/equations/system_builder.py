"""System of a definition: numbering of unknowns, blocks of elements, contacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from softehl.log import warn
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.element_blocks import facet_nodes
from softehl.runtime.definition.initial_values import point_data_names
from softehl.runtime.definition.problem_definition import (
    Block,
    Load,
    ProblemDefinition,
    RigidBody,
    StudyError,
)
from softehl.runtime.definition.rigid_bodies import linked_nodes, shared_constraints
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.constraints import (
    require_independent_ties,
    tie_dofs,
    tied_groups,
)
from softehl.runtime.discretisation.dofmap import ElementUnknowns, Numbering
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import Spring, Tie
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.equations.contact_setup import contact_of, with_contacts
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.mesh.face_matching import match_faces
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.suggestions import did_you_mean, join_names


def build_system(
    definition: ProblemDefinition, fields: Mapping[str, Sequence[str]] | None = None
) -> System:
    """Return the discrete equations of a definition; fields: see `Numbering.of`.

    Raises StudyError for what does not fit together.
    """
    if not definition.blocks:
        raise StudyError("there are no elements: add a page, study.add('body', 'solid.py')")
    mesh, pages = definition.mesh, definition.blocks.values()
    _warn_of_holes(definition)
    elements = [
        ElementUnknowns(b.name, b.nodes, b.slots, b.shared, b.options.dof_tables) for b in pages
    ]
    for body in _moving_bodies(definition):
        motion = np.array([[body.node]])
        elements.append(ElementUnknowns(f"motion of {body.name}", motion, body.slots))
    try:
        numbering = Numbering.of(len(mesh.points), elements, fields)
    except ValueError as error:
        raise StudyError(str(error)) from None
    for c in definition.conditions:
        _require(c.name, c.nodes, numbering, c.call, somewhere=mesh.anywhere)
    forces, implied = _forces(definition, numbering)
    ties = {f.label: len(f.nodes) for f in forces if isinstance(f.kernel, Tie)}
    layout = replace(
        numbering.layout,
        names=(*numbering.layout.names, *ties),
        counts=(*numbering.layout.counts, *ties.values()),
    )
    writer = _BlockBuilder(mesh, replace(numbering, layout=layout))
    blocks = [writer.page(b) for b in pages] + [writer.force(f) for f in forces if len(f.nodes)]
    contacts = {t.name: contact_of(definition, numbering, t) for t in definition.contacts}
    blocks += [block for contact in contacts.values() for block in contact.empty()]
    assembler = Assembler.build(layout.total, blocks)
    _require_independent_ties(definition, numbering, assembler)
    _require_independent_links(definition, numbering, assembler)
    system = System(
        mesh,
        writer.numbering,
        assembler,
        dict(definition.blocks),
        (*definition.conditions,),
        implied,
        _at_start(definition, numbering),
        definition=definition,
        definition_size=definition.size,
    )
    return with_contacts(system, contacts)


def _warn_of_holes(definition: ProblemDefinition) -> None:
    """Warn of cells without elements, where other cells have some: a body with a hole."""
    mesh = definition.mesh
    bare: dict[str, Flags] = {}
    for kind, nodes in mesh.cells.items():
        block_nodes = [block.nodes for block in definition.blocks.values() if block.kind == kind]
        if any(part is nodes or np.array_equal(part, nodes) for part in block_nodes):
            continue
        with_elements = np.concatenate([nodes[:0], *block_nodes])
        missing = (
            match_faces(nodes, with_elements, nodes.shape[1]) < 0
            if len(with_elements)
            else nodes[:, 0] >= 0
        )
        bare[kind] = missing & ~np.isin(nodes, linked_nodes(definition)).all(axis=1)
    count, total = sum(map(np.sum, bare.values())), sum(map(len, mesh.cells.values()))
    if not 0 < count < total:  # pages on sides or nodes alone leave no hole
        return
    groups = [
        name
        for name, group in mesh.groups.items()
        if any(map(len, group.values()))
        and all(k in bare and bare[k][rows].all() for k, rows in group.items() if len(rows))
    ]
    of = f", those of {join_names(map(repr, groups))}" if groups else ""
    warn(
        f"{count} of {total} cells of the mesh have no elements{of}: they are no part of the body; "
        "study.add(...) is for all cells or for a group, cells=...",
        stacklevel=4,
    )


def _forces(
    definition: ProblemDefinition, numbering: Numbering
) -> tuple[tuple[Load, ...], tuple[Load, ...]]:
    """Forces to be solved for, and ties both sides of which are prescribed."""
    forces, implied = [], []
    for force in definition.forces:
        for name in force.names:
            _require(name, force.nodes, numbering, force.label)
        if isinstance(force.kernel, Tie):
            # where both sides are prescribed nothing is left for a multiplier to do
            both = np.isin(force.nodes, definition.prescribed(force.names[0])).all(axis=1)
            implied.append(replace(force, nodes=force.nodes[both]))
            force = replace(force, nodes=force.nodes[~both])
        forces.append(force)
    return (*forces,), (*implied,)


def _require_independent_ties(
    definition: ProblemDefinition, numbering: Numbering, assembler: Assembler
) -> None:
    """Raise StudyError where ties, and what is prescribed, form a circle."""
    prescribed: Flags = np.zeros(assembler.size, dtype=bool)
    for condition in definition.conditions:
        dofs = numbering.nodal[condition.name][condition.nodes]
        prescribed[dofs[dofs >= 0]] = True
    try:
        require_independent_ties(assembler, prescribed)
    except ProblemError as error:
        raise StudyError(str(error)) from None


def _moving_bodies(definition: ProblemDefinition) -> list[RigidBody]:
    """Rigid bodies.  Raises StudyError for one that moves nothing."""
    surfaces = {contact.body for contact in definition.contacts}
    for body in definition.rigids.values():
        if not len(body.nodes) and body.name not in surfaces:
            raise StudyError(
                f"the rigid body {body.name!r} has no side and no surface: name a side, "
                f"study.rigid(side, name={body.name!r}), or study.contact(side, surface, "
                f"body={body.name!r})"
            )
    return [*definition.rigids.values()]


def _require_independent_links(
    definition: ProblemDefinition, numbering: Numbering, assembler: Assembler
) -> None:
    """Raise StudyError where nodes of rigid bodies are also prescribed, or tied to each other."""
    if not definition.rigids:
        return
    twice = shared_constraints(definition)
    if twice:
        raise StudyError(twice)
    owner = np.full(assembler.size, "", dtype=object)
    for body in definition.rigids.values():
        for name in body.names:
            owner[numbering.nodal[name][body.nodes]] = body.name
    for condition in definition.conditions:
        dofs = numbering.nodal[condition.name][condition.nodes]
        for dof, node in zip(dofs.tolist(), condition.nodes.tolist(), strict=True):
            if dof >= 0 and owner[dof]:
                raise StudyError(
                    f"{condition.call}: node {node} {place_text(definition.mesh.points[node])} "
                    f"moves with the rigid body {owner[dof]!r}: prescribe the motion of the body, "
                    f"fix({owner[dof]!r}, ...), and leave the node out here"
                )
    prescribed: Flags = owner != ""
    for condition in definition.conditions:
        dofs = numbering.nodal[condition.name][condition.nodes]
        prescribed[dofs[dofs >= 0]] = True
    a, b, _ = tie_dofs(assembler).T
    group = tied_groups(a, b, assembler.size)
    count = np.bincount(group[prescribed], minlength=assembler.size)
    for dof in np.flatnonzero((count[group] > 1) & (owner != "")):
        raise StudyError(
            f"a tie joins a node of the rigid body {owner[dof]!r} with one that is prescribed or "
            "rigid, too: leave the node out of the tie"
        )


def _require(
    name: str,
    nodes: Integers,
    numbering: Numbering,
    context: str,
    *,
    somewhere: Callable[[object], bool] | None = None,
) -> None:
    """Raise StudyError unless the nodes have an unknown of this name; somewhere: some of them."""
    if name not in numbering.nodal:
        existing = join_names(numbering.nodal)
        raise StudyError(
            f"{context}: no unknown {name!r}{did_you_mean(name, numbering.nodal)}; at nodes: "
            f"{existing}"
        )
    defined = numbering.nodal[name][nodes] >= 0
    if not (defined.all() if somewhere is None else somewhere(defined.any())):
        raise StudyError(f"{context}: no page has the unknown {name!r} there")


def _at_start(definition: ProblemDefinition, numbering: Numbering) -> dict[str, Array]:
    """Unknown -> its values at every node, (points,), nan where nothing was said."""
    initial_values: dict[str, Array] = {}
    for start in definition.start:
        somewhere = definition.mesh.anywhere
        context = f"initial({start.name}=...)"
        _require_in_time(definition, start.name, numbering, context)
        _require(start.name, start.nodes, numbering, context, somewhere=somewhere)
        values = initial_values.setdefault(start.name, np.full(len(definition.mesh.points), np.nan))
        values[start.nodes] = start.values
    return initial_values


def _require_in_time(
    definition: ProblemDefinition, name: str, numbering: Numbering, context: str
) -> None:
    """Raise StudyError for an initial value of data of points, or of no unknown at all."""
    if name in numbering.nodal:
        return
    names = {n: b.name for b in definition.blocks.values() for n in point_data_names(b)}
    if name in names:
        raise StudyError(f"{context}: data of points of {names[name]!r}: add the block before")
    allowed = [*numbering.nodal, *names]
    raise StudyError(
        f"{context}: no unknown {name!r}{did_you_mean(name, allowed)}; at nodes: "
        f"{join_names(numbering.nodal)}; data of points: {join_names(names)}"
    )


@dataclass(frozen=True, eq=False)
class _BlockBuilder:
    """Blocks of an assembler on a mesh with numbered unknowns."""

    mesh: Mesh
    numbering: Numbering

    def page(self, block: Block) -> ElementBlock:
        n = len(block.nodes)
        width = block.nodes.shape[1] * self.mesh.dimension if block.kernel.coordinates else 0
        coordinates = self.mesh.points[block.nodes].reshape(n, width) if width else np.empty((n, 0))
        element_data = [block.data[d] for d in block.kernel.data if d in block.data]
        # what else there is comes with steps
        data = np.stack(element_data, axis=1) if element_data else None
        return ElementBlock(
            block.name,
            block.kernel,
            coordinates,
            self.numbering.dofs[block.name],
            data=data,
            rule=block.options.rule,
            constant=block.options.constant,
            check_orientation=facet_nodes(block.kernel) is None,
        )

    def force(self, force: Load) -> ElementBlock:
        dofs = self.numbering.at(force.names, force.nodes)
        coordinates = self.mesh.points[force.nodes].reshape(len(dofs), -1)
        if isinstance(force.kernel, Tie):
            coordinates = self.mesh.points[force.nodes[:, 0]]
            dofs = np.column_stack([dofs, self.numbering.layout.dofs(force.label)])
        constant = isinstance(force.kernel, Spring | Tie)
        return ElementBlock(
            force.label, force.kernel, coordinates, np.ascontiguousarray(dofs), constant=constant
        )
