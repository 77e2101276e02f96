"""The kinds of cells: parent nodes, shape functions and faces, in the node order of meshio.

It is that of VTK, but for wedges. Corners first, then the middles of edges, of faces, of the cell.
Quadrilaterals and hexahedra live on [-1, 1]^d, triangles and tetrahedra on the unit simplex, wedges
on triangle x [-1, 1]. Lines, quadrilaterals and hexahedra of order 3 to 6 have the nodes of Gauss
and Lobatto along every line; those inside an edge, a face or the cell follow one another with x
running first, then y, then z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from math import factorial
from typing import TypeAlias

import numpy as np
from numpy.polynomial import Legendre
from scipy.special import roots_jacobi, roots_legendre

from softehl.runtime.arrays import Array, Integers

Groups: TypeAlias = tuple[tuple[int, ...], ...]
_Kind: TypeAlias = tuple[str, str, Groups, Groups, tuple[str, ...]]

_ENDS = ((-1,), (1,))
_SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
_CUBE = tuple((*p, z) for z in (-1, 1) for p in _SQUARE)
_TRIANGLE = ((0, 0), (1, 0), (0, 1))
_TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
_WEDGE = tuple((*p, z) for z in (-1, 1) for p in _TRIANGLE)
_CUBE_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_CUBE_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))

_TETRAHEDRON_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_LINE_SIDES = ((0,), (1,))
_TRIANGLE_SIDES = ((0, 1), (1, 2), (2, 0))
_SQUARE_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))
_TETRAHEDRON_SIDES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_CUBE_SIDES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_WEDGE_SIDES = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))


@dataclass(frozen=True, eq=False)
class Cell:
    """A kind of cell.

    name: of this kind, such as "quad8"; meshio: the name that meshio gives it. nodes: (k, dim)
    parent coordinates. exponents: of the k monomials that the shape functions are made of.
    corners: how many of the nodes. sides: corners of each face, seen from outside
    counterclockwise (in 2-D: along the boundary with the cell on the left). faces: the kinds that
    faces can be.
    """

    name: str
    meshio: str
    nodes: Array
    exponents: tuple[tuple[int, ...], ...]
    corners: int
    sides: tuple[tuple[int, ...], ...] = ()
    faces: tuple[str, ...] = ()

    @property
    def dimension(self) -> int:
        """Of the parent element."""
        return int(self.nodes.shape[1])

    @cached_property
    def _coefficients(self) -> Array:
        """(monomials, k): column a holds the coefficients of shape function a."""
        return np.asarray(np.linalg.inv(_monomials(self.nodes, self.exponents)), dtype=np.float64)

    def shape(self, at: Array) -> Array:
        """Shape functions (q, k) at parent points (q, dim)."""
        if not self.exponents:
            return self._products(np.asarray(at, dtype=np.float64), None)
        return _monomials(at, self.exponents) @ self._coefficients

    def gradient(self, at: Array) -> Array:
        """Their derivatives (q, k, dim) by the parent coordinates."""
        if not self.exponents:
            at = np.asarray(at, dtype=np.float64)
            return np.stack([self._products(at, d) for d in range(self.dimension)], axis=2)
        parts = []
        for d in range(self.dimension):
            factor = [e[d] for e in self.exponents]
            lowered = [tuple(max(e - (i == d), 0) for i, e in enumerate(x)) for x in self.exponents]
            parts.append((_monomials(at, lowered) * factor) @ self._coefficients)
        return np.stack(parts, axis=2)

    @cached_property
    def line(self) -> Array:
        """Nodes of the line that a product of lines is made of: ends first, then rising."""
        coordinates = np.unique(self.nodes[:, 0])
        return np.concatenate([coordinates[[0, -1]], coordinates[1:-1]])

    @cached_property
    def lines(self) -> Integers:
        """Numbers of nodes of the line along the directions, (k, dim), of a product of lines."""
        return np.asarray(np.abs(self.nodes[:, :, None] - self.line).argmin(axis=2))

    @property
    def order(self) -> int:
        """Of the shape functions along an edge."""
        if len(self.nodes) == self.corners:
            return 1
        return 2 if self.exponents else len(self.line) - 1

    def _products(self, at: Array, by: int | None) -> Array:
        """Products (q, k) of Lagrange's polynomials; along `by` their derivatives."""
        products = np.ones((len(at), len(self.nodes)))
        for d in range(self.dimension):
            values = lagrange(self.line, at[:, d])[int(d == by)]
            products *= values[:, self.lines[:, d]]
        return products

    @cached_property
    def side_nodes(self) -> tuple[tuple[Cell, tuple[int, ...]], ...]:
        """Kind and local nodes of each face, in the node order of that kind."""
        sides = []
        for corners in self.sides:
            kind = next(CELLS[f] for f in self.faces if CELLS[f].corners == len(corners))
            flat = CELLS[_LINEAR[len(corners), kind.dimension]]
            points = flat.shape(kind.nodes) @ self.nodes[list(corners)]
            distance = np.linalg.norm(self.nodes[None] - points[:, None], axis=2)
            sides.append((kind, tuple(int(k) for k in distance.argmin(axis=1))))
        return tuple(sides)

    @cached_property
    def mirrored(self) -> tuple[int, ...]:
        """Nodes (k,) of the same cell seen in a mirror, from the same first node where it has two
        dimensions or three.
        """
        seen = -self.nodes if self.dimension == 1 else self.nodes[:, [1, 0, 2][: self.dimension]]
        distance = np.linalg.norm(self.nodes[None] - seen[:, None], axis=2)
        return tuple(int(k) for k in distance.argmin(axis=1))

    def holds(self, at: Array, margin: float) -> bool:
        """True if a parent point (dim,) lies in the parent element, or no further out than that."""
        if self.corners == 2**self.dimension:
            return bool(np.abs(at).max(initial=0.0) <= 1.0 + margin)
        flat = at if self.corners == self.dimension + 1 else at[:2]
        inside = flat.min() >= -margin and flat.sum() <= 1.0 + margin
        return bool(inside and (flat is at or abs(at[2]) <= 1.0 + margin))

    def rule(self, degree: int) -> tuple[Array, Array]:
        """Points (q, dim) and weights (q,) that integrate polynomials of a degree exactly."""
        return _rule(self.corners, self.dimension, degree)

    def measured_rule(self, degree: int, *, ring: bool = False) -> tuple[Array, Array]:
        """A rule, exact for polynomials of a degree times the volume of bent cells.

        The volume per parent volume, or the normal of a face, is a polynomial: the determinant
        of slopes of the shape functions. ring: times the radius, as on rings.
        """
        order, simplex = self.order, self.corners == self.dimension + 1
        volume = self.dimension * order - (self.dimension if simplex else 1)
        return self.rule(degree + max(volume, 0) + (order if ring else 0))


def lagrange(nodes: Array, x: Array) -> tuple[Array, Array]:
    """Lagrange's polynomials of nodes (k,) and their derivatives at x (q,): both (q, k)."""
    values, derivatives = np.ones((len(x), len(nodes))), np.zeros((len(x), len(nodes)))
    for a, node in enumerate(nodes):
        for b in np.delete(nodes, a):
            derivatives[:, a] = (derivatives[:, a] * (x - b) + values[:, a]) / (node - b)
            values[:, a] *= (x - b) / (node - b)
    return values, derivatives


def lobatto(order: int) -> Array:
    """Points of Gauss and Lobatto on [-1, 1], (order + 1,), rising."""
    inside = np.sort(Legendre.basis(order).deriv().roots().real)
    inside = 0.5 * (inside - inside[::-1])  # exactly symmetric
    return np.concatenate([[-1.0], inside, [1.0]])


def _monomials(at: Array, exponents: Sequence[tuple[int, ...]]) -> Array:
    """(q, monomials) values of products of powers at points (q, dim)."""
    powers = np.asarray(exponents)
    return np.asarray(np.prod(np.asarray(at)[:, None, :] ** powers[None], axis=2))


@cache
def _rule(corners: int, dimension: int, degree: int) -> tuple[Array, Array]:
    n = degree // 2 + 1
    line = roots_legendre(n)
    if corners == 2**dimension:
        return _tensor([line] * dimension)
    if dimension == 3 and corners == 6:
        (flat, a), (z, b) = _rule(3, 2, degree), line
        points = np.array([(*p, t) for p in flat for t in z])
        return points, np.outer(a, b).ravel()
    # a simplex is a cube with collapsed faces; the Jacobian is the weight of Gauss and Jacobi
    half = [roots_jacobi(n, power, 0.0) for power in range(dimension)]
    points, weights = _tensor([((x + 1) / 2, w / 2 ** (k + 1)) for k, (x, w) in enumerate(half)])
    collapsed = points.copy()
    for d in range(dimension):
        collapsed[:, d] *= np.prod(1.0 - points[:, d + 1 :], axis=1)
    assert abs(weights.sum() * factorial(dimension) - 1.0) < 1e-12
    return collapsed, weights


def _tensor(factors: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    points = np.array(list(product(*(x for x, _ in factors))))
    weights = np.array([np.prod(w) for w in product(*(w for _, w in factors))])
    return points, weights


def _means(corners: Sequence[tuple[int, ...]], groups: Sequence[tuple[int, ...]]) -> Array:
    """The corners and the means of groups of them."""
    first = np.array(corners, dtype=np.float64)
    return np.vstack([first, *(first[list(g)].mean(axis=0)[None] for g in groups)])


def _between(corners: Sequence[tuple[int, ...]], groups: Groups, order: int) -> Array:
    """The corners, and the nodes inside edges, faces and cell, x running first."""
    inner, nodes = lobatto(order)[1:-1], [np.array(corners, dtype=np.float64)]
    for group in groups:
        end_values = [sorted({corners[k][d] for k in group}) for d in range(len(corners[0]))]
        lines = [
            inner if len(some) > 1 else np.array(some, dtype=np.float64) for some in end_values
        ]
        nodes.append(np.array([point[::-1] for point in product(*reversed(lines))]))
    return np.vstack(nodes)


def _high(shape: str, corners: Groups, sides: Groups, groups: Groups) -> list[Cell]:
    """Products of lines of order 3 to 6."""
    kinds, dimension = [], len(corners[0])
    file = {"line": "line", "quad": "quad", "hex": "hexahedron"}[shape]
    face = {"line": "", "quad": "line", "hex": "quad"}[shape]
    for order in range(3, HIGHEST + 1):
        count = (order + 1) ** dimension
        faces = f"{face}{(order + 1) ** (dimension - 1)}" if face else "point1"
        nodes = _between(corners, groups, order)
        name = f"{shape}{count}"
        kinds.append(Cell(name, f"{file}{count}", nodes, (), len(corners), sides, (faces,)))
    return kinds


def _powers(dimension: int, largest: int, total: int, squares: int) -> tuple[tuple[int, ...], ...]:
    """Exponents up to `largest`, of a `total` degree at most, at most so many of them squares."""
    every = product(range(largest + 1), repeat=dimension)
    return tuple(e for e in every if sum(e) <= total and e.count(2) <= squares)


def _family(corners: Groups, sides: Groups, kinds: Sequence[_Kind]) -> list[Cell]:
    """Kinds of one shape."""
    return [
        Cell(name, file, _means(corners, groups), powers, len(corners), sides, faces)
        for name, file, groups, powers, faces in kinds
    ]


def _cells() -> dict[str, Cell]:
    quad9_groups: Groups = (*_SQUARE_SIDES, tuple(range(4)))
    hex27_groups: Groups = (*_CUBE_EDGES, *_CUBE_FACES, tuple(range(8)))
    wedge = tuple((*a, b) for b in (0, 1) for a in _powers(2, 1, 1, 0))
    kinds = [
        Cell("point1", "vertex", np.zeros((1, 0)), ((),), 1),
        *_family(
            *(_ENDS, _LINE_SIDES),
            [
                ("line2", "line", (), _powers(1, 1, 1, 0), ("point1",)),
                ("line3", "line3", ((0, 1),), _powers(1, 2, 2, 1), ("point1",)),
            ],
        ),
        *_family(
            *(_TRIANGLE, _TRIANGLE_SIDES),
            [
                ("tri3", "triangle", (), _powers(2, 1, 1, 0), ("line2",)),
                ("tri6", "triangle6", _TRIANGLE_SIDES, _powers(2, 2, 2, 1), ("line3",)),
            ],
        ),
        *_family(
            *(_SQUARE, _SQUARE_SIDES),
            [
                ("quad4", "quad", (), _powers(2, 1, 2, 0), ("line2",)),
                ("quad8", "quad8", _SQUARE_SIDES, _powers(2, 2, 4, 1), ("line3",)),
                ("quad9", "quad9", quad9_groups, _powers(2, 2, 4, 2), ("line3",)),
            ],
        ),
        *_family(
            *(_TETRAHEDRON, _TETRAHEDRON_SIDES),
            [
                ("tet4", "tetra", (), _powers(3, 1, 1, 0), ("tri3",)),
                ("tet10", "tetra10", _TETRAHEDRON_EDGES, _powers(3, 2, 2, 1), ("tri6",)),
            ],
        ),
        *_family(
            *(_CUBE, _CUBE_SIDES),
            [
                ("hex8", "hexahedron", (), _powers(3, 1, 3, 0), ("quad4",)),
                ("hex20", "hexahedron20", _CUBE_EDGES, _powers(3, 2, 6, 1), ("quad8",)),
                ("hex27", "hexahedron27", hex27_groups, _powers(3, 2, 6, 3), ("quad9",)),
            ],
        ),
        *_high("line", _ENDS, _LINE_SIDES, ((0, 1),)),
        *_high("quad", _SQUARE, _SQUARE_SIDES, quad9_groups),
        *_high("hex", _CUBE, _CUBE_SIDES, hex27_groups),
        *_family(_WEDGE, _WEDGE_SIDES, [("wedge6", "wedge", (), wedge, ("tri3", "quad4"))]),
    ]
    return {cell.name: cell for cell in kinds}


HIGHEST = 6
"""Order of shape functions up to which there are lines, quadrilaterals and hexahedra."""
_LINEAR = {(1, 0): "point1", (2, 1): "line2", (3, 2): "tri3", (4, 2): "quad4"}
CELLS = _cells()
"""Every kind of cell by its name."""

BY_FILE = {cell.meshio: cell for cell in CELLS.values()}
"""Every kind of cell by meshio's name for it."""


def for_vtk(kind: str, nodes: Integers) -> Integers:
    """Nodes (n, k) of cells in VTK's order: the first triangle of a wedge looks outwards."""
    return nodes[:, list(CELLS[kind].mirrored)] if kind == "wedge6" else nodes


def jacobians(cell: Cell, places: Array, at: Array) -> Array:
    """Determinants (n, q) of the map of cells with nodes at `places` (n, k, dim) at parent points.

    `dim` must be the dimension of the cell.
    """
    if not cell.dimension:
        return np.ones((len(places), len(at)))
    gradient = np.tensordot(places, cell.gradient(at), axes=(1, 1)).transpose(0, 2, 1, 3)
    if cell.dimension == 2:
        (a, b), (c, d) = np.moveaxis(gradient, (2, 3), (0, 1))
        return np.asarray(a * d - b * c)
    return np.asarray(np.linalg.det(gradient))


def measures(cell: Cell, places: Array, at: Array) -> Array:
    """Lengths or areas (n, q) per parent unit of faces with nodes at `places` (n, k, dim)."""
    gradient = np.einsum("qkd,nkc->nqcd", cell.gradient(at), places)
    metric = np.einsum("nqci,nqcj->nqij", gradient, gradient)
    return np.asarray(np.sqrt(np.linalg.det(metric)))
