"""Builder of a model: its parts, and the frozen definition that they become.

`Symbols` map symbols to nodes of the graph. `Arguments` hold the declared arrays (coordinates,
unknowns, parameters, data), `Intermediates` the named values, lengths and derivatives, `Equations`
the integrals and potentials that add up to the residual, `Outputs` the fields, the new history and
the tasks that are generated. Each part knows the symbols and no other part.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from pathlib import Path
from typing import Any

import sympy as sp

from softehl.codegen.abi import Task
from softehl.codegen.elements import cells
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.graph import InputEntry, Node, Op
from softehl.codegen.graph.run_time_arrays import ArraySymbol
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language import local_unknowns
from softehl.codegen.language.definition import Argument, Condition, Definition, TermHistory
from softehl.codegen.language.errors import (
    ModelError,
    NoEquationsError,
    PointwiseError,
    page_line,
    warn_page,
)
from softehl.codegen.language.flatten import CheckedList, Entries, Matrix
from softehl.codegen.language.smooth_functions import SmoothFunctions
from softehl.codegen.language.sympy_lowering import Symbols
from softehl.codegen.language.sympy_tape import Integral
from softehl.codegen.language.tensor_functions import TensorFunctions
from softehl.function_address import FunctionAddress

_TIMES = (
    ("rate", "coefficient of the time derivative [1/s]"),
    ("acceleration", "coefficient of the second one [1/s^2]"),
)


_VARYING: ContextVar[tuple[tuple[str, str], ...]] = ContextVar("varying", default=())


@contextmanager
def varying_parameters(arrays: tuple[tuple[str, str], ...]) -> Iterator[None]:
    """Parameters of the models of this context are "data" or "point data", by name."""
    token = _VARYING.set(arrays)
    try:
        yield
    finally:
        _VARYING.reset(token)


class Arguments:
    """The arrays of one element: which names they hold, in which order, declared in which line.

    dof_nodes: of every unknown its name without number, and its node or None. nodal: first unknown
    and number of components of what has unknowns at all nodes. components: basis values of what is
    `interpolated`. directions: nodes of all that the potential is differentiated by. lists:
    parameters, data and point data. varying: parameters that are data or point data instead.
    """

    def __init__(self, symbols: Symbols, nodes: int) -> None:
        self._symbols, self._nodes = symbols, nodes
        self.coordinates: tuple[str, ...] = ()
        self.unknowns: list[str] = []
        self.dof_nodes: list[tuple[str, int | None]] = []
        self.nodal: list[tuple[int, int]] = []
        self.internal: list[str] = []
        self.interpolated: str | None = None
        self.components = 0
        self.directions: list[Node] = []
        self.lists: dict[str, list[Argument]] = {"parameters": [], "data": [], "point data": []}
        self.conditions: list[Condition] = []
        self.example: dict[str, float] = {}
        self.arrays: list[ArraySymbol] = []
        self.term_history: list[TermHistory] = []
        self.term_groups: dict[tuple[str, ...], None] = {}
        self.varying = dict(_VARYING.get())
        self._declared: dict[str, tuple[Node, str]] = {}
        self._idle: set[str] = set()

    # coordinates and unknowns -------------------------------------------------------------------

    def declare_coordinates(self, names: tuple[str, ...]) -> list[list[sp.Symbol]]:
        """A list over the nodes for each name."""
        if self.coordinates not in ((), names):
            raise ModelError(f"the coordinates are {', '.join(self.coordinates)} already")
        self.coordinates, width = names, len(names)
        node_range = range(self._nodes)
        columns = [
            [
                self._symbols.input(f"{name}{a + 1}", "coordinates", a * width + c)
                for a in node_range
            ]
            for c, name in enumerate(names)
        ]
        return _columns("the coordinates", names, columns)

    def nodal_unknowns(
        self, names: Sequence[str], idle: Sequence[str], nodes: int | None
    ) -> list[list[sp.Symbol]]:
        """Unknowns at all or the first nodes, numbered node by node; idle ones may be unused."""
        columns: list[list[sp.Symbol]] = [[] for _ in names]
        count = self._nodes if nodes is None else nodes
        if not 1 <= count <= self._nodes:
            raise ModelError(f"{names[0]}: nodes = {nodes}, must be 1 to {self._nodes}")
        if count == self._nodes:
            self.nodal.append((len(self.unknowns), len(names)))
        for a in range(count):
            for c, name in enumerate(names):
                columns[c].append(self.unknown(f"{name}{a + 1}"))
                self.dof_nodes[-1] = (name, a)
                if name in idle:
                    self._idle.add(name)
                    self._declared.pop(f"{name}{a + 1}", None)
        return _columns("the unknowns", names, columns)

    def unknown(self, name: str) -> sp.Symbol:
        """One more scalar unknown of the element."""
        if self.interpolated:
            raise ModelError(f"declare {name} before the interpolated {self.interpolated}")
        symbol = self._input(name, "dofs", len(self.unknowns))
        self.unknowns.append(name)
        self.dof_nodes.append((name, None))
        self.directions.append(self._symbols.bound[symbol])
        return symbol

    def interpolated_sides(self, names: Sequence[str]) -> list[tuple[sp.Symbol, sp.Symbol]]:
        """Value and xi-derivative of several fields that share the `modes` unknowns."""
        previous, symbols = self.components, []
        labels = [label for name in names for label in (name, f"{name}_xi")]
        for name in names:
            if name in self._symbols:
                raise ModelError(f"the name {name} is used twice in model {self._symbols.model}")
        self.interpolated = ", ".join([*filter(None, [self.interpolated]), *names])
        self.components += len(labels)
        xi = sp.Symbol("xi", real=True)
        for k, label in enumerate(labels, start=previous):
            node = self._symbols.graph.input("interpolated", k, varying=True)
            symbols.append(self._symbols.name(label, node, xi, has_definition=False))
        for p, p_xi in zip(symbols[::2], symbols[1::2], strict=True):
            p.slope(xi, p_xi)
        self.directions.extend(self._symbols.bound[s] for s in symbols)
        return list(zip(symbols[::2], symbols[1::2], strict=True))

    # parameters and data ------------------------------------------------------------------------

    def declare(
        self, array: str, meanings: Mapping[str, str], *, varying: bool = False
    ) -> list[sp.Symbol]:
        """Entries at the end of one of the `lists`."""
        start = len(self.lists[array])
        self.lists[array] += [Argument(n, " ".join(m.split())) for n, m in meanings.items()]
        return [
            self._input(name, array, start + k, varying=varying) for k, name in enumerate(meanings)
        ]

    def array(self, record: ArraySymbol) -> tuple[int, sp.Symbol]:
        """Number of a run-time array, declared once, and the amount of its variation."""
        named = [k for k, a in enumerate(self.arrays) if a.name == record.name]
        number = named[0] if named else len(self.arrays)
        if named and self.arrays[number].layout != record.layout:
            raise ModelError(
                f"{record.name} is declared already, as {self.arrays[number].layout}: say the same "
                f"here, not {record.layout}, or take another name"
            )
        if not named:
            self.arrays.append(record)
        amount = self._input(f"variation of {record.name}", "arrays", number)
        return number, amount

    def point_array(self, record: TermHistory, *, varying: bool) -> tuple[int, sp.Symbol]:
        """Number of a history with one number for each term, and the amount of its variation."""
        used = [*(a.name for a in self.arrays), *(h.name for h in self.term_history)]
        if record.name in used:
            raise ModelError(f"the name {record.name} is used twice for arrays: rename one")
        self.term_history.append(record)
        number = len(self.term_history) - 1
        label = f"variation of {record.name}"
        return number, self._input(label, "term history", number, varying=varying)

    def nodal_data(
        self, names: Sequence[str], meaning: str, nodes: int | None
    ) -> list[list[sp.Symbol]]:
        """Data at all or the first nodes."""
        columns = []
        for name in names:
            meanings = {f"{name}{a + 1}": f"{name} {meaning}" for a in range(nodes or self._nodes)}
            columns.append(self.declare("data", meanings))
        return _columns("the data", names, columns)

    def rates(self, names: Sequence[str], order: int) -> list[list[sp.Expr]]:
        """Time derivatives of nodal unknowns: coefficient times unknown plus data."""
        coefficient, suffix = self.of_time(order)
        result = []
        for name in names:
            count = sum(n == name and a is not None for n, a in self.dof_nodes)
            if not count:
                raise ModelError(f"rates: {name} is no unknown at the nodes")
            values = [sp.Symbol(f"{name}{a + 1}", real=True) for a in range(count)]
            (offset,) = self.nodal_data([f"{name}_{suffix}"], "of the steps before", count)
            if name in self._idle:
                for unused in (str(coefficient), *map(str, offset)):
                    self._declared.pop(unused, None)
            result.append([coefficient * u + v for u, v in zip(values, offset, strict=True)])
        return result

    def of_time(self, order: int) -> tuple[sp.Symbol, str]:
        """Coefficient of a time derivative, and what the names of its data end in."""
        if order not in (1, 2):
            raise ModelError(f"rates of order {order!r}: allowed are 1 and 2")
        name, meaning = _TIMES[order - 1]
        if name in self.names("parameters"):
            return sp.Symbol(name, real=True), name
        (coefficient,) = self.declare("parameters", {name: meaning})
        return coefficient, name

    def names(self, *arrays: str) -> list[str]:
        """Names in some of the `lists`."""
        return [a.name for array in arrays for a in self.lists[array]]

    def require(self, conditions: Iterable[Any]) -> None:
        """Conditions on parameters and data, with the line of the model."""
        declared = [*self.names("parameters", "data"), *self.varying]
        for c in conditions:
            if isinstance(c, sp.core.relational.Relational) and c.lhs.is_number:
                c = c.reversed
            fit = isinstance(
                c, (sp.StrictLessThan, sp.LessThan, sp.StrictGreaterThan, sp.GreaterThan)
            )
            if not fit or str(c.lhs) not in declared or not c.rhs.is_number:
                raise ModelError(
                    f"require {c}: compare one parameter or datum with a number, e.g. mu > 0"
                )
            where = Path(page_line()).name
            self.conditions.append(Condition(str(c.lhs), c.rel_op, float(c.rhs), where))

    @property
    def moved(self) -> bool:
        """True if a parameter is data instead."""
        return any(name in self.names("data", "point data") for name in self.varying)

    # checks -------------------------------------------------------------------------------------

    def set_example(self, values: Mapping[str, float]) -> None:
        """Values near which the model makes sense."""
        unknown = set(values) - self._symbols.inputs()
        if unknown:
            names = ", ".join(sorted(unknown))
            raise ModelError(f"example: {names} is no argument of {self._symbols.model}")
        self.example.update({name: float(v) for name, v in values.items()})

    def check_use(self, equations: set[Node], used: set[Node], unused: str) -> None:
        """Every unknown enters the equations, every other argument is used somewhere.

        unused: advice on unknowns.
        """
        for name, (n, where) in self._declared.items():
            unknown = isinstance(n.payload, InputEntry) and n.payload.array == "dofs"
            if n not in (equations if unknown else used):
                what, advice = ("unknown", unused) if unknown else ("argument", "leave it out")
                name = name.removeprefix("variation of ")
                raise ModelError(f"the {what} {name} is never used: {advice}", where)

    def _input(self, name: str, array: str, index: int, *, varying: bool = False) -> sp.Symbol:
        symbol = self._symbols.input(name, array, index, varying=varying)
        self._declared.setdefault(name, (self._symbols.bound[symbol], page_line()))
        return symbol


def _columns(what: str, names: Sequence[str], columns: Sequence[Sequence[Any]]) -> list[Any]:
    """Lists over the nodes, one for each name."""
    inner = (CheckedList(c, f"the nodes of {n}") for n, c in zip(names, columns, strict=True))
    return CheckedList(inner, f"{what} ({', '.join(names)})")


class Equations:
    """Potentials with their frozen quantities, and the measures of their integrals."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self._potentials: list[tuple[Node, list[Node]]] = []
        self._factors = 0
        self._measures: set[Node] = set()
        self._gradients: set[Node] = set()

    def numbered(self, label: str) -> str:
        """A label for the next factor of a weak form."""
        self._factors += 1
        return f"{label}_{self._factors - 1}"

    def label_of_work(self) -> str:
        """A label for the integral of the next weak form."""
        return f"virtual_work_{len(self._potentials)}" if self._potentials else "virtual_work"

    def measure(self, detJ: Any, gradients: Iterable[Any]) -> None:
        """Note what an integrand is multiplied by, and which names only divide by it."""
        self._measures.add(self._symbols.lower(detJ))
        self._gradients.update(self._symbols.lower(v) for v in gradients)

    def integral(
        self, name: str, integrand: Any, weight: sp.Symbol, directions: Sequence[Node]
    ) -> sp.Symbol:
        """Sum of `integrand` times `weight` over the points.

        It is warned of if it moves with `directions` and has no measure.
        """
        symbols = self._symbols
        density = symbols.lower(integrand)
        inside = reachable([density], stop=self._gradients.__contains__)
        moves = any(n in directions for n in reachable([density]))
        if moves and self._measures and not self._measures & set(inside):
            warn_page(
                f"the integrand of {name} has no factor detJ: the sum is over the parent element; "
                "multiply by e.detJ"
            )
        node = symbols.graph.sum(symbols.lower(integrand * weight))
        symbol: sp.Symbol = symbols.record.define(
            symbols.name(name, node, integrand, has_definition=False), Integral(integrand)
        )
        return symbol

    def potential(self, expression: Any, constant: Iterable[Any]) -> None:
        """One more term of the potential, with the symbols that are frozen in it."""
        constant, symbols = list(constant), self._symbols
        symbols.record.potentials.append((expression, tuple(constant)))
        value, frozen = symbols.lower(expression), [symbols.lower(s) for s in constant]
        symbols.state("", value)
        if value.varying:
            raise PointwiseError(
                f"the potential of {symbols.model} varies with the point: wrap it in integral(...)"
            )
        self._potentials.append((value, frozen))

    def total(self) -> tuple[Node, tuple[Node, ...]]:
        """Sum of all potentials and weak forms, and its frozen quantities."""
        model = self._symbols.model
        if not self._potentials:
            raise NoEquationsError(f"model {model} has neither a potential nor a weak form")
        total = self._symbols.graph.zero
        constant = dict.fromkeys(n for _, frozen in self._potentials for n in frozen)
        for value, frozen in self._potentials:
            total = self._symbols.graph.add(total, value)
            shared = set(constant) - set(frozen)
            # what lies below a frozen value is frozen with it
            met = [n for n in reachable([value], stop=frozen.__contains__) if n in shared]
            if met:
                label = self._symbols.label_of(met[0]) or "a value"
                raise ModelError(
                    f"{label} is constant in one potential of {model} and varies in another: "
                    f"freeze a name of its own, m.define('{label}_frozen', {label})"
                )
        return total, tuple(constant)


class Intermediates:
    """Names for values. interface: those that derivatives are taken through.

    prescribed: derivatives that a model gives instead of the true ones.
    """

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self.interface: list[Node] = []
        self.prescribed: dict[Node, dict[Node, Node]] = {}
        self._norms = 0

    def define(
        self,
        name: str,
        expression: Any,
        *,
        interface: bool = False,
        derivative: Mapping[sp.Symbol, Any] | None = None,
    ) -> Any:
        """Name of a scalar, or a matrix of names."""
        if isinstance(expression, sp.MatrixBase):
            if derivative is not None:
                raise ModelError(f"{name}: give the derivative of each entry, not of the matrix")
            rows, columns = expression.shape
            return Matrix(
                rows,
                columns,
                lambda i, j: self.define(f"{name}_{i}{j}", expression[i, j], interface=interface),
            )
        symbols, lower = self._symbols, self._symbols.lower
        node = symbols.graph.name(name, lower(expression))
        if interface:
            self.interface.append(node)
        if derivative is not None:
            self.prescribed[node] = {lower(s): lower(e) for s, e in derivative.items()}
        return symbols.record.define(
            symbols.name(name, node, expression, prescribed=derivative), sp.sympify(expression)
        )

    def norm(self, values: Any) -> Any:
        """Name of the root of the sum of squares.

        Its derivatives are zero where it is zero. `graph.length_derivatives` has those of functions
        of it.
        """
        self._norms += 1
        squares = sum(v**2 for v in Entries.of(values).values)
        square = self.define(f"norm_{self._norms}_squared", squares)
        root = sp.Piecewise((sp.sqrt(square), square > 0), (sp.Integer(0), True))
        return self.define(f"norm_{self._norms}", root)

    def derivative(self, name: str, value: Any, by: Any) -> Any:
        """Names of the derivatives of a scalar, arranged like `by`.

        Entries of a matrix that are one symbol share its derivative, so that dW = P_ij dF_ij.
        """
        symbols = Entries.of(by)
        lower = self._symbols.lower
        sources = [lower(s) for s in symbols.values]
        root = lower(value)
        # at a point, a symbol that is the same for all points is differentiated by there too
        local = root.varying and not all(s.varying for s in sources)
        if local and any(n.op is Op.SUM for n in reachable([root], stop=sources.__contains__)):
            raise ModelError(f"{name}: {value} depends on an integral; give it a name of its own")
        by_source = gradient(
            self._symbols.graph, root, sources, prescribed=self.prescribed, flat=local
        )
        below = [value, *symbols.values]
        matrix = isinstance(by, sp.MatrixBase)
        times = [sources.count(s) if matrix else 1 for s in sources]
        graph = self._symbols.graph
        parts = [
            graph.mul(graph.const(Fraction(1, n)), by_source[s])
            for s, n in zip(sources, times, strict=True)
        ]
        derivatives = self._symbols.named(name, symbols, parts, below)
        named = Entries.of(derivatives).values
        self._symbols.record.derivatives(value, symbols.values, named, times)
        return derivatives


class Outputs:
    """Fields, new history and chosen tasks; tasks None: all but the product."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self.fields: list[tuple[str, Node]] = []
        self.history: list[tuple[str, Node]] = []
        self.derivatives: list[tuple[str, Node]] = []
        self._updates: dict[str, Node] = {}
        self.product = self.pseudo_load = self.fields_rate = False
        self._tasks: tuple[str, ...] | None = None
        self._probes: set[str] = set()

    @property
    def renewed(self) -> list[Node]:
        """New values of history of terms."""
        return list(self._updates.values())

    @property
    def tasks(self) -> tuple[str, ...] | None:
        """Selected tasks, with the product if it is requested."""
        if self._tasks is not None and self.product:
            return (*self._tasks, Task.PRODUCT)
        return self._tasks

    @property
    def evaluated(self) -> tuple[tuple[str, Node], ...]:
        """All fields; the last ones are the new history."""
        return (*self.fields, *((f"new_{name}", n) for name, n in self.history))

    def add_fields(self, values: Mapping[str, Any]) -> None:
        """Quantities at the quadrature points."""
        for name, value in values.items():
            if name in [n for n, _ in self.fields]:
                raise ModelError(f"the field {name} is given twice in model {self._symbols.model}")
            self._symbols.record.fields.append((name, value))
            self.fields.append((name, self._symbols.lower(value)))
            self._symbols.state(name, self.fields[-1][1])

    def add_term_history(self, new: Mapping[str, Node]) -> None:
        """New values of history with one number for each term."""
        for name in new.keys() & self._updates.keys():
            raise ModelError(f"history: {name} is given twice in model {self._symbols.model}")
        self._updates.update(new)

    def term_updates(self, history: Sequence[TermHistory]) -> tuple[Node, ...]:
        """New values of all history of terms, which must be there."""
        for h in history:
            if h.name not in self._updates:
                raise ModelError(
                    f"{h.name} is never renewed: m.history({h.name}=m.each(..., lambda ...: new))"
                )
        return tuple(self._updates[h.name] for h in history)

    def add_history(self, new: Mapping[str, Any], declared: Sequence[str]) -> None:
        """New values of some of the `declared` point data."""
        for name, value in new.items():
            if name not in declared:
                raise ModelError(
                    f"history: {name} is no point data; there are {', '.join(declared) or 'none'}"
                )
            if name in [n for n, _ in self.history]:
                raise ModelError(f"history: {name} is given twice in model {self._symbols.model}")
            self._symbols.record.history.append((f"new_{name}", value))
            self.history.append((name, self._symbols.lower(value)))
            self._symbols.state(f"new_{name}", self.history[-1][1])

    def probe(self, name: str, value: Any) -> Any:
        """Note a value for explanations; returns it."""
        if isinstance(value, sp.MatrixBase):
            for i in range(value.rows):
                for j in range(value.cols):
                    self.probe(f"{name}_{i}{j}", value[i, j])
            return value
        if name in self._symbols or name in self._probes:
            raise ModelError(f"probe: the name {name} is used twice in model {self._symbols.model}")
        self._probes.add(name)
        self._symbols.state(name, self._symbols.lower(value))
        return value

    def choose(self, tasks: Sequence[str] | None, *, product: bool) -> None:
        """Add tasks by name."""
        allowed = [str(t) for t in Task if t not in (Task.PSEUDO_LOAD, Task.FIELDS_RATE)]
        for t in tasks or ():
            if t not in allowed:
                raise ModelError(f"no task {t!r}; there are {', '.join(allowed)}")
        if tasks is not None:
            self._tasks = (*(self._tasks or ()), *tasks)
        self.product |= product or Task.PRODUCT in (tasks or ())

    def derive_by(self, symbols: Sequence[Any]) -> None:
        """Add derivatives of the residual by parameters, data or coordinates."""
        nodes = [(str(s), self._symbols.lower(s)) for s in symbols]
        for name, n in nodes:
            source = n.payload.array if isinstance(n.payload, InputEntry) else ""
            if source not in ("parameters", "data", "coordinates"):
                raise ModelError(f"{name} is no parameter, datum or coordinate to derive by")
        self.derivatives += [pair for pair in nodes if pair not in self.derivatives]


def check(definition: Definition) -> None:
    """Check that a finished model has what its tasks need.  Raises ModelError where not."""
    name, tasks = definition.name, definition.tasks or ()
    if Task.ENERGY in tasks and not definition.conservative:
        raise ModelError(f"no energy for {name}: its residual is not the gradient of one")
    if (definition.pseudo_load or definition.fields_rate) and definition.prescribed:
        raise ModelError(
            f"no pseudo_load or fields_rate for {name}: it gives derivatives of its own"
        )
    if definition.fields_rate and not (definition.fields or definition.term_updates):
        raise ModelError(f"no fields_rate for {name}: it declares no fields")
    if Task.FIELDS in tasks and not (definition.fields or definition.term_updates):
        raise ModelError(f"no task fields for {name}: it declares none")


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What a model may be called: it is part of the names of C functions."""
LONGEST = 200
"""Letters of the name of a model: file systems take 255, with `_design.c` and the like."""


class ModelBuilder:
    """Owner of the parts of a model; `Model` adds the user's methods."""

    _unused = 'its residual is zero; if that is meant, say idle=["..."] in m.nodal_unknowns'

    def __init__(
        self,
        name: str,
        *,
        nodes: int,
        rule: QuadratureRule | None = None,
        unroll: bool | None = None,
        doc: str | None = "",
    ) -> None:
        if not NAME.fullmatch(name):
            raise ModelError(
                f"a model is called {name!r}; use letters, digits and underscores, a letter first"
            )
        if len(name) > LONGEST:
            raise ModelError(
                f"the name {name[:20]}... of a model has {len(name)} letters, allowed are {LONGEST}"
            )
        if rule is None:
            raise ModelError(
                f"{name} has no rule: give rule=quadrature.gauss(2, 2), say, or "
                "rule=quadrature.point_rule() where there is no integral"
            )
        mismatch = self._foreign(rule, nodes)
        if mismatch:
            raise ModelError(f"{name} has {nodes} nodes, and {mismatch}")
        self.name, self.nodes, self.rule, self.unroll = name, nodes, rule, unroll
        self.doc = " ".join((doc or "").split())
        self._symbols = Symbols(name)
        self.graph, self._lower = self._symbols.graph, self._symbols.lower
        self._arguments = Arguments(self._symbols, nodes)
        self._intermediates = Intermediates(self._symbols)
        self._tensors = TensorFunctions(self._symbols)
        self._smooth = SmoothFunctions(self._symbols, self._intermediates.define)
        self._equations = Equations(self._symbols)
        self._outputs = Outputs(self._symbols)
        self._functions: dict[str, Node] = {}
        self._addresses: dict[str, FunctionAddress] = {}

    def _foreign(self, rule: QuadratureRule, nodes: int) -> str:
        """Words on a rule of another cell than that of the nodes."""
        return cells.foreign(rule, nodes)

    def finish(self) -> Definition:
        """Return the definition of the model.

        Returns
        -------
        Definition
            The model, for `softehl.load_kernel` and `Study.add`.

        Raises
        ------
        ModelError
            The model has no residual, or declares something that it does not use.
        """
        potential, constant = self._equations.total()
        self._check_use(potential)
        a, o = self._arguments, self._outputs
        definition = Definition(
            name=self.name,
            doc=self.doc,
            nodes=self.nodes,
            coordinates=a.coordinates,
            unknowns=tuple(a.unknowns),
            interpolated=a.interpolated,
            parameters=tuple(a.lists["parameters"]),
            data=tuple(a.lists["data"]),
            point_data=tuple(a.lists["point data"]),
            varying=a.moved,
            rule=self.rule,
            unroll=self.unroll,
            graph=self.graph,
            potential=potential,
            constant=constant,
            prescribed=self._intermediates.prescribed,
            directions=tuple(a.directions),
            interface=tuple(self._intermediates.interface),
            fields=o.evaluated,
            product=o.product,
            pseudo_load=o.pseudo_load,
            fields_rate=o.fields_rate,
            derivatives=tuple(o.derivatives),
            example=tuple(a.example.items()),
            tasks=o.tasks,
            conditions=tuple(a.conditions),
            nodal=tuple(a.nodal),
            components=a.components or 2,
            dof_nodes=tuple(a.dof_nodes),
            history=tuple(name for name, _ in o.history),
            internal=tuple(a.internal),
            arrays=tuple(a.arrays),
            term_groups=tuple(a.term_groups),
            term_history=tuple(a.term_history),
            term_updates=self._outputs.term_updates(a.term_history),
            functions=tuple(self._functions),
            addresses=tuple(self._addresses.items()),
            record=self._symbols.record,
            statements=tuple(self._symbols.statements),
        )
        check(definition)
        return definition

    def _check_use(self, potential: Node) -> None:
        """Every unknown enters the potential, every other argument it or a field."""
        prescribed = [
            n
            for pairs in self._intermediates.prescribed.values()
            for n in (*pairs, *pairs.values())
        ]
        equations = set(reachable([potential, *prescribed]))
        renewed = self._outputs.renewed
        used = equations | set(reachable([*(n for _, n in self._outputs.evaluated), *renewed]))
        self._arguments.check_use(equations, used, self._unused)

    def _address(self, function: str, at: FunctionAddress | None) -> Node:
        """Parameter that is the address of a C function, which calls of it share; at: its value."""
        if at is not None and self._addresses.setdefault(function, at) != at:
            raise ModelError(f"{function} is another C function already: say function=... of one")
        if function not in self._functions:
            (symbol,) = self._arguments.declare("parameters", {function: "address of a C function"})
            self._functions[function] = self._symbols.bound[symbol]
        return self._functions[function]

    def _condensed(self, name: str, values: list[Node], unknowns: list[Node]) -> list[Node]:
        """Equations of local unknowns; integrals of these, and with them the loop, written out."""
        if not local_unknowns.contain_integrals(values, unknowns):
            return values
        if self.unroll is False:
            raise ModelError(f"{name}: its equations are integrals, which need unroll=True or None")
        prescribed = self._intermediates.prescribed
        written = local_unknowns.written_out(
            self.graph, name, values, unknowns, prescribed, self.rule
        )
        self.unroll = True
        return written
