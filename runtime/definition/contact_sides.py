"""Contact of sides as it was written down: the request, and its blocks of sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from softehl.runtime.arrays import Integers
from softehl.runtime.contact.body_thickness import by_normals, in_chains
from softehl.runtime.contact.rigid_contact import face_rule
from softehl.runtime.contact.rigid_surfaces import Surface
from softehl.runtime.definition.argument_checks import finite
from softehl.runtime.definition.element_blocks import page_on
from softehl.runtime.definition.kernel_loading import KernelOrigin
from softehl.runtime.definition.problem_definition import (
    Block,
    Number,
    PageOptions,
    ProblemDefinition,
    StudyError,
    display_name,
)
from softehl.runtime.kernels.kernel import Kernel, Rule, load_kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, Predicate
from softehl.runtime.suggestions import did_you_mean, join_names

MULTIPLIERS = {2: ("lambda", "tau"), 3: ("lambda", "tau_x", "tau_y", "tau_z")}
"""Unknowns of a contact by the dimension of its mesh."""
KINDS = {2: ("line2", "line3"), 3: ("tri3", "quad4", "tri6", "quad8", "quad9")}
"""Faces that may touch."""
_PAIRS = {2: ("line2_pair", "plane strain"), 3: ("quad4_pair", "solid")}
"""Cell and geometry of the page of a law: it is the same for all faces, and for rings."""


@dataclass(frozen=True, eq=False)
class LawRequest:
    """Law of a contact: its kernel on pairs, and the values of its parameters.

    differentiated: makes the kernel of its derivatives, or None where its page is C.
    """

    kernel: Kernel
    parameters: Mapping[str, Number]
    differentiated: Callable[[], Kernel] | None = None

    @property
    def conservative(self) -> bool:
        """True if it has an energy of the present state alone."""
        states = ("came_", "_before")
        past = any(u.startswith(states[0]) or u.endswith(states[1]) for u in self.kernel.unknowns)
        return "energy" in self.kernel.tasks and not past


@dataclass(frozen=True, eq=False)
class ContactRequest:
    """Request of a contact.

    labels: of the blocks of its sides, one for each kind; none with a law. faces: of the first side
    by kind, other_faces: those that it may meet. names: of the displacements; named: as given.
    alone: both are one surface. stiffness, depth, reach: None: derived. friction: with a law 1
    unless that is conservative. surface: of a rigid body, in place of another side; body: its name,
    None where it is at rest.
    """

    name: str
    labels: tuple[str, ...]
    faces: tuple[tuple[str, Integers], ...]
    other_faces: tuple[tuple[str, Integers], ...]
    names: tuple[str, ...]
    named: bool
    friction: float
    axisymmetric: bool
    alone: bool
    stiffness: float | None
    depth: float | None
    reach: float | None = None
    law: LawRequest | None = None
    surface: Surface | None = None
    body: str | None = None

    def unknown(self, multiplier: str) -> str:
        """Name of an unknown of the contact."""
        return f"{self.name}:{multiplier}"


def add_contact(
    definition: ProblemDefinition,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | Surface | None],
    of: Sequence[str] | None,
    *,
    body: str | None = None,
    law: object = None,
    model: str | None = None,
    parameters: Mapping[str, Any],
    **coefficients: float | None,
) -> None:
    """Add contact between two sides, or a side and a rigid surface; see `Study.contact`.

    coefficients: friction, stiffness, depth, reach.
    """
    used = [*definition.blocks, *(contact.name for contact in definition.contacts)]
    if name in used:
        raise StudyError(f"contact(name={name!r}): the name is taken; blocks: {join_names(used)}")
    side, other = sides
    surface: Surface | None = None
    meeting: tuple[str | Predicate, str | Predicate | None] = side, None
    if other is None or isinstance(other, str) or callable(other):
        meeting = side, other
    else:
        surface = other
    title = display_name(side) if other is None else f"{display_name(side)}, {_other_name(other)}"
    context = f"contact({title})"
    if law is None and parameters:
        raise StudyError(
            f"{context}: {join_names(parameters)}: only a law, law=page, has parameters"
        )
    if law is None and coefficients["reach"] is not None:
        raise StudyError(
            f"{context}: reach = {coefficients['reach']:g}: only a law, law=page, has it"
        )
    if law is not None:
        if surface is not None:
            raise StudyError(
                f"{context}: a law, law=page, is for two sides: give a side in place of the "
                "surface, that of a group which study.rigid moves"
            )
        for key in ("friction", "stiffness"):
            if coefficients[key] is not None:
                raise StudyError(f"{context}: {key} = {coefficients[key]:g}: a law states its own")
    contact, blocks = _contact_and_sides(
        definition, name, meeting, of, coefficients, with_blocks=law is None, surface=surface
    )
    if law is not None:
        request = _law(definition, context, (law, model), parameters)
        contact = replace(contact, law=request, friction=float(not request.conservative))
    if surface is None and body is not None:
        raise StudyError(
            f"{context}: body={body!r} moves a surface: name one in place of the other side, as in "
            "softehl.Sphere(centre, radius)"
        )
    if surface is not None:
        _require_surface(definition, contact, surface, body)
        contact = replace(contact, surface=surface, body=body, other_faces=(), alone=False)
    definition.blocks.update(blocks)
    definition.contacts.append(contact)


def _other_name(other: str | Predicate | Surface) -> str:
    """The other side or surface, for messages."""
    return display_name(other) if isinstance(other, str) or callable(other) else repr(other)


def _law(
    definition: ProblemDefinition,
    context: str,
    source: tuple[object, str | None],
    parameters: Mapping[str, Any],
) -> LawRequest:
    """The kernel of a law on pairs, and its parameters.  Raises StudyError."""
    cell, geometry = _PAIRS[definition.mesh.dimension]
    page, name = source
    origin = KernelOrigin(page, name, geometry, law=False)
    kernel = origin.loaded(cell)
    if kernel.cell != cell:
        raise StudyError(
            f"{context}: {kernel.name} is no law of contact: give a page of m.gap, "
            "m.slip and m.jump(...), under @softehl.page"
        )
    if kernel.arrays or kernel.data:
        names = join_names([*(a.name for a in kernel.arrays), *kernel.data])
        raise StudyError(f"{context}: {names}: a law of contact has numbers as parameters")
    for key in parameters:
        if key not in kernel.parameters:
            hint = did_you_mean(key, kernel.parameters)
            raise StudyError(
                f"{context}: {kernel.name} has no parameter {key!r}{hint}; it has "
                f"{join_names(kernel.parameters)}"
            )
    missing = [name for name in kernel.parameters if name not in parameters]
    if missing:
        raise StudyError(f"{context}: give {join_names(missing)}, parameters of {kernel.name}")
    values = {k: v if callable(v) else finite(f"{context}: {k}", v) for k, v in parameters.items()}
    return LawRequest(kernel, values, origin.differentiated(kernel))


def _contact_and_sides(
    definition: ProblemDefinition,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | None],
    of: Sequence[str] | None,
    coefficients: Mapping[str, float | None],
    *,
    with_blocks: bool,
    surface: Surface | None,
) -> tuple[ContactRequest, dict[str, Block]]:
    """A contact and the blocks of its sides.  Raises StudyError, MeshError."""
    mesh, axisymmetric = definition.mesh, definition.axisymmetric
    title = [display_name(s) for s in sides if s is not None]
    title += [] if surface is None else [repr(surface)]
    context = f"contact({', '.join(title)})"
    mesh.require_whole(context)
    if mesh.dimension not in KINDS:
        raise StudyError(f"{context}: contact is for meshes in 2-D and 3-D, this one is a line")
    usual = tuple(f"u_{axis}" for axis in "xyz"[: mesh.dimension])
    names = usual if of is None else tuple(of)
    if len(names) != len(usual):
        raise StudyError(f"{context}: of={list(names)}: {len(usual)} displacements are needed")
    numbers = {
        k: None if v is None else finite(f"{context}: {k}", v) for k, v in coefficients.items()
    }
    for key, value in numbers.items():
        if value is not None and (value < 0.0 if key == "friction" else value <= 0.0):
            requirement = "at least 0" if key == "friction" else "positive"
            raise StudyError(f"{context}: {key} = {value:g}, must be {requirement}")
    side, other = sides
    side_faces = mesh.outer_faces(side)
    other_faces = side_faces if other is None or other == side else mesh.outer_faces(other)
    alone = other_faces is side_faces and surface is None
    for kind in (*side_faces, *other_faces):
        if kind not in KINDS[mesh.dimension]:
            raise StudyError(
                f"{context}: {kind} cannot touch; {join_names(KINDS[mesh.dimension])} can"
            )
    if alone:
        side_faces = other_faces = {k: _in_order(mesh, faces) for k, faces in side_faces.items()}
    blocks = {}
    for kind, faces in side_faces.items() if with_blocks else ():
        label = name if len(side_faces) == 1 else f"{name}:{kind}"
        rule = None if surface is None else face_rule(kind)
        blocks[label] = _block(mesh, name, label, (kind, faces), names, float(axisymmetric), rule)
    contact = ContactRequest(
        name=name,
        labels=(*blocks,),
        faces=(*side_faces.items(),),
        other_faces=(*other_faces.items(),),
        names=names,
        named=of is not None,
        friction=numbers["friction"] or 0.0,
        axisymmetric=axisymmetric,
        alone=alone,
        stiffness=numbers["stiffness"],
        depth=numbers["depth"],
        reach=numbers["reach"],
    )
    return contact, blocks


def _require_surface(
    definition: ProblemDefinition, contact: ContactRequest, surface: Surface, body: str | None
) -> None:
    """Raise StudyError for a surface or a body that does not fit."""
    mesh, context = definition.mesh, f"contact({contact.name!r})"
    if not hasattr(surface, "nearest"):
        raise StudyError(
            f"{context}: {surface!r} is no side and no surface: a surface is Plane, Sphere, "
            "Cylinder or Polyline of softehl"
        )
    if surface.dimension != mesh.dimension:
        raise StudyError(
            f"{context}: {surface!r} has {surface.dimension} coordinates, the mesh has "
            f"{mesh.dimension}"
        )
    if body is not None and body not in definition.rigids:
        existing = join_names(definition.rigids) or "none"
        raise StudyError(
            f"{context}: there is no rigid body {body!r}, but {existing}: make it before, "
            f"study.rigid(at=..., name={body!r})"
        )
    if body is not None and not definition.rigids[body].finite:
        raise StudyError(
            f'{context}: the rigid body {body!r} has rotations="small", and surfaces turn by '
            "finite ones: leave rotations out"
        )


def _in_order(mesh: Mesh, faces: Integers) -> Integers:
    """Faces of a surface that meets itself: of two that face each other the first has the pressure,
    and so its neighbours should have it.
    """
    return in_chains(faces) if mesh.dimension == 2 else by_normals(mesh.points, faces)


def _block(
    mesh: Mesh,
    name: str,
    label: str,
    elements: tuple[str, Integers],
    names: tuple[str, ...],
    axisymmetric: float,
    rule: Rule | None,
) -> Block:
    family = "mortar" if mesh.dimension == 2 else "touch"
    kernel = load_kernel(f"{family}_side_{len(CELLS[elements[0]].nodes)}")
    side_data = {"rho": 1.0, "ring": axisymmetric} if mesh.dimension == 2 else {"rho": 1.0}
    study_names = {f"u_{axis}": name for axis, name in zip("xyz", names, strict=False)}
    study_names |= {m: f"{name}:{m}" for m in MULTIPLIERS[mesh.dimension]}
    return page_on(
        mesh, label, kernel, elements, PageOptions(called=study_names, rule=rule), side_data
    )
