"""Definition of a boundary-value problem: blocks, prescribed values, loads, initial values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.dofmap import Slot
from softehl.runtime.discretisation.loads import Amount, DeadLoad, NodalForce, Pressure, Spring, Tie
from softehl.runtime.kernels.kernel import Kernel, Rule
from softehl.runtime.kernels.run_time_arrays import ArrayData
from softehl.runtime.mesh.mesh import Mesh, Predicate

Where: TypeAlias = "str | Predicate | Integers | Sequence[float]"
"""A side or group by name, a predicate of places (n, dim), node numbers, or one place (a tuple)."""
Number: TypeAlias = float | Callable[[float], float]
"""A parameter: a number, or a function of time or load factor."""
Datum: TypeAlias = float | Array | Callable[[Array], Array]
"""Data of elements: one number, (n,) numbers, or a function of their centres (n, dim)."""


class StudyError(SoftehlError, ValueError):
    """A request that a study cannot meet; the message says what was given and what is allowed."""


@dataclass(frozen=True, eq=False)
class PageOptions:
    """Form of a page on its elements: names, places, quadrature.

    shared: unknowns without a node that are one for all elements. called: name of an unknown on the
    page -> its name in the study. along: fields that it interpolates along its elements -> places
    (n, m) of their unknowns, or an order. rule: of quadrature, None for that of the page. constant:
    whether its tangent depends on parameters and data alone.
    """

    shared: frozenset[str] = frozenset()
    called: Mapping[str, str] = field(default_factory=dict)
    along: Mapping[str, int | Integers] = field(default_factory=dict)
    rule: Rule | None = None
    constant: bool = False

    @property
    def dof_tables(self) -> dict[str, Integers]:
        """Places (n, m) of the fields along the elements, without those that are orders still."""
        return {name: p for name, p in self.along.items() if not isinstance(p, int | np.integer)}


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one page.

    nodes: (n, k). kind: of the cells or faces. slots: its unknowns but for those along elements,
    as the study calls them. data: name -> (n,) of those that the user gave.
    previous: column of the kernel's data -> name and node of the unknown whose value at the step
    before it is; rates, accelerations: likewise of what `rates` adds. initial: (n, points, k) point
    data at the start, or None.
    arrays: curves and weights of networks by name.
    differentiated, twice_differentiated: make the kernels of first and of second derivatives, or
    None where the page is C. valued: makes kernels whose fields are named values of the page.
    """

    name: str
    kernel: Kernel
    nodes: Integers
    kind: str
    slots: tuple[Slot, ...]
    options: PageOptions
    data: Mapping[str, Array]
    previous: Mapping[str, Slot]
    rates: Mapping[str, Slot]
    accelerations: Mapping[str, Slot]
    initial: Array | None
    parameters: Mapping[str, Number]
    arrays: Mapping[str, ArrayData] = field(default_factory=dict)
    differentiated: Callable[[], Kernel] | None = None
    twice_differentiated: Callable[[], Kernel] | None = None
    valued: Callable[[tuple[str, ...]], Kernel] | None = None

    @property
    def shared(self) -> frozenset[str]:
        """Unknowns without a node that are one for all elements."""
        return self.options.shared

    @property
    def filled(self) -> dict[str, Slot]:
        """All data that a step fills."""
        return {**self.previous, **self.rates, **self.accelerations}


@dataclass(frozen=True, eq=False)
class PrescribedValues:
    """Prescribed values of an unknown at nodes."""

    where: Where
    nodes: Integers
    name: str
    value: Amount

    @property
    def call(self) -> str:
        """The request in words, for messages."""
        return f"fix({display_name(self.where)}, {self.name}=...)"


@dataclass(frozen=True, eq=False)
class Load:
    """A load, a pressure, a spring or a tie: elements of a kernel of ours on unknowns by name.

    what, where: the call and its place in words: "load", "right".
    """

    label: str
    kernel: DeadLoad | NodalForce | Pressure | Spring | Tie
    nodes: Integers
    names: tuple[str, ...]
    what: str = ""
    where: str = ""


@dataclass(frozen=True, eq=False)
class InitialValues:
    """Values of an unknown at nodes at the start, (n,) each."""

    name: str
    nodes: Integers
    values: Array


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A rigid body: nodes that move with a reference point, or the reference point alone.

    nodes: (n,). node: that has the unknowns of its motion. point: (dim,) reference point. names: of
    the displacements of the nodes. finite: of rotations of any size; else of small ones.
    axisymmetric: it moves along the axis alone.
    """

    name: str
    nodes: Integers
    node: int
    point: Array
    names: tuple[str, ...]
    finite: bool
    axisymmetric: bool = False

    @property
    def components(self) -> tuple[str, ...]:
        """Components of its motion: the displacement, and the angle or rotation vector."""
        if len(self.point) == 2:
            return "u_x", "u_y", "theta"
        return "u_x", "u_y", "u_z", "theta_x", "theta_y", "theta_z"

    @property
    def slots(self) -> tuple[Slot, ...]:
        """Its unknowns, at the first node of an element."""
        return tuple(Slot(self.unknown(c), 0) for c in self.components)

    def unknown(self, component: str) -> str:
        """Name of an unknown of the body."""
        return f"{self.name}:{component}"


@dataclass(eq=False)
class ProblemDefinition:
    """A boundary-value problem that is being written down, in the order of the script.

    point_values: names of the data of points that `Study.initial` has set.
    axisymmetric: whether cells and sides are those of rings around the x axis.
    """

    mesh: Mesh
    axisymmetric: bool = False
    blocks: dict[str, Block] = field(default_factory=dict)
    conditions: list[PrescribedValues] = field(default_factory=list)
    forces: list[Load] = field(default_factory=list)
    start: list[InitialValues] = field(default_factory=list)
    contacts: list[Any] = field(default_factory=list)
    point_values: list[str] = field(default_factory=list)
    rigids: dict[str, RigidBody] = field(default_factory=dict)

    def copy(self) -> ProblemDefinition:
        """A copy, to which more can be added."""
        containers: dict[str, Any] = {
            n: copy(v) for n, v in vars(self).items() if isinstance(v, dict | list)
        }
        return replace(self, **containers)

    @property
    def size(self) -> int:
        """Number of blocks, bodies, contacts, supports, loads, initial values; it only grows."""
        counted: tuple[Sized, ...] = (self.blocks, self.rigids, self.contacts, self.conditions)
        return sum(map(len, (*counted, self.forces, self.start, self.point_values)))

    def prescribed(self, name: str) -> Integers:
        """Nodes at which an unknown is prescribed."""
        parts = [c.nodes for c in self.conditions if c.name == name]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])


def display_name(where: object) -> str:
    """A place that was meant, for messages."""
    if callable(where):
        return getattr(where, "__name__", "predicate")
    return repr(where) if isinstance(where, str | tuple) else "nodes"
