"""Contact by a penalty, for explicit dynamics: forces of the present gaps, without unknowns.

Kernels are those of the augmented Lagrangian with a multiplier lambda of zero: the pressure is
rho times the penetration. The shear stress tau of the step before stays at the nodes and grows by
rho times the slip, up to the friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.contact.rigid_contact import RigidContact
from softehl.runtime.contact.search import Contact, FaceContact
from softehl.runtime.mesh.cells import CELLS, measures

AnyContact: TypeAlias = Contact | FaceContact | RigidContact


@dataclass(frozen=True, eq=False)
class PenaltyKernel:
    """A kernel of contact whose multipliers lambda are zero; columns: of lambda among its dofs."""

    kernel: Any
    columns: tuple[int, ...]

    def __getattr__(self, name: str) -> Any:
        """Everything else, names above all, is the kernel's."""
        if name == "kernel":
            raise AttributeError(name)
        return getattr(self.kernel, name)

    def residual(self, coordinates: Array, dofs: Array, **arguments: Any) -> Array:
        """Residuals (n, ndof)."""
        return np.asarray(self.kernel.residual(coordinates, self._without(dofs), **arguments))

    def tangent(self, coordinates: Array, dofs: Array, **arguments: Any) -> tuple[Array, Array]:
        """Residuals (n, ndof) and tangents (n, ndof, ndof)."""
        r, K = self.kernel.tangent(coordinates, self._without(dofs), **arguments)
        K[:, :, self.columns] = 0.0
        return r, K

    def fields_at(self, coordinates: Array, dofs: Array, **arguments: Any) -> Array:
        """None, (n, 0, 0)."""
        return np.empty((len(dofs), 0, 0))

    def _without(self, dofs: Array) -> Array:
        dofs = dofs.copy()
        dofs[:, self.columns] = 0.0
        return dofs


def with_penalty(contact: AnyContact) -> AnyContact:
    """The contact with kernels of a penalty."""
    if isinstance(contact, RigidContact):
        return replace(
            contact,
            kernels={
                kind: PenaltyKernel(kernel, kernel.pressures)
                for kind, kernel in contact.kernels.items()
            },
        )
    dimension, count = contact.displacements.shape[1], contact.multipliers.shape[1]
    kernels = {}
    for (a, b), kernel in contact.kernels.items():
        width = dimension * (len(CELLS[a].nodes) + len(CELLS[b].nodes))
        columns = tuple(width + count * k for k in range(CELLS[a].corners))
        kernels[a, b] = PenaltyKernel(kernel, columns)
    return replace(contact, kernels=kernels)  # type: ignore[arg-type]


def frequency_squared(contacts: Sequence[AnyContact], masses: Array, fixed: Flags) -> float:
    """Bound of the square of the highest angular frequency of the penalties alone [1/s^2].

    masses, fixed: (n,) of the unknowns; fixed ones do not move. Of every contact the bound is the
    sum of those of its sides, row sums of rho N N' over the masses: for motions a and b of a pair
    (a - b)^2 is at most (1 + s) a^2 + (1 + 1/s) b^2, with the best s. It holds for any pairs.
    """
    at_nodes = np.zeros(len(contacts[0].points) if contacts else 0)
    for contact in contacts:
        largest = max(float(s.rho.max(initial=0.0)) for s in contact.sides)
        first = [(side.kind, side.faces, side.rho) for side in contact.sides]
        second = [(kind, faces, np.full(len(faces), largest)) for kind, faces in contact.others]
        both = 0.0
        for side in (first, second):
            both += (
                max(
                    _largest_ratio(contact, kind, faces, rho, masses=masses, fixed=fixed)
                    for kind, faces, rho in side
                )
                if side
                else 0.0
            )
        at_nodes[contact.nodes] += both
    return float(at_nodes.max(initial=0.0))


def _largest_ratio(
    contact: AnyContact,
    kind: str,
    faces: Integers,
    rho: Array,
    *,
    masses: Array,
    fixed: Flags,
) -> float:
    """Largest row sum of rho times products of shape functions, over the mass of its node."""
    cell, ring = CELLS[kind], not isinstance(contact, FaceContact) and contact.ring
    at, weights = cell.measured_rule(2 * cell.order, ring=ring)
    points, N = contact.points[faces], cell.shape(at)
    density = measures(cell, points, at) * weights
    if ring:
        density = density * 2.0 * np.pi * np.einsum("qk,nk->nq", N, points[:, :, 1])
    size = np.abs(N)
    rows = rho[:, None] * np.einsum("nq,qk,q->nk", density, size, size.sum(axis=1))
    stiffness = np.zeros(len(contact.points))
    np.add.at(stiffness, faces, rows)
    dofs = contact.displacements
    free = (dofs >= 0) & ~fixed[dofs] & (masses[dofs] > 0.0)
    ratios = np.where(free, stiffness[:, None] / np.where(free, masses[dofs], 1.0), 0.0)
    return float(ratios.max(initial=0.0))


def lumped_areas(blocks: Sequence[Any], size: int) -> Array:
    """Areas over rho, (size,), of the nodes with multipliers, from the blocks of their sides."""
    areas = np.zeros(size)
    for block in blocks:
        multipliers = np.arange(block.dofs.shape[1]) >= block.coordinates.shape[1]
        unit = np.zeros(size)
        unit[block.dofs[:, multipliers]] = 1.0
        values = block.residual(unit, np.empty(0))[:, multipliers]
        np.add.at(areas, block.dofs[:, multipliers], -values)
    return areas
