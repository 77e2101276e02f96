"""The model of a page: declared symbols, named intermediates, one potential or weak form.

A model page declares its arguments, writes its mathematics in SymPy, and ends with `potential` or
`weak_form`.  Nothing is differentiated here; `codegen.pipeline` does that.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import sympy as sp

from softehl.codegen.abi import Task
from softehl.codegen.graph.differentiate import gradient
from softehl.codegen.graph.graph import Graph, Input, Node, Op
from softehl.codegen.graph.routines import (
    SYMMETRIC,
    Control,
    depends,
    isotropic,
    localise,
    newton,
    sums_written_out,
    symmetric,
)
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Argument, Condition, Definition
from softehl.codegen.language.elements import cells
from softehl.codegen.language.elements.quadrature import QuadratureRule
from softehl.codegen.language.entries import Entries, Listed, applied, fraction
from softehl.codegen.language.lower import Lowering, ModelError, page_line, warn_page
from softehl.codegen.language.names import named
from softehl.codegen.language.record import Integral, Record

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What a model may be called: it is part of the names of C functions."""
LONGEST = 200
"""Letters of the name of a model: file systems take 255, with `_design.c` and the like."""

__all__ = ["Argument", "Definition", "Model"]


def _columns(what: str, names: Sequence[str], columns: Sequence[Sequence[Any]]) -> list[Any]:
    """Lists over the nodes, one for each name."""
    inner = (Listed(c, f"the nodes of {n}") for n, c in zip(names, columns, strict=True))
    return Listed(inner, f"{what} ({', '.join(names)})")


class Model:
    """Builder of a `Definition`; every method declares or names something.

    The generator writes the loop over the points of `rule` out where that saves operations; the
    rule is then part of the kernel.  With unroll=False it never does, and `rule` is the default of
    a kernel that takes any; with unroll=True it always does.
    """

    def __init__(
        self,
        name: str,
        *,
        nodes: int,
        rule: QuadratureRule,
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
        wrong = self._foreign(rule, nodes)
        if wrong:
            raise ModelError(f"{name} has {nodes} nodes, and {wrong}")
        self.name, self.nodes, self.rule, self.unroll = name, nodes, rule, unroll
        self.doc = " ".join((doc or "").split())
        self.graph = Graph()
        self._bound: dict[sp.Symbol, Node] = {}
        self._symbols: dict[str, Any] = {}
        self._lower = Lowering(self.graph, self._bound)
        self._record = Record()
        self._coordinates: tuple[str, ...] = ()
        self._unknowns: list[str] = []
        self._interpolated: str | None = None
        self._components = 0
        self._directions: list[Node] = []
        self._nodal: list[tuple[int, int]] = []
        self._places: list[tuple[str, int | None]] = []
        self._history: list[tuple[str, Node]] = []
        self._internal: list[str] = []
        self._arguments: dict[str, list[Argument]] = {
            "parameters": [],
            "data": [],
            "point data": [],
        }
        self._interface: list[Node] = []
        self._given: dict[Node, dict[Node, Node]] = {}
        self._fields: list[tuple[str, Node]] = []
        self._potentials: list[tuple[Node, list[Node]]] = []
        self._factors = 0
        self._measures: set[Node] = set()
        self._gradients: set[Node] = set()
        self._product = False
        self._norms = 0
        self._design = (False, False)
        self._derivatives: list[tuple[str, Node]] = []
        self._example: dict[str, float] = {}
        self._conditions: list[Condition] = []
        self._tasks: tuple[str, ...] | None = None
        self._declared: dict[str, tuple[Node, str]] = {}

    def _foreign(self, rule: QuadratureRule, nodes: int) -> str:
        """Words on a rule of another cell than that of the nodes."""
        return cells.foreign(rule, nodes)

    # declarations -------------------------------------------------------------------------------

    def coordinates(self, *names: str) -> list[list[sp.Symbol]]:
        """Reference coordinates, any number of components: a list over the nodes for each."""
        if self._coordinates not in ((), names):
            raise ModelError(f"the coordinates are {', '.join(self._coordinates)} already")
        self._coordinates, width = names, len(names)
        places = range(self.nodes)
        columns = [
            [self._input(f"{name}{a + 1}", "coordinates", a * width + c) for a in places]
            for c, name in enumerate(names)
        ]
        return _columns("the coordinates", names, columns)

    def nodal_unknowns(
        self, *names: str, idle: Sequence[str] = (), nodes: int | None = None
    ) -> list[list[sp.Symbol]]:
        """Unknowns at the nodes, numbered node by node; one list for each component.

        The `idle` ones of `names` belong to the node but need not enter the mathematics. nodes:
        at the first so many nodes only, such as a pressure at the corners of a quadratic cell.
        """
        columns: list[list[sp.Symbol]] = [[] for _ in names]
        count = self.nodes if nodes is None else nodes
        if not 1 <= count <= self.nodes:
            raise ModelError(f"{names[0]}: nodes = {nodes}, must be 1 to {self.nodes}")
        if count == self.nodes:
            self._nodal.append((len(self._unknowns), len(names)))
        for a in range(count):
            for c, name in enumerate(names):
                columns[c].append(self.unknown(f"{name}{a + 1}"))
                self._places[-1] = (name, a)
                if name in idle:
                    self._declared.pop(f"{name}{a + 1}", None)
        return _columns("the unknowns", names, columns)

    def unknown(self, name: str) -> sp.Symbol:
        """One more scalar unknown of the element."""
        if self._interpolated:
            raise ModelError(f"declare {name} before the interpolated {self._interpolated}")
        symbol = self._input(name, "dofs", len(self._unknowns))
        self._unknowns.append(name)
        self._places.append((name, None))
        self._directions.append(self._bound[symbol])
        return symbol

    def internal(self, name: str, count: int | None = None) -> Any:
        """One unknown of an element, or a list of so many, called name_0, name_1, ...

        No other element knows them. A study condenses them from its equations exactly, keeps their
        values with the element, and has them in `result.fields`.
        """
        if count is None:
            return self._internal_unknowns([name])[0]
        if not (isinstance(count, int) and count > 0):
            raise ModelError(f"internal {name}: count = {count!r} must be an integer > 0")
        return self._internal_unknowns([f"{name}_{k}" for k in range(count)])

    def _internal_unknowns(self, names: Sequence[str]) -> list[sp.Symbol]:
        self._internal += names
        return Listed([self.unknown(name) for name in names], "the internal unknowns")

    def interpolated(self, name: str) -> tuple[sp.Symbol, sp.Symbol]:
        """Value and xi-derivative of a field with any number of element unknowns (`modes`).

        Each further field has modes of its own, which follow those of the fields before it.
        """
        return self.interpolated_sides(name)[0]

    def interpolated_sides(self, *names: str) -> list[tuple[sp.Symbol, sp.Symbol]]:
        """Value and xi-derivative of several fields that share the `modes` unknowns.

        An interior facet has two: the traces from its sides.  The basis holds both components
        of each field for every mode, zero where a mode belongs to another field.
        """
        before = self._components
        labels = [label for name in names for label in (name, f"{name}_xi")]
        for name in names:
            if name in self._symbols:
                raise ModelError(f"the name {name} is used twice in model {self.name}")
        self._interpolated = ", ".join([*filter(None, [self._interpolated]), *names])
        self._components += len(labels)
        xi = sp.Symbol("xi", real=True)
        symbols = []
        for k, label in enumerate(labels, start=before):
            node = self.graph.input("interpolated", k, varying=True)
            symbols.append(self._name(label, node, xi, known=False))
        for p, p_xi in zip(symbols[::2], symbols[1::2], strict=True):
            p.slope(xi, p_xi)
        self._directions.extend(self._bound[s] for s in symbols)
        return list(zip(symbols[::2], symbols[1::2], strict=True))

    def parameters(self, **meanings: str) -> list[sp.Symbol]:
        """Arguments that are the same for all elements of a call."""
        return self._declare("parameters", meanings)

    def data(self, **meanings: str) -> list[sp.Symbol]:
        """Arguments that differ from element to element."""
        return self._declare("data", meanings)

    def point_data(self, **meanings: str) -> list[sp.Symbol]:
        """Arguments that differ from quadrature point to point, e.g. history variables."""
        return self._declare("point data", meanings, varying=True)

    def nodal_data(
        self, *names: str, meaning: str = "at the nodes", nodes: int | None = None
    ) -> list[list[sp.Symbol]]:
        """Data at the (first) nodes: a list over the nodes for each name, data name1, name2, ...

        A study fills `u_old` (for an unknown u) with the values of the step before.
        """
        columns = []
        for name in names:
            given = {f"{name}{a + 1}": f"{name} {meaning}" for a in range(nodes or self.nodes)}
            columns.append(self._declare("data", given))
        return _columns("the data", names, columns)

    def rates(self, *names: str, order: int = 1) -> list[list[sp.Expr]]:
        """Time derivatives of nodal unknowns, in the order of `nodal_unknowns`.

        du/dt = rate u + u_rate, with the parameter `rate` and the data `u_rate` at the nodes;
        order=2: d2u/dt2 = acceleration u + u_acceleration. `Study.march` gives them.
        """
        coefficient, suffix = self._of_time(order)
        found = []
        for name in names:
            count = sum(n == name and a is not None for n, a in self._places)
            if not count:
                raise ModelError(f"rates: {name} is no unknown at the nodes")
            values = [sp.Symbol(f"{name}{a + 1}", real=True) for a in range(count)]
            label, words = f"{name}_{suffix}", "of the steps before"
            (rest,) = self.nodal_data(label, meaning=words, nodes=count)
            found.append([coefficient * u + v for u, v in zip(values, rest, strict=True)])
        return found

    def _of_time(self, order: int) -> tuple[sp.Symbol, str]:
        """Coefficient of a time derivative, and what the names of its data end in."""
        if order not in (1, 2):
            raise ModelError(f"rates of order {order!r}: allowed are 1 and 2")
        name, words = (("rate", "time derivative [1/s]"), ("acceleration", "second one [1/s^2]"))[
            order - 1
        ]
        known = {a.name: sp.Symbol(a.name, real=True) for a in self._arguments["parameters"]}
        if name not in known:
            (known[name],) = self.parameters(**{name: f"coefficient of the {words}"})
        return known[name], name

    def history(self, **new: Any) -> None:
        """Declare new values of `point_data` after a converged step: m.history(v_old=v).

        Each is a field of the kernel, named new_v_old.
        """
        known = [a.name for a in self._arguments["point data"]]
        for name, value in new.items():
            if name not in known:
                raise ModelError(
                    f"history: {name} is no point data; there are {', '.join(known) or 'none'}"
                )
            if name in [n for n, _ in self._history]:
                raise ModelError(f"history: {name} is given twice in model {self.name}")
            self._record.history.append((f"new_{name}", value))
            self._history.append((name, self._lower(value)))

    def require(self, *conditions: Any) -> None:
        """Require conditions on parameters and data, e.g. `mu > 0`; checked at every call.

        Each condition compares one parameter or datum with a number by <, <=, > or >=.
        """
        for c in conditions:
            known = [a.name for k in ("parameters", "data") for a in self._arguments[k]]
            if isinstance(c, sp.core.relational.Relational) and c.lhs.is_number:
                c = c.reversed
            fit = isinstance(
                c, (sp.StrictLessThan, sp.LessThan, sp.StrictGreaterThan, sp.GreaterThan)
            )
            if not fit or str(c.lhs) not in known or not c.rhs.is_number:
                raise ModelError(
                    f"require {c}: compare one parameter or datum with a number, e.g. mu > 0"
                )
            where = Path(page_line()).name
            self._conditions.append(Condition(str(c.lhs), c.rel_op, float(c.rhs), where))

    def point(self) -> list[sp.Symbol]:
        """Coordinates of the quadrature point in the parent element."""
        names = ("xi", "eta", "zeta")[: self.rule.dimension]
        point = [self._input(s, "rule", k, varying=True) for k, s in enumerate(names)]
        return Listed(point, "the point's coordinates")

    @property
    def weight(self) -> sp.Symbol:
        """Weight of the quadrature point."""
        return self._input("weight", "rule", self.rule.dimension, varying=True)

    # mathematics --------------------------------------------------------------------------------

    def define(
        self,
        name: str,
        expression: Any,
        *,
        interface: bool = False,
        derivative: Mapping[sp.Symbol, Any] | None = None,
    ) -> Any:
        """Name an intermediate (scalar or matrix); returns its symbol or matrix of symbols.

        A `interface` intermediate is one that derivatives are taken through.  `derivative` replaces
        the true derivative by given ones with respect to chosen symbols.
        """
        if isinstance(expression, sp.MatrixBase):
            if derivative is not None:
                raise ModelError(f"{name}: give the derivative of each entry, not of the matrix")
            rows, columns = expression.shape
            return sp.Matrix(
                rows,
                columns,
                lambda i, j: self.define(f"{name}_{i}{j}", expression[i, j], interface=interface),
            )
        node = self.graph.name(name, self._lower(expression))
        if interface:
            self._interface.append(node)
        if derivative is not None:
            self._given[node] = {self._lower(s): self._lower(e) for s, e in derivative.items()}
        return self._record.define(
            self._name(name, node, expression, given=derivative), sp.sympify(expression)
        )

    def norm(self, values: Any) -> Any:
        """Length of a scalar, list or matrix: the root of the sum of its squares.

        If it is zero, its first and second derivatives are zero too: a direction that does not
        exist contributes nothing.  (Of lengths below 1e-154 the squares are zero.)
        """
        self._norms += 1
        squares = sum(v**2 for v in Entries.of(values).values)
        square = self.define(f"norm_{self._norms}_squared", squares)
        return sp.Piecewise((sp.sqrt(square), square > 0), (sp.Integer(0), True))

    def implicit(
        self,
        name: str,
        equations: Callable[[Any], Any],
        *,
        start: Any,
        tolerance: float = 1e-10,
        size: float = 0.0,
        iterations: int = 25,
    ) -> Any:
        """Local unknowns s with equations(s) = 0, found by Newton's method inside the kernel.

        Equations that are integrals belong to the element: s is then one for all of its points
        (condensation), and the rule becomes part of the kernel.

        `start` is where the iteration begins: a scalar, a list, or a matrix, and s is alike; so is
        what `equations` returns.  Derivatives of s follow from the implicit function theorem,
        whatever the start.  The iteration ends when every equation is solved to `tolerance` of its
        own terms and a step changes every s_k by no more than `tolerance` (`size` + |s_k|), or by
        nothing but rounding; `size` is a magnitude of s_k below which it does not matter. The last
        step is taken, so that the error is of the order of its square.  Without success after
        `iterations` steps all outputs of the element are not-a-number.
        """
        begin, unknowns = Entries.of(start), Entries.of(start).map(lambda _: sp.Dummy(real=True))
        local = self._placeholders(name, unknowns)
        found = Entries.of(applied(name, equations, unknowns.shaped()))
        if len(found.values) != len(local):
            raise ModelError(
                f"{name}: {len(found.values)} equations for {len(local)} unknowns; one for each"
            )
        values = self._condensed(name, [self._lower(e) for e in found.values], local)
        system = localise(self.graph, values, local)
        if not (isinstance(iterations, int) and iterations > 0):
            raise ModelError(f"{name}: iterations = {iterations!r} must be an integer > 0")
        control = Control(fraction(tolerance), fraction(size, zero=True), iterations)
        routine = newton(self.graph, name, system, control)
        for k in range(len(local)):
            if all(row[k] is self.graph.zero for row in routine.by_local):
                raise ModelError(f"{name}: unknown {k} does not occur in the equations")
        args = [*system.external, *(self._lower(e) for e in begin.values)]
        below = [*found.values, *begin.values]
        solution = self._named(name, begin, self.graph.run(routine, args), below)
        self._record.implicit(
            found.values, unknowns.values, begin.values, Entries.of(solution).values
        )
        return solution

    def principal(self, name: str, C: Any, energy: Callable[[Any, Any, Any], Any]) -> sp.Symbol:
        """An isotropic energy of the principal stretches: energy(lambda_1, lambda_2, lambda_3).

        C is the symmetric right Cauchy-Green matrix, 3x3 (its upper triangle is read), the
        stretches are the roots of its eigenvalues, and `energy` must not change when they are
        exchanged.  First and second derivatives by C are exact also where stretches are equal.
        """
        if sp.Matrix(C).shape != (3, 3):
            raise ModelError(f"{name}: C has shape {sp.Matrix(C).shape}, must be (3, 3)")
        squares = Entries([sp.Dummy(positive=True) for _ in range(3)], ("", "", ""), list)
        local = self._placeholders(name, squares)
        written = applied(name, energy, *(sp.sqrt(c) for c in squares.values))
        value = self._lower(written)
        if not symmetric(value, local):
            raise ModelError(f"{name}: the energy changes when two stretches are exchanged")
        system = localise(self.graph, [value], local)
        routine = isotropic(name, 6 + len(system.external), system.values[0])
        args = [*(self._lower(C[i, j]) for i, j in SYMMETRIC), *system.external]
        node = self.graph.name(name, self.graph.run(routine, args)[0])
        symbol: sp.Symbol = self._record.principal(
            self._name(name, node, [*C, written], known=False), written, squares.values, C
        )
        return symbol

    def derivative(self, name: str, value: Any, by: Any) -> Any:
        """Derivatives of a scalar by one named symbol, a list or a matrix of them, e.g. P = dW/dF.

        The symbols are those of `define` or of arguments; all else is differentiated through.
        """
        symbols = Entries.of(by)
        sources = [self._lower(s) for s in symbols.values]
        root = self._lower(value)
        # at a point, a symbol that is the same for all points is differentiated by there too
        local = root.varying and not all(s.varying for s in sources)
        if local and any(n.op is Op.SUM for n in reachable([root], stop=sources.__contains__)):
            raise ModelError(f"{name}: {value} depends on an integral; give it a name of its own")
        slopes = gradient(self.graph, root, sources, given=self._given, flat=local)
        below = [value, *symbols.values]
        derivatives = self._named(name, symbols, [slopes[s] for s in sources], below)
        self._record.slopes(value, symbols.values, Entries.of(derivatives).values)
        return derivatives

    def integral(self, name: str, integrand: Any) -> sp.Symbol:
        """Quadrature of `integrand` over the parent element."""
        density = self._lower(integrand)
        inside = reachable([density], stop=self._gradients.__contains__)
        moves = any(n in self._directions for n in reachable([density]))
        if moves and self._measures and not self._measures & set(inside):
            warn_page(
                f"the integrand of {name} has no factor detJ: the sum is over the parent element; "
                "multiply by e.detJ"
            )
        node = self.graph.sum(self._lower(integrand * self.weight))
        symbol: sp.Symbol = self._record.define(
            self._name(name, node, integrand, known=False), Integral(integrand)
        )
        return symbol

    def measure(self, detJ: Any, gradients: Iterable[Any]) -> None:
        """Say what an integrand is multiplied by, and which names only divide by it.

        `kinematics` does; an integrand without such a factor is warned of.
        """
        self._measures.add(self._lower(detJ))
        self._gradients.update(self._lower(v) for v in gradients)

    def potential(self, expression: Any, *, constant: Iterable[Any] = ()) -> None:
        """The residual is the gradient of `expression` with the `constant` symbols frozen.

        Further potentials and weak forms add up.
        """
        constant = list(constant)
        self._record.potentials.append((expression, tuple(constant)))
        value, frozen = self._lower(expression), [self._lower(s) for s in constant]
        if value.varying:
            raise ModelError(
                f"the potential of {self.name} varies with the point: wrap it in integral(...)"
            )
        self._potentials.append((value, frozen))

    def weak_form(self, terms: Sequence[tuple[Any, Any]]) -> None:
        """Residual = integral of sum(factor * variation of varied) over (factor, varied).

        Further weak forms and potentials add up.
        """
        density = sp.Integer(0)
        frozen = []
        for factor, varied in terms:
            label = f"factor_{self._factors}"
            self._factors += 1
            frozen.append(self.define(label, factor, interface=True))
            density += frozen[-1] * varied
        work = f"virtual_work_{len(self._potentials)}" if self._potentials else "virtual_work"
        self.potential(self.integral(work, density), constant=frozen)

    def fields(self, **values: Any) -> None:
        """Quantities to be evaluated at the quadrature points; further calls add more."""
        for name, value in values.items():
            if name in [n for n, _ in self._fields]:
                raise ModelError(f"the field {name} is given twice in model {self.name}")
            self._record.fields.append((name, value))
            self._fields.append((name, self._lower(value)))

    def offer(
        self,
        *,
        tasks: Sequence[str] | None = None,
        product: bool = False,
        pseudo_load: bool = False,
        fields_rate: bool = False,
        derivatives: Sequence[Any] = (),
    ) -> None:
        """Choose what is generated: tasks by name, derivatives of the residual by argument.

        `tasks` are chosen among energy, residual, tangent (residual and tangent together), fields
        and product; left out, all but the product.  `product` adds the tangent times a vector.
        `pseudo_load` adds the derivative of the residual along a variation of coordinates, data
        and parameters, `fields_rate` that of the fields: for sensitivities of what a study
        computes.  `derivatives` lists symbols of parameters, data or coordinates.  Further calls
        add up.
        """
        known = [str(t) for t in Task if t not in (Task.PSEUDO_LOAD, Task.FIELDS_RATE)]
        self._design = self._design[0] or pseudo_load, self._design[1] or fields_rate
        for t in tasks or ():
            if t not in known:
                raise ModelError(f"no task {t!r}; there are {', '.join(known)}")
        if tasks is not None:
            self._tasks = (*(self._tasks or ()), *tasks)
        self._product |= product or Task.PRODUCT in (tasks or ())
        nodes = [(str(s), self._lower(s)) for s in derivatives]
        for name, n in nodes:
            source = n.payload.array if isinstance(n.payload, Input) else ""
            if source not in ("parameters", "data", "coordinates"):
                raise ModelError(f"{name} is no parameter, datum or coordinate to derive by")
        self._derivatives += [pair for pair in nodes if pair not in self._derivatives]

    def example(self, **values: float) -> None:
        """Values near which the model makes sense, by name; the check of its kernel starts there.

        Names of parameters, data, unknowns (`u_x1`) and coordinates (`X1`).  Values that are not
        named are about 1 (parameters, data), a few per cent (unknowns), the unit cell
        (coordinates).
        """
        unknown = set(values) - {str(s) for s, n in self._bound.items() if n.op is Op.INPUT}
        if unknown:
            raise ModelError(f"example: {', '.join(sorted(unknown))} is no argument of {self.name}")
        self._example.update({name: float(v) for name, v in values.items()})

    def finish(self) -> Definition:
        """The frozen definition of the model."""
        potential, constant = self._total()
        self._check_use(potential)
        chosen = self._tasks
        if chosen is not None and self._product:
            chosen = (*chosen, Task.PRODUCT)
        definition = Definition(
            name=self.name,
            doc=self.doc,
            nodes=self.nodes,
            coordinates=self._coordinates,
            unknowns=tuple(self._unknowns),
            interpolated=self._interpolated,
            parameters=tuple(self._arguments["parameters"]),
            data=tuple(self._arguments["data"]),
            point_data=tuple(self._arguments["point data"]),
            rule=self.rule,
            unroll=self.unroll,
            graph=self.graph,
            potential=potential,
            constant=constant,
            given=self._given,
            directions=tuple(self._directions),
            interface=tuple(self._interface),
            fields=(*self._fields, *((f"new_{name}", n) for name, n in self._history)),
            product=self._product,
            pseudo_load=self._design[0],
            fields_rate=self._design[1],
            derivatives=tuple(self._derivatives),
            example=tuple(self._example.items()),
            tasks=chosen,
            conditions=tuple(self._conditions),
            nodal=tuple(self._nodal),
            components=self._components or 2,
            places=tuple(self._places),
            history=tuple(name for name, _ in self._history),
            internal=tuple(self._internal),
            record=self._record,
        )

        chosen = chosen or ()
        if Task.ENERGY in chosen and not definition.conservative:
            raise ModelError(f"no energy for {self.name}: its residual is not the gradient of one")
        if any(self._design) and definition.given:
            raise ModelError(
                f"no pseudo_load or fields_rate for {self.name}: it gives derivatives of its own"
            )
        if definition.fields_rate and not definition.fields:
            raise ModelError(f"no fields_rate for {self.name}: it declares no fields")
        if Task.FIELDS in chosen and not definition.fields:
            raise ModelError(f"no task fields for {self.name}: it declares none")
        return definition

    def _total(self) -> tuple[Node, tuple[Node, ...]]:
        """The sum of all potentials and weak forms, and what is frozen in it."""
        if not self._potentials:
            raise ModelError(f"model {self.name} has neither a potential nor a weak form")
        total = self.graph.zero
        constant = dict.fromkeys(n for _, frozen in self._potentials for n in frozen)
        for value, frozen in self._potentials:
            total = self.graph.add(total, value)
            shared = set(constant) - set(frozen)
            # what lies below a frozen value is frozen with it
            met = [n for n in reachable([value], stop=frozen.__contains__) if n in shared]
            if met:
                label = next((str(s) for s, n in self._bound.items() if n is met[0]), "a value")
                raise ModelError(
                    f"{label} is constant in one potential of {self.name} and varies in another: "
                    f"freeze a name of its own, m.define('{label}_frozen', {label})"
                )
        return total, tuple(constant)

    def _check_use(self, potential: Node) -> None:
        """Every unknown enters the potential, every other argument it or a field."""
        given = [n for pairs in self._given.values() for n in (*pairs, *pairs.values())]
        equations = set(reachable([potential, *given]))
        used = equations | set(reachable([n for _, n in (*self._fields, *self._history)]))
        for name, (n, where) in self._declared.items():
            unknown = isinstance(n.payload, Input) and n.payload.array == "dofs"
            if n not in (equations if unknown else used):
                advice = "its residual is zero; is it idle?" if unknown else "leave it out"
                what = "unknown" if unknown else "argument"
                raise ModelError(f"the {what} {name} is never used: {advice}", where)

    # binding ------------------------------------------------------------------------------------

    def _condensed(self, name: str, values: list[Node], local: Sequence[Node]) -> list[Node]:
        """Equations of local unknowns with their integrals as sums of one term for each point."""
        inside = depends(values, local)
        sums = [n for n in inside if n.op is Op.SUM]
        if not sums:
            return values
        if self.unroll is False:
            raise ModelError(f"{name}: its equations are integrals, which need unroll=True or None")
        if any(v.varying for v in values):
            raise ModelError(
                f"{name}: an equation varies with the point and another holds an integral of the "
                "unknowns; wrap it in integral(...) too"
            )
        below = reachable(sums)
        arrays = {n.payload.array for n in below if isinstance(n.payload, Input) and n.varying}
        if arrays - {"rule"} or any(n in self._given for n in below):
            raise ModelError(
                f"{name}: an integral of local unknowns may hold no point data, no interpolated "
                "field and no given derivative; use m.unknown for what the element condenses"
            )
        self.unroll = True
        return sums_written_out(self.graph, values, inside, self.rule.rows())

    def _placeholders(self, name: str, symbols: Entries) -> list[Node]:
        """Inputs that stand for local unknowns while their equations are written."""
        nodes = [self.graph.input(f"local {name}", k) for k in range(len(symbols.values))]
        self._bound.update(zip(symbols.values, nodes, strict=True))
        return nodes

    def _named(self, name: str, like: Entries, nodes: Sequence[Node], below: list[Any]) -> Any:
        """Names for `nodes` that depend on `below`, arranged like other values."""
        labels = [name + suffix for suffix in like.suffixes]
        symbols = [
            self._name(label, self.graph.name(label, n), below, known=False)
            for label, n in zip(labels, nodes, strict=True)
        ]
        return Entries(symbols, like.suffixes, like.arrange).shaped()

    def _name(self, label: str, node: Node, value: Any, **how: Any) -> Any:
        """A name that SymPy differentiates through (`names.named`); the old one for an old node."""
        found = self._symbols.get(label)
        symbol = found if found is not None else named(label, value, **how)
        return self._bind(symbol, node)

    def _declare(
        self, array: str, meanings: Mapping[str, str], *, varying: bool = False
    ) -> list[sp.Symbol]:
        start = len(self._arguments[array])
        self._arguments[array] += [Argument(n, " ".join(m.split())) for n, m in meanings.items()]
        return [
            self._input(name, array, start + k, varying=varying) for k, name in enumerate(meanings)
        ]

    def _input(self, name: str, array: str, index: int, *, varying: bool = False) -> sp.Symbol:
        node = self.graph.input(array, index, varying=varying)
        symbol = self._bind(sp.Symbol(name, real=True), node)
        if array in ("dofs", "parameters", "data", "point data"):
            self._declared.setdefault(name, (node, page_line()))
        return symbol

    def _bind(self, symbol: Any, node: Node) -> Any:
        label = str(symbol)
        if self._bound.get(self._symbols.setdefault(label, symbol), node) is not node:
            raise ModelError(f"the name {label} is used twice in model {self.name}")
        self._bound[symbol] = node
        if isinstance(node.payload, Input):
            self._record.inputs[symbol] = (node.payload.array, node.payload.index)
        return symbol
