"""An element: nodes, shape functions, default rule, faces, and its names in mesh files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, TypeAlias

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.elements.reference_cell import Groups, Point, ReferenceCell

ShapeFunctions: TypeAlias = Callable[..., list[Any]]
HALF = sp.Rational(1, 2)


@dataclass(frozen=True)
class FileNames:
    """Names of an element in mesh files, and orders of nodes that differ.

    meshio: the name there. gmsh: the number of the type, 0 for none; abaqus: the type that is
    written, "" for none, as cells of the mesh and as faces in 3-D ("CPS3 S3"). gmsh_nodes,
    abaqus_nodes: our nodes as numbers of theirs, empty if the order is ours. vtk_mirrored: the
    first face looks outwards in files of VTK, inwards here.
    """

    meshio: str
    gmsh: int = 0
    abaqus: str = ""
    gmsh_nodes: tuple[int, ...] = ()
    abaqus_nodes: tuple[int, ...] = ()
    vtk_mirrored: bool = False


@dataclass(frozen=True)
class Element:
    """Element: reference cell, nodes, shape functions, default quadrature, names in mesh files.

    Attributes
    ----------
    name : str
        Such as "hex8".
    cell : ReferenceCell
        Shape on which the element lives.
    nodes : tuple of tuple
        Parent coordinates of each node.
    shape : callable
        Shape functions at a point, shape(xi, eta, zeta).
    degree : int
        Degree of the polynomials that `rule` integrates exactly.
    exponents : tuple of tuple
        Exponents of the monomials that span the shape functions; one more than the coordinates is
        that of 1 - zeta. Empty for products of lines of order 3 and more.
    face_kinds : tuple of str
        Elements that the faces are.
    files : FileNames
        Names in mesh files.
    """

    name: str
    cell: ReferenceCell
    nodes: tuple[Point, ...]
    shape: ShapeFunctions
    degree: int
    exponents: Groups
    face_kinds: tuple[str, ...]
    files: FileNames

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Element {self.name}: {len(self.nodes)} nodes>"

    @property
    def dimension(self) -> int:
        """Number of parent coordinates."""
        return self.cell.dimension

    @cached_property
    def rule(self) -> QuadratureRule:
        """Quadrature rule that integrates the stiffness of an undistorted element exactly."""
        return self.cell.rule(self.degree)

    @property
    def order(self) -> int:
        """Order of the shape functions along an edge."""
        if len(self.nodes) == len(self.cell.corners):
            return 1
        return 2 if self.exponents else len({point[0] for point in self.nodes}) - 1

    @property
    def lines(self) -> tuple[tuple[int, ...], ...] | None:
        """Node of a line in every direction, by nodes of the element; None below order 3."""
        if self.exponents:
            return None
        number = {c: k for k, c in enumerate(line_nodes(self.order))}
        return tuple(tuple(number[c] for c in point) for point in self.nodes)

    def along(self, x: Any) -> list[Any]:
        """Return the shape functions of a line, in the order of `lines`.

        Parameters
        ----------
        x : Expr
            Coordinate in [-1, 1].

        Returns
        -------
        list of Expr
            Values.
        """
        return lagrange_line(len({point[0] for point in self.nodes}) - 1, x)

    def gradient(self, *point: Any) -> list[tuple[Any, ...]]:
        """Return the derivatives (dN_a/dxi, dN_a/deta, ...) of every shape function.

        Parameters
        ----------
        *point : Expr
            Coordinates in the reference cell.

        Returns
        -------
        list of tuple of Expr
            [node][direction].
        """
        coordinates, gradients = self._gradients
        values = dict(zip(coordinates, point, strict=True))
        return [tuple(g.xreplace(values) for g in row) for row in gradients]

    @cached_property
    def _gradients(self) -> tuple[list[Any], list[list[Any]]]:
        """Parent coordinates, and derivatives of every shape function by them."""
        names = [f"xi_{k}" for k in range(self.dimension)]  # by which SymPy orders terms
        coordinates: list[Any] = [sp.Dummy(name, real=True) for name in names]
        return coordinates, [[sp.diff(N, s) for s in coordinates] for N in self.shape(*coordinates)]

    def coefficients(self) -> sp.Matrix:
        """Return the coefficients of the shape functions.

        Returns
        -------
        Matrix
            (monomials, nodes): shape function a is the sum of column a times the monomials.
        """
        rows = [[monomial(point, e) for e in self.exponents] for point in self.nodes]
        return sp.Matrix(rows).inv()


def monomial(point: Sequence[Any], exponents: Sequence[int]) -> Any:
    """Product of powers of the coordinates, and of 1 - the last one; 0 where both are 0."""
    bases = [*point, *([1 - point[-1]] if len(exponents) > len(point) else [])]
    if any(b == 0 and e < 0 for b, e in zip(bases, exponents, strict=True)):
        return sp.Integer(0)
    return sp.prod([b**e for b, e in zip(bases, exponents, strict=True)])


def powers(dimension: int, largest: int, total: int, squares: int) -> Groups:
    """Exponents up to `largest`, of a `total` degree at most, at most so many of them squares."""
    every = product(range(largest + 1), repeat=dimension)
    return tuple(e for e in every if sum(e) <= total and e.count(2) <= squares)


def lagrange_line(order: int, x: Any) -> list[Any]:
    """Lagrange polynomials on [-1, 1]: ends first, then the nodes between, rising."""
    if order == 1:
        return [(1 - x) * HALF, (1 + x) * HALF]
    if order == 2:
        return [x * (x - 1) * HALF, x * (x + 1) * HALF, 1 - x**2]
    nodes = line_nodes(order)
    return [
        sp.prod([x - b for b in nodes if b != a]) / sp.prod([a - b for b in nodes if b != a])
        for a in nodes
    ]


def line_nodes(order: int) -> tuple[Any, ...]:
    """Nodes of a line: ends first, then those of Gauss and Lobatto between, rising."""
    return (sp.Integer(-1), sp.Integer(1), *quadrature.lobatto(order))


def lagrange_product(nodes: Sequence[Point]) -> ShapeFunctions:
    """Products of Lagrange polynomials, in the order of the nodes."""
    order = len({point[0] for point in nodes}) - 1
    number = {c: k for k, c in enumerate(line_nodes(order))}

    def shape(*point: Any) -> list[Any]:
        lines = [lagrange_line(order, x) for x in point]
        return [
            sp.prod([line[number[c]] for line, c in zip(lines, node, strict=True)])
            for node in nodes
        ]

    return shape


def serendipity(nodes: Sequence[Point]) -> ShapeFunctions:
    """Shape functions of quadratic squares and cubes without nodes inside faces and cell."""

    def shape(*point: Any) -> list[Any]:
        values = []
        for node in nodes:
            factors = [
                1 - x**2 if c == 0 else (1 + c * x) * HALF for x, c in zip(point, node, strict=True)
            ]
            if 0 not in node:  # a corner: less what the middles of its edges take there
                inside = sum(c * x for x, c in zip(point, node, strict=True))
                factors.append(inside - (len(node) - 1))
            values.append(sp.prod(factors))
        return values

    return shape


def simplex(nodes: Sequence[Point]) -> ShapeFunctions:
    """Polynomials in the barycentric coordinates, of order 1 or 2."""
    dimension = len(nodes[0])
    edges = [[k for k, c in enumerate(barycentric(p)) if c != 0] for p in nodes]

    def shape(*point: Any) -> list[Any]:
        L = barycentric(point)
        if len(nodes) == dimension + 1:
            return [L[edge[0]] for edge in edges]
        return [
            L[e[0]] * (2 * L[e[0]] - 1) if len(e) == 1 else 4 * L[e[0]] * L[e[1]] for e in edges
        ]

    return shape


def barycentric(point: Sequence[Any]) -> list[Any]:
    """Barycentric coordinates of a point of a unit simplex."""
    return [1 - sum(point), *point]


def high_order_nodes(cell: ReferenceCell, groups: Groups, order: int) -> tuple[Point, ...]:
    """The corners, and the nodes inside edges, faces and cell, x running first."""
    inner = quadrature.lobatto(order)
    nodes = [tuple(map(sp.Integer, c)) for c in cell.corners]
    for group in groups:
        corners = [cell.corners[k] for k in group]
        axes = [sorted({c[d] for c in corners}) for d in range(cell.dimension)]
        lines = [inner if len(signs) > 1 else [sp.Integer(signs[0])] for signs in axes]
        nodes += [tuple(reversed(node)) for node in product(*reversed(lines))]
    return tuple(nodes)


def high_order(
    cell: ReferenceCell, family: str, meshio: str, face: str, groups: Groups
) -> list[Element]:
    """Products of lines of order 3 to 6 on a line, square or cube."""
    elements = []
    for order in range(3, 7):
        nodes = high_order_nodes(cell, groups, order)
        points = order + (cell.dimension > 1)
        elements.append(
            Element(
                name=f"{family}{len(nodes)}",
                cell=cell,
                nodes=nodes,
                shape=lagrange_product(nodes),
                degree=2 * (points - 1),
                exponents=(),
                face_kinds=(f"{face}{(order + 1) ** (cell.dimension - 1)}",),
                files=FileNames(f"{meshio}{len(nodes)}"),
            )
        )
    return elements
