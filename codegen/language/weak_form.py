"""`@softehl.page`: a function of fields that becomes the definition of an element of any cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import CodeType
from typing import Any, Literal, TypeVar, get_args, overload

from softehl.codegen.elements.cells import element
from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.language.boundary_model import FACES, BoundaryModel, FacetModel, shape_of
from softehl.codegen.language.cell_model import CellModel
from softehl.codegen.language.definition import Definition, PointForm
from softehl.codegen.language.errors import ModelError, NeedsElementError, NoEquationsError
from softehl.codegen.language.fields import (
    AXISYMMETRIC,
    GEOMETRIES,
    SOLID,
    Fields,
    order_of,
)
from softehl.codegen.language.flatten import call_function
from softehl.codegen.language.model_builder import varying_parameters
from softehl.codegen.language.pair_model import PairModel
from softehl.codegen.language.point_model import PointModel

T = TypeVar("T")
Write = Callable[[Fields], Any]
Form = Literal["whole", "point"]


class UnsupportedCellError(ModelError):
    """A weak form cannot be used on this cell; no line of it is wrong."""

    def __init__(self, message: str) -> None:
        ValueError.__init__(self, message)


@dataclass(frozen=True)
class CellOptions:
    """Cells of weak forms by name, and their geometry (None: the default one).

    materials: take only the stress laws of a file, as bodies. varying: parameters that become
    "data" of elements or "point data".
    """

    cells: tuple[str, ...] = ()
    geometry: str | None = None
    materials: bool = False
    varying: tuple[tuple[str, str], ...] = ()

    def options(self) -> tuple[str, ...]:
        """All of it as texts, for a digest."""
        moved = (f"{name} as {array}" for name, array in self.varying)
        return (*self.cells, self.geometry or "", "materials" if self.materials else "", *moved)


DEFAULT_CELL = CellOptions()


@dataclass(frozen=True)
class Page:
    """Page of fields: a function that defines the equations at a point; made by `softehl.page`.

    Attributes
    ----------
    name : str
        Name of the page.
    write : callable
        The function, which takes a `Fields`.
    degree : int, optional
        Degree of polynomials that the quadrature integrates exactly on the reference cell. Left
        out: the rule of the cell; on triangles and tetrahedra one that integrates products of
        values, where they occur.
    doc : str
        Description.
    form : str, optional
        Form of its kernels: "whole" elements, or loops around a "point"; the faster one if left
        out.
    source : callable, optional
        Function whose file and line errors name, if that is not `write`.
    """

    name: str
    write: Write
    degree: int | None = None
    doc: str = ""
    form: Form | None = None
    source: Callable[..., object] | None = None

    @property
    def code(self) -> CodeType:
        """Code object of its function."""
        code: CodeType = (self.source or self.write).__code__
        return code

    def definition(self, cell: str, geometry: str | None = None) -> Definition:
        """Return the model of an element of a cell.

        Parameters
        ----------
        cell : str
            Name of a cell, such as "hex8"; "quad4_interior" is a facet between two cells,
            "quad4_side" a side with gradients of the cell beside it, "quad4_pair" and "line2_pair"
            a law of contact in 3-D and 2-D. With a geometry of one
            dimension more it is a side: quad4 of a solid, line2 in plane strain.
        geometry : str, optional
            "plane strain", "axisymmetric" or "solid"; the default of the dimension if left out.

        Returns
        -------
        Definition
            The model.

        Raises
        ------
        ModelError
            The page is wrong, with its line.
        """
        stem, _, facet = cell.partition("_")
        kind = element(stem)
        resolved = geometry_of(kind.dimension, geometry)
        name = f"{self.name}_{cell}" + ("_axisymmetric" if resolved == AXISYMMETRIC else "")
        if facet:
            return self._on_facet(name, kind, resolved, facet)
        if space_of(resolved, kind.dimension) > kind.dimension:
            degree = self.degree or 2 * order_of(kind)
            side = BoundaryModel(name, kind, resolved, rule_of(kind, degree), self.doc)
            return self._made(side, side.finish)
        try:
            point = self._at_point(name, kind, resolved)
        except NeedsElementError:
            if self.form == "point":
                raise
            point = None
        model = CellModel(name, kind, resolved, self.rule(kind, point), self.doc)
        made = self._made(model, model.finish)
        unroll = False if self.form == "point" else None
        at = None if self.form == "whole" else point
        return replace(made, point=at, unroll=unroll)

    def _on_facet(self, name: str, kind: Element, geometry: str, facet: str) -> Definition:
        """On facets between two cells ("interior") or on those of a side ("side")."""
        if facet == "pair":
            pair = PairModel(name, kind, geometry, self.doc)
            return self._made(pair, pair.finish)
        if facet not in ("interior", "side"):
            raise UnsupportedCellError(f'no facet "{facet}" of {kind.name}: "interior" or "side"')
        face = element(FACES[shape_of(kind)])
        rule = rule_of(face, self.degree or 2 * order_of(kind))
        on = FacetModel(name, kind, geometry, rule, self.doc, both=facet == "interior")
        return replace(self._made(on, on.finish), cell=f"{kind.name}_{facet}")

    def definitions(self, on: CellOptions) -> list[Definition]:
        """Return the models of an element on all requested cells.

        Parameters
        ----------
        on : On
            Cells and geometry.

        Returns
        -------
        list of Definition
            A model for each cell.

        Raises
        ------
        ModelError
            There is no such cell, or the page is wrong.
        """
        if not on.cells:
            raise UnsupportedCellError(
                f"{self.name} is a page of fields, which stands on any cell: say which, as in "
                'softehl.load_kernel(page, cell="hex8") or softehl generate --cell hex8'
            )
        for cell in on.cells:
            try:
                element(cell.partition("_")[0])
            except ValueError as error:
                raise UnsupportedCellError(str(error)) from None
        with varying_parameters(on.varying):
            return [self.definition(cell, on.geometry) for cell in on.cells]

    def at_point(self, cell: str, geometry: str | None = None) -> PointForm:
        """Return the model at a point of a cell.

        Parameters
        ----------
        cell : str
            Name of a cell.
        geometry : str, optional
            As in `definition`.

        Returns
        -------
        PointForm
            Residuals by values and gradients.

        Raises
        ------
        ModelError
            The page is wrong.
        """
        kind = element(cell)
        return self._at_point(self.name, kind, geometry_of(kind.dimension, geometry))

    def _at_point(self, name: str, kind: Element, geometry: str) -> PointForm:
        site = PointModel(name, kind, geometry, self.doc)
        return self._made(site, site.form)

    def _made(self, onto: Fields, finish: Callable[[], T]) -> T:
        """Result of the page on `onto`.  Raises ModelError with a line of the page."""
        code = self.code
        where = f"{code.co_filename}:{code.co_firstlineno}"
        value = None
        try:
            value = call_function(self.name, self.write, onto, write=f"`def {self.name}(m):`")
            return finish()
        except ModelError as error:
            if type(error) not in (ModelError, NoEquationsError) or error.where.startswith(
                code.co_filename
            ):
                raise
            if value is not None and isinstance(error, NoEquationsError):
                remedy = "returns a value, which is lost: say m.minimise(energy) or m.weak(...)"
                raise ModelError(f"{error.text}; {self.name} {remedy}", where) from error
            raise ModelError(error.text, where) from error

    def rule(self, cell: Element, form: PointForm | None) -> QuadratureRule:
        """Return the quadrature on a cell.

        Parameters
        ----------
        cell : Element
            The cell.
        form : PointForm or None
            The model at a point, if it is known.

        Returns
        -------
        QuadratureRule
            The rule.
        """
        if self.degree is not None:
            return rule_of(cell, self.degree)
        order = order_of(cell)
        values = form is None or any(
            q.axis is None and q.component.order == order for q in form.unknowns
        )
        short = cell.name.startswith(("line", "tri", "tet"))
        return rule_of(cell, 2 * order) if values and short else cell.rule


def rule_of(cell: Element, degree: int) -> QuadratureRule:
    """A rule of a cell for polynomials of a degree (in each direction of a square or cube)."""
    return cell.cell.rule(degree)


def space_of(geometry: str, dimension: int) -> int:
    """Dimensions of the mesh in which a cell of a dimension has this geometry."""
    if geometry != SOLID:
        return 2
    return 3 if dimension > 1 else 1


def geometry_of(dimension: int, geometry: str | None) -> str:
    """The geometry of a mesh, checked.  Raises ModelError."""
    allowed = GEOMETRIES[dimension]
    if geometry is not None and geometry not in allowed:
        raise UnsupportedCellError(
            f"geometry = {geometry!r} of a cell in {dimension}-D; allowed is "
            + " or ".join(f'"{g}"' for g in allowed)
        )
    return geometry or allowed[0]


@overload
def page(write: Write, /) -> Page: ...
@overload
def page(*, degree: int | None = None, form: Form | None = None) -> Callable[[Write], Page]: ...
def page(
    write: Write | None = None, /, *, degree: int | None = None, form: Form | None = None
) -> Any:
    """Make a page of fields of a function: `@softehl.page` or `@softehl.page(degree=4)`.

    Parameters
    ----------
    write : callable
        Function that takes a `Fields`.
    degree : int, optional
        Degree of polynomials that the quadrature integrates, as in `Page`.
    form : str, optional
        "whole" or "point", as in `Page`.

    Returns
    -------
    Page
        The page, for `Study.add`, `softehl.load_kernel` and `softehl generate`.

    Raises
    ------
    ModelError
        There is no such form.
    """
    if form is not None and form not in get_args(Form):
        raise ModelError(f'form = {form!r}: allowed are "whole" and "point"')

    def made(function: Write) -> Page:
        return Page(function.__name__, function, degree, function.__doc__ or "", form)

    return made if write is None else made(write)
