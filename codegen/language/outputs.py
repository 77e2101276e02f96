"""Outputs of a model beside its residual: fields, new history, and the tasks that are generated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from softehl.codegen.abi import Task
from softehl.codegen.graph.graph import Input, Node
from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.symbols import Symbols


class Outputs:
    """Fields, new history and chosen tasks; tasks None: all but the product."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self.fields: list[tuple[str, Node]] = []
        self.history: list[tuple[str, Node]] = []
        self.derivatives: list[tuple[str, Node]] = []
        self.product = self.pseudo_load = self.fields_rate = False
        self._tasks: tuple[str, ...] | None = None

    @property
    def tasks(self) -> tuple[str, ...] | None:
        """The chosen tasks, with the product where it is asked for beside them."""
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

    def add_history(self, new: Mapping[str, Any], known: Sequence[str]) -> None:
        """New values of some of the `known` point data."""
        for name, value in new.items():
            if name not in known:
                raise ModelError(
                    f"history: {name} is no point data; there are {', '.join(known) or 'none'}"
                )
            if name in [n for n, _ in self.history]:
                raise ModelError(f"history: {name} is given twice in model {self._symbols.model}")
            self._symbols.record.history.append((f"new_{name}", value))
            self.history.append((name, self._symbols.lower(value)))

    def choose(self, tasks: Sequence[str] | None, *, product: bool) -> None:
        """Add tasks by name."""
        known = [str(t) for t in Task if t not in (Task.PSEUDO_LOAD, Task.FIELDS_RATE)]
        for t in tasks or ():
            if t not in known:
                raise ModelError(f"no task {t!r}; there are {', '.join(known)}")
        if tasks is not None:
            self._tasks = (*(self._tasks or ()), *tasks)
        self.product |= product or Task.PRODUCT in (tasks or ())

    def derive_by(self, symbols: Sequence[Any]) -> None:
        """Add derivatives of the residual by parameters, data or coordinates."""
        nodes = [(str(s), self._symbols.lower(s)) for s in symbols]
        for name, n in nodes:
            source = n.payload.array if isinstance(n.payload, Input) else ""
            if source not in ("parameters", "data", "coordinates"):
                raise ModelError(f"{name} is no parameter, datum or coordinate to derive by")
        self.derivatives += [pair for pair in nodes if pair not in self.derivatives]


def check(definition: Definition) -> None:
    """Check that a finished model has what its tasks need.  Raises ModelError where not."""
    name, chosen = definition.name, definition.tasks or ()
    if Task.ENERGY in chosen and not definition.conservative:
        raise ModelError(f"no energy for {name}: its residual is not the gradient of one")
    if (definition.pseudo_load or definition.fields_rate) and definition.given:
        raise ModelError(
            f"no pseudo_load or fields_rate for {name}: it gives derivatives of its own"
        )
    if definition.fields_rate and not definition.fields:
        raise ModelError(f"no fields_rate for {name}: it declares no fields")
    if Task.FIELDS in chosen and not definition.fields:
        raise ModelError(f"no task fields for {name}: it declares none")
