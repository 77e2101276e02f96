"""Cells by name: nodes, shape functions, faces and quadrature, read from the compiler's table.

`generated/cells.json` is written from the exact definitions in `codegen/elements`. The node order
is that of meshio, which is that of VTK but for wedges: corners first, then the middles of edges,
of faces, of the cell. Quadrilaterals and hexahedra live on [-1, 1]^d, triangles and tetrahedra on
the unit simplex, wedges on triangle x [-1, 1], pyramids on the square with the apex (0, 0, 1).
Lines, quadrilaterals and hexahedra of order 3 to 6 have the nodes of Gauss and Lobatto along every
line; those inside an edge, a face or the cell follow one another with x running first, then y,
then z.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy.special import roots_jacobi, roots_legendre

from softehl.runtime.arrays import Array, Integers

Groups: TypeAlias = tuple[tuple[int, ...], ...]

_TABLE = Path(__file__).resolve().parents[2] / "generated" / "cells.json"


@dataclass(frozen=True, eq=False)
class Cell:
    """A kind of cell.

    name: of this kind, such as "quad8"; meshio: the name that meshio gives it. nodes: (k, dim)
    parent coordinates. exponents: of the monomials that span the shape functions; one more than the
    coordinates is the exponent of 1 - zeta; none for products of lines of order 3 and more.
    coefficients: (monomials, k), column a holds those of shape function a. corners: how many of the
    nodes. order: of the shape functions along an edge. lower, collapse: coordinate d runs from 0 or
    -s_d to s_d, where s_d is 1 minus the coordinates that collapse[d] names. sides: corners of each
    face, seen from outside counterclockwise (in 2-D: along the boundary with the cell on the left).
    faces: the kinds that faces can be. gmsh, abaqus: number and names in files; gmsh_nodes,
    abaqus_nodes: our nodes as numbers of theirs, empty if the order is ours.
    """

    name: str
    meshio: str
    nodes: Array
    exponents: Groups
    coefficients: Array
    corners: int
    order: int = 1
    lower: tuple[int, ...] = ()
    collapse: Groups = ()
    sides: Groups = ()
    faces: tuple[str, ...] = ()
    gmsh: int = 0
    gmsh_nodes: tuple[int, ...] = ()
    abaqus: tuple[str, ...] = ()
    abaqus_nodes: tuple[int, ...] = ()
    vtk_mirrored: bool = False

    @property
    def dimension(self) -> int:
        """Of the parent element."""
        return int(self.nodes.shape[1])

    @property
    def is_simplex(self) -> bool:
        """True for points, lines, triangles and tetrahedra."""
        return self.corners == self.dimension + 1

    @cached_property
    def collapsed(self) -> tuple[int, ...]:
        """Coordinates that shrink others or are shrunk."""
        shrunk = {d for d, by in enumerate(self.collapse) if by}
        return tuple(sorted(shrunk.union(*self.collapse)))

    @cached_property
    def linear(self) -> Cell:
        """The cell of order 1 with the same corners."""
        key = (self.dimension, self.corners, 1)
        return next(c for c in CELLS.values() if (c.dimension, c.corners, c.order) == key)

    @cached_property
    def corner_shape(self) -> Array:
        """Shape functions (k, corners) of the linear cell at all nodes."""
        return self.linear.shape(self.nodes)

    def shape(self, at: Array) -> Array:
        """Shape functions (q, k) at parent points (q, dim)."""
        if not self.exponents:
            return self._products(np.asarray(at, dtype=np.float64), None)
        return _monomials(at, self.exponents) @ self.coefficients

    def gradient(self, at: Array) -> Array:
        """Their derivatives (q, k, dim) by the parent coordinates."""
        if not self.exponents:
            at = np.asarray(at, dtype=np.float64)
            return np.stack([self._products(at, d) for d in range(self.dimension)], axis=2)
        parts = []
        for d in range(self.dimension):
            factor = [e[d] for e in self.exponents]
            lowered = [
                tuple(max(e - (i == d), 0) if i < self.dimension else e for i, e in enumerate(x))
                for x in self.exponents
            ]
            part = (_monomials(at, lowered) * factor) @ self.coefficients
            if d == self.dimension - 1 < len(self.exponents[0]) - 1:  # also of powers of 1 - zeta
                lowered = [(*x[:-1], x[-1] - 1) if x[-1] else x for x in self.exponents]
                part += (_monomials(at, lowered) * [-x[-1] for x in self.exponents]) @ (
                    self.coefficients
                )
            parts.append(part)
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
            points = kind.corner_shape @ self.nodes[list(corners)]
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
        for x, low, by in zip(at, self.lower, self.collapse, strict=True):
            upper = 1.0 - sum(at[e] for e in by)
            if not low * upper - margin <= x <= upper + margin:
                return False
        return True

    def clipped(self, at: Array, margin: float) -> Array:
        """Parent points (m, dim) taken into the parent element, or no further out than that."""
        if not self.collapsed:
            return np.clip(at, -1.0 - margin, 1.0 + margin)
        inside = at.copy()
        for d in range(self.dimension):
            if d not in self.collapsed:
                inside[:, d] = np.clip(at[:, d], -1.0 - margin, 1.0 + margin)
        if any(self.lower[d] for d in self.collapsed):  # a pyramid: the height first
            inside[:, 2] = np.clip(at[:, 2], -margin, 1.0 - _APEX)
            half = 1.0 - inside[:, 2:] + margin
            inside[:, :2] = np.clip(at[:, :2], -half, half)
            return inside
        size = len(self.collapsed)
        weights = np.maximum(at[:, :size], -margin)
        total = weights.sum(axis=1, keepdims=True)
        over = np.maximum(total - 1.0 - margin, 0.0)
        inside[:, :size] = weights
        if margin == 0.0:
            scaled = weights / np.where(over > 0.0, total, 1.0)
            inside[:, :size] = np.where(over > 0.0, scaled, weights)
        else:
            inside[:, :size] -= over / size
        return inside

    def rule(self, degree: int) -> tuple[Array, Array]:
        """Points (q, dim) and weights (q,) that integrate polynomials of a degree exactly."""
        return _rule(self.lower, self.collapse, degree)

    def measured_rule(self, degree: int, *, ring: bool = False) -> tuple[Array, Array]:
        """A rule, exact for polynomials of a degree times the volume of bent cells.

        The volume per parent volume, or the normal of a face, is a polynomial: the determinant
        of slopes of the shape functions. ring: times the radius, as on rings.
        """
        order = self.order
        volume = self.dimension * order - (self.dimension if self.is_simplex else 1)
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
    """Points of Gauss and Lobatto on [-1, 1], (order + 1,), rising; order 1 to 6."""
    return np.sort(CELLS[f"line{order + 1}"].nodes[:, 0])


def _monomials(at: Array, exponents: Sequence[tuple[int, ...]]) -> Array:
    """(q, monomials) values of products of powers at points (q, dim), and of 1 - the last
    coordinate where there is one exponent more; 0 at the apex, where both factors are 0.
    """
    powers, at = np.asarray(exponents), np.asarray(at)
    polynomial = np.ones((len(at), len(powers)))
    for d in range(at.shape[1]):  # much faster than powers of floating-point numbers
        of_one = np.ones((len(at), powers[:, d].max() + 1))
        np.cumprod(
            np.broadcast_to(at[:, d : d + 1], of_one[:, 1:].shape), axis=1, out=of_one[:, 1:]
        )
        polynomial *= of_one[:, powers[:, d]]
    if powers.shape[1] == at.shape[1]:
        return polynomial
    depth = 1.0 - at[:, -1:]
    quotient = np.where(depth == 0.0, 1.0, depth) ** powers[:, -1].astype(float)
    return np.where((depth == 0.0) & (powers[:, -1] < 0), 0.0, polynomial * quotient)


@cache
def _rule(lower: tuple[int, ...], collapse: Groups, degree: int) -> tuple[Array, Array]:
    """Rule of a cube with collapsed faces: the Jacobian is the weight of Gauss and Jacobi."""
    n = degree // 2 + 1
    factors = []
    for d, low in enumerate(lower):
        power = sum(d in by for by in collapse)
        if low:
            factors.append(roots_legendre(n))
        else:
            x, w = roots_jacobi(n, power, 0.0)
            factors.append(((x + 1) / 2, w / 2 ** (power + 1)))
    points, weights = _tensor(factors)
    collapsed = points.copy()
    for d, by in enumerate(collapse):
        collapsed[:, d] *= np.prod(1.0 - points[:, list(by)], axis=1)
    return collapsed, weights


def _tensor(factors: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Products of rules on lines."""
    points = np.array(list(product(*(x for x, _ in factors))))
    weights = np.array([np.prod(w) for w in product(*(w for _, w in factors))])
    return points, weights


def _read_cells() -> dict[str, Cell]:
    """Points, and all cells of the table."""
    point = Cell(
        name="point1",
        meshio="vertex",
        nodes=np.zeros((1, 0)),
        exponents=((),),
        coefficients=np.ones((1, 1)),
        corners=1,
        gmsh=15,
        abaqus=("MASS",),
    )
    table = json.loads(_TABLE.read_text(encoding="utf-8"))
    return {"point1": point, **{name: _cell(name, row) for name, row in table.items()}}


def _cell(name: str, row: dict[str, Any]) -> Cell:
    if "line" in row:
        nodes = np.array(row["line"])[np.array(row["lines"])]
    else:
        nodes = np.array(row["nodes"])
    return Cell(
        name=name,
        meshio=row["meshio"],
        nodes=nodes,
        exponents=_groups(row.get("exponents", ())),
        coefficients=np.array(row.get("coefficients", np.empty((0, 0)))),
        corners=row["corners"],
        order=row["order"],
        lower=tuple(row["lower"]),
        collapse=_groups(row["collapse"]),
        sides=_groups(row["sides"]),
        faces=tuple(row["faces"]),
        gmsh=row["gmsh"][0],
        gmsh_nodes=tuple(row["gmsh"][1]),
        abaqus=tuple(row["abaqus"][0]),
        abaqus_nodes=tuple(row["abaqus"][1]),
        vtk_mirrored=row["vtk_mirrored"],
    )


def _groups(rows: Sequence[Sequence[int]]) -> Groups:
    return tuple(map(tuple, rows))


_APEX = 1e-12
"""Distance from the apex of a pyramid at which its shape functions still have gradients."""
CELLS = _read_cells()
"""Every kind of cell by its name."""

BY_FILE = {cell.meshio: cell for cell in CELLS.values()}
"""Every kind of cell by meshio's name for it."""


def for_vtk(kind: str, nodes: Integers) -> Integers:
    """Nodes (n, k) of cells in VTK's order: the first triangle of a wedge looks outwards."""
    return nodes[:, list(CELLS[kind].mirrored)] if CELLS[kind].vtk_mirrored else nodes


def linear_pieces(kind: str, nodes: Integers) -> tuple[str, Integers]:
    """Kind by meshio and nodes of cells in a file; linear pieces of those of order 3 and more."""
    cell = CELLS[kind]
    if cell.exponents:
        return cell.meshio, for_vtk(kind, nodes)
    linear = CELLS[{1: "line2", 2: "quad4", 3: "hex8"}[cell.dimension]]
    rank = np.argsort(np.argsort(cell.line))[cell.lines]
    at = np.empty((cell.order + 1,) * cell.dimension, dtype=np.int64)
    at[tuple(rank.T)] = np.arange(len(nodes[0]))
    steps = np.moveaxis(np.indices((cell.order,) * cell.dimension), 0, -1)
    corners = steps.reshape(-1, 1, cell.dimension) + (linear.nodes > 0.0)
    local = at[tuple(np.moveaxis(corners, -1, 0))]
    return linear.meshio, nodes[:, local].reshape(-1, len(linear.nodes))


def jacobians(cell: Cell, node_points: Array, at: Array) -> Array:
    """Determinants (n, q) of the map of cells with nodes at `places` (n, k, dim) at parent points.

    `dim` must be the dimension of the cell.
    """
    if not cell.dimension:
        return np.ones((len(node_points), len(at)))
    gradient = np.tensordot(node_points, cell.gradient(at), axes=(1, 1)).transpose(0, 2, 1, 3)
    if cell.dimension == 2:
        (a, b), (c, d) = np.moveaxis(gradient, (2, 3), (0, 1))
        return np.asarray(a * d - b * c)
    return np.asarray(np.linalg.det(gradient))


def measures(cell: Cell, node_points: Array, at: Array) -> Array:
    """Lengths or areas (n, q) per parent unit of faces with nodes at `places` (n, k, dim)."""
    gradient = np.einsum("qkd,nkc->nqcd", cell.gradient(at), node_points)
    metric = np.einsum("nqci,nqcj->nqij", gradient, gradient)
    return np.asarray(np.sqrt(np.linalg.det(metric)))
