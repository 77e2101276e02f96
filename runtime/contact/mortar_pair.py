"""Mortar elements of contact in 3-D: the law of a point (page `touch`) integrated over a triangle.

A triangle is part of what a face and another one have in common (`common_part`). Places, slopes and
multipliers of a point are interpolated here, and the tangent of the law is carried over to the
nodes: with the motion of the corners of the triangle, of the partner and of the normal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.contact.mortar_overlap import CORNER
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.mesh.cells import CELLS, Cell

MULTIPLIERS = 4
"""lambda and the vector tau, at the corners of a face."""
_ITERATIONS = 8
Varied: TypeAlias = tuple[Array, Array]
"""Values (n, ...) and their derivatives (n, ..., ndof) by the unknowns of the element."""


@dataclass(frozen=True, eq=False)
class MortarPairKernel:
    """A kernel of assembly: a triangle of a face and another one.

    Unknowns are the displacements of the nodes of both, node by node, then lambda, tau_x, tau_y,
    tau_z at the corners of the face. data: displacements of the step before, likewise; rho,
    friction, depth, reach; the corners of the triangle, 3 times CORNER.
    """

    law: Kernel
    one: Cell
    other: Cell
    parameters: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.law.name} of {self.one.name} on {self.other.name}"

    @property
    def signature(self) -> str:
        """Of the law."""
        return self.law.signature

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Element residuals (n, ndof)."""
        n, ndof = dofs.shape
        R = np.zeros((n, ndof))
        if n:
            at = self._geometry(coordinates, dofs, kwargs["data"], columns=0)
            for point in at.points():
                self._add(R, None, point, dofs, kwargs["data"])
        return R

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof)."""
        n, ndof = dofs.shape
        R, K = np.zeros((n, ndof)), np.zeros((n, ndof, ndof))
        if n:
            at = self._geometry(coordinates, dofs, kwargs["data"], columns=ndof)
            for point in at.points():
                self._add(R, K, point, dofs, kwargs["data"])
        return R, K

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """None, (n, 0, 0): fields are those of the whole face."""
        return np.empty((len(dofs), 0, 0))

    def _geometry(self, coordinates: Array, dofs: Array, data: Array, columns: int) -> FaceGeometry:
        n, width = len(dofs), coordinates.shape[1]
        corners = data[:, width + 4 :].reshape(n, 3, CORNER)
        order = max(self.one.order, self.other.order)
        moved = coordinates + dofs[:, :width], coordinates + data[:, :width]
        X, x, previous = (v.reshape(n, -1, 3) for v in (coordinates, *moved))
        return FaceGeometry(
            self.one, self.other, X, x, previous, corners, columns, columns > 0, order
        )

    def _add(self, R: Array, K: Array | None, point: PairPoint, dofs: Array, data: Array) -> None:
        """Add a point of all triangles in place; K is None where only residuals are needed."""
        n, width = len(R), 3 * (len(self.one.nodes) + len(self.other.nodes))
        multipliers = dofs[:, width:].reshape(n, -1, MULTIPLIERS)
        L, dL = point.corners
        tau = np.einsum("nk,nkc->nc", L, multipliers)
        dtau = np.einsum("nkm,nkc->ncm", dL, multipliers)
        for c in range(0 if K is None else MULTIPLIERS):
            dtau[:, c, width + c :: MULTIPLIERS] += L
        parts = [*(point.vectors[v] for v in ("apart", "slope_a", "slope_b", "came")), (tau, dtau)]
        z, dz = (np.concatenate([p[i] for p in parts], axis=1) for i in (0, 1))
        limits = data[:, width : width + 4]
        none, unknowns = np.empty((n, 0)), np.ascontiguousarray(z)
        arguments = {"data": np.ascontiguousarray(limits), "parameters": np.empty(0)}
        node_weights = _opposite(point.first, point.second)
        W, dW = point.weight
        rows = [0, 1, 2, 12, 13, 14, 15]
        if K is None:
            f = W[:, None] * self.law.residual(none, unknowns, **arguments)[:, rows]
        else:
            values, derivatives = self.law.tangent(none, unknowns, **arguments)
            df = W[:, None, None] * np.einsum("nij,njm->nim", derivatives[:, rows], dz)
            df += values[:, rows, None] * dW[:, None]
            f = W[:, None] * values[:, rows]
        for part, columns, (S, dS) in (
            (slice(width), slice(3), node_weights),
            (slice(width, None), slice(3, None), point.corners),
        ):
            k, c = S.shape[1], f[:, columns].shape[1]
            R[:, part] += (S[:, :, None] * f[:, None, columns]).reshape(n, k * c)
            if K is None:
                continue
            change = S[:, :, None, None] * df[:, None, columns]
            change += dS[:, :, None] * f[:, None, columns, None]
            K[:, part] += change.reshape(n, k * c, -1)


def _opposite(first: Varied, second: Varied) -> Varied:
    """Weights of what acts on a point, and with the other sign on its partner."""
    return tuple(np.concatenate([a, -b], axis=1) for a, b in zip(first, second, strict=True))  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class PairPoint:
    """Integration point of n pairs: a point of the first side and its partner.

    weight: (n,) by the undeformed area. vectors: (n, dim) "apart", from the point to the partner,
    "slope_a", "slope_b", along the side, and "came", which "apart" was before the step. area_ratio:
    (n,) deformed over undeformed area. first, second, corners: shape functions (n, k) of the nodes
    of both sides, and of the corners of the first one. position: (n, dim) of the point.
    """

    weight: Varied
    vectors: dict[str, Varied]
    area_ratio: Varied
    first: Varied
    second: Varied
    corners: Varied
    position: Array


@dataclass(frozen=True, eq=False)
class FaceGeometry:
    """Nodes of two faces at rest X, now x, and before, (n, nodes, 3), and triangles of their part.

    columns: derivatives are by so many unknowns; if the nodes are `varied`, the first of these move
    them, node by node. order: of the rule.
    """

    one: Cell
    other: Cell
    X: Array
    x: Array
    previous: Array
    corners: Array
    columns: int
    varied: bool
    order: int

    @property
    def nodes(self) -> int:
        """Of both faces."""
        return int(self.x.shape[1])

    @property
    def side_nodes(self) -> slice:
        """Nodes of the face."""
        return slice(0, len(self.one.nodes))

    @property
    def other_nodes(self) -> slice:
        """Nodes of the other one."""
        return slice(len(self.one.nodes), None)

    def points(self) -> Iterator[PairPoint]:
        """Points of the rule of a triangle."""
        normal = self._normal()
        start, *other_corners = (self._corner(k, normal) for k in range(3))
        along, across = (_minus(end, start) for end in other_corners)
        area = _triple(along, across, normal)
        positive = area[0] > 0.0
        area = area[0] * positive, area[1] * positive[:, None]
        for (s, t), weight in zip(*CELLS["tri3"].rule(2 * self.order), strict=True):
            z = _plus(start, _plus(_times(s, along), _times(t, across)))
            xi = self._project(self.one, self.side_nodes, z, normal)
            slope = self._gradient(self.one, self.side_nodes, xi)
            first, second = ((slope[0][:, :, d], slope[1][:, :, d]) for d in (0, 1))
            reference, deformed = self._area(xi), _length(_cross(first, second))
            measure = _over(reference, _triple(first, second, normal))
            eta = self._project(self.other, self.other_nodes, z, normal)
            yield PairPoint(
                weight=_product(_times(weight, area), measure),
                vectors=self._vectors(xi, eta) | {"slope_a": first, "slope_b": second},
                area_ratio=_over(deformed, reference),
                first=_shapes(self.one, xi),
                second=_shapes(self.other, eta),
                corners=_shapes(self.one.linear, xi),
                position=z[0],
            )

    def _vectors(self, xi: Varied, eta: Varied) -> dict[str, Varied]:
        faces = ((self.one, self.side_nodes, xi), (self.other, self.other_nodes, eta))
        x, y = (self._moving_point(cell, self.x, part, at) for cell, part, at in faces)
        was, were = (
            self._interpolate(cell, self.previous[:, part], at) for cell, part, at in faces
        )
        return {"apart": _minus(y, x), "came": _minus(were, was)}

    def _moving_point(self, cell: Cell, x: Array, part: slice, at: Varied) -> Varied:
        """Place of parent coordinates, with the motion of the nodes."""
        point, change = self._interpolate(cell, x[:, part], at)
        shape = cell.shape(at[0])
        numbers = range(self.nodes)[part]
        for c in range(3 if self.varied else 0):
            change[:, c, [3 * i + c for i in numbers]] += shape
        return point, change

    def _interpolate(self, cell: Cell, x: Array, at: Varied) -> Varied:
        """Place of parent coordinates on nodes (n, k, 3) that do not move."""
        N, dN = _shapes(cell, at)
        return np.einsum("nk,nkc->nc", N, x), np.einsum("nkm,nkc->ncm", dN, x)

    def _gradient(self, cell: Cell, part: slice, at: Varied) -> Varied:
        """Slopes (n, 3, 2) of the face."""
        G, dG = _gradients(cell, at)
        x = self.x[:, part]
        gradient = np.einsum("nkd,nkc->ncd", G, x)
        change = np.einsum("nkdm,nkc->ncdm", dG, x)
        numbers = range(self.nodes)[part]
        for c in range(3 if self.varied else 0):
            change[:, c][:, :, [3 * i + c for i in numbers]] += G.transpose(0, 2, 1)
        return gradient, change

    def _area(self, xi: Varied) -> Varied:
        """Area at rest per parent area."""
        k = len(self.one.nodes)
        G, dG = _gradients(self.one, xi)
        X = self.X[:, :k]
        slope = np.einsum("nkd,nkc->ncd", G, X)
        change = np.einsum("nkdm,nkc->ncdm", dG, X)
        a, b = slope[:, :, 0], slope[:, :, 1]
        across = np.cross(a, b)
        area = np.linalg.norm(across, axis=1)
        moved = np.cross(change[:, :, 0], b[:, :, None], axis=1)
        moved += np.cross(a[:, :, None], change[:, :, 1], axis=1)
        return area, np.einsum("nc,ncm->nm", across / area[:, None], moved)

    def _normal(self) -> Varied:
        """Mean normal of the face."""
        flat = self.one.linear
        k = len(flat.nodes)
        middle = np.tile(flat.nodes.mean(axis=0), (len(self.x), 1))
        xi = middle, np.zeros((len(middle), 2, self.columns))
        slope, change = self._gradient(flat, slice(0, k), xi)
        a, b = slope[:, :, 0], slope[:, :, 1]
        across = np.cross(a, b)
        moved = np.cross(change[:, :, 0], b[:, :, None], axis=1)
        moved += np.cross(a[:, :, None], change[:, :, 1], axis=1)
        length = np.linalg.norm(across, axis=1)[:, None]
        n = across / length
        moved -= n[:, :, None] * np.einsum("nc,ncm->nm", n, moved)[:, None]
        return n, moved / length[:, :, None]

    def _corner(self, k: int, normal: Varied) -> Varied:
        """Place of a corner of the triangle."""
        motion = self.corners[:, k]
        A = motion[:, 2:6].reshape(-1, 2, 2).transpose(0, 2, 1)
        B = motion[:, 8:12].reshape(-1, 2, 2).transpose(0, 2, 1)
        zero = np.zeros((len(motion), 2, self.columns))
        flat, far = self.one.linear, self.other.linear
        a, b = len(self.one.nodes), len(far.nodes)
        side_nodes, other_nodes = slice(0, len(flat.nodes)), slice(a, a + b)
        xi, eta = (motion[:, :2], zero), (motion[:, 6:8], zero)
        x, y = (
            self._moving_point(flat, self.x, side_nodes, xi),
            self._moving_point(far, self.x, other_nodes, eta),
        )
        K = (
            self._gradient(flat, side_nodes, xi)[0] @ A
            - self._gradient(far, other_nodes, eta)[0] @ B
        )
        v, dv = _tangential_solution(K, (y[0] - x[0], y[1] - x[1]), normal)
        at = motion[:, :2] + np.einsum("ndv,nv->nd", A, v), np.einsum("ndv,nvm->ndm", A, dv)
        return self._moving_point(flat, self.x, side_nodes, at)

    def _project(self, cell: Cell, part: slice, z: Varied, normal: Varied) -> Varied:
        """Parent coordinates on a face of what lies on the line through z along the normal."""
        at = np.tile(cell.nodes[: cell.corners].mean(axis=0), (len(self.x), 1))
        zero = np.zeros((len(at), 2, self.columns))
        for _ in range(_ITERATIONS):
            point = self._interpolate(cell, self.x[:, part], (at, zero))[0]
            K = -np.einsum("nkd,nkc->ncd", cell.gradient(at), self.x[:, part])
            step = _solve_columns(K, normal[0], point - z[0])[:, :2]
            at = at + np.clip(step, -2.0, 2.0)
            if np.abs(step).max(initial=0.0) < 1e-14:
                break
        K = -self._gradient(cell, part, (at, zero))[0]
        return at, _tangential_solution(
            K, _minus(self._moving_point(cell, self.x, part, (at, zero)), z), normal
        )[1]


def _plus(a: Varied, b: Varied) -> Varied:
    return a[0] + b[0], a[1] + b[1]


def _minus(a: Varied, b: Varied) -> Varied:
    return a[0] - b[0], a[1] - b[1]


def _times(number: float, a: Varied) -> Varied:
    return number * a[0], number * a[1]


def _product(a: Varied, b: Varied) -> Varied:
    """Of scalars (n,)."""
    return a[0] * b[0], a[0][:, None] * b[1] + b[0][:, None] * a[1]


def _over(a: Varied, b: Varied) -> Varied:
    """Of scalars (n,)."""
    ratio = a[0] / b[0]
    return ratio, (a[1] - ratio[:, None] * b[1]) / b[0][:, None]


def _triple(a: Varied, b: Varied, c: Varied) -> Varied:
    """(a x b) . c of vectors (n, 3)."""
    changes = (
        np.einsum("nc,ncm->nm", np.cross(v[0], w[0]), u[1])
        for u, v, w in ((a, b, c), (b, c, a), (c, a, b))
    )
    return np.einsum("nc,nc->n", np.cross(a[0], b[0]), c[0]), sum(changes)


def _cross(a: Varied, b: Varied) -> Varied:
    """Of vectors (n, 3)."""
    moved = np.cross(a[1], b[0][:, :, None], axis=1) + np.cross(a[0][:, :, None], b[1], axis=1)
    return np.cross(a[0], b[0]), moved


def _length(a: Varied) -> Varied:
    """Of vectors (n, 3)."""
    length = np.linalg.norm(a[0], axis=1)
    return length, np.einsum("nc,ncm->nm", a[0] / length[:, None], a[1])


def _tangential_solution(K: Array, offset: Varied, normal: Varied) -> Varied:
    """v with K v + g n = off, and its derivatives where v is nearly zero."""
    w = _solve_columns(K, normal[0], offset[0])
    change = offset[1] - w[:, 2, None, None] * normal[1]
    return w[:, :2], _solve_columns(K, normal[0], change)[:, :2]


def _solve_columns(K: Array, n: Array, right: Array) -> Array:
    """Solution (n, 3, ...) of the columns of K (n, 3, 2) and n (n, 3); nan if any is singular."""
    matrix = np.concatenate([K, n[:, :, None]], axis=2)
    flat = right.ndim == 2
    try:
        solution = np.linalg.solve(matrix, right[:, :, None] if flat else right)
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.nan)
    return np.asarray(solution[:, :, 0] if flat else solution)


def _shapes(cell: Cell, at: Varied) -> Varied:
    """Shape functions (n, k)."""
    return cell.shape(at[0]), np.einsum("nkd,ndm->nkm", cell.gradient(at[0]), at[1])


def _gradients(cell: Cell, at: Varied) -> Varied:
    """Their derivatives (n, k, 2); differences are exact, they are at most quadratic."""
    change = np.zeros((*at[0].shape[:1], len(cell.nodes), 2, at[1].shape[2]))
    for d in (0, 1):
        h = 0.5 * np.eye(2)[d]
        second = cell.gradient(at[0] + h) - cell.gradient(at[0] - h)
        change += second[:, :, :, None] * at[1][:, None, None, d]
    return cell.gradient(at[0]), change
