"""Weak form at a pair of points of two sides: a law of contact.

The model has the geometry and the fields of the pair as unknowns, whatever the faces are; the
runtime finds pairs, integrates, and carries residual and tangent over to the nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import point_rule
from softehl.codegen.graph.graph import Node
from softehl.codegen.language.definition import Component, Definition
from softehl.codegen.language.errors import ModelError, WrongDomainError
from softehl.codegen.language.fields import AXES, Fields, FieldTrace
from softehl.codegen.language.flatten import Entries
from softehl.codegen.language.model import Model

FIRST, SECOND, BEFORE = "_first", "_second", "_before"
"""Ends of the names of unknowns: a field on each of both sides, and history before the step."""


class PairModel(Fields):
    """Model of a pair: a point of the first side, and the point of the second one that the line
    along the normal meets. Densities are per undeformed area of the first side.

    Unknowns are declared when a page asks for them: `apart`, from the point to its partner;
    `slope_a` and `slope_b`, along the first side; `came`, what `apart` of both points was before
    the step; `area_ratio`; every field at both points; and history, so that the tangent knows how
    it changes along the side.
    """

    def __init__(self, name: str, cell: Element, geometry: str, doc: str) -> None:
        super().__init__(name, cell, geometry, 1, point_rule(), doc)
        self.dimension = cell.dimension + 1
        self._vectors: dict[str, Any] = {}
        self._named: dict[str, Any] = {}
        self._beyond: dict[Any, Any] = {}
        self._history: list[str] = []
        self._of_pairs = False

    @property
    def normal(self) -> Any:
        """Unit normal (dimension, 1) of the deformed first side at the point, outwards."""
        if "normal" not in self._named:
            a = self._vector("slope_a")
            vector = sp.Matrix([a[1], -a[0]])
            if self.dimension == 3:
                vector = sp.Matrix(a).cross(sp.Matrix(self._vector("slope_b")))
            vector = self.define("across", vector)
            length = self.define("length_across", sp.sqrt(vector.dot(vector)))
            self._named["normal"] = self.define("normal", vector / length)
        return self._named["normal"]

    @property
    def gap(self) -> Any:
        """Distance of the sides along the normal [mm]; negative where they overlap."""
        self._of_pairs = True
        if "gap" not in self._named:
            distance = sp.Matrix(self._vector("apart"))
            self._named["gap"] = self.define("gap", distance.dot(self.normal))
        return self._named["gap"]

    @property
    def slip(self) -> Any:
        """Motion (dimension, 1) of the first side along itself in a step [mm]."""
        self._of_pairs = True
        if "slip" not in self._named:
            came, n = sp.Matrix(self._vector("came")), self.normal
            self._named["slip"] = self.define("slip", came - came.dot(n) * n)
        return self._named["slip"]

    @property
    def area_ratio(self) -> Any:
        """Deformed over undeformed area of the first side at the point."""
        if "area_ratio" not in self._named:
            self._named["area_ratio"] = self.unknown("area_ratio")
        return self._named["area_ratio"]

    def jump(self, value: Any) -> Any:
        """A value on the first side less that on the second."""
        return self._both(value, lambda a, b: a - b)

    def average(self, value: Any) -> Any:
        """Mean of a value on both sides."""
        return self._both(value, lambda a, b: (a + b) / 2)

    def grad(self, value: Any) -> Any:
        """Raise WrongDomainError: a pair has no gradients."""
        raise WrongDomainError(
            f"grad of {value}: a law of contact has values of fields, no gradients"
        )

    def point_data(self, /, **meanings: str) -> list[sp.Symbol]:
        """Declare history: its values at the point before the step; see `history`."""
        self._history += meanings
        return [self.unknown(f"{name}{BEFORE}") for name in meanings]

    def history(self, /, **new: Any) -> None:
        """Give history its new values. They are kept as means about the corners of the first side,
        as pairs move over it.
        """
        for name in new:
            if name not in self._history:
                raise ModelError(f"history: {name} is not declared, m.point_data({name}=...)")
            self._history.remove(name)
        self.fields(**{f"new_{name}": value for name, value in new.items()})

    def finish(self) -> Definition:
        """Return the definition with its cell.  Raises WrongDomainError if it is not of pairs."""
        if not self._of_pairs:
            raise WrongDomainError(
                f"{self.name}: a law of contact has m.gap, m.slip, m.jump or m.average"
            )
        for name in self._history:
            raise ModelError(
                f"{name}: point data of a law of contact are history, m.history({name}=...)"
            )
        return replace(super().finish(), cell=f"{self.cell.name}_pair")

    def _both(self, value: Any, operation: Any) -> Any:
        self._of_pairs = True
        entries = Entries.of(value)
        others = [sp.sympify(v).xreplace(self._beyond) for v in entries.values]
        pairs = zip(entries.values, others, strict=True)
        return entries.arrange([operation(a, b) for a, b in pairs])

    def _vector(self, name: str) -> list[Any]:
        if name not in self._vectors:
            axes = AXES[: self.dimension]
            self._vectors[name] = [self.unknown(f"{name}_{axis}") for axis in axes]
        return list(self._vectors[name])

    def _components_of(self, components: Sequence[Component]) -> list[FieldTrace]:
        traced = []
        for component in components:
            if component.is_data:
                raise ModelError(
                    f"{component.name}: a law of contact has no values of fields before the step "
                    "and no rates, but m.slip, and m.history"
                )
            if component.order != self.order:
                raise ModelError(f"{component.name}: a field of a law of contact has no order")
            first, second = (self.unknown(f"{component.name}{end}") for end in (FIRST, SECOND))
            self._beyond[first] = second
            traced.append(FieldTrace(component, first, ()))
        return traced

    def _position(self) -> list[Any]:
        raise ModelError("position: a law of contact does not depend on the place")

    def _volume(self) -> Any:
        return sp.Integer(1)

    def _total_of(self, name: str, density: Any) -> Any:
        return Model.integral(self, name, density)

    def _check_use(self, potential: Node) -> None:
        """Accept unused unknowns: the normal has some, and fields of one side alone."""
