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
    Form,
    Statement,
    StudyError,
    shown,
)
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, Predicate
from softehl.runtime.suggestions import listed

MULTIPLIERS = {2: ("lambda", "tau"), 3: ("lambda", "tau_x", "tau_y", "tau_z")}
"""Unknowns of a contact by the dimension of its mesh."""
KINDS = {2: ("line2", "line3"), 3: ("tri3", "quad4", "tri6", "quad8", "quad9")}
"""Faces that may touch."""


@dataclass(frozen=True, eq=False)
class Touch:
    """Request of a contact.

    labels: of the blocks of its sides, one for each kind. others: kind -> faces that it may meet.
    names: of the displacements. alone: both are one surface. stiffness, depth: None: derived.
    """

    name: str
    labels: tuple[str, ...]
    others: tuple[tuple[str, Integers], ...]
    names: tuple[str, ...]
    friction: float
    ring: bool
    alone: bool
    stiffness: float | None
    depth: float | None

    def unknown(self, multiplier: str) -> str:
        """Name of an unknown of the contact."""
        return f"{self.name}:{multiplier}"


def add_contact(
    definition: Statement,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | None],
    of: Sequence[str] | None,
    **given: float | None,
) -> None:
    """Add contact between two sides; see `Study.contact`.

    given: friction, stiffness, depth.
    """
    if name in definition.blocks:
        existing = listed(definition.blocks)
        raise StudyError(f"contact(name={name!r}): the name is taken; blocks: {existing}")
    contact, blocks = _contact_and_sides(definition, name, sides, of, given)
    definition.blocks.update(blocks)
    definition.contacts.append(contact)


def _contact_and_sides(
    definition: Statement,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | None],
    of: Sequence[str] | None,
    given: Mapping[str, float | None],
) -> tuple[Touch, dict[str, Block]]:
    """A contact and the blocks of its sides.  Raises StudyError, MeshError."""
    mesh, ring = definition.mesh, definition.ring
    words = f"contact({', '.join(shown(s) for s in sides if s is not None)})"
    mesh.require_whole(words)
    if mesh.dimension not in KINDS:
        raise StudyError(f"{words}: contact is for meshes in 2-D and 3-D, this one is a line")
    usual = tuple(f"u_{axis}" for axis in "xyz"[: mesh.dimension])
    names = usual if of is None else tuple(of)
    if len(names) != len(usual):
        raise StudyError(f"{words}: of={list(names)}: {len(usual)} displacements are needed")
    numbers = {k: None if v is None else finite(f"{words}: {k}", v) for k, v in given.items()}
    for key, value in numbers.items():
        if value is not None and (value < 0.0 if key == "friction" else value <= 0.0):
            least = "at least 0" if key == "friction" else "positive"
            raise StudyError(f"{words}: {key} = {value:g}, must be {least}")
    side, other = sides
    mine = mesh.outer_faces(side)
    theirs = mine if other is None or other == side else mesh.outer_faces(other)
    alone = theirs is mine
    for kind in (*mine, *theirs):
        if kind not in KINDS[mesh.dimension]:
            raise StudyError(f"{words}: {kind} cannot touch; {listed(KINDS[mesh.dimension])} can")
    if alone:
        mine = theirs = {k: _in_order(mesh, faces) for k, faces in mine.items()}
    blocks = {}
    for kind, faces in mine.items():
        label = name if len(mine) == 1 else f"{name}:{kind}"
        blocks[label] = _block(mesh, name, label, (kind, faces), names, float(ring))
    friction, stiffness, depth = (numbers[k] for k in ("friction", "stiffness", "depth"))
    faces_of = (*theirs.items(),)
    found = Touch(name, (*blocks,), faces_of, names, friction or 0.0, ring, alone, stiffness, depth)
    return found, blocks


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
    ring: float,
) -> Block:
    family = "mortar" if mesh.dimension == 2 else "touch"
    kernel = load_kernel(f"{family}_side_{len(CELLS[elements[0]].nodes)}")
    given = {"rho": 1.0, "ring": ring} if mesh.dimension == 2 else {"rho": 1.0}
    told = {f"u_{axis}": name for axis, name in zip("xyz", names, strict=False)}
    told |= {m: f"{name}:{m}" for m in MULTIPLIERS[mesh.dimension]}
    return page_on(mesh, label, kernel, elements, Form(called=told), given)
