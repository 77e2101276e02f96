"""Mass of cells by their shape functions: consistent, or lumped at the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import CELLS, Cell, measures

PARAMETER = "acceleration"
"""Coefficient c of an acceleration c u + rest, by which pages and masses are told of it."""


_AT_ONCE = 1_000_000
"""Numbers of shape functions at points of cells that are evaluated at once: 8 MB."""


def mass_matrices(
    cell: Cell, node_points: Array, density: Array, *, ring: bool, geometry: Cell | None = None
) -> Array:
    """Integrals (n, k, k) of density N_a N_b over cells, exact on bent ones, too.

    cell: of the field, with k nodes. places: (n, m, dim) of the nodes of the geometry, which is the
    cell unless given. density: (n,) per reference measure of the cell. ring: over rings around the
    x axis.
    """
    outline = geometry or cell
    points, weights = outline.measured_rule(2 * cell.order, ring=ring)
    shape, position = cell.shape(points), outline.shape(points)
    matrices = np.empty((len(node_points), shape.shape[1], shape.shape[1]))
    step = max(_AT_ONCE // shape.size, 1)
    for first in range(0, len(node_points), step):
        some = slice(first, first + step)
        mass = density[some, None] * weights
        if outline.dimension:
            mass = mass * measures(outline, node_points[some], points)
        if ring:
            mass = mass * 2.0 * np.pi * (node_points[some, :, 1] @ position.T)
        matrices[some] = (mass[:, None, :] * shape.T) @ shape
    return matrices


def lumped(matrices: Array) -> Array:
    """Positive masses (n, k) of the nodes with the mass of each element: the diagonal, scaled
    (Hinton, Rock and Zienkiewicz); of simplices and bilinear cells alike it is the sum of rows.
    """
    diagonal = np.einsum("naa->na", matrices)
    total = matrices.sum(axis=(1, 2)) / diagonal.sum(axis=1)
    return np.asarray(diagonal * total[:, None])


def interpolation(kind: str, nodes: int) -> Cell:
    """The cell of a field on so many (first) nodes of a kind: all, or the corners."""
    cell = CELLS[kind]
    return cell if nodes == len(cell.nodes) else cell.linear


@dataclass(frozen=True, eq=False)
class MassKernel:
    """Inertia of elements as a kernel: m (c u + rest), c being its parameter.

    Unknowns (n, components k), component by component. matrices: (n, k, k). Its data are rest, of
    the shape of the unknowns; none means zeros.
    """

    matrices: Array
    components: int
    name = "mass"
    signature = "built in"
    parameters = (PARAMETER,)
    fields: tuple[str, ...] = ()

    def part(self, rows: slice) -> MassKernel:
        """Of some of the elements."""
        return MassKernel(self.matrices[rows], self.components)

    def residual(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """Virtual work of inertia, (n, components k)."""
        a = float(kwargs["parameters"][0]) * dofs
        if kwargs.get("data") is not None:
            a = a + kwargs["data"]
        n, k = self.matrices.shape[:2]
        rows = np.einsum("nab,ncb->nca", self.matrices, a.reshape(n, self.components, k))
        return np.asarray(rows.reshape(dofs.shape))

    def tangent(self, coordinates: Array, dofs: Array, **kwargs: Any) -> tuple[Array, Array]:
        """Residual, and c m."""
        n, k = self.matrices.shape[:2]
        K = np.zeros((n, self.components, k, self.components, k))
        for c in range(self.components):
            K[:, c, :, c, :] = float(kwargs["parameters"][0]) * self.matrices
        return self.residual(coordinates, dofs, **kwargs), K.reshape(*dofs.shape, dofs.shape[1])

    def fields_at(self, coordinates: Array, dofs: Array, **kwargs: Any) -> Array:
        """None, (n, 0, 0)."""
        return np.empty((len(dofs), 0, 0))
