"""Contacts of a system: their search, elements and stiffness, from their definition."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.contact.body_thickness import inner_radii, thickness
from softehl.runtime.contact.mortar_pair import MortarPairKernel
from softehl.runtime.contact.pair_law import LawContact, PairLawKernel, corner_areas
from softehl.runtime.contact.rigid_contact import (
    ANY_DEPTH,
    RigidContact,
    RigidContactKernel,
    face_rule,
)
from softehl.runtime.contact.search import Contact, ContactSide, FaceContact, StateDependentBlocks
from softehl.runtime.definition.contact_sides import MULTIPLIERS, ContactRequest
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.dofmap import Numbering
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.equations.system import Step, System
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS, Cell, measures
from softehl.runtime.suggestions import did_you_mean, join_names

AnyContact: TypeAlias = Contact | FaceContact | LawContact | RigidContact
_SOFTER, _SOFTEST = 0.25, 0.1
"""Of the stiffness of the bodies at their sides; of quadratic faces in 3-D, whose gap varies inside
them. Blocks, discs and dies with and without friction need as many iterations from 0.03 to 0.25;
from 0.5 on, of quadratic faces from 0.25 on, sticking and slipping may cycle."""
_NOTHING = 1e-9  # of the parent face, of order 1: exact shares are 0, or more than a tenth


def contact_of(
    definition: ProblemDefinition, numbering: Numbering, request: ContactRequest
) -> AnyContact:
    """The search and the elements of a contact, whose stiffness is not known yet.

    Raises StudyError.
    """
    mesh = definition.mesh
    moves = _moves(definition, request)
    sides = []
    for kind, faces in request.faces:
        x = mesh.points[faces]
        reach = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)  # of the order of a face
        if request.reach is not None:
            reach = np.full(len(reach), request.reach)
        measure = inner_radii if request.alone else thickness
        depth = measure(mesh.points, mesh.boundary, faces)
        depth = np.minimum(depth, float(np.ptp(mesh.points, axis=0).max()))
        if request.depth is not None:
            depth = np.full(len(reach), request.depth)
        sides.append(ContactSide(kind, faces, np.ones(len(reach)), depth, reach))
    kinds = [(s.kind, other) for s in sides for other, _ in request.other_faces]
    if request.law is not None:
        return _law_contact(definition, numbering, request, sides, moves=moves)
    unknowns = [request.unknown(m) for m in MULTIPLIERS[mesh.dimension]]
    displacements = np.stack([numbering.nodal[n] for n in request.names], axis=1)
    multipliers = np.stack([numbering.nodal[n] for n in unknowns], axis=1)
    if request.surface is not None:
        return _rigid_contact(definition, numbering, request, displacements, multipliers, (*sides,))
    if mesh.dimension == 3:
        law = load_kernel("touch")
        pairs = {(a, b): MortarPairKernel(law, CELLS[a], CELLS[b]) for a, b in kinds}
        return FaceContact(
            name=request.name,
            points=mesh.points,
            displacements=displacements,
            multipliers=multipliers,
            sides=tuple(sides),
            others=request.other_faces,
            kernels=pairs,
            friction=request.friction,
            alone=request.alone,
        )
    nodes = {kind: len(CELLS[kind].nodes) for pair in kinds for kind in pair}
    kernels = {(a, b): load_kernel(f"mortar_{nodes[a]}{nodes[b]}") for a, b in kinds}
    return Contact(
        name=request.name,
        points=mesh.points,
        displacements=displacements,
        multipliers=multipliers,
        sides=tuple(sides),
        others=request.other_faces,
        kernels=kernels,
        friction=request.friction,
        ring=request.axisymmetric,
        alone=request.alone,
    )


def _rigid_contact(
    definition: ProblemDefinition,
    numbering: Numbering,
    request: ContactRequest,
    displacements: Integers,
    multipliers: Integers,
    sides: tuple[ContactSide, ...],
) -> RigidContact:
    """The contact with a rigid surface, whose stiffness is not known yet."""
    mesh = definition.mesh
    surface, motion, reference = request.surface, np.empty(0, dtype=np.int64), mesh.points[0] * 0.0
    assert surface is not None
    if request.body is not None:
        body = definition.rigids[request.body]
        unknowns = [body.unknown(c) for c in body.components]
        motion = np.array([numbering.nodal[n][body.node] for n in unknowns])
        reference = body.point
    law, moves = load_kernel(f"rigid_touch_{mesh.dimension}"), request.body is not None
    kernels = {
        s.kind: RigidContactKernel(law, CELLS[s.kind], face_rule(s.kind), moves) for s in sides
    }
    return RigidContact(
        name=request.name,
        points=mesh.points,
        displacements=displacements,
        multipliers=multipliers,
        sides=sides,
        surface=surface,
        law=law,
        motion=motion,
        reference=reference,
        depth=ANY_DEPTH if request.depth is None else request.depth,
        friction=request.friction,
        ring=request.axisymmetric,
        kernels=kernels,
    )


def _law_contact(
    definition: ProblemDefinition,
    numbering: Numbering,
    request: ContactRequest,
    sides: list[ContactSide],
    *,
    moves: bool,
) -> LawContact:
    """A contact by a law.  Raises StudyError."""
    assert request.law is not None
    mesh, law, kernels = definition.mesh, request.law.kernel, {}
    nowhere = np.full(len(mesh.points), -1)
    displacements = np.stack(
        [numbering.nodal[n] if moves else nowhere for n in request.names], axis=1
    )
    multipliers = np.empty((len(mesh.points), 0), dtype=np.int64)
    search: Contact | FaceContact
    if mesh.dimension == 3:
        search = FaceContact(
            name=request.name,
            points=mesh.points,
            displacements=displacements,
            multipliers=multipliers,
            sides=tuple(sides),
            others=request.other_faces,
            kernels={},
            alone=request.alone,
        )
    else:
        search = Contact(
            name=request.name,
            points=mesh.points,
            displacements=displacements,
            multipliers=multipliers,
            sides=tuple(sides),
            others=request.other_faces,
            kernels={},
            ring=request.axisymmetric,
            alone=request.alone,
        )
    order = max(CELLS[kind].order for kind, _ in (*request.faces, *request.other_faces))
    names = [u.removesuffix("_first") for u in law.unknowns if u.endswith("_first")]
    fields = {name: _field(numbering, request, name) for name in names}
    for kind, faces in request.faces:
        for other, other_faces in request.other_faces:
            counts = {
                name: tuple(
                    _count(request, name, dofs, f) for f in ((kind, faces), (other, other_faces))
                )
                for name, dofs in fields.items()
            }
            kernels[kind, other] = PairLawKernel(
                law=law,
                one=CELLS[kind],
                other=CELLS[other],
                moves=moves,
                ring=request.axisymmetric,
                order=order,
                counts=counts,  # type: ignore[arg-type]
                values=request.law.parameters,
                differentiated=request.law.differentiated,
            )
    history = sum(u.endswith("_before") for u in law.unknowns)
    return LawContact(
        name=request.name,
        search=search,
        kernels=kernels,
        fields=fields,
        areas=corner_areas(search),
        history=np.zeros((len(mesh.points), 1, history)),
        friction=request.friction,
    )


def _field(numbering: Numbering, request: ContactRequest, name: str) -> Integers:
    """Numbers of a field of a law at each node.  Raises StudyError where no page has it."""
    if name not in numbering.nodal:
        raise StudyError(
            f"{request.name!r}: no unknown {name!r}{did_you_mean(name, numbering.nodal)}; at "
            f"nodes: {join_names(numbering.nodal)}"
        )
    return numbering.nodal[name]


def _count(request: ContactRequest, name: str, dofs: Integers, faces: tuple[str, Integers]) -> int:
    """Number of nodes of a face with a field: all, or the corners.  Raises StudyError."""
    kind, nodes = faces
    defined: Flags = np.asarray((dofs[nodes] >= 0).all(axis=0))
    corners = CELLS[kind].corners
    if defined.all():
        return len(defined)
    if defined[:corners].all() and not defined[corners:].any():
        return corners
    raise StudyError(f"{request.name!r}: {name!r} is not everywhere on both sides")


def _moves(definition: ProblemDefinition, request: ContactRequest) -> bool:
    """True if the bodies have displacements; those of a law need none.

    Raises StudyError for displacements that no page of a body has.
    """
    contacts = {label for other in definition.contacts for label in other.labels}
    bodies = [block for label, block in definition.blocks.items() if label not in contacts]
    existing = list(dict.fromkeys(s.name for b in bodies for s in b.slots if s.node is not None))
    if request.law is not None and not request.named and not {*request.names} & {*existing}:
        return False
    for name in request.names:
        if name not in existing:
            raise StudyError(
                f"{request.name!r}: no unknown {name!r}{did_you_mean(name, existing)}; at nodes: "
                f"{join_names(existing)}; give of=(...), the displacements along x and y"
            )
    return True


def with_contacts(system: System, contacts: dict[str, AnyContact]) -> System:
    """The system with its contacts, of the stiffness of the bodies at rest.  Raises StudyError."""
    definition = system.definition
    assert definition is not None
    if not contacts:
        return system
    x = system.at_rest()
    step = Step(0.0, 0.0, x, 0.0, np.zeros(system.size), 1.0, system.histories())
    problem = system.problem(step)
    with np.errstate(all="ignore"):
        stiffness = problem.assembler.linearise(x, problem.parameters)[1].diagonal()
    assembler, blocks = system.assembler, dict(system.blocks)
    contacts_with_stiffness: list[AnyContact] = []
    for request in definition.contacts:
        contact = contacts[request.name]
        if isinstance(contact, LawContact):
            contacts_with_stiffness.append(contact)
            continue
        rho = [_rho(system, request, contact, side, stiffness) for side in contact.sides]
        for label, values in zip(request.labels, rho, strict=True):
            data = {**blocks[label].data, "rho": values}
            blocks[label] = replace(blocks[label], data=data)
            columns = [data[name] for name in blocks[label].kernel.data]
            assembler = assembler.with_data(label, data=np.stack(columns, axis=1))
        sides = tuple(replace(s, rho=r) for s, r in zip(contact.sides, rho, strict=True))
        contacts_with_stiffness.append(replace(contact, sides=sides))
    return replace(
        system, assembler=assembler, blocks=blocks, contacts=tuple(contacts_with_stiffness)
    )


def contact_blocks(system: System) -> dict[str, float]:
    """Friction of each block of a contact, by name: those of its sides and of its pairs."""
    touches = [] if system.definition is None else system.definition.contacts
    friction = {label: request.friction for request in touches for label in request.labels}
    pairs = {b.name: c.friction for c in system.contacts for b in c.empty()}
    return {**friction, **pairs}


def weighted(
    system: System, weight: float
) -> tuple[tuple[StateDependentBlocks, ...], dict[str, ElementBlock]]:
    """Contacts and the blocks of their sides by name with a stiffness times `weight`.

    Their unknowns times the same number then have forces times this number and the same gaps.
    """
    contacts, blocks = [], {}
    for contact in system.contacts:
        sides = tuple(replace(side, rho=weight * side.rho) for side in contact.sides)
        contacts.append(replace(contact, sides=sides))  # type: ignore[type-var]
    labels = [] if system.definition is None else system.definition.contacts
    for label in (label for request in labels for label in request.labels):
        block = system.assembler.block(label)
        assert block.data is not None
        data = block.data.copy()
        data[:, list(system.blocks[label].kernel.data).index("rho")] *= weight
        blocks[label] = replace(block, data=data)
    return tuple(contacts), blocks


def _rho(
    system: System,
    request: ContactRequest,
    contact: Contact | FaceContact | RigidContact,
    side: ContactSide,
    K: Array,
) -> Array:
    """Stiffness per area, (n,), about that of the softer of the two bodies beneath a side."""
    if request.stiffness is not None:
        return np.full(len(side.faces), request.stiffness)
    at_nodes = _per_area(contact, [(side.kind, side.faces)], K)[side.faces]
    side_stiffness = at_nodes[:, _loaded(CELLS[side.kind])].mean(axis=1)
    other_stiffness = _per_area(contact, contact.others, K)
    rho = np.minimum(
        side_stiffness,
        np.median(other_stiffness[other_stiffness > 0.0])
        if (other_stiffness > 0.0).any()
        else np.inf,
    )
    if not (np.isfinite(rho) & (rho > 0.0)).all():
        raise StudyError(
            f"{request.name!r}: the bodies have no stiffness at rest; give stiffness=..., about "
            "Young's modulus over the length of a side"
        )
    curved = not isinstance(contact, Contact) and CELLS[side.kind].order > 1
    return np.asarray((_SOFTEST if curved else _SOFTER) * rho)


def _per_area(contact: Contact | FaceContact | RigidContact, faces: object, K: Array) -> Array:
    """Entries of the diagonal of K over the area of each node, (points,); zero elsewhere."""
    area = np.zeros(len(contact.points))
    for kind, nodes in faces:  # type: ignore[attr-defined]
        axisymmetric = not isinstance(contact, FaceContact) and contact.ring
        at, weights = CELLS[kind].measured_rule(CELLS[kind].order, ring=axisymmetric)
        points = contact.points[nodes]
        density = measures(CELLS[kind], points, at)
        shape = CELLS[kind].shape(at)
        if axisymmetric:
            density = density * 2.0 * np.pi * np.einsum("qk,nk->nq", shape, points[:, :, 1])
        fractions = np.einsum("nq,q,qk->nk", density, weights, shape)
        first = _loaded(CELLS[kind]).start
        np.add.at(area, nodes[:, first:], fractions[:, first:])
    loaded = area > 0.0
    per_area = np.zeros(len(area))
    per_area[loaded] = K[contact.displacements[loaded]].mean(axis=1) / area[loaded]
    return per_area


def _loaded(cell: Cell) -> slice:
    """Corners of a face; or its other nodes, where a uniform pressure does not load the corners."""
    at, weights = cell.rule(cell.order)
    corners = (weights @ cell.shape(at))[: cell.corners]
    return slice(0, cell.corners) if (corners > _NOTHING).all() else slice(cell.corners, None)
