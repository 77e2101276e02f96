"""Loads, pressures, springs and ties as element kernels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import Cell, measures

Amount = float | Callable[[Array, float], Array | float]
"""A number that the load factor multiplies, or a function of places (n, dim) and of t."""

_TIME = ("t", "factor")
"""Parameters of loads: time or load factor, and what numbers are multiplied by."""
_HIGHER = 2
"""Loads are functions of any kind. On linear faces cubic ones are integrated exactly."""


def amount(value: Amount, positions: Array, t: float, factor: float) -> Array:
    """Values (n,) at places (n, dim): factor times a number, or a function of places and t.

    Raises ValueError for another shape.
    """
    if not callable(value):
        return np.full(len(positions), factor * float(value))
    result = np.asarray(value(positions, t), dtype=np.float64)
    if result.shape not in ((), (len(positions),)):
        raise ValueError(
            f"a function of {len(positions)} places gave values of shape {result.shape}"
        )
    return np.broadcast_to(result, (len(positions),)).copy()


def _rule(face: Cell, *, ring: bool) -> tuple[Array, Array]:
    """Points and weights that are exact for loads of an order that is by _HIGHER above the face's.

    Of bent faces pressures are exact, too: their normal is a polynomial, the area is not.
    """
    return face.measured_rule(2 * face.order + _HIGHER, ring=ring)


class _Kernel:
    """Base of the kernels of this module: no data, no fields."""

    name = ""
    signature = "built in"
    parameters: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """None, (n, 0, 0)."""
        return np.empty((len(dofs), 0, 0))


@dataclass(frozen=True, eq=False)
class DeadLoad(_Kernel):
    """A load per reference length or area of faces, one component; its parameters are t and factor.

    face: kind of the faces, whose coordinates the elements have. value: of the load. ring: whether
    the faces are those of rings around the x axis.
    """

    face: Cell
    value: Amount
    ring: bool = False
    name = "dead load"
    parameters = _TIME

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Minus the virtual work of the load, (n, k)."""
        n, nodes = len(coordinates), len(self.face.nodes)
        node_points = coordinates.reshape(n, nodes, coordinates.shape[1] // nodes)
        points, weights = _rule(self.face, ring=self.ring)
        shape = self.face.shape(points)
        x = np.einsum("qk,nkc->nqc", shape, node_points)
        load = amount(self.value, x.reshape(-1, x.shape[2]), *kwargs["parameters"].tolist())
        area = (
            measures(self.face, node_points, points)
            if self.face.dimension
            else np.ones(x.shape[:2])
        )
        area = area * 2.0 * np.pi * x[:, :, 1] if self.ring else area
        work = np.einsum("nq,nq,q,qk->nk", load.reshape(x.shape[:2]), area, weights, shape)
        return np.asarray(-work)

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Residual, and a tangent of zeros."""
        r = self.residual(coordinates, dofs, **kwargs)
        return r, np.zeros((*r.shape, r.shape[1]))


@dataclass(frozen=True, eq=False)
class Pressure(_Kernel):
    """A pressure on the deformed faces of a body, against their outward normal.

    Its unknowns are the displacements, all components node by node. face: kind of the faces.
    value: force per deformed length or area, a function of undeformed places. ring: whether the
    faces are those of rings around the x axis.
    """

    face: Cell
    value: Amount
    ring: bool = False
    name = "pressure"
    parameters = _TIME

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Minus the virtual work of the pressure, (n, k)."""
        return self._evaluate(coordinates, dofs, kwargs)[0]

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Residual and its exact tangent, which is not symmetric."""
        r, gradient, load, points = self._evaluate(coordinates, dofs, kwargs)
        around = self._around(coordinates, dofs, points)
        shape, along = self.face.shape(points), self.face.gradient(points)
        turn = _turned(
            gradient
        )  # (n, q, c, c, d): normal component by slope component and direction
        K = np.einsum("nq,qk,nqced,qld->nkcle", load * around, shape, turn, along, optimize=True)
        if self.ring:
            wider = 2.0 * np.pi * load
            K[..., 1] += np.einsum("nq,qk,nqc,ql->nkcl", wider, shape, _normal(gradient), shape)
        return r, np.ascontiguousarray(K.reshape(*r.shape, r.shape[1]))

    def _evaluate(
        self, coordinates: Array, dofs: Array, kwargs: Any
    ) -> tuple[Array, Array, Array, Array]:
        """Residual (n, k c), slopes of the deformed face (n, q, c, d), load times weight (n, q)
        and the points.
        """
        n, k = len(coordinates), len(self.face.nodes)
        shape = n, k, coordinates.shape[1] // k  # n may be 0
        X, u = coordinates.reshape(shape), dofs.reshape(shape)
        points, weights = _rule(self.face, ring=self.ring)
        values, along = self.face.shape(points), self.face.gradient(points)
        load_points = np.einsum("qk,nkc->nqc", values, X)
        load = amount(
            self.value, load_points.reshape(-1, X.shape[2]), *kwargs["parameters"].tolist()
        )
        gradient = np.einsum("qkd,nkc->nqcd", along, X + u)
        weighted = load.reshape(load_points.shape[:2]) * weights
        around = self._around(coordinates, dofs, points)
        r = np.einsum("nq,qk,nqc->nkc", weighted * around, values, _normal(gradient))
        return r.reshape(dofs.shape), gradient, weighted, points

    def _around(self, coordinates: Array, dofs: Array, points: Array) -> Array:
        """Deformed circumferences (n, q) of rings, else ones."""
        n, k = len(coordinates), len(self.face.nodes)
        if not self.ring:
            return np.ones((n, len(points)))
        radius = (coordinates + dofs).reshape(n, k, 2)[:, :, 1]
        return np.asarray(2.0 * np.pi * radius @ self.face.shape(points).T)


def _normal(gradient: Array) -> Array:
    """Outward normals (n, q, c) times length or area per parent unit, from slopes (n, q, c, d)."""
    if gradient.shape[2] == 2:
        return np.stack([gradient[..., 1, 0], -gradient[..., 0, 0]], axis=-1)
    return np.asarray(np.cross(gradient[..., 0], gradient[..., 1]))


def _turned(gradient: Array) -> Array:
    """Derivatives of the normal by the slopes, (n, q, c, c, d)."""
    derivatives = np.zeros((*gradient.shape[:2], gradient.shape[2], *gradient.shape[2:]))
    if gradient.shape[2] == 2:
        derivatives[..., 0, 1, 0], derivatives[..., 1, 0, 0] = 1.0, -1.0
        return derivatives
    for c in range(3):  # normal = a x b, d/da_c = e_c x b, d/db_c = a x e_c
        e = np.eye(3)[c]
        derivatives[..., :, c, 0] = np.cross(e, gradient[..., 1])
        derivatives[..., :, c, 1] = np.cross(gradient[..., 0], e)
    return derivatives


@dataclass(frozen=True, eq=False)
class NodalForce(_Kernel):
    """Forces at nodes; its parameters are t and factor."""

    value: Amount
    name = "nodal force"
    parameters = _TIME

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Minus the forces, (n, 1)."""
        return -amount(self.value, coordinates, *kwargs["parameters"].tolist())[:, None]

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Residual, and a tangent of zeros."""
        r = self.residual(coordinates, dofs, **kwargs)
        return r, np.zeros((*r.shape, 1))


@dataclass(frozen=True, eq=False)
class RigidMoment(NodalForce):
    """A moment about an axis that does not turn, on rigid bodies in space.

    Its unknowns are the three of the rotation vector. axis: 0 to 2. law: the kernel `rigid_moment`.
    """

    axis: int = 0
    law: Any = None
    name = "moment"

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Minus the virtual work of the moment, (n, 3)."""
        return self.tangent(coordinates, dofs, **kwargs)[0]

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Residual and its exact tangent, which is not symmetric."""
        n = len(dofs)
        moments = np.zeros((n, 3))
        moments[:, self.axis] = amount(self.value, coordinates, *kwargs["parameters"].tolist())
        data, parameters = np.ascontiguousarray(moments), np.empty(0)
        r, K = self.law.tangent(
            np.empty((n, 0)), np.ascontiguousarray(dofs), data=data, parameters=parameters
        )
        return np.asarray(r), np.asarray(K)


@dataclass(frozen=True, eq=False)
class Spring(_Kernel):
    """Springs between nodes and the ground."""

    stiffness: float
    name = "spring"

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Forces, (n, 1)."""
        return self.stiffness * dofs

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Forces and stiffness."""
        return self.residual(coordinates, dofs), np.full((len(dofs), 1, 1), self.stiffness)


@dataclass(frozen=True, eq=False)
class Tie(_Kernel):
    """u_a = u_b + offset by a multiplier: unknowns u_a, u_b, multiplier; parameters t and factor.

    The coordinates are those of the node a.
    """

    offset: Amount
    name = "tie"
    parameters = _TIME

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Forces of the multiplier and the equation itself, (n, 3)."""
        a, b, force = dofs.T
        offset = amount(self.offset, coordinates, *kwargs["parameters"].tolist())
        return np.stack([force, -force, a - b - offset], axis=1)

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Residual and its constant tangent."""
        K = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, -1.0, 0.0]])
        return self.residual(coordinates, dofs, **kwargs), np.tile(K, (len(dofs), 1, 1))
