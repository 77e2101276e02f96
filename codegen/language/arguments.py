"""Arguments of a model: coordinates, unknowns, parameters and data, as a page declares them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import sympy as sp

from softehl.codegen.graph.graph import Input, Node
from softehl.codegen.language.complaints import ModelError, page_line
from softehl.codegen.language.definition import Argument, Condition
from softehl.codegen.language.entries import Listed
from softehl.codegen.language.symbols import Symbols

_TIMES = (
    ("rate", "coefficient of the time derivative [1/s]"),
    ("acceleration", "coefficient of the second one [1/s^2]"),
)


class Arguments:
    """The arrays of one element: which names they hold, in which order, declared in which line.

    places: of every unknown its name without number, and its node or None. nodal: first unknown and
    number of components of what has unknowns at all nodes. components: basis values of what is
    `interpolated`. directions: nodes of all that the potential is differentiated by. lists:
    parameters, data and point data.
    """

    def __init__(self, symbols: Symbols, nodes: int) -> None:
        self._symbols, self._nodes = symbols, nodes
        self.coordinates: tuple[str, ...] = ()
        self.unknowns: list[str] = []
        self.places: list[tuple[str, int | None]] = []
        self.nodal: list[tuple[int, int]] = []
        self.internal: list[str] = []
        self.interpolated: str | None = None
        self.components = 0
        self.directions: list[Node] = []
        self.lists: dict[str, list[Argument]] = {"parameters": [], "data": [], "point data": []}
        self.conditions: list[Condition] = []
        self.example: dict[str, float] = {}
        self._declared: dict[str, tuple[Node, str]] = {}
        self._idle: set[str] = set()

    # coordinates and unknowns -------------------------------------------------------------------

    def declare_coordinates(self, names: tuple[str, ...]) -> list[list[sp.Symbol]]:
        """A list over the nodes for each name."""
        if self.coordinates not in ((), names):
            raise ModelError(f"the coordinates are {', '.join(self.coordinates)} already")
        self.coordinates, width = names, len(names)
        places = range(self._nodes)
        columns = [
            [self._symbols.input(f"{name}{a + 1}", "coordinates", a * width + c) for a in places]
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
                self.places[-1] = (name, a)
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
        self.places.append((name, None))
        self.directions.append(self._symbols.bound[symbol])
        return symbol

    def interpolated_sides(self, names: Sequence[str]) -> list[tuple[sp.Symbol, sp.Symbol]]:
        """Value and xi-derivative of several fields that share the `modes` unknowns."""
        before, symbols = self.components, []
        labels = [label for name in names for label in (name, f"{name}_xi")]
        for name in names:
            if name in self._symbols:
                raise ModelError(f"the name {name} is used twice in model {self._symbols.model}")
        self.interpolated = ", ".join([*filter(None, [self.interpolated]), *names])
        self.components += len(labels)
        xi = sp.Symbol("xi", real=True)
        for k, label in enumerate(labels, start=before):
            node = self._symbols.graph.input("interpolated", k, varying=True)
            symbols.append(self._symbols.name(label, node, xi, known=False))
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

    def nodal_data(
        self, names: Sequence[str], meaning: str, nodes: int | None
    ) -> list[list[sp.Symbol]]:
        """Data at all or the first nodes."""
        columns = []
        for name in names:
            given = {f"{name}{a + 1}": f"{name} {meaning}" for a in range(nodes or self._nodes)}
            columns.append(self.declare("data", given))
        return _columns("the data", names, columns)

    def rates(self, names: Sequence[str], order: int) -> list[list[sp.Expr]]:
        """Time derivatives of nodal unknowns: coefficient times unknown plus data."""
        coefficient, suffix = self.of_time(order)
        found = []
        for name in names:
            count = sum(n == name and a is not None for n, a in self.places)
            if not count:
                raise ModelError(f"rates: {name} is no unknown at the nodes")
            values = [sp.Symbol(f"{name}{a + 1}", real=True) for a in range(count)]
            (rest,) = self.nodal_data([f"{name}_{suffix}"], "of the steps before", count)
            if name in self._idle:
                for unused in (str(coefficient), *map(str, rest)):
                    self._declared.pop(unused, None)
            found.append([coefficient * u + v for u, v in zip(values, rest, strict=True)])
        return found

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
        """Conditions on parameters and data, with the line of the page."""
        known = self.names("parameters", "data")
        for c in conditions:
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
            self.conditions.append(Condition(str(c.lhs), c.rel_op, float(c.rhs), where))

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
            unknown = isinstance(n.payload, Input) and n.payload.array == "dofs"
            if n not in (equations if unknown else used):
                what, advice = ("unknown", unused) if unknown else ("argument", "leave it out")
                raise ModelError(f"the {what} {name} is never used: {advice}", where)

    def _input(self, name: str, array: str, index: int, *, varying: bool = False) -> sp.Symbol:
        symbol = self._symbols.input(name, array, index, varying=varying)
        self._declared.setdefault(name, (self._symbols.bound[symbol], page_line()))
        return symbol


def _columns(what: str, names: Sequence[str], columns: Sequence[Sequence[Any]]) -> list[Any]:
    """Lists over the nodes, one for each name."""
    inner = (Listed(c, f"the nodes of {n}") for n, c in zip(names, columns, strict=True))
    return Listed(inner, f"{what} ({', '.join(names)})")
