"""Fields of a block at its nodes: polynomials in each cell, by least squares.

A polynomial one degree below the shape functions, at least linear, is fitted to the values at the
points of the quadrature, with their weights: the projection in L2 of the parent cell (Hinton and
Campbell). Slopes of shape functions are best at that degree (Barlow), and of order p at the nodes.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.element_blocks import facet_nodes
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.kernels.kernel_call import Rule
from softehl.runtime.mesh.cells import CELLS, Cell
from softehl.runtime.suggestions import join_names

RECOVERIES = ("projection", "mean")
"""How a field comes from the points of a cell to its nodes."""
_SLACK = 1e-9  # of points and weights of a rule, which belong to the parent cell or do not


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
    if recovery == "mean" or nodes.shape[1] != len(cell.nodes) or not _is_of(rule, cell):
        operator = np.full((nodes.shape[1], count), 1.0 / count)
    else:
        operator = projection(cell, rule, max(_order(block, cell) - 1, 1))
    if block.kernel.cell.endswith("_interior"):  # the facet as the second cell sees it
        assert facet is not None
        second_cell = block.nodes[:, block.nodes.shape[1] // 2 :][:, facet]
        return np.hstack([nodes, second_cell]), np.vstack([operator, operator[_mirrored(cell)]])
    return nodes, operator


def projection(cell: Cell, rule: Rule, degree: int) -> Array:
    """Values (nodes, q) at the nodes of a polynomial by its values at the points of a rule.

    Of the degree, or of the highest one that the points determine.
    """
    weights = rule.weights if (rule.weights > 0.0).all() else np.ones(len(rule.weights))
    root = np.sqrt(weights)
    while True:
        powers = _powers(cell, degree)
        values = root[:, None] * _monomials(rule.table[:, :-1], powers)
        if degree == 0 or np.linalg.matrix_rank(values) == len(powers):
            return np.asarray(_monomials(cell.nodes, powers) @ np.linalg.pinv(values) * root)
        degree -= 1


def _order(block: Block, cell: Cell) -> int:
    """Order of the shape functions, or of a field along the elements."""
    along = block.options.along.values()
    orders = [a if isinstance(a, int) else np.shape(a)[1] - 1 for a in along]
    return max(cell.order, *orders, 1)


def _is_of(rule: Rule, cell: Cell) -> bool:
    """True if the points of a rule are those of the parent cell."""
    if not cell.dimension or rule.table.shape[1] != cell.dimension + 1:
        return False
    size = float(cell.rule(0)[1].sum())
    inside = all(cell.holds(x, _SLACK) for x in rule.table[:, :-1])
    return inside and abs(float(rule.weights.sum()) - size) < _SLACK * size


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
