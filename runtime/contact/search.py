"""Contact of deformable sides: search for pairs, their elements, and the problem with contact.

`Contact` has pairs of lines in the plane, `FaceContact` pairs of faces and triangles of their
overlap in space.

The elements of a pair (page `mortar_22` and its like) are zero where sides do not meet, so that
any list of pairs that holds those that meet gives the same equations: they are functions of the
unknowns alone, although the list is another one in each iteration.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.mortar_overlap import CORNER, common_part, mean_normal
from softehl.runtime.contact.mortar_pair import MULTIPLIERS, MortarPairKernel
from softehl.runtime.discretisation.assembly import Memo
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.sparsity import Structure
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.mesh.cells import CELLS

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Sparse = csc_array
FACING = -0.1  # cosine between normals; sides that meet more steeply do not press
_BACK = 0.5
"""Of a step: how far it may differ from the opposite of the last one to count as taking it back.
With 0.1 to 0.9 all of 48 pairs of blocks that just touch are solved, without it 44."""
_STRIDE = 0.9  # of the depth to which sides notice each other
SLANTED = 2.0  # a line along the normal is at most so many times as long as the distance


@dataclass(frozen=True, eq=False)
class ContactSide:
    """Faces of one kind, (n, k), their ends first; rho, depth, reach: (n,), see the page."""

    kind: str
    faces: Integers
    rho: Array
    depth: Array
    reach: Array


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact between `sides`, which have the multipliers, and `others`.

    points: (p, 2) of the mesh. displacements, multipliers: (p, 2) numbers of the unknowns at each
    node, -1 where there are none. kernels: (kind, other kind) -> kernel. alone: both are one
    surface, of which a pair has its first face as the side.
    """

    name: str
    points: Array
    displacements: Integers
    multipliers: Integers
    sides: tuple[ContactSide, ...]
    others: tuple[tuple[str, Integers], ...]
    kernels: dict[tuple[str, str], Kernel]
    friction: float = 0.0
    ring: bool = False
    alone: bool = False

    @property
    def nodes(self) -> Integers:
        """Of all its faces."""
        return nodes_of(self.sides, self.others)

    @property
    def bound(self) -> Integers:
        """Numbers of the unknowns on which it acts."""
        return bound_unknowns(self)

    def empty(self) -> list[ElementBlock]:
        """Its blocks without elements, which keep their places."""
        none = np.empty(0, dtype=np.int64)
        x = np.zeros(int(max(self.displacements.max(), self.multipliers.max())) + 1)
        kinds = by_kind(self.sides, self.others, none, none)
        return [self._block(a, b, i, j, x) for a, b, i, j in kinds]

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Elements of the pairs at unknowns x; old: those of the step before."""
        kinds = by_kind(self.sides, self.others, *self.pairs(x))
        return [self._block(a, b, i, j, old) for a, b, i, j in kinds]

    def pairs(self, x: Array) -> tuple[Integers, Integers]:
        """Numbers of sides and of others, both counted through their kinds, that may meet at x."""
        moved = np.where(self.displacements >= 0, x[self.displacements], 0.0)
        if not np.isfinite(moved).all():
            return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        points = self.points + moved
        side_corners = np.concatenate([s.faces[:, :2] for s in self.sides])
        other_corners = np.concatenate([faces[:, :2] for _, faces in self.others])
        side, other = facing(
            _balls(points[side_corners]), _balls(points[other_corners]), limits(self.sides)
        )
        return without_common_corners(side_corners, other_corners, side, other, alone=self.alone)

    def _block(self, a: int, b: int, one: Integers, other: Integers, old: Array) -> ElementBlock:
        """Elements of sides of kind a with others of kind b."""
        side, (kind, faces) = self.sides[a], self.others[b]
        nodes = np.concatenate([side.faces[one], faces[other]], axis=1)
        n, width, corners = len(nodes), 2 * nodes.shape[1], side.faces[one][:, :2]
        moved = self.displacements[nodes]
        previous = np.where(moved >= 0, old[moved], 0.0).transpose(0, 2, 1).reshape(n, width)
        constant = np.tile([self.friction, float(self.ring)], (n, 1))
        limits = np.stack([v[one] for v in (side.rho, side.depth, side.reach)], axis=1)
        data = np.concatenate(
            [previous, limits[:, :1], constant[:, :1], limits[:, 1:], constant[:, 1:]], axis=1
        )
        multipliers = self.multipliers[corners].reshape(n, 4)
        dofs = np.concatenate([moved.reshape(n, width), multipliers], axis=1)
        return ElementBlock(
            f"{self.name}: {side.kind} on {kind}",
            self.kernels[side.kind, kind],
            self.points[nodes].reshape(n, width),
            np.ascontiguousarray(dofs),
            data,
            check_orientation=False,
        )


def pairs_within(tree: cKDTree, queries: Array, radius: Array) -> tuple[Integers, Integers]:
    """Pairs of places (n, dim) and points of a tree that are no further apart than radius, (n,)."""
    neighbours = tree.query_ball_point(queries, radius, return_sorted=True)
    one = np.repeat(np.arange(len(queries)), [len(row) for row in neighbours])
    return one, np.concatenate([np.empty(0, dtype=np.int64), *neighbours]).astype(np.int64)


Balls: TypeAlias = tuple[Array, Array, Array]
"""Centres (n, dim), radii (n,) of faces, and directions (n, dim) that are opposite in contact."""


def facing(
    one_side: Balls, other_side: Balls, limits: tuple[Array, Array]
) -> tuple[Integers, Integers]:
    """Pairs of opposite faces that are near enough to come into contact."""
    from scipy.spatial import cKDTree  # late: slow to import

    (centre, radius, along), (far, size, against), (depth, reach) = one_side, other_side, limits
    tree = cKDTree(far)
    nearest = SLANTED * tree.query(centre)[0]
    one, other = pairs_within(
        tree, centre, radius + size.max() + np.maximum(reach, np.minimum(depth, nearest))
    )
    mask = np.einsum("nc,nc->n", along[one], against[other]) < FACING
    return one[mask], other[mask]


def without_common_corners(
    one_side: Integers, other_side: Integers, one: Integers, other: Integers, *, alone: bool
) -> tuple[Integers, Integers]:
    """Pairs of faces without a corner in common; alone: both are one surface, each pair once.

    mine, theirs: corners (n, k) of all faces. one, other: rows of them, (m,).
    """
    mask = (one_side[one][:, :, None] != other_side[other][:, None, :]).all(axis=(1, 2))
    if alone:
        mask &= one < other
    return one[mask], other[mask]


def by_kind(
    sides: Sequence[ContactSide],
    others: Sequence[tuple[str, Integers]],
    one: Integers,
    other: Integers,
) -> Iterator[tuple[int, int, Integers, Integers]]:
    """For each kind of side and of other: their numbers, and the pairs by numbers within them.

    one, other: pairs of faces that are counted through all kinds.
    """
    side_starts, other_starts = (
        _starts([s.faces for s in sides]),
        _starts([faces for _, faces in others]),
    )
    kind, kind_of_other = (
        np.searchsorted(s, k, side="right") - 1
        for s, k in ((side_starts, one), (other_starts, other))
    )
    for a, b in product(range(len(sides)), range(len(others))):
        mask = (kind == a) & (kind_of_other == b)
        yield a, b, one[mask] - side_starts[a], other[mask] - other_starts[b]


def limits(sides: Sequence[ContactSide]) -> tuple[Array, Array]:
    """Depth and reach of the faces of all kinds."""
    depth, reach = (np.concatenate([getattr(s, n) for s in sides]) for n in ("depth", "reach"))
    return depth, reach


def _starts(parts: Sequence[Integers]) -> Integers:
    """Numbers of the first row of each part, counted through all."""
    return np.cumsum([0, *map(len, parts)])[:-1]


def _balls(end_points: Array) -> Balls:
    """Centres (n, 2), radii (n,) and unit directions (n, 2) of segments with ends (n, 2, 2)."""
    along = end_points[:, 1] - end_points[:, 0]
    length = np.linalg.norm(along, axis=1)
    return end_points.mean(axis=1), 0.5 * length, along / np.maximum(length, 1e-300)[:, None]


def nodes_of(sides: Sequence[ContactSide], others: Sequence[tuple[str, Integers]]) -> Integers:
    """Nodes of the faces of all kinds, rising."""
    faces = [*(s.faces for s in sides), *(f for _, f in others)]
    return np.unique(np.concatenate([f.ravel() for f in faces]))


def bound_unknowns(contact: Contact | FaceContact) -> Integers:
    """Numbers of the displacements of all nodes of a contact."""
    dofs = contact.displacements[contact.nodes]
    return np.asarray(dofs[dofs >= 0])


def max_step(sides: Sequence[ContactSide]) -> float:
    """Largest motion in an iteration that contact search still detects."""
    return _STRIDE * float(np.median(np.concatenate([side.depth for side in sides])))


class StateDependentBlocks(Protocol):
    """Elements that depend on the unknowns."""

    @property
    def name(self) -> str:
        """Name of the contact."""
        ...

    @property
    def friction(self) -> float:
        """Coulomb's coefficient."""
        ...

    @property
    def multipliers(self) -> Integers:
        """Numbers of the multipliers at each node, (points, k), -1 where there are none."""
        ...

    @property
    def nodes(self) -> Integers:
        """Of all its faces."""
        ...

    @property
    def bound(self) -> Integers:
        """Numbers of the unknowns on which it acts."""
        ...

    def empty(self) -> list[ElementBlock]:
        """Its blocks without elements."""
        ...

    @property
    def displacements(self) -> Integers:
        """Numbers of the unknowns that move the nodes, (points, dim), -1 where there are none."""
        ...

    @property
    def sides(self) -> tuple[ContactSide, ...]:
        """Faces with multipliers."""
        ...

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Blocks at unknowns x, always of the same names; old: unknowns of the step before."""
        ...


@dataclass(frozen=True, eq=False)
class ContactProblem(Problem):
    """A problem with contacts, whose elements are searched at each evaluation.

    old: (n,) unknowns of the step before. latest: the last problem without a search; it only
    saves time. change: (n,) of the unknowns in the last iteration, empty before the first.
    """

    contacts: tuple[StateDependentBlocks, ...] = ()
    old: Array = field(default_factory=lambda: np.empty(0))
    change: Array = field(default_factory=lambda: np.empty(0), repr=False)
    latest: list[Problem] = field(default_factory=list, repr=False)

    def at(self, x: Array) -> Problem:
        """The problem with the pairs at x, (n,), and no others."""
        blocks_at_x = [b for contact in self.contacts for b in contact.blocks(x, self.old)]
        last = self.latest[0].assembler if self.latest else None
        if last is not None and all(_alike(b, last.block(b.name), data=True) for b in blocks_at_x):
            return self.latest[0]
        new = {block.name: block for block in blocks_at_x}
        blocks = tuple(new.get(b.name, b) for b in self.assembler.blocks)
        structure = Structure(self.assembler.size, tuple(b.dofs for b in blocks))
        if last is not None and all(_alike(b, last.block(b.name)) for b in blocks_at_x):
            structure = last.structure
        assembler = replace(self.assembler, blocks=blocks, structure=structure, memo=Memo())
        arguments = {f.name: getattr(self, f.name) for f in fields(Problem)}
        self.latest[:] = [Problem(**{**arguments, "assembler": assembler})]
        return self.latest[0]

    def step_limit(self, x: Array, dx: Array) -> float:
        """A body must not jump over the side that it should touch.

        A step that takes the last one back is halved: where bodies exactly touch at the start,
        states of sticking and slipping may alternate, however short the load step is.
        """
        limit = Problem.step_limit(self, x, dx)
        if self.change.size and np.linalg.norm(dx + self.change) <= _BACK * np.linalg.norm(dx):
            limit *= 0.5
        for contact in self.contacts:
            moved = np.where(contact.displacements >= 0, dx[contact.displacements], 0.0)
            largest = float(np.linalg.norm(moved, axis=1).max())
            limit = min(limit, max_step(contact.sides) / max(largest, 1e-300))
        return limit

    def after(self, previous: Array, x: Array) -> ContactProblem:
        """The problem as it is after a step from `before` to x, (n,)."""
        return replace(self, change=x - previous)

    def where_not_finite(self, x: Array) -> str:
        """See `Problem`."""
        return self.at(x).where_not_finite(x)

    def residual(self, x: Array) -> Array:
        """See `Problem`."""
        return self.at(x).residual(x)

    def linearise_with(self, x: Array, addition: Array | None) -> tuple[Array, Sparse]:
        """See `Problem`; an addition has the pattern at x."""
        return self.at(x).linearise_with(x, addition)

    def linearise_along(self, x: Array, rate: Array) -> tuple[Array, Sparse, Array]:
        """See `Problem`."""
        return self.at(x).linearise_along(x, rate)

    def measure(self, x: Array, K: Sparse | None, *, rounded: bool = False) -> float:
        """See `Problem`."""
        return self.at(x).measure(x, K, rounded=rounded)

    def merit(self, x: Array) -> float:
        """See `Problem`."""
        return self.at(x).merit(x)


def _alike(one: ElementBlock, other: ElementBlock, *, data: bool = False) -> bool:
    """True if blocks have the same unknowns, and the same data."""
    alike = np.array_equal(one.dofs, other.dofs)
    return alike and (not data or np.array_equal(one.data, other.data))  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class FaceContact:
    """A contact between `sides`, which have the multipliers, and `others`.

    points: (p, 3) of the mesh. displacements (p, 3), multipliers (p, 4): numbers of the unknowns
    at each node, -1 where there are none. kernels: (kind, other kind) -> elements. alone: both are
    one surface, of which a pair has its first face as the side.
    """

    name: str
    points: Array
    displacements: Integers
    multipliers: Integers
    sides: tuple[ContactSide, ...]
    others: tuple[tuple[str, Integers], ...]
    kernels: dict[tuple[str, str], MortarPairKernel]
    friction: float = 0.0
    alone: bool = False

    @property
    def nodes(self) -> Integers:
        """Of all its faces."""
        return nodes_of(self.sides, self.others)

    @property
    def bound(self) -> Integers:
        """Numbers of the unknowns on which it acts."""
        return bound_unknowns(self)

    def empty(self) -> list[ElementBlock]:
        """Its blocks without elements, which keep their places."""
        x = np.zeros(int(max(self.displacements.max(), self.multipliers.max())) + 1)
        none = np.empty(0, dtype=np.int64)
        kinds, corners = by_kind(self.sides, self.others, none, none), np.empty((0, 3, CORNER))
        return [self._block(a, b, (i, j, corners), x) for a, b, i, j in kinds]

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Elements of the pairs at unknowns x; old: of the step before."""
        moved = np.where(self.displacements >= 0, x[self.displacements], 0.0)
        if not np.isfinite(moved).all():
            return self.empty()
        points = self.points + moved
        result = []
        for a, b, i, j in by_kind(self.sides, self.others, *self.pairs(x)):
            side, (label, faces) = self.sides[a], self.others[b]
            cells = CELLS[side.kind], CELLS[label]
            part = common_part(cells[0], points[side.faces[i]], cells[1], points[faces[j]])
            result.append(self._block(a, b, (i[part.pairs], j[part.pairs], part.corners), old))
        return result

    def pairs(self, x: Array) -> tuple[Integers, Integers]:
        """Numbers of sides and of others, both counted through their kinds, that may meet at x."""
        moved = np.where(self.displacements >= 0, x[self.displacements], 0.0)
        node_points = self.points + moved
        sides = [(s.kind, s.faces) for s in self.sides]
        side, other = facing(
            _face_balls(node_points, sides),
            _face_balls(node_points, self.others),
            limits(self.sides),
        )
        return without_common_corners(
            _corners(sides), _corners(self.others), side, other, alone=self.alone
        )

    def _block(
        self, a: int, b: int, overlaps: tuple[Integers, Integers, Array], old: Array
    ) -> ElementBlock:
        """Elements of triangles of sides of kind a and others of kind b."""
        side, (kind, faces) = self.sides[a], self.others[b]
        one, other, corners = overlaps
        side_faces = side.faces[one]
        nodes = np.concatenate([side_faces, faces[other]], axis=1)
        n, width = len(nodes), 3 * nodes.shape[1]
        moved = self.displacements[nodes].reshape(n, width)
        previous = np.where(moved >= 0, old[moved], 0.0)
        limits = [side.rho[one], np.full(n, self.friction), side.depth[one], side.reach[one]]
        corners_of_side = side_faces[:, : CELLS[side.kind].corners]
        multipliers = self.multipliers[corners_of_side].reshape(
            n, MULTIPLIERS * corners_of_side.shape[1]
        )
        return ElementBlock(
            f"{self.name}: {side.kind} on {kind}",
            self.kernels[side.kind, kind],
            self.points[nodes].reshape(n, width),
            np.ascontiguousarray(np.concatenate([moved, multipliers], axis=1)),
            np.concatenate(
                [previous, np.stack(limits, axis=1), corners.reshape(n, 3 * CORNER)], axis=1
            ),
            check_orientation=False,
        )


def _face_balls(node_points: Array, kinds: Sequence[tuple[str, Integers]]) -> Balls:
    """Centres, radii and normals of the faces of all kinds."""
    balls = []
    for kind, faces in kinds:
        corners = node_points[faces[:, : CELLS[kind].corners]]
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        balls.append((centre, radius, mean_normal(CELLS[kind], corners)))
    centre, radius, normal = (np.concatenate([f[k] for f in balls]) for k in (0, 1, 2))
    return centre, radius, normal


def _corners(kinds: Sequence[tuple[str, Integers]]) -> Integers:
    """Corners of the faces of all kinds, (n, 4), the last one twice on triangles."""
    return np.concatenate([faces[:, [0, 1, 2, CELLS[kind].corners - 1]] for kind, faces in kinds])
