"""Fields of a block at its nodes: polynomials in each cell or each patch, by least squares.

Projection: a polynomial one degree below the shape functions, at least linear, is fitted to the
values at the points of the quadrature, with their weights: the projection in L2 of the parent cell
(Hinton and Campbell). Slopes of shape functions are best at that degree (Barlow), and of order p
at the nodes.

Superconvergent patch recovery (Zienkiewicz and Zhu 1992): around each vertex a polynomial of the
degree p of the shape functions, in the coordinates of the body, is fitted to the values at the
points where slopes are of order p + 1. Between the vertices of a cell the polynomials are weighted
with the linear shape functions.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.element_blocks import facet_nodes
from softehl.runtime.definition.point_data import integrates_over
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.kernels.kernel_call import Rule
from softehl.runtime.mesh.cells import CELLS, Cell
from softehl.runtime.suggestions import join_names

if TYPE_CHECKING:
    from softehl.runtime.equations.system import System

RECOVERIES = ("projection", "mean", "spr")
"""How a field comes from the points of a cell to its nodes."""


def nodal_fields(
    system: System, name: str, fields: Mapping[str, Array], recovery: str
) -> dict[str, Array]:
    """Fields of a block at all nodes, (points,), nan outside the block.

    fields: at the points of the elements of this process; for "spr", of all. Raises StudyError.
    """
    if recovery == "spr":
        return _recovered_by_patches(system, name, fields)
    nodes, operator = nodal_operator(system.blocks[name], recovery)
    points, piece = len(system.mesh.points), system.mesh.piece

    def sums(weights: Array) -> Array:
        local_sums = np.bincount(nodes.ravel(), weights.ravel(), points).astype(np.float64)
        return system.comm.sum(local_sums) if piece is None else piece.added(local_sums)

    count = sums(np.ones(nodes.shape))
    return {
        label: np.where(count > 0, sums(values @ operator.T) / np.maximum(count, 1), np.nan)
        for label, values in fields.items()
    }


def _recovered_by_patches(
    system: System, name: str, fields: Mapping[str, Array]
) -> dict[str, Array]:
    if not fields:
        return {}
    values = np.stack(list(fields.values()), axis=2)
    nodal = recover_block(system.everywhere.blocks[name], system.everywhere.mesh.points, values)
    return {label: nodal[:, k] for k, label in enumerate(fields)}


def nodal_operator(block: Block, recovery: str) -> tuple[Integers, Array]:
    """Nodes (n, k) of the elements, and values there of values at points, (k, q).

    Elements without a cell, or with a quadrature of another one, have the mean of their points.
    Raises StudyError.
    """
    if recovery not in RECOVERIES:
        raise StudyError(
            f"recovery = {recovery!r}: allowed are {join_names(map(repr, RECOVERIES))}"
        )
    rule = block.options.rule or block.kernel.default_rule
    cell, facet = CELLS[block.kind], facet_nodes(block.kernel)
    nodes = block.nodes if facet is None else block.nodes[:, facet]
    count = len(rule.weights)
    if recovery == "mean" or nodes.shape[1] != len(cell.nodes) or not integrates_over(rule, cell):
        operator = np.full((nodes.shape[1], count), 1.0 / count)
    else:
        operator = projection(cell, rule, max(_order(block, cell) - 1, 1))
    if block.kernel.cell.endswith("_interior"):  # the facet as the second cell sees it
        assert facet is not None
        second_cell = block.nodes[:, block.nodes.shape[1] // 2 :][:, facet]
        return np.hstack([nodes, second_cell]), np.vstack([operator, operator[_mirrored(cell)]])
    return nodes, operator


def projection(cell: Cell, rule: Rule, degree: int, at: Array | None = None) -> Array:
    """Values (nodes, q) at the nodes of a polynomial by its values at the points of a rule.

    Of the degree, or of the highest one that the points determine. at: other points (k, dim).
    """
    at = cell.nodes if at is None else at
    weights = rule.weights if (rule.weights > 0.0).all() else np.ones(len(rule.weights))
    root = np.sqrt(weights)
    while True:
        powers = _powers(cell, degree)
        values = root[:, None] * _monomials(rule.table[:, :-1], powers)
        if degree == 0 or np.linalg.matrix_rank(values) == len(powers):
            return np.asarray(_monomials(at, powers) @ np.linalg.pinv(values) * root)
        degree -= 1


def _order(block: Block, cell: Cell) -> int:
    """Order of the shape functions, or of a field along the elements."""
    along = block.options.along.values()
    orders = [a if isinstance(a, int) else np.shape(a)[1] - 1 for a in along]
    return max(cell.order, *orders, 1)


def _powers(cell: Cell, degree: int) -> list[tuple[int, ...]]:
    """Exponents up to a degree: of the sum on simplices, in each direction of squares and cubes."""
    every = product(range(degree + 1), repeat=cell.dimension)
    return [e for e in every if sum(e[d] for d in cell.collapsed) <= degree]


def _monomials(at: Array, powers: list[tuple[int, ...]]) -> Array:
    return np.asarray(np.prod(at[:, None, :] ** np.array(powers)[None], axis=2))


def _mirrored(face: Cell) -> Integers:
    """Nodes of a facet in the order of the second cell, where corner k is corner 1 - k."""
    turned = face.nodes[[(1 - k) % face.corners for k in range(face.corners)]]
    mirrored_points = face.corner_shape @ turned
    distances = np.linalg.norm(face.nodes[None] - mirrored_points[:, None], axis=2)
    return np.asarray(distances.argmin(axis=1))


# patches ----------------------------------------------------------------------------------------

_INDEPENDENT = 0.18
"""Least ratio of the eigenvalues of the moments of a patch, relative to that of a full cube.

From 0.16 to 0.2 all cells of orders 1 to 4 have their order of convergence. Below, patches of one
layer of bent cells at a boundary count as full (0.1: tet4, 0.05: tri3 and wedge6 lose an order).
"""
_RINGS = 4
"""Rings of cells that a patch takes at most before its degree is lowered."""
_PIECE = 2048
"""Patches that are fitted at once."""


def recover_block(block: Block, points: Array, fields: Array) -> Array:
    """Nodal values (points, f) of the fields (cells, q, f) of a block by patches.

    Raises StudyError for elements that are no cells.
    """
    rule, cell = block.options.rule or block.kernel.default_rule, CELLS[block.kind]
    if facet_nodes(block.kernel) is not None or not integrates_over(rule, cell):
        raise StudyError(
            f'recovery = "spr": the elements of {block.name!r} do not integrate over cells; '
            'use "projection"'
        )
    return recover_by_patches(cell, rule, block.nodes, points, fields)


def recover_by_patches(
    cell: Cell, rule: Rule, nodes: Integers, points: Array, fields: Array
) -> Array:
    """Nodal values (points, f) of fields (cells, q, f) by patches; nan at nodes of no cell."""
    at = superconvergent_points(cell)
    values = np.einsum("sq,nqf->nsf", projection(cell, rule, cell.order - 1, at), fields)
    sampling_points = np.einsum("sk,nkd->nsd", cell.shape(at), points[nodes])
    vertices, corners = np.unique(nodes[:, : cell.corners], return_inverse=True)
    corners = corners.reshape(len(nodes), cell.corners)
    patches = _Patches(points[vertices], corners, sampling_points, values, cell.order)
    return patches.nodal_values(points, nodes, cell.corner_shape)


def superconvergent_points(cell: Cell) -> Array:
    """Points (s, dim) of a cell where slopes of its shape functions are best."""
    degree = cell.order if cell.collapsed else 2 * cell.order - 1
    return cell.rule(degree)[0]


class _Patches:
    """Polynomials around the vertices: centres (v, d), coefficients (v, m, f).

    Their coordinates are (x - centre) scales, (v, d, d), of unit covariance. A vertex whose cells
    do not determine a polynomial, as at a boundary, has that of the nearest vertex of these cells.
    Where there is none, in a thin body, its patch takes more rings of cells.
    """

    def __init__(
        self, vertices: Array, corners: Integers, sampling_points: Array, values: Array, degree: int
    ) -> None:
        self.corners, self.vertices, self.centres = corners, vertices, vertices.copy()
        powers = product(range(degree + 1), repeat=vertices.shape[1])
        self.powers = sorted((e for e in powers if sum(e) <= degree), key=sum)
        count, cells = len(vertices), len(corners)
        self.scales = np.zeros((count, vertices.shape[1], vertices.shape[1]))
        self.coefficients = np.zeros((count, len(self.powers), values.shape[2]))
        pairs = np.repeat(np.arange(cells), corners.shape[1])
        incidence = csr_array((np.ones(corners.size), (corners.ravel(), pairs)), (count, cells))
        waiting, patches = self._fit(np.arange(count), incidence, sampling_points, values, degree)
        previous = count
        while 0 < len(waiting) < previous:
            previous = len(waiting)
            waiting, patches = self._copy_nearest(waiting, patches, incidence)
        neighbours = (incidence.T @ incidence).tocsr()
        for lower in range(degree, -1, -1):
            for _ in range(_RINGS):
                if not len(waiting):
                    return
                patches = (patches @ neighbours).tocsr()
                waiting, patches = self._fit(waiting, patches, sampling_points, values, lower)

    def _copy_nearest(
        self, waiting: Integers, patches: Any, incidence: Any
    ) -> tuple[Integers, Any]:
        """Copy the polynomial of the nearest vertex that has one; returns vertices without any."""
        has_polynomial = np.ones(len(self.vertices), dtype=bool)
        has_polynomial[waiting] = False
        adjacent = (patches @ incidence.T).tocoo()
        allowed = has_polynomial[adjacent.col]
        rows, others = adjacent.row[allowed], adjacent.col[allowed]
        distance = np.linalg.norm(self.vertices[waiting[rows]] - self.vertices[others], axis=1)
        order = np.lexsort((distance, rows))
        indices, first = np.unique(rows[order], return_index=True)
        source, target = others[order][first], waiting[indices]
        for array in (self.centres, self.scales, self.coefficients):
            array[target] = array[source]
        left = np.setdiff1d(np.arange(len(waiting)), indices)
        return waiting[left], patches[left]

    def _fit(
        self, waiting: Integers, patches: Any, sampling_points: Array, values: Array, degree: int
    ) -> tuple[Integers, Any]:
        """Fit polynomials of a degree; returns the vertices whose patch is too small."""
        length = sum(sum(e) <= degree for e in self.powers)
        min_ratio = _INDEPENDENT * self._ratio_of_cube(degree)
        left = []
        for begin in range(0, len(waiting), _PIECE):
            rows = patches[begin : begin + _PIECE].tocsr()
            batch = waiting[begin : begin + _PIECE]
            starts, cells = rows.indptr[:-1], rows.indices
            owner = np.repeat(np.arange(len(batch)), np.diff(rows.indptr))
            around = self.vertices[self.corners[cells]]  # corners of the cells
            number = np.diff(np.append(starts, len(cells)))[:, None] * around.shape[1]
            centres = np.add.reduceat(around.sum(axis=1), starts) / number
            around -= centres[owner][:, None, :]
            squares = np.add.reduceat(np.einsum("pqd,pqe->pde", around, around), starts)
            scales = _scales(squares / number[..., None])
            away = sampling_points[cells] - centres[owner][:, None, :]
            P = self._basis(np.einsum("pqd,pde->pqe", away, scales[owner]))[..., :length]
            moments = np.add.reduceat(np.einsum("pqi,pqj->pij", P, P), starts)
            loads = np.add.reduceat(np.einsum("pqi,pqf->pif", P, values[cells]), starts)
            eigenvalues = np.linalg.eigvalsh(moments)
            sound = eigenvalues[:, 0] > min_ratio * eigenvalues[:, -1]
            done = batch[sound]
            self.centres[done], self.scales[done] = centres[sound], scales[sound]
            self.coefficients[done, :length] = np.linalg.solve(moments[sound], loads[sound])
            left.append(begin + np.flatnonzero(~sound))
        remaining = np.concatenate(left)
        return waiting[remaining], patches[remaining]

    def _ratio_of_cube(self, degree: int) -> float:
        """Ratio of the eigenvalues of the moments of a cube of unit covariance."""
        powers = np.array([e for e in self.powers if sum(e) <= degree])
        sums = powers[:, None] + powers[None]
        moments = np.where(sums % 2, 0.0, np.sqrt(3.0) ** sums / (sums + 1)).prod(axis=2)
        eigenvalues = np.linalg.eigvalsh(moments)
        return float(eigenvalues[0] / eigenvalues[-1])

    def _basis(self, at: Array) -> Array:
        """Monomials (..., m) at points (..., d)."""
        return np.stack([np.prod(at ** np.array(e), axis=-1) for e in self.powers], axis=-1)

    def nodal_values(self, points: Array, nodes: Integers, corner_shape: Array) -> Array:
        """Values (points, f), nan at nodes of no element."""
        total = np.zeros((len(points), self.coefficients.shape[2]))
        count = np.bincount(nodes.ravel(), minlength=len(points))
        for c in range(self.corners.shape[1]):
            local_nodes = np.flatnonzero(corner_shape[:, c])  # nodes at which this corner counts
            vertex = self.corners[:, c]
            away = points[nodes[:, local_nodes]] - self.centres[vertex][:, None, :]
            basis = self._basis(np.einsum("nkd,nde->nke", away, self.scales[vertex]))
            parts = np.einsum("nkm,nmf->nkf", basis, self.coefficients[vertex])
            np.add.at(
                total, nodes[:, local_nodes], parts * corner_shape[local_nodes, c][None, :, None]
            )
        with np.errstate(invalid="ignore"):
            return np.where(count[:, None] > 0, total / count[:, None], np.nan)


def _scales(covariance: Array) -> Array:
    """Matrices (v, d, d) that give points of a covariance (v, d, d) that of a unit matrix."""
    variances, axes = np.linalg.eigh(covariance)
    flat = variances <= np.finfo(float).eps * variances[:, -1:]
    return np.asarray(axes / np.sqrt(np.where(flat, 1.0, variances))[:, None, :])
