"""Weak forms on boundaries and facets.

`BoundaryModel` integrates over the faces of a mesh: values at the point, area and outward normal.
`FacetModel` has the traces of the cell on one side of a facet or of the cells on both.
Its nodes are those of the first cell, then those of the second. Each cell has its nodes turned so
that the facet is the first of its faces, and so that corner k of the facet in the first cell is
corner 1 - k (counted in a circle) in the second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.elements.shapes import interpolate
from softehl.codegen.language.definition import Component, Definition
from softehl.codegen.language.errors import ModelError, WrongDomainError
from softehl.codegen.language.fields import AXISYMMETRIC, FieldTrace
from softehl.codegen.language.flatten import Entries
from softehl.codegen.language.nodal_fields import NodalFields


class NeedsTracesError(ModelError):
    """Error of a weak form on faces that needs traces of cells, as on "quad4_side"."""

    traces = True

    def __init__(self, what: str) -> None:
        remedy = 'on a side there are values of fields, no gradients, but with cell="quad4_side"'
        super().__init__(f"{what}: {remedy}")


class BoundaryModel(NodalFields):
    """Weak form on faces of a mesh; gradients are along the parent coordinates of the face."""

    def __init__(
        self, name: str, cell: Element, geometry: str, rule: QuadratureRule, doc: str
    ) -> None:
        super().__init__(name, cell, geometry, rule, doc, dimension=cell.dimension + 1)
        self._tangents = self._derived(self._X, self._parent(self.order)[1])
        vector = self.define("reference_area", sp.Matrix(self._crossed(self._tangents)))
        self._area = self.define("size_of_area", sp.sqrt(vector.dot(vector)))
        self._unit = vector / self._area

    @property
    def normal(self) -> Any:
        """Unit normal (dimension, 1) of the undeformed side, outwards."""
        return self._unit

    def area_vector(self, u: Any) -> Any:
        """Area vector (dimension, 1) of the side displaced by u, outwards, per undeformed area.

        A pressure p that follows the side is `m.weak(p * m.area_vector(u), u)`.
        """
        if getattr(u, "shape", None) != (self.dimension, 1):
            raise ModelError(f"area_vector: a vector of {self.dimension} is needed, as of m.vector")
        traces = [self._traced.get(v) for v in Entries.of(u).values]
        if any(t is None for t in traces):
            raise ModelError(f"area_vector: {u} is no field")
        moved = [
            [x[k] + t.gradient[k] for x, t in zip(self._tangents, traces, strict=True) if t]
            for k in range(self.cell.dimension)
        ]
        columns = list(map(list, zip(*moved, strict=True)))
        area = sp.Matrix(self._crossed(columns)) / self._area
        if self.geometry == AXISYMMETRIC:
            radius = self._position()[1]
            area = area * (radius + u[1]) / radius
        return area

    def grad(self, value: Any) -> Any:
        """Raise `NeedsTracesError`: a face has no gradients."""
        raise NeedsTracesError(f"grad of {value}")

    @property
    def size(self) -> Any:
        """Raise `NeedsTracesError` likewise."""
        raise NeedsTracesError("m.size")

    def jump(self, value: Any) -> Any:
        """Raise `NeedsTracesError` likewise."""
        raise NeedsTracesError(f"m.jump({value})")

    def average(self, value: Any) -> Any:
        """Raise `NeedsTracesError` likewise."""
        raise NeedsTracesError(f"m.average({value})")

    def _derived(self, columns: Sequence[Sequence[Any]], parent: Sequence[Sequence[Any]]) -> Any:
        """Derivatives of nodal values by the parent coordinates, [component][direction]."""
        size = range(self.cell.dimension)
        return [[interpolate([g[k] for g in parent], c) for k in size] for c in columns]

    def _crossed(self, t: Sequence[Sequence[Any]]) -> list[Any]:
        """Area vector of tangents [component][direction]; 2-D has the cell on the left."""
        if self.dimension == 2:
            return [t[1][0], -t[0][0]]
        return list(sp.Matrix([c[0] for c in t]).cross(sp.Matrix([c[1] for c in t])))

    def _slopes_of(self, component: Component, column: Sequence[Any]) -> list[Any]:
        parent = self._parent(component.order)[1]
        return list(self._derived([column], parent)[0])

    def _volume(self) -> Any:
        if self.geometry == AXISYMMETRIC:
            return self.define("area_of_ring", 2 * sp.pi * self._position()[1] * self._area)
        return self._area


FIRST = {"tri": (0, 1), "quad": (0, 1), "tet": (0, 2, 1), "hex": (0, 3, 2, 1)}
"""Corners of the first face of a cell, seen from outside counterclockwise."""
FACES = {"tri": "line2", "quad": "line2", "tet": "tri3", "hex": "quad4"}
"""The cell whose linear shape functions a facet has."""


def shape_of(cell: Element) -> str:
    """Shape of a cell without its number of nodes.  Raises ModelError for cells without traces."""
    shape = cell.name.rstrip("0123456789")
    flat = shape == "quad" and len(cell.nodes) <= 25  # kernels of higher orders are large
    if shape not in FIRST or (cell.lines is not None and not flat):
        raise ModelError(
            f"traces of {cell.name}: facets are those of triangles, tetrahedra and hexahedra of "
            "order 1 and 2, and of quadrilaterals of order 1 to 4"
        )
    return shape


class FacetModel(NodalFields):
    """Values and gradients of the cells at a facet; `both` for one between two cells."""

    def __init__(
        self,
        name: str,
        cell: Element,
        geometry: str,
        rule: QuadratureRule,
        doc: str,
        *,
        both: bool,
    ) -> None:
        self._count, self._crossed = 1 + both, False
        super().__init__(name, cell, geometry, rule, doc, dimension=cell.dimension)
        self._others: dict[Any, Any] = {}
        self._sides = [self._seen(k) for k in range(self._count)]
        self._area, self._unit = self._surface()

    def _count_of_nodes(self, cell: Element) -> int:
        return len(cell.nodes) * self._count

    def _foreign(self, rule: QuadratureRule, nodes: int) -> str:
        return ""  # the rule is that of a face, the nodes are of cells

    @property
    def normal(self) -> Any:
        """Unit normal (dimension, 1) of the undeformed facet, out of the first cell."""
        return self._unit

    @property
    def size(self) -> Any:
        """Volume of a cell, the mean of both, per area of the facet: a length."""
        quarter, third, two = sp.Rational(1, 4), sp.Rational(1, 3), sp.Integer(2)
        sizes = {"tri": quarter, "quad": two, "tet": third, "hex": two}
        volumes = sum(side[2] for side in self._sides) / len(self._sides)
        return sizes[shape_of(self.cell)] * volumes / self._area

    def jump(self, value: Any) -> Any:
        """A value in the first cell less that in the second; on a side of the mesh the value."""
        entries = Entries.of(value)
        if self._count == 1:
            return value
        pairs = zip(entries.values, self._beyond(entries), strict=True)
        return entries.arrange([a - b for a, b in pairs])

    def average(self, value: Any) -> Any:
        """Mean of a value in both cells; on a side of the mesh the value."""
        entries = Entries.of(value)
        if self._count == 1:
            return value
        pairs = zip(entries.values, self._beyond(entries), strict=True)
        return entries.arrange([(a + b) / 2 for a, b in pairs])

    def finish(self) -> Definition:
        """Return the definition.  Raises WrongDomainError if nothing refers to the second cell."""
        if self._count > 1 and not self._crossed:
            raise WrongDomainError(
                f"{self.name}: a page on facets between cells has m.jump or m.average"
            )
        return super().finish()

    def _beyond(self, entries: Entries) -> list[Any]:
        """Values of the first cell, evaluated in the second."""
        self._crossed = True
        return [sp.sympify(v).xreplace(self._others) for v in entries.values]

    def _at_facet(self, second: int) -> list[Any]:
        """Parent coordinates in a cell of the point of the facet."""
        shape = shape_of(self.cell)
        corners, face = FIRST[shape], ELEMENTS[FACES[shape]]
        N, count = face.shape(*self._at), len(corners)
        turn = [(1 - k) % count if second else k for k in range(count)]
        points = [self.cell.nodes[corners[k]] for k in turn]
        axes = range(self.cell.dimension)
        return [sp.expand(sum(n * p[i] for n, p in zip(N, points, strict=True))) for i in axes]

    def _seen(self, second: int) -> tuple[list[Any], Any, Any]:
        """Shape functions, their gradients and the Jacobian determinant of one cell."""
        label, size = "ab"[second], self.dimension
        point, nodes = self._at_facet(second), self._nodes_of(second)
        N = [self.define(f"shape_{label}_{a}", v) for a, v in enumerate(self.cell.shape(*point))]
        xi = sp.symbols(f"xi:{size}", real=True)
        at_point = dict(zip(xi, point, strict=True))
        parent = [
            [sp.sympify(g).subs(at_point, simultaneous=True) for g in row]
            for row in self.cell.gradient(*xi)
        ]
        J = sp.Matrix(
            size,
            size,
            lambda i, k: interpolate([g[k] for g in parent], [self._X[i][a] for a in nodes]),
        )
        J = self.define(f"dX_{label}", J)
        det = self.define(f"detJ_{label}", J.det(method="berkowitz"))
        inverse = self.define(f"dX_inverse_{label}", J.adjugate() / det)
        rows = [list(sp.Matrix([row]) * inverse) for row in parent]
        dN = [
            [self.define(f"slope_{label}_{a}{k}", v) for k, v in enumerate(row)]
            for a, row in enumerate(rows)
        ]
        if not second:
            along = [[sp.diff(p, s) for s in self._at] for p in point]
            self._tangents = J * sp.Matrix(along)
        return N, dN, det

    def _nodes_of(self, second: int) -> range:
        count = len(self.cell.nodes)
        return range(second * count, (second + 1) * count)

    def _surface(self) -> tuple[Any, Any]:
        t = self._tangents
        flat = self.dimension == 2
        crossed = sp.Matrix([t[1, 0], -t[0, 0]]) if flat else t[:, 0].cross(t[:, 1])
        vector = self.define("reference_area", crossed)
        area = self.define("size_of_area", sp.sqrt(vector.dot(vector)))
        return area, vector / area

    def _components_of(self, components: Sequence[Component]) -> list[FieldTrace]:
        if components[0].order != self.order:
            raise ModelError(
                f"{components[0].name}: on facets fields have the order of the cell, {self.order}"
            )
        names = [c.name for c in components]
        is_data = components[0].is_data
        columns: Any = self.nodal_data(*names) if is_data else self.nodal_unknowns(*names)
        traced = []
        for component, column in zip(components, columns, strict=True):
            values = []
            for second in range(self._count):
                N, dN, _ = self._sides[second]
                label = component.name + ("_beyond" if second else "")
                nodal = [column[a] for a in self._nodes_of(second)]
                value = self.define(label, interpolate(N, nodal))
                rows = [interpolate([g[k] for g in dN], nodal) for k in range(self.dimension)]
                gradient = [self.define(f"grad_{label}_{k}", v) for k, v in enumerate(rows)]
                values.append((value, *gradient))
            self._others.update(zip(values[0], values[-1], strict=True))
            traced.append(FieldTrace(component, values[0][0], tuple(values[0][1:])))
        return traced

    def _slopes_of(self, component: Component, column: Sequence[Any]) -> list[Any]:
        raise AssertionError("the traces of a facet have slopes of their own")

    def _position(self) -> list[Any]:
        N = self._sides[0][0]
        names = (f"at_{axis}" for axis in "XYZ")
        nodal = [[x[a] for a in self._nodes_of(0)] for x in self._X]
        return [self.define(n, interpolate(N, x)) for n, x in zip(names, nodal, strict=False)]

    def _volume(self) -> Any:
        if self.geometry == AXISYMMETRIC:
            return self.define("area_of_ring", 2 * sp.pi * self._position()[1] * self._area)
        return self._area
