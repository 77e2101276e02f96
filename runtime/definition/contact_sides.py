"""Contact of sides as it was written down: the request, and its blocks of sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from softehl.runtime.arrays import Integers
from softehl.runtime.contact.body_thickness import by_normals, in_chains
from softehl.runtime.definition.argument_checks import finite
from softehl.runtime.definition.element_blocks import page_on
from softehl.runtime.definition.problem_definition import (
    Block,
    PageOptions,
    ProblemDefinition,
    StudyError,
    display_name,
)
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, Predicate
from softehl.runtime.suggestions import join_names

MULTIPLIERS = {2: ("lambda", "tau"), 3: ("lambda", "tau_x", "tau_y", "tau_z")}
"""Unknowns of a contact by the dimension of its mesh."""
KINDS = {2: ("line2", "line3"), 3: ("tri3", "quad4", "tri6", "quad8", "quad9")}
"""Faces that may touch."""


@dataclass(frozen=True, eq=False)
class ContactRequest:
    """Request of a contact.

    labels: of the blocks of its sides, one for each kind. other_faces: kind -> faces that it may
    meet. names: of the displacements. alone: both are one surface. stiffness, depth: None: derived.
    """

    name: str
    labels: tuple[str, ...]
    other_faces: tuple[tuple[str, Integers], ...]
    names: tuple[str, ...]
    friction: float
    axisymmetric: bool
    alone: bool
    stiffness: float | None
    depth: float | None

    def unknown(self, multiplier: str) -> str:
        """Name of an unknown of the contact."""
        return f"{self.name}:{multiplier}"


def add_contact(
    definition: ProblemDefinition,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | None],
    of: Sequence[str] | None,
    **coefficients: float | None,
) -> None:
    """Add contact between two sides; see `Study.contact`.

    coefficients: friction, stiffness, depth.
    """
    if name in definition.blocks:
        existing = join_names(definition.blocks)
        raise StudyError(f"contact(name={name!r}): the name is taken; blocks: {existing}")
    contact, blocks = _contact_and_sides(definition, name, sides, of, coefficients)
    definition.blocks.update(blocks)
    definition.contacts.append(contact)


def _contact_and_sides(
    definition: ProblemDefinition,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | None],
    of: Sequence[str] | None,
    coefficients: Mapping[str, float | None],
) -> tuple[ContactRequest, dict[str, Block]]:
    """A contact and the blocks of its sides.  Raises StudyError, MeshError."""
    mesh, axisymmetric = definition.mesh, definition.axisymmetric
    context = f"contact({', '.join(display_name(s) for s in sides if s is not None)})"
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
    alone = other_faces is side_faces
    for kind in (*side_faces, *other_faces):
        if kind not in KINDS[mesh.dimension]:
            raise StudyError(
                f"{context}: {kind} cannot touch; {join_names(KINDS[mesh.dimension])} can"
            )
    if alone:
        side_faces = other_faces = {k: _in_order(mesh, faces) for k, faces in side_faces.items()}
    blocks = {}
    for kind, faces in side_faces.items():
        label = name if len(side_faces) == 1 else f"{name}:{kind}"
        blocks[label] = _block(mesh, name, label, (kind, faces), names, float(axisymmetric))
    contact = ContactRequest(
        name=name,
        labels=(*blocks,),
        other_faces=(*other_faces.items(),),
        names=names,
        friction=numbers["friction"] or 0.0,
        axisymmetric=axisymmetric,
        alone=alone,
        stiffness=numbers["stiffness"],
        depth=numbers["depth"],
    )
    return contact, blocks


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
) -> Block:
    family = "mortar" if mesh.dimension == 2 else "touch"
    kernel = load_kernel(f"{family}_side_{len(CELLS[elements[0]].nodes)}")
    side_data = {"rho": 1.0, "ring": axisymmetric} if mesh.dimension == 2 else {"rho": 1.0}
    study_names = {f"u_{axis}": name for axis, name in zip("xyz", names, strict=False)}
    study_names |= {m: f"{name}:{m}" for m in MULTIPLIERS[mesh.dimension]}
    return page_on(mesh, label, kernel, elements, PageOptions(called=study_names), side_data)
