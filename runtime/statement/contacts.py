"""Contact of sides as it was written down: the request, and its blocks of sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from softehl.runtime.arrays import Integers
from softehl.runtime.fem.unknowns import Slot
from softehl.runtime.kernels import load_kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, Predicate
from softehl.runtime.mesh.thickness import in_chains
from softehl.runtime.statement.given import finite
from softehl.runtime.statement.pages import page_on
from softehl.runtime.statement.records import Block, StudyError, shown

MULTIPLIERS = ("lambda", "tau")


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


def touch(
    mesh: Mesh,
    name: str,
    sides: tuple[str | Predicate, str | Predicate | None],
    of: Sequence[str] | None,
    ring: bool,
    given: Mapping[str, float | None],
) -> tuple[Touch, dict[str, Block]]:
    """A contact and the blocks of its sides.  Raises StudyError, MeshError."""
    words = f"contact({', '.join(shown(s) for s in sides if s is not None)})"
    if mesh.dimension != 2:
        raise StudyError(f"{words}: contact is for meshes in 2-D, this one has {mesh.dimension}")
    names = ("u_x", "u_y") if of is None else tuple(of)
    if len(names) != 2:
        raise StudyError(f"{words}: of={list(names)}: two displacements are needed")
    numbers = {k: None if v is None else finite(f"{words}: {k}", v) for k, v in given.items()}
    for key, value in numbers.items():
        if value is not None and (value < 0.0 if key == "friction" else value <= 0.0):
            least = "at least 0" if key == "friction" else "positive"
            raise StudyError(f"{words}: {key} = {value:g}, must be {least}")
    side, other = sides
    mine = mesh.outer_faces(side)
    theirs = mine if other is None or other == side else mesh.outer_faces(other)
    alone = theirs is mine
    if alone:
        mine = theirs = {kind: in_chains(faces) for kind, faces in mine.items()}
    blocks = {}
    for kind, faces in mine.items():
        label = name if len(mine) == 1 else f"{name}:{kind}"
        blocks[label] = _block(mesh, name, label, (kind, faces), names, float(ring))
    friction, stiffness, depth = (numbers[k] for k in ("friction", "stiffness", "depth"))
    faces_of = (*theirs.items(),)
    found = Touch(name, (*blocks,), faces_of, names, friction or 0.0, ring, alone, stiffness, depth)
    return found, blocks


def _block(
    mesh: Mesh,
    name: str,
    label: str,
    elements: tuple[str, Integers],
    names: tuple[str, ...],
    ring: float,
) -> Block:
    kernel = load_kernel(f"mortar_side_{len(CELLS[elements[0]].nodes)}")
    block = page_on(mesh, label, kernel, elements, (), {"rho": 1.0, "ring": ring})
    told = dict(zip(("u_x", "u_y"), names, strict=True))
    told |= {m: f"{name}:{m}" for m in MULTIPLIERS}
    slots = tuple(Slot(told[s.name], s.node) for s in block.slots)
    return replace(block, slots=slots)
