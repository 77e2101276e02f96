"""A finished model as one record: what the compiler gets from a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.external_function import ExternalFunction
from softehl.codegen.graph.graph import Graph, Node
from softehl.codegen.graph.routines import external_functions
from softehl.codegen.graph.run_time_arrays import ArraySymbol
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.sympy_tape import SympyTape
from softehl.function_address import FunctionAddress


@dataclass(frozen=True)
class Argument:
    """A named scalar argument of a kernel and what it means (with its unit)."""

    name: str
    meaning: str


@dataclass(frozen=True)
class TermHistory:
    """Data of a point with one number for each term of a run-time array.

    array, terms_of: number and name of this array.
    """

    name: str
    meaning: str
    array: int
    terms_of: str


@dataclass(frozen=True)
class Condition:
    """Condition on a parameter or datum: `name relation bound`, and the model's line."""

    name: str
    relation: str
    bound: float
    where: str


@dataclass(frozen=True)
class Statement:
    """A value that a page names, and where: `file:line`. name: empty for an equation."""

    name: str
    value: Node
    where: str


@dataclass(frozen=True)
class Component:
    """A scalar that varies in the cell.

    name: as of its unknowns; of what was at the step before name_old, of a rate name_rate, of an
    acceleration name_acceleration. order: of its shape functions. is_data: whether it is data, not
    an unknown.
    """

    name: str
    order: int
    is_data: bool = False


@dataclass(frozen=True)
class PointQuantity:
    """Value of a component at the point (axis None), or its derivative along an axis."""

    component: Component
    axis: int | None


@dataclass(frozen=True)
class PointForm:
    """A weak form at a point: `definition` is its model, with one node, the point itself.

    Its unknowns are values and gradients: `all` says what each is, `unknowns` those that occur, in
    the order of `definition.directions`. data: of those of its data that are interpolated, by
    their number. axisymmetric: whether the volume is that of a ring. centroid: unknowns that are no
    fields but values at the centroid of the cell, by their number in `all`, and what they are.
    """

    definition: Definition
    unknowns: tuple[PointQuantity, ...]
    all: tuple[PointQuantity, ...]
    data: Mapping[int, PointQuantity]
    axisymmetric: bool
    centroid: Mapping[int, Node] = field(default_factory=dict)

    @property
    def cell_quantities(self) -> dict[int, PointQuantity]:
        """The unknowns that are fields at this point, with their numbers in `unknowns`."""
        others = {self.all[k] for k in self.centroid}
        return {k: q for k, q in enumerate(self.unknowns) if q not in others}


@dataclass(frozen=True)
class Definition:
    """A finished model: arguments, potential and fields as graphs, nothing differentiated yet.

    Made by `Model.finish`; `softehl.load_kernel` and `Study.add` take it.

    Attributes
    ----------
    name : str
        Name of the model.
    doc : str
        Description.
    nodes : int
        Number of nodes.
    coordinates : tuple of str
        Components of the reference coordinates.
    unknowns : tuple of str
        Unknowns of the element.
    interpolated : str or None
        Field with any number of unknowns.
    parameters, data, point_data : tuple of Argument
        Further arguments with their meanings.
    rule : QuadratureRule
        Quadrature.
    unroll : bool or None
        Whether the loop over the points is written out; None: where it pays.
    graph : Graph
        The expressions.
    potential : Node
        Its gradient is the residual.
    constant : tuple of Node
        Values without variation.
    prescribed : mapping
        Value -> derivatives in place of the true ones.
    directions : tuple of Node
        Unknowns by which the residual is derived.
    interface : tuple of Node
        Values through which derivatives are computed.
    fields : tuple
        Name and value of each field.
    product, pseudo_load, fields_rate : bool
        Further tasks; see `Model.offer`.
    adjoint_rate : bool
        Whether the tasks are those of second derivatives of results, and no others.
    derivatives : tuple
        Arguments by which the residual is differentiated.
    example : tuple
        Values near which the model makes sense.
    tasks : tuple of str or None
        Tasks that are generated; None: the usual ones.
    conditions : tuple of Condition
        Conditions on parameters and data.
    components : int
        Basis values of the interpolated field.
    nodal : tuple
        First unknown and number of components of fields with unknowns at all nodes.
    dof_nodes : tuple
        Name and node of every unknown.
    history : tuple of str
        Point data with new values after a step.
    internal : tuple of str
        Unknowns of one element alone.
    functions : tuple of str
        Parameters that are addresses of C functions.
    addresses : tuple
        Name and address of those that the page knows itself.
    point_rates : bool
        Whether point data have rates.
    cell : str
        Reference cell of a weak form.
    varying : bool
        Whether a parameter of the page is data instead.
    point : PointForm or None
        The model at a point.
    arrays : tuple of RunTimeArray
        Arrays of any length that each call gives: curves, weights of networks.
    term_history : tuple of TermHistory
        Point data with one number for each term.
    term_updates : tuple of Node
        Their new values.
    term_groups : tuple of tuple of str
        Arrays of terms that have equal lengths.
    record : Record
        The model as it was written, by which kernels are checked.
    statements : tuple of Statement
        Named values, probes, fields and equations in the order of the page.
    """

    name: str
    doc: str
    nodes: int
    coordinates: tuple[str, ...]
    unknowns: tuple[str, ...]
    interpolated: str | None
    parameters: tuple[Argument, ...]
    data: tuple[Argument, ...]
    point_data: tuple[Argument, ...]
    rule: QuadratureRule
    unroll: bool | None
    graph: Graph
    potential: Node
    constant: tuple[Node, ...]
    prescribed: Mapping[Node, Mapping[Node, Node]]
    directions: tuple[Node, ...]
    interface: tuple[Node, ...]
    fields: tuple[tuple[str, Node], ...]
    product: bool = False
    pseudo_load: bool = False
    fields_rate: bool = False
    adjoint_rate: bool = False
    derivatives: tuple[tuple[str, Node], ...] = ()
    example: tuple[tuple[str, float], ...] = ()
    tasks: tuple[str, ...] | None = None
    conditions: tuple[Condition, ...] = ()
    components: int = 2
    """Basis values of the interpolated field: value and derivative, on each side of a facet."""
    nodal: tuple[tuple[int, int], ...] = ()
    """First unknown and number of components of every field with unknowns at all nodes."""
    dof_nodes: tuple[tuple[str, int | None], ...] = ()
    """Of every unknown its name without number, and its node or None."""
    history: tuple[str, ...] = ()
    """Point data that the last fields are the new values of."""
    internal: tuple[str, ...] = ()
    """Unknowns of one element alone, which a study condenses."""
    functions: tuple[str, ...] = ()
    """Parameters that are addresses of C functions."""
    addresses: tuple[tuple[str, FunctionAddress], ...] = field(default=(), compare=False)
    """Those that the page knows itself."""
    point_rates: bool = False
    """Whether the second half of the point data says how the first moves along a variation."""
    cell: str = ""
    """The cell of a weak form, which could stand on another one, too."""
    varying: bool = field(default=False, compare=False)
    """Whether a parameter of the page is data of elements or points instead."""
    point: PointForm | None = field(default=None, compare=False)
    """The same model at a point, from which the kernel of the whole element can be made as well."""
    arrays: tuple[ArraySymbol, ...] = ()
    """Arrays of any length, the same for all elements of a call."""
    term_groups: tuple[tuple[str, ...], ...] = ()
    """Arrays of terms that stand in one sum, and so have equal lengths."""
    term_history: tuple[TermHistory, ...] = ()
    """Point data with one number for each term; new values are `term_updates`."""
    term_updates: tuple[Node, ...] = ()
    record: SympyTape = field(default_factory=SympyTape, repr=False, compare=False)
    """The model as written, by which kernels are checked; nothing is derived from it."""
    statements: tuple[Statement, ...] = field(default=(), repr=False, compare=False)
    """Named values and equations with their lines, for explanations; nothing is derived from it."""

    def __repr__(self) -> str:
        """Summary in one line."""
        unknowns = self.unknowns if len(self.unknowns) <= 6 else self.unknowns[:5]
        more = f", ... ({len(self.unknowns)})" if len(self.unknowns) > 6 else ""
        names = ", ".join(unknowns) or "none"
        return f"<Definition {self.name}: {self.nodes} nodes; unknowns: {names}{more}>"

    @property
    def coordinate_width(self) -> int:
        """Number of coordinates of one element, components times nodes."""
        return len(self.coordinates) * self.nodes

    @property
    def conservative(self) -> bool:
        """True if the residual is the gradient of the potential."""
        return not self.constant and not self.prescribed

    def for_derivatives(self) -> Definition:
        """Return the model from which derivatives of results are computed, along any variation.

        Returns
        -------
        Definition
            With the tasks `pseudo_load` and, if there are fields, `fields_rate`. Its point data are
            those of this model, then the rate of each.
        """
        rates = tuple(Argument(f"rate_{a.name}", f"rate of {a.name}") for a in self.point_data)
        return replace(
            self,
            point_data=(*self.point_data, *rates),
            point_rates=True,
            product=False,
            pseudo_load=True,
            fields_rate=bool(self.fields or self.term_updates),
            derivatives=(),
            tasks=(),
            point=self.point
            and replace(self.point, definition=self.point.definition.for_derivatives()),
        )

    def for_second_derivatives(self) -> Definition:
        """Return the model from which second derivatives of results are computed.

        Returns
        -------
        Definition
            With the task `adjoint_rate` and, if there are data of points, `point_adjoint_rate`. Its
            point data are those of this model, their rates, the adjoints of the history after the
            step, and the rates of these. Elements are compiled as a whole.
        """
        if self.term_history:
            name = self.term_history[0].name
            raise ModelError(
                f"{self.name} has history of each term, {name}: second derivatives of results know "
                "none; take differences of result.gradient",
            )
        prefixes = ("", "rate_", "adjoint_", "rate_adjoint_")
        return replace(
            self,
            point_data=tuple(
                Argument(f"{p}{a.name}", f"{p}{a.name}") for p in prefixes for a in self.point_data
            ),
            point_rates=True,
            product=False,
            pseudo_load=False,
            fields_rate=False,
            adjoint_rate=True,
            derivatives=(),
            tasks=(),
            point=None,
        )

    def for_values(self, names: tuple[str, ...]) -> Definition:
        """Return the model whose fields are values that the page names.

        Parameters
        ----------
        names : tuple of str
            Names of `Model.define` and `Model.probe`, those of a material also without its name.

        Returns
        -------
        Definition
            With the task `fields`. Elements are compiled as a whole.

        Raises
        ------
        ModelError
            The page has no such name.
        """
        return replace(
            self,
            fields=tuple((name, self._value(name)) for name in names),
            product=False,
            pseudo_load=False,
            fields_rate=False,
            derivatives=(),
            tasks=("fields",),
            history=(),
            term_updates=(),
            point=None,
        )

    def _value(self, name: str) -> Node:
        """Value that the page names.  Raises ModelError."""
        values = {s.name: s.value for s in self.statements if s.name}
        prefixed = [k for k in values if k.endswith(f"_{name}")]
        of_material = [k for k in prefixed if self.name.startswith(k[: -len(name)])]
        if name not in values and len(of_material) != 1:
            names = [k for k in values if not k.startswith(("parent_", "shape_"))]
            raise ModelError(f"{self.name} has no value {name!r}; it names {', '.join(names)}", "")
        return values[name if name in values else of_material[0]]

    @property
    def page_point_data(self) -> int:
        """Number of data of a point that the page has, without their rates and adjoints."""
        return len(self.point_data) // (4 if self.adjoint_rate else 2 if self.point_rates else 1)


def functions_of_user(d: Definition) -> dict[Node, ExternalFunction]:
    """Calls of C functions of the user in a model."""
    nodes = [n for pairs in d.prescribed.values() for n in pairs.values()]
    nodes += d.term_updates
    return external_functions([d.potential, *(n for _, n in d.fields), *nodes])
