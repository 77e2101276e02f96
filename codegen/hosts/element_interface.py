"""Interface of an element to a host: unknowns by name and node, source of each argument, history.

Every file of `codegen.hosts` reads this record and no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from softehl.codegen.abi import TargetError
from softehl.codegen.derive import task_outputs
from softehl.codegen.elements import cells
from softehl.codegen.elements.element import Element
from softehl.codegen.language.definition import Argument, Definition


@dataclass(frozen=True)
class NodalUnknown:
    """Unknowns of one name: `dofs` are their numbers at the nodes 0, 1, ... of the element."""

    name: str
    dofs: tuple[int, ...]


@dataclass(frozen=True)
class UserInput:
    """An argument that a user gives: number `index` of his list."""

    index: int


@dataclass(frozen=True)
class TimeStepValue:
    """An argument from the step in time: its length `dt`, or `rate`, which is 1 / dt."""

    what: str


@dataclass(frozen=True)
class PreviousValue:
    """A datum from the values before the step: of unknown `dof`, or (`rate`) minus it by dt."""

    dof: int
    rate: bool


Source = UserInput | TimeStepValue | PreviousValue


@dataclass(frozen=True)
class ElementInterface:
    """A model with a fixed number of unknowns; `of` makes it."""

    definition: Definition

    @staticmethod
    def of(d: Definition, host: str) -> ElementInterface:
        """Raises `TargetError` for a model of interpolated fields, which no host can number."""
        if d.interpolated:
            raise TargetError(
                f"{d.name} interpolates {d.interpolated} with any number of unknowns: target "
                f"{host} needs a fixed number, use simd or scalar"
            )
        if d.term_history:
            raise TargetError(
                f"{d.name} has history of each term, {d.term_history[0].name}: target {host} has "
                "no place for a number of them that is known at run time only"
            )
        if d.functions:
            raise TargetError(
                f"{d.name} gets the address of {d.functions[0]} when it is called: target {host} "
                "has no addresses, name its C text, m.external(..., source=...)"
            )
        return ElementInterface(replace(d, pseudo_load=False, fields_rate=False))

    def require(self, host: str, *tasks: str) -> None:
        """Raise `TargetError` where the model does not offer a task that a host needs."""
        missing = [t for t in tasks if t not in self.tasks]
        if missing:
            raise TargetError(
                f"{self.name} offers no task {' and '.join(missing)}, which target {host} needs: "
                "name it in m.offer(tasks=[...]), or leave tasks out"
            )

    @property
    def name(self) -> str:
        """Name of the model, and the first part of the names of its C functions."""
        return self.definition.name

    @cached_property
    def tasks(self) -> list[str]:
        """Tasks that the model offers."""
        return task_outputs.tasks(self.definition)

    @property
    def symmetric(self) -> bool:
        """True where the tangent is symmetric."""
        return self.definition.conservative

    @property
    def points(self) -> int:
        """Number of quadrature points."""
        return len(self.definition.rule.weights)

    @property
    def rule(self) -> list[list[float]]:
        """Rows (parent coordinates..., weight) of the quadrature rule."""
        rule = self.definition.rule
        pairs = zip(rule.points, rule.weights, strict=True)
        return [[float(x.evalf(30)) for x in (*point, weight)] for point, weight in pairs]

    @property
    def dimension(self) -> int:
        """Coordinates of a node."""
        return len(self.definition.coordinates)

    @cached_property
    def cell(self) -> Element | None:
        """Standard element of which the model has nodes, coordinates and rule; None for others."""
        rule = self.definition.rule
        element = cells.of(self.definition.nodes, rule.dimension)
        if element is None or element.dimension != self.dimension or not element.cell.fits(rule):
            return None
        return element

    # unknowns -----------------------------------------------------------------------------------

    @cached_property
    def nodal(self) -> tuple[NodalUnknown, ...]:
        """Nodal unknowns by name, in the order of the model."""
        by_name: dict[str, list[int]] = {}
        for dof, (name, node) in enumerate(self.definition.dof_nodes):
            if node is not None:
                by_name.setdefault(name, []).append(dof)
        return tuple(NodalUnknown(name, tuple(dofs)) for name, dofs in by_name.items())

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Unknowns that belong to the element alone."""
        return tuple(name for name, node in self.definition.dof_nodes if node is None)

    @cached_property
    def vector(self) -> tuple[int, ...]:
        """Numbers in `nodal` of the components of the first vector: the displacements."""
        first = [
            dof
            for start, width in self.definition.nodal
            if width == self.dimension
            for dof in range(start, start + width)
        ]
        components = [k for k, f in enumerate(self.nodal) if f.dofs[0] in first]
        return tuple(components[: self.dimension])

    def at_node(self, node: int) -> list[int]:
        """Numbers of the unknowns at a node, in the order of the names."""
        return [f.dofs[node] for f in self.nodal if node < len(f.dofs)]

    def by_node(self) -> list[int]:
        """Numbers of the unknowns, node after node."""
        return [dof for node in range(self.definition.nodes) for dof in self.at_node(node)]

    # arguments ----------------------------------------------------------------------------------

    @cached_property
    def _sources(self) -> tuple[list[Source], list[Source], list[Argument]]:
        d, inputs = self.definition, list[Argument]()
        old = dict(_previous(d, "_old"))
        rates = dict(_previous(d, "_rate")) if "rate" in {a.name for a in d.parameters} else {}
        timed = {"dt", "rate"} if rates else {"dt"}

        def source(a: Argument, filled: Mapping[str, Source]) -> Source:
            if a.name in filled:
                return filled[a.name]
            inputs.append(a)
            return UserInput(len(inputs) - 1)

        parameters = [
            source(a, {name: TimeStepValue(name) for name in timed}) for a in d.parameters
        ]
        data = [source(a, {**old, **rates}) for a in d.data]
        return parameters, data, inputs

    @property
    def parameters(self) -> list[Source]:
        """Source of each parameter."""
        return self._sources[0]

    @property
    def data(self) -> list[Source]:
        """Source of each datum of the element."""
        return self._sources[1]

    @property
    def inputs(self) -> list[Argument]:
        """Parameters, then data, that a user gives."""
        return self._sources[2]

    @property
    def state(self) -> tuple[Argument, ...]:
        """Data of each point: what a host stores between steps."""
        return self.definition.point_data

    @property
    def variables(self) -> int:
        """Numbers that a host may store for an element: state and fields of all points, or 1."""
        return max(self.points * (len(self.state) + len(self.definition.fields)), 1)

    @cached_property
    def renewed(self) -> list[int | None]:
        """For each datum of a point the field that is its new value, None where it stays."""
        fields = [name for name, _ in self.definition.fields]
        history = self.definition.history
        return [fields.index(f"new_{a.name}") if a.name in history else None for a in self.state]

    @property
    def remembers(self) -> bool:
        """True where the model renews data of points: history."""
        return any(k is not None for k in self.renewed)


def _previous(d: Definition, suffix: str) -> Iterator[tuple[str, PreviousValue]]:
    """Data such as u_old1 (for an unknown u at node 1) and the unknown whose value before it is."""
    for dof, (name, node) in enumerate(d.dof_nodes):
        if node is not None:
            yield f"{name}{suffix}{node + 1}", PreviousValue(dof, suffix == "_rate")
