"""Contact of a deformable side with the surface of a rigid body: its elements and their kernel.

The law of a point is the page `rigid_touch_2` or `rigid_touch_3`. The points are those of a rule on
the faces of the side. The nearest part of the surface is
searched at each iterate.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.rigid_surfaces import Surface
from softehl.runtime.contact.search import ContactSide, nodes_of
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.rotations import rotation_matrix
from softehl.runtime.kernels.kernel import Kernel, Rule
from softehl.runtime.mesh.cells import CELLS, Cell, measures

ANY_DEPTH = 1e300
"""A depth that no penetration exceeds."""
_DEGREES = {1: 7, 2: 5}
"""Of the polynomials that the rule integrates exactly, by the dimension of a face: the pressure
ends inside a face, so that more points than for a polynomial pay along a line."""


def face_rule(kind: str) -> Rule:
    """Points and weights on a face of a side in contact with a rigid surface."""
    cell = CELLS[kind]
    return Rule(*cell.rule(_DEGREES[cell.dimension]))


@dataclass(frozen=True, eq=False)
class RigidContactKernel:
    """A kernel of assembly: the law of a point, summed over the points of a face.

    Unknowns are the displacements of the face, node by node, lambda and the shear at its corners,
    and the motion of the rigid body if it moves. data: those of the law at each point.
    """

    law: Kernel
    cell: Cell
    rule: Rule
    moves: bool
    parameters: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.law.name} of {self.cell.name}"

    @property
    def signature(self) -> str:
        """Of the law."""
        return self.law.signature

    @cached_property
    def interpolation(self) -> Array:
        """Inputs of the law at each point by the unknowns of an element, (q, inputs, ndof)."""
        dim = self.cell.dimension + 1
        multipliers, motion = 2 if dim == 2 else 4, 3 if dim == 2 else 6
        N = self.cell.shape(self.rule.points)
        L = self.cell.linear.shape(self.rule.points)
        width, corners = N.shape[1] * dim, L.shape[1] * multipliers
        B = np.zeros((len(N), dim + multipliers + motion, width + corners + motion))
        for c in range(dim):
            B[:, c, c:width:dim] = N
        for c in range(multipliers):
            B[:, dim + c, width + c : width + corners : multipliers] = L
        B[:, dim + multipliers :, width + corners :] = np.eye(motion)
        return B if self.moves else B[:, :, : width + corners]

    @property
    def pressures(self) -> tuple[int, ...]:
        """Numbers of lambda among the unknowns of an element."""
        dim = self.cell.dimension + 1
        width, step = dim * len(self.cell.nodes), 2 if dim == 2 else 4
        return tuple(width + step * k for k in range(self.cell.corners))

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Element residuals (n, ndof)."""
        return self.tangent(coordinates, dofs, **kwargs)[0]

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof)."""
        n, B = len(dofs), self.interpolation
        if not n:
            return np.zeros(dofs.shape), np.zeros((*dofs.shape, dofs.shape[1]))
        q, inputs, _ = B.shape
        z = np.einsum("qia,na->nqi", B, dofs)
        dim = self.cell.dimension + 1
        X = coordinates.reshape(n, -1, dim)
        z[:, :, :dim] += np.einsum("qk,nkc->nqc", self.cell.shape(self.rule.points), X)
        f, K = self.law.tangent(
            np.empty((n * q, 0)),
            np.ascontiguousarray(z.reshape(n * q, inputs)),
            data=np.ascontiguousarray(kwargs["data"].reshape(n * q, -1)),
            parameters=np.empty(0),
        )
        f, K = f.reshape(n, q, inputs), K.reshape(n, q, inputs, inputs)
        R = np.einsum("qia,nqi->na", B, f)
        columns = np.einsum("nqij,qjb->nqib", K, B)
        return R, np.einsum("qia,nqib->nab", B, columns, optimize=True)

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """None, (n, 0, 0): fields are those of the whole face."""
        return np.empty((len(dofs), 0, 0))


@dataclass(frozen=True, eq=False)
class RigidContact:
    """Contact between `sides` and the surface of a rigid body.

    points: (p, dim) of the mesh. displacements (p, dim), multipliers (p, k): numbers of the
    unknowns at each node, -1 where there are none. motion: numbers of the unknowns of the body,
    empty where it is at rest. reference: (dim,) its reference point. depth: largest penetration
    that counts. ring: sides are those of rings around the x axis.
    """

    name: str
    points: Array
    displacements: Integers
    multipliers: Integers
    sides: tuple[ContactSide, ...]
    surface: Surface
    law: Kernel
    motion: Integers
    reference: Array
    depth: float = ANY_DEPTH
    friction: float = 0.0
    ring: bool = False
    others: tuple[tuple[str, Integers], ...] = ()
    kernels: dict[str, Any] = field(default_factory=dict)

    @property
    def nodes(self) -> Integers:
        """Of all its faces."""
        return nodes_of(self.sides, ())

    @property
    def bound(self) -> Integers:
        """Numbers of the unknowns on which it acts."""
        dofs = self.displacements[self.nodes]
        return np.concatenate([dofs[dofs >= 0], self.motion])

    def empty(self) -> list[ElementBlock]:
        """Its blocks, at rest."""
        largest = max(*(int(v.max()) for v in (self.displacements, self.multipliers)), 0)
        x = np.zeros(max(largest, int(self.motion.max(initial=0))) + 1)
        return self.blocks(x, x)

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Elements at unknowns x; old: those of the step before."""
        return [self._block(side, x, old) for side in self.sides]

    def penalty_forces(self, x: Array) -> tuple[Array, float]:
        """Forces (n,) of the penalty alone on the displacements at unknowns x, and its energy."""
        forces, energy = np.zeros(len(x)), 0.0
        for block in replace(self, friction=0.0).blocks(x, x):
            width = block.coordinates.shape[1]
            r = block.residual(x, np.empty(0))[:, :width]
            np.add.at(forces, block.dofs[:, :width].ravel(), r.ravel())
        for side in self.sides:
            rule, cell = self.kernels[side.kind].rule, CELLS[side.kind]
            at = self._seen(side.faces, cell.shape(rule.points), x)
            gap = self.surface.nearest(at.reshape(-1, at.shape[2])).gap.reshape(at.shape[:2])
            closed = (gap < 0.0) & (gap > -self.depth)
            stiffness = side.rho[:, None] * self._areas(side)
            energy += 0.5 * float((stiffness * np.where(closed, gap, 0.0) ** 2).sum())
        return forces, energy

    def _areas(self, side: ContactSide) -> Array:
        """Reference areas (n, q) of the points of a side."""
        cell, rule = CELLS[side.kind], self.kernels[side.kind].rule
        X = self.points[side.faces]
        area = measures(cell, X, rule.points) * rule.weights
        if self.ring:
            radius = np.einsum("qk,nk->nq", cell.shape(rule.points), X[:, :, 1])
            area = area * 2.0 * np.pi * radius
        return np.asarray(area)

    def _block(self, side: ContactSide, x: Array, old: Array) -> ElementBlock:
        kernel, faces = self.kernels[side.kind], side.faces
        n, dim = len(faces), self.points.shape[1]
        cell, rule = kernel.cell, kernel.rule
        X, N, area = self.points[faces], cell.shape(rule.points), self._areas(side)
        q = area.shape[1]
        current, previous = (self._seen(faces, N, v).reshape(n * q, dim) for v in (x, old))
        constants = [np.full(n * q, v) for v in (self.friction, self.depth)]
        reference = np.broadcast_to(self.reference, (n * q, dim))
        columns = [np.repeat(side.rho, q), *constants, reference, previous, area.ravel()]
        data = np.column_stack([*columns, self.surface.nearest(current).columns])
        moved = self.displacements[faces].reshape(n, -1)
        multipliers = self.multipliers[faces[:, : cell.corners]].reshape(n, -1)
        motion = np.broadcast_to(self.motion, (n, len(self.motion)))
        return ElementBlock(
            f"{self.name}: {side.kind} on a rigid surface",
            kernel,
            X.reshape(n, -1),
            np.ascontiguousarray(np.concatenate([moved, multipliers, motion], axis=1)),
            np.ascontiguousarray(data.reshape(n, -1)),
            check_orientation=False,
        )

    def _seen(self, faces: Integers, N: Array, x: Array) -> Array:
        """Points (n, q, dim) of the faces as the rigid body sees them."""
        dofs, dim = self.displacements[faces], self.points.shape[1]
        moved = self.points[faces] + np.where(dofs >= 0, x[dofs], 0.0)
        at = np.einsum("qk,nkc->nqc", N, moved)
        if not len(self.motion):
            return np.asarray(at)
        U, theta = x[self.motion[:dim]], x[self.motion[dim:]]
        return np.asarray((at - self.reference - U) @ rotation_matrix(theta) + self.reference)
