"""Elements by name: parent nodes, shape functions and default rules of every kind of cell.

Node order of VTK and meshio: corners, then the middles of edges, of faces, of the cell. Lines,
quadrilaterals and hexahedra of order 3 to 6 have the nodes of Gauss and Lobatto along every line;
those inside an edge, a face or the cell follow one another with x running first, then y, then z.
Quadrilaterals and hexahedra live on [-1, 1]^d, triangles and tetrahedra on the unit simplex,
wedges on triangle x [-1, 1].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, TypeAlias

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.elements.quadrature import QuadratureRule

Place: TypeAlias = tuple[sp.Rational, ...]
Shape: TypeAlias = Callable[..., list[Any]]

_HALF = sp.Rational(1, 2)


@dataclass(frozen=True)
class Element:
    """Reference cell: nodes, shape functions, default quadrature.

    Attributes
    ----------
    name : str
        Such as "hex8".
    nodes : tuple of tuple
        Coordinates of each node.
    shape : callable
        Shape functions at a point, shape(xi, eta, zeta).
    rule : QuadratureRule
        Rule that integrates the stiffness of an undistorted element exactly.
    """

    name: str
    nodes: tuple[Place, ...]
    shape: Shape
    rule: QuadratureRule

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Element {self.name}: {len(self.nodes)} nodes>"

    @property
    def dimension(self) -> int:
        """Dimension of the reference cell."""
        return self.rule.dimension

    @property
    def lines(self) -> tuple[tuple[int, ...], ...] | None:
        """Node of a line in every direction, by nodes of the element; None below order 3."""
        order = len({place[0] for place in self.nodes}) - 1
        if order < 3:
            return None
        number = {c: k for k, c in enumerate(_line_nodes(order))}
        return tuple(tuple(number[c] for c in place) for place in self.nodes)

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
        return _line(len({place[0] for place in self.nodes}) - 1, x)

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
        places, slopes = self._slopes
        values = dict(zip(places, point, strict=True))
        return [tuple(slope.xreplace(values) for slope in row) for row in slopes]

    @cached_property
    def _slopes(self) -> tuple[list[Any], list[list[Any]]]:
        """Parent coordinates, and derivatives of every shape function by them."""
        places: list[Any] = [sp.Dummy(real=True) for _ in range(self.dimension)]
        return places, [[sp.diff(N, s) for s in places] for N in self.shape(*places)]


def element(name: str, order: int | None = None) -> Element:
    """Return the element of a name, or of a shape and an order.

    Parameters
    ----------
    name : str
        "hex20", or a shape: "line", "quad" and "hex" (orders 1 to 6), "tri" and "tet" (1 and 2),
        "wedge" (1).
    order : int, optional
        Order of the shape, element("hex", order=4).

    Returns
    -------
    Element
        The element.

    Raises
    ------
    ValueError
        There is no such element; the message names those that there are.
    """
    if order is not None:
        if name not in SHAPES:
            raise ValueError(f"no shape {name!r} of elements; there are {', '.join(SHAPES)}")
        of_shape = SHAPES[name]
        if order not in range(1, len(of_shape) + 1):
            last = f" to {len(of_shape)}" if len(of_shape) > 1 else ""
            raise ValueError(f"order = {order!r} of {name}: allowed is 1{last}")
        name = of_shape[order - 1]
    if name not in ELEMENTS:
        raise ValueError(f"no element {name!r}; there are {', '.join(ELEMENTS)}")
    return ELEMENTS[name]


def _line(order: int, x: Any) -> list[Any]:
    """Lagrange polynomials on [-1, 1]: ends first, then the nodes between, rising."""
    if order == 1:
        return [(1 - x) * _HALF, (1 + x) * _HALF]
    if order == 2:
        return [x * (x - 1) * _HALF, x * (x + 1) * _HALF, 1 - x**2]
    nodes = _line_nodes(order)
    return [
        sp.prod([x - b for b in nodes if b != a]) / sp.prod([a - b for b in nodes if b != a])
        for a in nodes
    ]


def _line_nodes(order: int) -> tuple[Any, ...]:
    """Nodes of a line: ends first, then those of Gauss and Lobatto between, rising."""
    return (sp.Integer(-1), sp.Integer(1), *quadrature.lobatto(order))


def _tensor(nodes: Sequence[Place]) -> Shape:
    """Products of Lagrange polynomials, in the order of the nodes."""
    order = len({place[0] for place in nodes}) - 1
    number = {c: k for k, c in enumerate(_line_nodes(order))}

    def shape(*point: Any) -> list[Any]:
        lines = [_line(order, x) for x in point]
        return [
            sp.prod([line[number[c]] for line, c in zip(lines, place, strict=True)])
            for place in nodes
        ]

    return shape


def _between(corners: Sequence[Sequence[int]], groups: Sequence[Sequence[int]], order: int) -> Any:
    """The corners, and the nodes inside edges, faces and cell, x running first."""
    inner, found = quadrature.lobatto(order), [tuple(map(sp.Integer, c)) for c in corners]
    for group in groups:
        some = [corners[k] for k in group]
        axes = [sorted({c[d] for c in some}) for d in range(len(corners[0]))]
        lines = [inner if len(ends) > 1 else [sp.Integer(ends[0])] for ends in axes]
        found += [tuple(reversed(place)) for place in product(*reversed(lines))]
    return tuple(found)


def _serendipity(nodes: Sequence[Place]) -> Shape:
    """The quadratic elements without nodes inside faces and cell."""

    def shape(*point: Any) -> list[Any]:
        found = []
        for place in nodes:
            factors = [
                1 - x**2 if c == 0 else (1 + c * x) * _HALF
                for x, c in zip(point, place, strict=True)
            ]
            if 0 not in place:  # a corner: less what the middles of its edges take there
                inner = sum(c * x for x, c in zip(point, place, strict=True))
                factors.append(inner - (len(place) - 1))
            found.append(sp.prod(factors))
        return found

    return shape


def _simplex(nodes: Sequence[Place]) -> Shape:
    """Polynomials in the barycentric coordinates, of order 1 or 2."""
    dimension = len(nodes[0])
    edges = [[k for k, c in enumerate(_barycentric(p)) if c != 0] for p in nodes]

    def shape(*point: Any) -> list[Any]:
        L = _barycentric(point)
        if len(nodes) == dimension + 1:
            return [L[edge[0]] for edge in edges]
        return [
            L[e[0]] * (2 * L[e[0]] - 1) if len(e) == 1 else 4 * L[e[0]] * L[e[1]] for e in edges
        ]

    return shape


def _barycentric(point: Sequence[Any]) -> list[Any]:
    return [1 - sum(point), *point]


def _wedge(xi: Any, eta: Any, zeta: Any) -> list[Any]:
    return [t * z for z in _line(1, zeta) for t in _barycentric((xi, eta))]


def _places(
    corners: Sequence[Sequence[int]], groups: Sequence[Sequence[int]] = ()
) -> tuple[Place, ...]:
    """The corners and the means of groups of them."""
    first = [tuple(sp.Integer(c) for c in corner) for corner in corners]
    means = [
        tuple(
            sp.Rational(sum(first[k][d] for k in group), len(group)) for d in range(len(first[0]))
        )
        for group in groups
    ]
    return (*first, *means)


_LINE = ((-1,), (1,))
_SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
_CUBE = tuple((*p, z) for z in (-1, 1) for p in _SQUARE)
_TRIANGLE = ((0, 0), (1, 0), (0, 1))
_TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
_SQUARE_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_CUBE_EDGES = (
    *(*_SQUARE_EDGES, (4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_CUBE_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))
_SIMPLEX_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))


def _elements() -> dict[str, Element]:
    gauss, triangle, tetrahedron = quadrature.gauss, quadrature.triangle, quadrature.tetrahedron
    quad9 = _places(_SQUARE, (*_SQUARE_EDGES, range(4)))
    hex27 = _places(_CUBE, (*_CUBE_EDGES, *_CUBE_FACES, range(8)))
    tensor: dict[str, tuple[tuple[Place, ...], QuadratureRule]] = {
        "line2": (_places(_LINE), gauss(1, 1)),
        "line3": (_places(_LINE, [(0, 1)]), gauss(2, 1)),
        "quad4": (_places(_SQUARE), gauss(2, 2)),
        "quad9": (quad9, gauss(3, 2)),
        "hex8": (_places(_CUBE), gauss(2, 3)),
        "hex27": (hex27, gauss(3, 3)),
    }
    groups: dict[str, Any] = {"line": (_LINE, [(0, 1)])}
    groups["quad"] = (_SQUARE, (*_SQUARE_EDGES, range(4)))
    groups["hex"] = (_CUBE, (*_CUBE_EDGES, *_CUBE_FACES, range(8)))
    for shape, (corners, some) in groups.items():
        for order, name in enumerate(SHAPES[shape][2:], start=3):
            nodes = _between(corners, some, order)
            tensor[name] = (nodes, gauss(order + (shape != "line"), len(corners[0])))
    serendipity = {"quad8": (quad9[:8], gauss(3, 2)), "hex20": (hex27[:20], gauss(3, 3))}
    simplex = {
        "tri3": (_places(_TRIANGLE), triangle(1)),
        "tri6": (_places(_TRIANGLE, _SIMPLEX_EDGES[:3]), triangle(2)),
        "tet4": (_places(_TETRAHEDRON), tetrahedron(1)),
        "tet10": (_places(_TETRAHEDRON, _SIMPLEX_EDGES), tetrahedron(2)),
    }
    found = {}
    for family, table in ((_tensor, tensor), (_serendipity, serendipity), (_simplex, simplex)):
        for name, (nodes, rule) in table.items():
            found[name] = Element(name, nodes, family(nodes), rule)
    wedge = _places([(*p, z) for z in (-1, 1) for p in _TRIANGLE])
    found["wedge6"] = Element("wedge6", wedge, _wedge, quadrature.wedge(2))
    return found


SHAPES = {
    "line": ("line2", "line3", "line4", "line5", "line6", "line7"),
    "quad": ("quad4", "quad9", "quad16", "quad25", "quad36", "quad49"),
    "hex": ("hex8", "hex27", "hex64", "hex125", "hex216", "hex343"),
    "tri": ("tri3", "tri6"),
    "tet": ("tet4", "tet10"),
    "wedge": ("wedge6",),
}
"""Elements with all nodes of an order, from order 1 on."""
ELEMENTS: dict[str, Element] = _elements()
"""Every element by its name."""


def of(nodes: int, dimension: int) -> tuple[Element, quadrature.Region] | None:
    """The element with so many nodes in so many dimensions, and its reference cell."""
    for found in ELEMENTS.values():
        if (len(found.nodes), found.dimension) == (nodes, dimension):
            region = next(r for r in quadrature.REGIONS[dimension] if r.fits(found.rule))
            return found, region
    return None


_THICK = {"line": "square", "square": "cube", "triangle": "wedge"}


def foreign(rule: QuadratureRule, nodes: int) -> str:
    """Message for a rule of another cell than the one with so many nodes.

    A line, triangle or quadrilateral that is integrated over its thickness has the rule of the cell
    with one dimension more.
    """
    mine = of(nodes, rule.dimension)
    if mine is None or mine[1].fits(rule):
        return ""
    others = [r for r in quadrature.REGIONS[rule.dimension] if r.fits(rule)]
    middle = of(nodes, rule.dimension - 1)
    if middle and others and others[0].name == _THICK.get(middle[1].name):
        return ""
    return misfit(mine[1], others[0].name) if others else ""


def misfit(region: quadrature.Region, of_what: str = "") -> str:
    """Words for a rule that does not fit a reference cell."""
    whose = f"is that of a {of_what}" if of_what else "does not fit the cell"
    return (
        f"the rule {whose}: points of a {region.name} lie in it and its weights sum to "
        f"{region.measure}; take e.g. quadrature.{region.rule}"
    )
