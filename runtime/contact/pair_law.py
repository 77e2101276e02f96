"""Contact with a law of the user's own: a page of pairs, integrated over the common part of sides.

The kernel of a page (`softehl.codegen.language.pair_model`) has the geometry, the fields and the
history of a pair as unknowns. Its residual and its tangent are carried over to the nodes of both
sides, with the motion of the pair. History stays at the corners of the first side: each adds up
the changes of the points about it, by its part of their area.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.line_pair import LineGeometry
from softehl.runtime.contact.mortar_overlap import CORNER, common_part
from softehl.runtime.contact.mortar_pair import FaceGeometry, PairPoint, Varied
from softehl.runtime.contact.search import Contact, ContactSide, FaceContact, by_kind
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.kernels.kernel import Kernel, KernelError
from softehl.runtime.mesh.cells import CELLS, Cell, measures

AXES = "xyz"
FIRST, SECOND, BEFORE, NEW = "_first", "_second", "_before", "new_"
"""Names of a page's unknowns and fields: on each side, before the step, and after it."""
_Test: TypeAlias = tuple[int, float, Integers, Varied]
"""Row of the law, sign, columns (k,) of the element and shape functions (n, k) of a variation."""


@dataclass(frozen=True, eq=False)
class PairLawKernel:
    """A kernel of assembly: the law on the common part of two sides of these kinds.

    Unknowns: displacements of the nodes of both sides, node by node, unless the sides do not move;
    then each field at the nodes of the first and of the second side, `counts` of them. data:
    displacements of the step before; depth, reach; history at the corners of the first side; in 3-D
    corners of the triangle, 3 times CORNER. values: of the parameters. differentiated: makes the
    kernel of derivatives of the law, or None where its page is C.
    """

    law: Kernel
    one: Cell
    other: Cell
    moves: bool
    ring: bool
    order: int
    counts: Mapping[str, tuple[int, int]]
    values: Mapping[str, Any]
    differentiated: Callable[[], Kernel] | None = None

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.law.name} of {self.one.name} on {self.other.name}"

    @property
    def signature(self) -> str:
        """Of the law."""
        return self.law.signature

    @property
    def parameters(self) -> tuple[str, ...]:
        """Of the law."""
        return tuple(self.law.parameters)

    @property
    def fields(self) -> tuple[str, ...]:
        """None: see `evaluated`."""
        return ()

    @property
    def dimension(self) -> int:
        """Of the mesh."""
        return self.one.dimension + 1

    @property
    def history(self) -> tuple[str, ...]:
        """Names of the history of the law."""
        return tuple(u[: -len(BEFORE)] for u in self.law.unknowns if u.endswith(BEFORE))

    def residual(self, coordinates: Array, dofs: Array, **arguments: Any) -> Array:
        """Element residuals (n, ndof)."""
        R = np.zeros(dofs.shape)
        for point in self._points(coordinates, dofs, arguments["data"], columns=0):
            rows, z, _ = self._inputs(point, dofs, arguments["data"])
            f = self.law.residual(np.empty((len(rows), 0)), z, parameters=arguments["parameters"])
            for row, sign, columns, (S, _) in self._tests(point):
                R[np.ix_(rows, columns)] += (
                    sign * (point.weight[0][rows] * f[:, row])[:, None] * S[rows]
                )
        return R

    def tangent(self, coordinates: Array, dofs: Array, **arguments: Any) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof)."""
        n, ndof = dofs.shape
        R, K = np.zeros((n, ndof)), np.zeros((n, ndof, ndof))
        for point in self._points(coordinates, dofs, arguments["data"], columns=ndof):
            rows, z, dz = self._inputs(point, dofs, arguments["data"])
            f, D = self.law.tangent(np.empty((len(rows), 0)), z, parameters=arguments["parameters"])
            W, dW = (v[rows] for v in point.weight)
            df = np.einsum("nij,njm->nim", D, dz)
            for row, sign, columns, (S, dS) in self._tests(point):
                s, value = S[rows], sign * f[:, row]
                R[np.ix_(rows, columns)] += (W * value)[:, None] * s
                change = (W * sign)[:, None, None] * s[:, :, None] * df[:, None, row]
                change += value[:, None, None] * (
                    W[:, None, None] * dS[rows] + s[:, :, None] * dW[:, None]
                )
                K[np.ix_(rows, columns)] += change
        return R, K

    def rate(self, coordinates: Array, dofs: Array, direction: Array, **arguments: Any) -> Array:
        """Rate of the residuals (n, ndof) as the parameters move by direction, (n, k).

        Raises KernelError where the law has no derivatives.
        """
        if self.differentiated is None:
            raise KernelError(
                f"{self.law.name} comes as C without derivatives: give its page instead"
            )
        R, law = np.zeros(dofs.shape), self.differentiated()
        for point in self._points(coordinates, dofs, arguments["data"], columns=0):
            rows, z, _ = self._inputs(point, dofs, arguments["data"])
            f = law.pseudo_load(
                np.empty((len(rows), 0)),
                z,
                np.ascontiguousarray(direction[rows]),
                parameters=arguments["parameters"],
            )
            for row, sign, columns, (S, _) in self._tests(point):
                share = sign * point.weight[0][rows] * f[:, row]
                R[np.ix_(rows, columns)] += share[:, None] * S[rows]
        return R

    def fields_at(self, coordinates: Array, dofs: Array, **arguments: Any) -> Array:
        """None, (n, 0, 0): see `evaluated`."""
        return np.empty((len(dofs), 0, 0))

    def evaluated(
        self, coordinates: Array, dofs: Array, **arguments: Any
    ) -> Iterator[tuple[Integers, PairPoint, dict[str, Array]]]:
        """Yield for each integration point the elements (m,) where the law acts, and values there.

        They are the fields of the page, the place, the undeformed area, and new history.
        """
        for point in self._points(coordinates, dofs, arguments["data"], columns=0):
            rows, z, _ = self._inputs(point, dofs, arguments["data"])
            values: dict[str, Array] = {}
            if self.law.fields:
                fields = self.law.fields_at(
                    np.empty((len(rows), 0)), z, parameters=arguments["parameters"]
                )
                values = {name: fields[:, 0, k] for k, name in enumerate(self.law.fields)}
            for k, u in enumerate(self.law.unknowns):
                if u.endswith(BEFORE):
                    values[u] = z[:, k]
            positions = point.position[rows].T
            values |= dict(zip(AXES, positions, strict=False))
            yield rows, point, values | {"area": point.weight[0][rows]}

    def _points(
        self, coordinates: Array, dofs: Array, data: Array, columns: int
    ) -> Iterator[PairPoint]:
        n, width = coordinates.shape
        if not n:
            return
        shape = (n, width // self.dimension, self.dimension)
        X = coordinates.reshape(shape)
        now = dofs[:, :width].reshape(shape) if self.moves else 0.0
        x, previous = X + now, X + data[:, :width].reshape(shape)
        varied = self.moves and columns > 0
        if self.dimension == 2:
            yield from LineGeometry(
                self.one, self.other, X, x, previous, columns, varied, self.ring
            ).points()
        else:
            corners = data[:, -3 * CORNER :].reshape(n, 3, CORNER)
            yield from FaceGeometry(
                self.one, self.other, X, x, previous, corners, columns, varied, self.order
            ).points()

    def _inputs(self, point: PairPoint, dofs: Array, data: Array) -> tuple[Integers, Array, Array]:
        """Elements (m,) where the law acts, and its unknowns there, (m, k), (m, k, columns)."""
        first = self.dimension * (len(self.one.nodes) + len(self.other.nodes))
        depth, reach = data[:, first : first + 2].T
        with np.errstate(all="ignore"):
            gap = self._gap(point)
            acts = (point.weight[0] > 0.0) & (gap > -depth) & (gap < reach)
        rows = np.flatnonzero(acts)
        corners = self.one.corners
        history = data[rows, first + 2 : first + 2 + corners * len(self.history)]
        history = history.reshape(len(rows), corners, len(self.history))
        positions, parts = self._columns, []
        for name in self.law.unknowns:
            if name.endswith(BEFORE):
                k = self.history.index(name[: -len(BEFORE)])
                L, dL = point.corners
                value = np.einsum("nk,nk->n", L[rows], history[:, :, k])
                parts.append((value, np.einsum("nkm,nk->nm", dL[rows], history[:, :, k])))
            elif name in positions:
                columns = positions[name]
                N, dN = self._shape(point, name)
                u, slope = dofs[rows][:, columns], np.zeros((len(rows), dN.shape[2]))
                if dN.shape[2]:
                    slope += np.einsum("nkm,nk->nm", dN[rows], u)
                    slope[:, columns] += N[rows]
                parts.append((np.einsum("nk,nk->n", N[rows], u), slope))
            elif name == "area_ratio":
                parts.append((point.area_ratio[0][rows], point.area_ratio[1][rows]))
            else:
                vector, _, axis = name.rpartition("_")
                v, dv = point.vectors[vector]
                c = AXES.index(axis)
                parts.append((v[rows, c], dv[rows, c]))
        z, dz = (np.stack([p[k] for p in parts], axis=1) for k in (0, 1))
        return rows, np.ascontiguousarray(z), dz

    def _gap(self, point: PairPoint) -> Array:
        a = point.vectors["slope_a"][0]
        across = np.stack([a[:, 1], -a[:, 0]], axis=1) if self.dimension == 2 else None
        if across is None:
            across = np.cross(a, point.vectors["slope_b"][0])
        distance = point.vectors["apart"][0]
        return np.asarray((distance * across).sum(axis=1) / np.linalg.norm(across, axis=1))

    def _tests(self, point: PairPoint) -> Iterator[_Test]:
        """Variations that the rows of the law belong to.

        That of a gap or slip is one of the places at rest on their sides.
        """
        positions, d = self._columns, self.dimension
        count = len(self.one.nodes), len(self.other.nodes)
        for row, name in enumerate(self.law.unknowns):
            if name in positions:
                yield row, 1.0, positions[name], self._shape(point, name)
                continue
            vector, _, axis = name.rpartition("_")
            if self.moves and vector in ("apart", "came"):
                sign = -1.0 if vector == "apart" else 1.0
                first = d * np.arange(count[0]) + AXES.index(axis)
                yield row, sign, first, point.first
                second = d * (count[0] + np.arange(count[1])) + AXES.index(axis)
                yield row, -sign, second, point.second

    @property
    def _columns(self) -> dict[str, Integers]:
        """Columns of the fields among the unknowns of an element, by the names of the law."""
        start = 0
        if self.moves:
            start = self.dimension * (len(self.one.nodes) + len(self.other.nodes))
        columns = {}
        for name, counts in self.counts.items():
            for end, count in zip((FIRST, SECOND), counts, strict=True):
                columns[f"{name}{end}"] = np.arange(start, start + count)
                start += count
        return columns

    def _shape(self, point: PairPoint, name: str) -> Varied:
        """Shape functions of a field on its side."""
        count = len(self._columns[name])
        full = point.first if name.endswith(FIRST) else point.second
        if count == full[0].shape[1]:
            return full
        assert name.endswith(FIRST)
        return point.corners


@dataclass(frozen=True, eq=False)
class LawContact:
    """A contact by a law.

    search: of its pairs. fields: name -> numbers of the unknowns at each node, (points,), -1 where
    there are none. history: (points, 1, k) before the step. areas: (points,) of the corners of the
    first side. friction: 0 if the law has an energy of the present state, else 1.
    """

    name: str
    search: Contact | FaceContact
    kernels: Mapping[tuple[str, str], PairLawKernel]
    fields: Mapping[str, Integers]
    areas: Array
    history: Array
    friction: float

    @property
    def multipliers(self) -> Integers:
        """None, (points, 0)."""
        return np.empty((len(self.search.points), 0), dtype=np.int64)

    @property
    def displacements(self) -> Integers:
        """See `StateDependentBlocks`."""
        return self.search.displacements

    @property
    def sides(self) -> tuple[ContactSide, ...]:
        """See `StateDependentBlocks`."""
        return self.search.sides

    @property
    def nodes(self) -> Integers:
        """See `StateDependentBlocks`."""
        return self.search.nodes

    @property
    def bound(self) -> Integers:
        """See `StateDependentBlocks`."""
        return self.search.bound

    @property
    def history_names(self) -> tuple[str, ...]:
        """Names of its history."""
        return next(iter(self.kernels.values())).history

    def empty(self) -> list[ElementBlock]:
        """Its blocks without elements, which keep their places."""
        return [block for block, _ in self._without_pairs()]

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Elements of the pairs at unknowns x; old: of the step before."""
        return [block for block, _ in self._elements(x, old)]

    def committed(self, x: Array, old: Array, parameters: Mapping[str, Array]) -> Array:
        """History (points, 1, k) after a step that ends at x."""
        change = np.zeros_like(self.history)
        for block, faces in self._elements(x, old):
            for rows, point, values in _evaluated(block, x, parameters[block.name]):
                L, area = point.corners[0][rows], values["area"]
                nodes = faces[rows, : L.shape[1]]
                for k, name in enumerate(self.history_names):
                    grown = area * (values[f"{NEW}{name}"] - values[f"{name}{BEFORE}"])
                    np.add.at(change[:, 0, k], nodes, L * grown[:, None])
        return self.history + change / np.where(self.areas > 0.0, self.areas, 1.0)[:, None, None]

    def _without_pairs(self) -> Iterator[tuple[ElementBlock, Integers]]:
        none, corners = np.empty(0, dtype=np.int64), np.empty((0, 3, CORNER))
        dofs = [self.displacements, *self.fields.values()]
        x = np.zeros(int(max(n.max(initial=0) for n in dofs)) + 1)
        for a, b, i, j in by_kind(self.sides, self.search.others, none, none):
            yield self._block(a, b, (i, j, corners), x)

    def _elements(self, x: Array, old: Array) -> Iterator[tuple[ElementBlock, Integers]]:
        """Blocks, and the nodes of the first face of each of their elements."""
        moved = np.where(self.displacements >= 0, x[self.displacements], 0.0)
        if not np.isfinite(moved).all():
            yield from self._without_pairs()
            return
        points, search = self.search.points + moved, self.search
        for a, b, i, j in by_kind(self.sides, search.others, *search.pairs(x)):
            side, (label, faces) = self.sides[a], search.others[b]
            overlap = i, j, np.empty((len(i), 3, CORNER))
            if isinstance(search, FaceContact):
                cells = CELLS[side.kind], CELLS[label]
                part = common_part(cells[0], points[side.faces[i]], cells[1], points[faces[j]])
                overlap = i[part.pairs], j[part.pairs], part.corners
            yield self._block(a, b, overlap, old)

    def _block(
        self, a: int, b: int, overlap: tuple[Integers, Integers, Array], old: Array
    ) -> tuple[ElementBlock, Integers]:
        """Elements of sides of kind a with others of kind b, and their first faces."""
        side, (kind, faces), (one, other, corners) = self.sides[a], self.search.others[b], overlap
        kernel = self.kernels[side.kind, kind]
        first, second = side.faces[one], faces[other]
        nodes = np.concatenate([first, second], axis=1)
        n, width = len(nodes), kernel.dimension * nodes.shape[1]
        moved = self.displacements[nodes].reshape(n, width)
        dofs = [moved] if kernel.moves else []
        for name, counts in kernel.counts.items():
            dofs += [
                self.fields[name][f[:, :c]] for f, c in zip((first, second), counts, strict=True)
            ]
        at_corners = self.history[first[:, : kernel.one.corners], 0]
        data = [np.where(moved >= 0, old[moved], 0.0), side.depth[one, None], side.reach[one, None]]
        data += [
            at_corners.reshape(n, kernel.one.corners * len(kernel.history)),
            corners.reshape(n, 3 * CORNER),
        ][: kernel.dimension - 1]
        block = ElementBlock(
            f"{self.name}: {side.kind} on {kind}",
            kernel,
            self.search.points[nodes].reshape(n, width),
            np.ascontiguousarray(np.concatenate(dofs, axis=1)),
            np.ascontiguousarray(np.concatenate(data, axis=1)),
            check_orientation=False,
        )
        return block, first


def fields_of_law(
    blocks: Iterable[ElementBlock], x: Array, parameters: Mapping[str, Array]
) -> dict[str, Array]:
    """Fields (m,) at the points of some blocks where the law acts, and their place and area."""
    fields: dict[str, list[Array]] = {}
    for block in blocks:
        for _, _, values in _evaluated(block, x, parameters[block.name]):
            for name, value in values.items():
                if not (name.startswith(NEW) or name.endswith(BEFORE)):
                    fields.setdefault(name, []).append(value)
    return {name: np.concatenate(parts) for name, parts in fields.items()}


def _evaluated(
    block: ElementBlock, x: Array, parameters: Array
) -> Iterator[tuple[Integers, PairPoint, dict[str, Array]]]:
    """See `PairLawKernel.evaluated`."""
    assert isinstance(block.kernel, PairLawKernel)
    arguments = {"data": block.data, "parameters": parameters}
    return block.kernel.evaluated(block.coordinates, x[block.dofs], **arguments)


def corner_areas(search: Contact | FaceContact) -> Array:
    """Undeformed areas (points,) about the corners of the first side."""
    areas, ring = np.zeros(len(search.points)), isinstance(search, Contact) and search.ring
    for side in search.sides:
        cell = CELLS[side.kind]
        at, weights = cell.measured_rule(cell.order, ring=ring)
        density = measures(cell, search.points[side.faces], at)
        if ring:
            radius = search.points[side.faces][:, :, 1]
            density = density * 2.0 * np.pi * np.einsum("qk,nk->nq", cell.shape(at), radius)
        parts = np.einsum("nq,q,qk->nk", density, weights, cell.linear.shape(at))
        np.add.at(areas, side.faces[:, : cell.corners], parts)
    return areas
