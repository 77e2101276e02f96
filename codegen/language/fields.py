"""Fields of a weak form at a point, independent of cell and geometry.

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

from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.language.definition import Component
from softehl.codegen.language.errors import ModelError, NeedsElementError, WrongDomainError
from softehl.codegen.language.flatten import Entries, Matrix
from softehl.codegen.language.model import Model

PLANE, AXISYMMETRIC, SOLID = "plane strain", "axisymmetric", "solid"
GEOMETRIES = {1: (SOLID, PLANE, AXISYMMETRIC), 2: (PLANE, AXISYMMETRIC, SOLID), 3: (SOLID,)}
"""Geometries by the dimension of a cell, the default first; the last of two dimensions and those
but the first of one are of sides."""
AXES = "xyz"
_IN_FIELDS = "a page of fields says it with m.vector, m.scalar and m.minimise or m.weak"


@dataclass(frozen=True)
class FieldTrace:
    """Value of a component at the point, and its gradient."""

    component: Component
    value: Any
    gradient: tuple[Any, ...]


class Fields(Model):
    """Model at a quadrature point, of any cell and geometry: the argument of a page of fields.

    Attributes
    ----------
    cell : Element
        The reference cell.
    geometry : str
        "plane strain", "axisymmetric" or "solid".
    dimension : int
        Number of coordinates.
    order : int
        Order of the shape functions.
    """

    _unused = 'a page that needs one component of a vector declares it, as in m.scalar("u_y")'

    def __init__(
        self, name: str, cell: Element, geometry: str, nodes: int, rule: QuadratureRule, doc: str
    ) -> None:
        super().__init__(name, nodes=nodes, rule=rule, doc=doc)
        self.cell, self.geometry = cell, geometry
        self.dimension = cell.dimension
        self.order = order_of(cell)
        self._traced: dict[Any, FieldTrace] = {}
        self._densities = 0
        self._energies: dict[tuple[Any, Any], Any] = {}

    # what Whole, Side and Site do differently ---------------------------------------------------

    @abstractmethod
    def _components_of(self, components: Sequence[Component]) -> list[FieldTrace]:
        """Unknowns at nodes of one field, or data; all of one order."""

    @abstractmethod
    def _position(self) -> list[Any]:
        """Reference coordinates of the point."""

    @abstractmethod
    def _volume(self) -> Any:
        """Volume at the point by that of the parent cell."""

    @abstractmethod
    def _total_of(self, name: str, density: Any) -> Any:
        """The integral of a density that holds its volume."""

    # fields -------------------------------------------------------------------------------------

    def vector(self, name: str, *, order: int | None = None) -> Any:
        """Declare a vector field u with unknowns u_x, u_y, u_z, as many as the mesh has dimensions.

        Parameters
        ----------
        name : str
            Name of the field.
        order : int, optional
            Order of its shape functions: 1 on a quadratic cell has unknowns at the corners only, 0
            has one value in every cell; that of the cell if left out.

        Returns
        -------
        Matrix
            Value at the point, (dimension, 1).

        Raises
        ------
        ModelError
            The cell does not allow the order.
        """
        names = [f"{name}_{axis}" for axis in AXES[: self.dimension]]
        return Matrix(self._declared_fields(names, order, is_data=False))

    def scalar(self, name: str, *, order: int | None = None) -> Any:
        """Declare a scalar field.

        Parameters
        ----------
        name : str
            Name of the field, and of its unknown.
        order : int, optional
            As in `vector`.

        Returns
        -------
        Symbol
            Value at the point.

        Raises
        ------
        ModelError
            The cell does not allow the order.
        """
        return self._declared_fields([name], order, is_data=False)[0]

    def _internal_unknowns(self, names: Sequence[str]) -> list[sp.Symbol]:
        self._arguments.internal += names
        return self._declared_fields(names, 0, is_data=False)

    @property
    def parent(self) -> Any:
        """Coordinates of the point in the reference cell, (dimension of the cell, 1)."""
        raise NeedsElementError("m.parent")

    @property
    def jacobian(self) -> Any:
        """Derivatives of reference coordinates (rows) by those of the cell (columns)."""
        raise NeedsElementError("m.jacobian")

    def centroid(self, value: Any) -> Any:
        """Return a value at the centroid of the reference cell.

        Parameters
        ----------
        value : Expr, list or Matrix
            The value at the point.

        Returns
        -------
        Expr, list or Matrix
            In the form of `value`.
        """
        raise NeedsElementError(f"m.centroid({value})")

    @property
    def size(self) -> Any:
        """Volume of the cell at a facet per area of the facet, a length [mm]."""
        raise WrongDomainError.no_facet("m.size", self.cell.name)

    @property
    def gap(self) -> Any:
        """Distance of the sides in a law of contact, along the normal [mm]; negative overlap."""
        raise WrongDomainError.no_pair("m.gap")

    @property
    def slip(self) -> Any:
        """Motion (dimension, 1) of the first side in a law of contact, along itself [mm].

        It is that against the second side since the step before.
        """
        raise WrongDomainError.no_pair("m.slip")

    @property
    def area_ratio(self) -> Any:
        """Deformed over undeformed area of the first side, in a law of contact."""
        raise WrongDomainError.no_pair("m.area_ratio")

    def jump(self, value: Any) -> Any:
        """Return the jump of a value on a facet, or between the sides of a law of contact.

        It is the value in the cell that the normal leaves, less that in the other one.

        Parameters
        ----------
        value : Expr, list or Matrix
            The value at the point.

        Returns
        -------
        Expr, list or Matrix
            In the form of `value`.

        Raises
        ------
        ModelError
            The page stands on cells.
        """
        raise WrongDomainError.no_facet(f"m.jump({value})", self.cell.name)

    def average(self, value: Any) -> Any:
        """Return the mean of a value in both cells at a facet.

        Parameters
        ----------
        value : Expr, list or Matrix
            The value at the point.

        Returns
        -------
        Expr, list or Matrix
            In the form of `value`.

        Raises
        ------
        ModelError
            The page stands on cells.
        """
        raise WrongDomainError.no_facet(f"m.average({value})", self.cell.name)

    def previous(self, field: Any) -> Any:
        """Return a field at the beginning of the step; it has gradients, too.

        Parameters
        ----------
        field : Symbol or Matrix
            The value that `vector` or `scalar` returned.

        Returns
        -------
        Symbol or Matrix
            In the form of `field`.

        Raises
        ------
        ModelError
            It is no field, or has order 0.
        """
        return self._of_step(field, "old")

    def rate(self, field: Any, order: int = 1) -> Any:
        """Return a time derivative of a field.

        Parameters
        ----------
        field : Symbol or Matrix
            The value that `vector` or `scalar` returned.
        order : int
            1 or 2; see `Model.rates`.

        Returns
        -------
        Expr or Matrix
            In the form of `field`; `Study.march` gives its values.

        Raises
        ------
        ModelError
            It is no field, or has order 0.
        """
        coefficient, suffix = self._arguments.of_time(order)
        entries = Entries.of(self._of_step(field, suffix)).values
        now = Entries.of(field)
        return now.arrange([coefficient * a + b for a, b in zip(now.values, entries, strict=True)])

    def grad(self, value: Any) -> Any:
        """Return the gradient by the reference coordinates.

        Parameters
        ----------
        value : Expr or Matrix
            A field, or an expression of fields and parameters.

        Returns
        -------
        Matrix
            (dimension, 1); of a vector a row for each entry.

        Raises
        ------
        ModelError
            The expression has other symbols.
        """
        rows = [self._gradient(v) for v in Entries.of(value).values]
        if isinstance(value, sp.MatrixBase):
            return Matrix(rows)
        return Matrix(rows[0])

    @property
    def normal(self) -> Any:
        """Unit normal (dimension, 1) of a side in the reference state, outwards."""
        raise ModelError(f"normal: {self.cell.name} is a cell here, only sides have normals")

    def area_vector(self, u: Any) -> Any:
        """Return the area vector of a displaced side per reference area.

        Parameters
        ----------
        u : Matrix
            Displacement, (dimension, 1).

        Returns
        -------
        Matrix
            (dimension, 1), outwards.

        Raises
        ------
        ModelError
            The page stands on cells.
        """
        raise ModelError(f"area_vector({u}): {self.cell.name} is a cell here, no side")

    @property
    def position(self) -> Any:
        """Reference coordinates of the point, (dimension, 1); in axisymmetry axis and radius."""
        return Matrix(self._position())

    def deformation_gradient(self, u: Any, name: str = "F") -> Any:
        """Return F = 1 + Grad u, (3, 3), with named entries F_00, F_01, ...

        Parameters
        ----------
        u : Matrix
            Displacement, (dimension, 1).
        name : str
            Name of the entries.

        Returns
        -------
        Matrix
            In 2-D with the third row of the geometry: 1 in plane strain, the hoop stretch 1 + u_y /
            y around the x axis.

        Raises
        ------
        ModelError
            `u` has another shape.
        """
        size = self.dimension
        if getattr(u, "shape", None) != (size, 1):
            raise ModelError(f"deformation_gradient: a vector of {size} is needed, as of m.vector")
        gradient = self.grad(u)
        F = sp.eye(3)
        for i in range(size):
            for k in range(size):
                F[i, k] += gradient[i, k]
        if self.geometry == AXISYMMETRIC:
            F[2, 2] += u[1] / self._position()[1]
        named = [[F[i, k] for k in range(3)] for i in range(3)]
        for i in range(3):
            for k in range(3):
                if F[i, k] not in (0, 1):
                    named[i][k] = self.define(f"{name}_{i}{k}", F[i, k], interface=True)
        return Matrix(named)

    # equations ----------------------------------------------------------------------------------

    def minimise(self, density: Any) -> None:
        """Make the integral of a density stationary; further densities add up.

        Parameters
        ----------
        density : Expr
            Energy per reference volume, of a side per reference area.
        """
        self._densities += 1
        name = f"minimised_{self._densities}"
        self.potential(self._total_of(name, density * self._volume()))

    def weak(self, flux: Any, varied: Any) -> None:
        """Require that the integral of flux times the variation of a value vanishes.

        Parameters
        ----------
        flux : Expr, list or Matrix
            Such as a heat flux. Further ones, and what is minimised, add up.
        varied : Expr, list or Matrix
            The value that is varied, in the form of `flux`, such as m.grad(T) of a field T.

        Raises
        ------
        ModelError
            The forms differ.
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
        """Return the first Piola-Kirchhoff stress of a material.

        Parameters
        ----------
        material : Law
            A function decorated by `softehl.material`.
        F : Matrix
            Deformation gradient (3, 3) of names.

        Returns
        -------
        Matrix
            P, (3, 3) [MPa].

        Notes
        -----
        `m.weak(m.stress(material, F), F)` is its equilibrium. The energy of the material, if it has
        one, is then minimised, so that the tangent is symmetric.
        """
        P, energy = material.at(self, F)
        if energy is not None:
            self._energies[tuple(P), tuple(F)] = energy
        return P

    # what belongs to whole elements -------------------------------------------------------------

    def integral(self, name: str, integrand: Any) -> sp.Symbol:
        """Refuse an integral: a page of fields has the values at one point.

        Parameters
        ----------
        name : str
            Name of the integral.
        integrand : Expr
            Its integrand.

        Raises
        ------
        ModelError
            Always.
        """
        raise ModelError(
            f"integral {name}: {_IN_FIELDS}; element-wide integrals need softehl.Model"
        )

    def weak_form(self, terms: Sequence[tuple[Any, Any]]) -> None:
        """Refuse a weak form of `Model`: a page of fields has `weak`.

        Parameters
        ----------
        terms : sequence of tuple
            Its terms.

        Raises
        ------
        ModelError
            Always.
        """
        raise ModelError(f"weak_form: {_IN_FIELDS}")

    # --------------------------------------------------------------------------------------------

    def _declared_fields(self, names: Sequence[str], order: int | None, is_data: bool) -> list[Any]:
        field_order = self.order if order is None else order
        if field_order not in (0, 1, self.order):
            allowed = "0 or 1" if self.order == 1 else f"0, 1 or {self.order}"
            raise ModelError(
                f"{names[0]}: order = {order!r} on {self.cell.name}; allowed is {allowed}"
            )
        traced = self._components_of([Component(name, field_order, is_data) for name in names])
        self._traced.update({t.value: t for t in traced})
        return [t.value for t in traced]

    def _of_step(self, field: Any, suffix: str) -> Any:
        """Data of a field that a study fills at every step."""
        entries = Entries.of(field)
        data = []
        for value in entries.values:
            traced = self._traced.get(value)
            if traced is None or traced.component.is_data:
                raise ModelError(f"{value} is no field: give what m.vector or m.scalar returned")
            component = traced.component
            if not component.order:
                raise ModelError(f"{value} has order 0: steps before are known at nodes only")
            name = f"{component.name}_{suffix}"
            existing = [t.value for t in self._traced.values() if t.component.name == name]
            data += existing or self._declared_fields([name], component.order, is_data=True)
        return entries.arrange(data)

    def _gradient(self, value: Any) -> list[Any]:
        """Slopes of an expression of fields along the axes, names of m.define included."""
        expression = sp.sympify(value)
        met = expression.free_symbols
        fields = [t for v, t in self._traced.items() if v in met or expression.has(v)]
        allowed = {s for t in fields for s in (t.value, *_leaves(t.value))}
        allowed |= {sp.Symbol(n, real=True) for n in self._arguments.names("parameters")}
        unknown = sorted(str(s) for s in _leaves(expression) - allowed)
        if unknown or not fields:
            raise ModelError(
                f"grad of {value}: {unknown[0] if unknown else 'it'} is no field; gradients are "
                "those of fields, and of expressions of fields and parameters"
            )
        gradient = []
        for k in range(self.dimension):
            gradient.append(sp.Add(*(expression.diff(t.value) * t.gradient[k] for t in fields)))
        return gradient


def _leaves(expression: Any) -> set[Any]:
    """Symbols of an expression without a definition."""
    symbols = expression.free_symbols
    return {s for s in symbols if getattr(s, "definition", None) is None}


def order_of(cell: Element) -> int:
    """Order of the shape functions along an edge."""
    corners = {1: (2,), 2: (3, 4), 3: (4, 6, 8)}[cell.dimension]
    if len(cell.nodes) in corners:
        return 1
    return max(2, len({node[0] for node in cell.nodes}) - 1)
