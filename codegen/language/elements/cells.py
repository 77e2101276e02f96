"""Elements by name: parent nodes, shape functions and default rules of every kind of cell.

Node order of VTK and meshio: corners, then the middles of edges, of faces, of the cell.
Quadrilaterals and hexahedra live on [-1, 1]^d, triangles and tetrahedra on the unit simplex,
wedges on triangle x [-1, 1].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy as sp

from softehl.codegen.language.elements import quadrature
from softehl.codegen.language.elements.quadrature import QuadratureRule

Place: TypeAlias = tuple[sp.Rational, ...]
Shape: TypeAlias = Callable[..., list[Any]]

_HALF = sp.Rational(1, 2)


@dataclass(frozen=True)
class Element:
    """An element.

    nodes: parent coordinates of each. shape(*point): shape functions. rule: that integrates the
    stiffness of an undistorted element exactly.
    """

    name: str
    nodes: tuple[Place, ...]
    shape: Shape
    rule: QuadratureRule

    @property
    def dimension(self) -> int:
        """Of the parent element."""
        return self.rule.dimension

    def gradient(self, *point: Any) -> list[tuple[Any, ...]]:
        """(dN_a/dxi, dN_a/deta, ...) of every shape function."""
        places = [sp.Dummy(real=True) for _ in point]
        values = dict(zip(places, point, strict=True))
        slopes = [[sp.diff(N, s) for s in places] for N in self.shape(*places)]
        return [tuple(slope.xreplace(values) for slope in row) for row in slopes]


def element(name: str) -> Element:
    """The element of a name, such as "hex20".  Raises ValueError that names what there is."""
    if name not in ELEMENTS:
        raise ValueError(f"no element {name!r}; there are {', '.join(ELEMENTS)}")
    return ELEMENTS[name]


def _line(order: int, x: Any) -> list[Any]:
    """Lagrange polynomials on [-1, 1]: ends first, then the middle."""
    if order == 1:
        return [(1 - x) * _HALF, (1 + x) * _HALF]
    return [x * (x - 1) * _HALF, x * (x + 1) * _HALF, 1 - x**2]


def _tensor(nodes: Sequence[Place]) -> Shape:
    """Products of Lagrange polynomials, in the order of the nodes."""
    order = 2 if any(c == 0 for place in nodes for c in place) else 1
    number = {-1: 0, 1: 1, 0: 2}

    def shape(*point: Any) -> list[Any]:
        lines = [_line(order, x) for x in point]
        return [
            sp.prod([line[number[int(c)]] for line, c in zip(lines, place, strict=True)])
            for place in nodes
        ]

    return shape


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
    tensor = {
        "line2": (_places(_LINE), gauss(1, 1)),
        "line3": (_places(_LINE, [(0, 1)]), gauss(2, 1)),
        "quad4": (_places(_SQUARE), gauss(2, 2)),
        "quad9": (quad9, gauss(3, 2)),
        "hex8": (_places(_CUBE), gauss(2, 3)),
        "hex27": (hex27, gauss(3, 3)),
    }
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


ELEMENTS: dict[str, Element] = _elements()
"""Every element by its name."""


def of(nodes: int, dimension: int) -> tuple[Element, quadrature.Region] | None:
    """The element with so many nodes in so many dimensions, and its reference cell."""
    for found in ELEMENTS.values():
        if (len(found.nodes), found.dimension) == (nodes, dimension):
            region = next(r for r in quadrature.REGIONS[dimension] if r.fits(found.rule))
            return found, region
    return None


def foreign(rule: QuadratureRule, nodes: int) -> str:
    """Message for a rule of another cell than the one with so many nodes."""
    mine = of(nodes, rule.dimension)
    if mine is None or mine[1].fits(rule):
        return ""
    others = [r for r in quadrature.REGIONS[rule.dimension] if r.fits(rule)]
    return misfit(mine[1], others[0].name) if others else ""


def misfit(region: quadrature.Region, of_what: str = "") -> str:
    """Words for a rule that does not fit a reference cell."""
    whose = f"is that of a {of_what}" if of_what else "does not fit the cell"
    return (
        f"the rule {whose}: points of a {region.name} lie in it and its weights sum to "
        f"{region.measure}; take e.g. quadrature.{region.rule}"
    )
