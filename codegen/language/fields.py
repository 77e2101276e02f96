"""Fields at a point: what a page of fields says, whatever the cell and the geometry.

`Fields` adds to a `Model` what such a page needs: fields with values and gradients, a deformation
gradient of three dimensions, densities and weak forms. Two classes carry it out. `Whole` sums over
the nodes of a cell: the model is that of the whole element. `Site` stops at the point: values and
gradients are the unknowns of the model, so that its residual is the fluxes and its tangent the
moduli, the same for every cell.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.language.complaints import Elsewhere, ModelError, NeedsElement
from softehl.codegen.language.definition import Component
from softehl.codegen.language.elements.cells import Element
from softehl.codegen.language.elements.quadrature import QuadratureRule
from softehl.codegen.language.entries import Entries, Matrix
from softehl.codegen.language.model import Model

PLANE, AXISYMMETRIC, SOLID = "plane strain", "axisymmetric", "solid"
GEOMETRIES = {1: (SOLID, PLANE, AXISYMMETRIC), 2: (PLANE, AXISYMMETRIC, SOLID), 3: (SOLID,)}
"""Geometries by the dimension of a cell, the default first; the last of two dimensions and those
but the first of one are of sides."""
AXES = "xyz"
_IN_FIELDS = "a page of fields says it with m.vector, m.scalar and m.minimise or m.weak"


@dataclass(frozen=True)
class Traced:
    """Value of a component at the point, and its slopes along the axes."""

    component: Component
    value: Any
    slopes: tuple[Any, ...]


class Fields(Model):
    """The model of a page of fields; the page gets it as its only argument."""

    _unused = 'a page that needs one component of a vector declares it, as in m.scalar("u_y")'

    def __init__(
        self, name: str, cell: Element, geometry: str, nodes: int, rule: QuadratureRule, doc: str
    ) -> None:
        super().__init__(name, nodes=nodes, rule=rule, doc=doc)
        self.cell, self.geometry = cell, geometry
        self.dimension = cell.dimension
        self.order = order_of(cell)
        self._traced: dict[Any, Traced] = {}
        self._densities = 0
        self._energies: dict[tuple[Any, Any], Any] = {}

    # what Whole, Side and Site do differently ---------------------------------------------------

    @abstractmethod
    def _components_of(self, components: Sequence[Component]) -> list[Traced]:
        """Unknowns at nodes of one field, or data; all of one order."""

    @abstractmethod
    def _place(self) -> list[Any]:
        """Reference coordinates of the point."""

    @abstractmethod
    def _volume(self) -> Any:
        """Volume at the point by that of the parent cell."""

    @abstractmethod
    def _total_of(self, name: str, density: Any) -> Any:
        """The integral of a density that holds its volume."""

    # fields -------------------------------------------------------------------------------------

    def vector(self, name: str, *, order: int | None = None) -> Any:
        """A vector field u with the unknowns u_x, u_y, u_z, as many as the mesh has dimensions.

        Its value at the point is a matrix (dimension, 1). order: 1 on a quadratic cell gives it
        unknowns at the corners only, 0 one value of its own in every cell; left out, it is that of
        the cell.
        """
        names = [f"{name}_{axis}" for axis in AXES[: self.dimension]]
        return Matrix(self._declared_fields(names, order, given=False))

    def scalar(self, name: str, *, order: int | None = None) -> Any:
        """A scalar field; its value at the point is a symbol. order: as in `vector`."""
        return self._declared_fields([name], order, given=False)[0]

    def _internal_unknowns(self, names: Sequence[str]) -> list[sp.Symbol]:
        self._arguments.internal += names
        return self._declared_fields(names, 0, given=False)

    @property
    def parent(self) -> Any:
        """Parent coordinates of the point, (dimension of the cell, 1)."""
        raise NeedsElement("m.parent")

    @property
    def jacobian(self) -> Any:
        """Slopes of the reference coordinates (rows) along the parent ones (columns)."""
        raise NeedsElement("m.jacobian")

    def centroid(self, value: Any) -> Any:
        """Value of a scalar, list or matrix at the centroid of the parent cell."""
        raise NeedsElement(f"m.centroid({value})")

    @property
    def size(self) -> Any:
        """Volume of a cell at a facet per area of the facet: a length."""
        raise Elsewhere.no_facet("m.size", self.cell.name)

    def jump(self, value: Any) -> Any:
        """A value on a facet in the cell that the normal leaves, less that in the other one."""
        raise Elsewhere.no_facet(f"m.jump({value})", self.cell.name)

    def average(self, value: Any) -> Any:
        """Mean of a value in both cells at a facet."""
        raise Elsewhere.no_facet(f"m.average({value})", self.cell.name)

    def previous(self, field: Any) -> Any:
        """A field at the beginning of the step; it has gradients, too."""
        return self._of_step(field, "old")

    def rate(self, field: Any, order: int = 1) -> Any:
        """Time derivative of a field, or its second one, by what `Study.march` gives: see
        `Model.rates`.
        """
        coefficient, suffix = self._arguments.of_time(order)
        rest = Entries.of(self._of_step(field, suffix)).values
        now = Entries.of(field)
        return now.arrange([coefficient * a + b for a, b in zip(now.values, rest, strict=True)])

    def grad(self, value: Any) -> Any:
        """Gradient by the reference coordinates: (dimension, 1), of a vector a row for each entry.

        value: a field, or an expression of fields and parameters.
        """
        rows = [self._slopes(v) for v in Entries.of(value).values]
        if isinstance(value, sp.MatrixBase):
            return Matrix(rows)
        return Matrix(rows[0])

    @property
    def normal(self) -> Any:
        """Unit normal (dimension, 1) of an undeformed side, outwards; a cell has none."""
        raise ModelError(f"normal: {self.cell.name} is a cell here, only sides have normals")

    def area_vector(self, u: Any) -> Any:
        """Area vector of a side displaced by u per undeformed area: see `normal`."""
        raise ModelError(f"area_vector({u}): {self.cell.name} is a cell here, no side")

    @property
    def position(self) -> Any:
        """Reference coordinates of the point, (dimension, 1); in axisymmetry axis and radius."""
        return Matrix(self._place())

    def deformation_gradient(self, u: Any, name: str = "F") -> Any:
        """F = 1 + Grad u, 3 x 3, with names F_00, F_01, ...; what the mesh has no axis for is said
        by the geometry: plane strain, or the hoop stretch 1 + u_y / y around the x axis.
        """
        size = self.dimension
        if getattr(u, "shape", None) != (size, 1):
            raise ModelError(f"deformation_gradient: a vector of {size} is needed, as of m.vector")
        slopes = self.grad(u)
        F = sp.eye(3)
        for i in range(size):
            for k in range(size):
                F[i, k] += slopes[i, k]
        if self.geometry == AXISYMMETRIC:
            F[2, 2] += u[1] / self._place()[1]
        named = [[F[i, k] for k in range(3)] for i in range(3)]
        for i in range(3):
            for k in range(3):
                if F[i, k] not in (0, 1):
                    named[i][k] = self.define(f"{name}_{i}{k}", F[i, k], interface=True)
        return Matrix(named)

    # equations ----------------------------------------------------------------------------------

    def minimise(self, density: Any) -> None:
        """The sum of these densities per reference volume, integrated, is stationary."""
        self._densities += 1
        name = f"minimised_{self._densities}"
        self.potential(self._total_of(name, density * self._volume()))

    def weak(self, flux: Any, varied: Any) -> None:
        """The integral of flux times the variation of `varied` is zero for every variation.

        Both are scalars, lists or matrices of the same shape, such as a flux and m.grad(T) of an
        unknown field T. Further ones, and what is minimised, add up.
        """
        left, right = Entries.of(flux), Entries.of(varied)
        energy = self._energies.get((tuple(left.values), tuple(right.values)))
        if energy is not None:
            self.minimise(energy)
            return
        if left.suffixes != right.suffixes:
            raise ModelError(
                f"weak: a flux of {len(left.values)} entries times the variation of "
                f"{len(right.values)}; both must have the same shape"
            )
        self._densities += 1
        volume, density, frozen = self._volume(), sp.Integer(0), []
        for factor, value in zip(left.values, right.values, strict=True):
            if sp.sympify(value).is_number:
                continue
            label = self._equations.numbered("weak_flux")
            frozen.append(self.define(label, factor * volume, interface=True))
            density += frozen[-1] * value
        total = self._total_of(f"virtual_work_{self._densities}", density)
        self.potential(total, constant=frozen)

    def stress(self, material: Any, F: Any) -> Any:
        """First Piola-Kirchhoff stress P (3, 3) of a `softehl.material` at F, a matrix of names.

        `m.weak(m.stress(material, F), F)` is its equilibrium; where the material has an energy,
        that is minimised, so that the tangent is symmetric.
        """
        P, energy = material.at(self, F)
        if energy is not None:
            self._energies[tuple(P), tuple(F)] = energy
        return P

    # what belongs to whole elements -------------------------------------------------------------

    def integral(self, name: str, integrand: Any) -> sp.Symbol:
        """Refused: a page of fields knows the point only."""
        raise ModelError(
            f"integral {name}: {_IN_FIELDS}; element-wide integrals need softehl.Model"
        )

    def weak_form(self, terms: Sequence[tuple[Any, Any]]) -> None:
        """Refused: it is `weak` here."""
        raise ModelError(f"weak_form: {_IN_FIELDS}")

    # --------------------------------------------------------------------------------------------

    def _declared_fields(self, names: Sequence[str], order: int | None, given: bool) -> list[Any]:
        chosen = self.order if order is None else order
        if chosen not in (0, 1, self.order):
            allowed = "0 or 1" if self.order == 1 else f"0, 1 or {self.order}"
            raise ModelError(
                f"{names[0]}: order = {order!r} on {self.cell.name}; allowed is {allowed}"
            )
        traced = self._components_of([Component(name, chosen, given) for name in names])
        self._traced.update({t.value: t for t in traced})
        return [t.value for t in traced]

    def _of_step(self, field: Any, suffix: str) -> Any:
        """Data of a field that a study fills at every step."""
        entries = Entries.of(field)
        found = []
        for value in entries.values:
            traced = self._traced.get(value)
            if traced is None or traced.component.given:
                raise ModelError(f"{value} is no field: give what m.vector or m.scalar returned")
            component = traced.component
            if not component.order:
                raise ModelError(f"{value} has order 0: steps before are known at nodes only")
            name = f"{component.name}_{suffix}"
            known = [t.value for t in self._traced.values() if t.component.name == name]
            found += known or self._declared_fields([name], component.order, given=True)
        return entries.arrange(found)

    def _slopes(self, value: Any) -> list[Any]:
        """Slopes of an expression of fields along the axes, names of m.define included."""
        expression = sp.sympify(value)
        met = expression.free_symbols
        fields = [t for v, t in self._traced.items() if v in met or expression.has(v)]
        known = {s for t in fields for s in (t.value, *_leaves(t.value))}
        known |= {sp.Symbol(n, real=True) for n in self._arguments.names("parameters")}
        strange = sorted(str(s) for s in _leaves(expression) - known)
        if strange or not fields:
            raise ModelError(
                f"grad of {value}: {strange[0] if strange else 'it'} is no field; gradients are "
                "those of fields, and of expressions of fields and parameters"
            )
        slopes = []
        for k in range(self.dimension):
            slopes.append(sp.Add(*(expression.diff(t.value) * t.slopes[k] for t in fields)))
        return slopes


def _leaves(expression: Any) -> set[Any]:
    """Symbols of an expression that stand for nothing else."""
    symbols = expression.free_symbols
    return {s for s in symbols if getattr(s, "definition", None) is None}


def order_of(cell: Element) -> int:
    """Order of the shape functions along an edge."""
    corners = {1: (2,), 2: (3, 4), 3: (4, 6, 8)}[cell.dimension]
    if len(cell.nodes) in corners:
        return 1
    return max(2, len({place[0] for place in cell.nodes}) - 1)
