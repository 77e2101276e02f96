"""Loads, springs and ties as element kernels: what a problem has besides its pages."""

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


def amount(value: Amount, places: Array, t: float, factor: float) -> Array:
    """Values (n,) at places (n, dim): factor times a number, or a function of places and t.

    Raises ValueError for another shape.
    """
    if not callable(value):
        return np.full(len(places), factor * float(value))
    found = np.asarray(value(places, t), dtype=np.float64)
    if found.shape not in ((), (len(places),)):
        raise ValueError(f"a function of {len(places)} places gave values of shape {found.shape}")
    return np.broadcast_to(found, (len(places),)).copy()


class _Kernel:
    """What the kernels of this module share: no data, no fields."""

    name = ""
    signature = "built in"
    parameters: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()

    def fields_at(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """None, (n, 0, 0)."""
        return np.empty((len(dofs), 0, 0))


@dataclass(frozen=True, eq=False)
class DeadLoad(_Kernel):
    """A load per reference length or area of faces, one component; its parameters are t and factor.

    face: kind of the faces, whose coordinates the elements have. value: of the load.
    """

    face: Cell
    value: Amount
    name = "dead load"
    parameters = _TIME

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Minus the virtual work of the load, (n, k)."""
        n, nodes = len(coordinates), len(self.face.nodes)
        places = coordinates.reshape(n, nodes, coordinates.shape[1] // nodes)
        points, weights = self.face.rule(4)
        shape = self.face.shape(points)
        x = np.einsum("qk,nkc->nqc", shape, places)
        load = amount(self.value, x.reshape(-1, x.shape[2]), *given["parameters"].tolist())
        area = measures(self.face, places, points) if self.face.dimension else np.ones(x.shape[:2])
        work = np.einsum("nq,nq,q,qk->nk", load.reshape(x.shape[:2]), area, weights, shape)
        return np.asarray(-work)

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        """Residual, and a tangent of zeros."""
        r = self.residual(coordinates, dofs, **given)
        return r, np.zeros((*r.shape, r.shape[1]))


@dataclass(frozen=True, eq=False)
class NodalForce(_Kernel):
    """Forces at nodes; its parameters are t and factor."""

    value: Amount
    name = "nodal force"
    parameters = _TIME

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Minus the forces, (n, 1)."""
        return -amount(self.value, coordinates, *given["parameters"].tolist())[:, None]

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        """Residual, and a tangent of zeros."""
        r = self.residual(coordinates, dofs, **given)
        return r, np.zeros((*r.shape, 1))


@dataclass(frozen=True, eq=False)
class Spring(_Kernel):
    """Springs between nodes and the ground."""

    stiffness: float
    name = "spring"

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Forces, (n, 1)."""
        return self.stiffness * dofs

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
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

    def residual(self, coordinates: Array, dofs: Array, **given: Any) -> Array:
        """Forces of the multiplier and the equation itself, (n, 3)."""
        a, b, force = dofs.T
        offset = amount(self.offset, coordinates, *given["parameters"].tolist())
        return np.stack([force, -force, a - b - offset], axis=1)

    def tangent(self, coordinates: Array, dofs: Array, **given: Any) -> tuple[Array, Array]:
        """Residual and its constant tangent."""
        K = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, -1.0, 0.0]])
        return self.residual(coordinates, dofs, **given), np.tile(K, (len(dofs), 1, 1))
