"""Inputs by which results are differentiated: each knows the arguments that move with it.

The value of an input can be read, and put into a definition. A function is differentiated by a
factor of it, which is 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.contact.pair_law import PairLawKernel
from softehl.runtime.definition.contact_sides import ContactRequest
from softehl.runtime.definition.problem_definition import (
    Block,
    Load,
    PrescribedValues,
    ProblemDefinition,
    StudyError,
)
from softehl.runtime.discretisation.loads import NodalForce, Spring, Tie, amount
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.sensitivity.differences import WIDE, mixed, slope
from softehl.runtime.sensitivity.tape import Tape


@dataclass(frozen=True, eq=False)
class InputColumn:
    """An argument of the elements of a block that moves with an input.

    column: among coordinates, data and parameters; of a load, coordinates and its amount. target:
    (n,) component of the input, -1 for elements that do not move. factor: (n,) rates.
    """

    block: str
    column: int
    target: Integers
    factor: Array

    def push(self, rows: Array, seed: Array) -> None:
        """Add the rate of the argument to rows (n, width) when the input moves by seed."""
        mask = self.target >= 0
        rows[mask, self.column] += self.factor[mask] * seed[self.target[mask]]

    def pull(self, gradient: Array, gradient_of_dofs: Array) -> None:
        """Add the derivatives (n,) by the argument to the gradient."""
        mask = self.target >= 0
        np.add.at(gradient, self.target[mask], self.factor[mask] * gradient_of_dofs[mask])


@dataclass(frozen=True, eq=False)
class PrescribedSeeds:
    """Prescribed values that move with an input.

    dofs: (m,) unknowns. target, factor: (m,), as of `Column`.
    """

    dofs: Integers
    target: Integers
    factor: Array


@dataclass(frozen=True, eq=False)
class ArraySeeds:
    """A run-time array of the elements of a block that moves with all components of an input.

    slope: (n, k) derivatives of its numbers by the components, None for the unit matrix.
    """

    block: str
    name: str
    slope: Array | None

    def rate(self, seed: Array) -> Array:
        """Rate (n,) of the numbers when the input moves by seed (k,)."""
        return seed if self.slope is None else np.asarray(self.slope @ seed)


@dataclass(frozen=True, eq=False)
class PointSeeds:
    """Data of the points of a block, at the beginning of a path, that move with an input.

    column: among the point data. shape: (n, points, k) of all of them. first: component of the
    input that is the first of its values.
    """

    block: str
    column: int
    shape: tuple[int, ...]
    first: int = 0

    def push(self, histories: dict[str, Array], seed: Array) -> None:
        """Add the rates of the point data when the input moves by seed."""
        rates = histories.setdefault(self.block, np.zeros(self.shape))
        rates[:, :, self.column] += seed[self._components].reshape(self.shape[:2])

    def pull(self, gradient: Array, histories: Mapping[str, Array]) -> None:
        """Add the derivatives by point data to the gradient."""
        if self.block in histories:
            gradient[self._components] += histories[self.block][:, :, self.column].ravel()

    @property
    def _components(self) -> slice:
        return slice(self.first, self.first + self.shape[0] * self.shape[1])


@dataclass(frozen=True, eq=False)
class InputSeeds:
    """All that moves with an input in one step; points: only at the beginning of a path."""

    columns: Sequence[InputColumn] = field(default=())
    prescribed: Sequence[PrescribedSeeds] = field(default=())
    arrays: Sequence[ArraySeeds] = field(default=())
    points: Sequence[PointSeeds] = field(default=())

    def pull_prescribed(self, gradient: Array, gradient_of_dofs: Array) -> None:
        """Add derivatives (n,) by prescribed values to the gradient."""
        for h in self.prescribed:
            mask = h.target >= 0
            np.add.at(gradient, h.target[mask], h.factor[mask] * gradient_of_dofs[h.dofs[mask]])


Key: TypeAlias = tuple[str, str]
"""Block, load or support, and a name of it: ("rubber", "mu"), ("load:right", "u_y")."""

_WIDE = 1e-3  # of the size of the mesh: step of a difference of order 6 of functions of places


@dataclass(frozen=True, eq=False)
class Move:
    """Move of an input by a seed (k,)."""

    item: Input
    seed: Array


class Input(Protocol):
    """Input of a study: a number or an array."""

    @property
    def key(self) -> Key:
        """Block, load or support, and a name of it."""
        ...

    @property
    def value(self) -> Array:
        """Its components, (k,)."""
        ...

    @property
    def scalar(self) -> bool:
        """True if it is one number."""
        ...

    def seeds(self, tape: Tape) -> InputSeeds:
        """Arguments of elements and prescribed values that move with it in a step."""
        ...

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """Put a value into a definition."""
        ...

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """Rates of `seeds(tape).prescribed` as inputs move; of linear ones none."""
        ...


@dataclass(frozen=True, eq=False)
class PageParameter:
    """A parameter of a page, on one kind of cells or several."""

    key: Key
    blocks: Sequence[Block]
    scalar: bool = True

    @property
    def value(self) -> Array:
        """See `Input`."""
        return np.array([_number(self.blocks[0].parameters[self.key[1]])])

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        columns, name = [], self.key[1]
        for block in self.blocks:
            n, kernel, value = len(block.nodes), block.kernel, block.parameters[self.key[1]]
            rate = value(tape.step.t) if callable(value) else 1.0
            width = kernel.nodes * len(kernel.coordinates) + len(kernel.data)
            column = width + kernel.parameters.index(name)
            columns.append(InputColumn(block.name, column, _one(n), np.full(n, float(rate))))
        return InputSeeds(columns)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        for block in self.blocks:
            changed_value = _changed(block.parameters[self.key[1]], float(value[0]))
            parameters = {**definition.blocks[block.name].parameters, self.key[1]: changed_value}
            changed = replace(definition.blocks[block.name], parameters=parameters)
            definition.blocks[block.name] = changed

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        return []


@dataclass(frozen=True, eq=False)
class LawParameter:
    """A parameter of a law of contact; request: that contact."""

    key: Key
    request: ContactRequest
    scalar: bool = True

    @property
    def value(self) -> Array:
        """See `Input`."""
        return np.array([_number(self._definition)])

    @property
    def _definition(self) -> Any:
        assert self.request.law is not None
        return self.request.law.parameters[self.key[1]]

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        rate = float(self._definition(tape.step.t)) if callable(self._definition) else 1.0
        columns = []
        for block in tape.problem.assembler.blocks:
            if isinstance(block.kernel, PairLawKernel) and block.name.startswith(
                f"{self.request.name}: "
            ):
                n, width = block.coordinates.shape
                column = width + block.kernel.parameters.index(self.key[1])
                columns.append(InputColumn(block.name, column, _one(n), np.full(n, rate)))
        return InputSeeds(columns)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        for k, contact in enumerate(definition.contacts):
            if contact.name == self.request.name:
                changed = _changed(self._definition, float(value[0]))
                parameters = {**contact.law.parameters, self.key[1]: changed}
                law = replace(contact.law, parameters=parameters)
                definition.contacts[k] = replace(contact, law=law)

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        return []


@dataclass(frozen=True, eq=False)
class PageArray:
    """Values of a curve, or weights of a network, of a page on one kind of cells or several."""

    key: Key
    blocks: Sequence[Block]
    scalar: bool = False

    @property
    def value(self) -> Array:
        """See `Input`."""
        return self.blocks[0].arrays[self.key[1]].values.copy()

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest allowed components, (k,) each."""
        return self.blocks[0].arrays[self.key[1]].bounds

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        name = self.key[1]
        moves = [ArraySeeds(b.name, name, b.arrays[name].slope()) for b in self.blocks]
        return InputSeeds(arrays=moves)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        for block in self.blocks:
            arrays = dict(definition.blocks[block.name].arrays)
            arrays[self.key[1]] = arrays[self.key[1]].with_values(value)
            definition.blocks[block.name] = replace(definition.blocks[block.name], arrays=arrays)

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        return []


@dataclass(frozen=True, eq=False)
class PageDatum:
    """Data of the elements of a page, one number an element."""

    key: Key
    blocks: Sequence[Block]
    scalar: bool = False

    @property
    def value(self) -> Array:
        """See `Input`."""
        return np.concatenate([block.data[self.key[1]] for block in self.blocks])

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        columns, start = [], 0
        for block in self.blocks:
            n, kernel = len(block.nodes), block.kernel
            column = kernel.nodes * len(kernel.coordinates) + kernel.data.index(self.key[1])
            columns.append(InputColumn(block.name, column, start + np.arange(n), np.ones(n)))
            start += n
        return InputSeeds(columns)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        start = 0
        for block in self.blocks:
            n, block_now = len(block.nodes), definition.blocks[block.name]
            data = {**block_now.data, self.key[1]: np.asarray(value[start : start + n]).copy()}
            definition.blocks[block.name] = replace(block_now, data=data)
            start += n

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        return []


@dataclass(frozen=True, eq=False)
class PagePointDatum:
    """Data of the points of a page at the beginning, one number a point of each element."""

    key: Key
    blocks: Sequence[Block]
    scalar: bool = False

    @property
    def value(self) -> Array:
        """See `Input`."""
        return np.concatenate([_initial(b)[:, :, self._column(b)].ravel() for b in self.blocks])

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        seeds, first = [], 0
        for block in self.blocks:
            shape = _initial(block).shape
            seeds.append(PointSeeds(block.name, self._column(block), shape, first))
            first += shape[0] * shape[1]
        return InputSeeds(points=seeds)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        first = 0
        for block in self.blocks:
            block_now = definition.blocks[block.name]
            initial = _initial(block_now).copy()
            count = initial[:, :, 0].size
            part = np.asarray(value[first : first + count])
            initial[:, :, self._column(block)] = part.reshape(initial.shape[:2])
            definition.blocks[block.name] = replace(block_now, initial=initial)
            first += count

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        return []

    def _column(self, block: Block) -> int:
        return block.kernel.point_data.index(self.key[1])


def _initial(block: Block) -> Array:
    """Point data of a block that has some, (n, points, k)."""
    assert block.initial is not None
    return block.initial


@dataclass(frozen=True, eq=False)
class LoadAmount:
    """The amount of a load, a pressure, a spring or the offset of a tie."""

    key: Key
    numbers: Sequence[int]
    forces: Sequence[Load]
    scalar: bool = True

    @property
    def value(self) -> Array:
        """See `Input`."""
        kernel = self.forces[0].kernel
        return np.array([_number(getattr(kernel, _amount(self.forces[0])))])

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        element_blocks = {b.name: b for b in tape.problem.assembler.blocks}
        blocks = [element_blocks[f.label] for f in self.forces if f.label in element_blocks]
        columns = []
        for block in blocks:
            n, width = len(block.dofs), np.shape(block.coordinates)[1]
            columns.append(InputColumn(block.name, width, _one(n), np.ones(n)))
        return InputSeeds(columns)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        for number in self.numbers:
            force = definition.forces[number]
            name = _amount(force)
            changes = {name: _changed(getattr(force.kernel, name), float(value[0]))}
            kernel: Any = replace(force.kernel, **changes)  # type: ignore[arg-type]
            definition.forces[number] = replace(force, kernel=kernel)

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        return []


@dataclass(frozen=True, eq=False)
class SupportValue:
    """A prescribed value."""

    key: Key
    numbers: Sequence[int]
    conditions: Sequence[PrescribedValues]
    scalar: bool = True

    @property
    def value(self) -> Array:
        """See `Input`."""
        return np.array([_number(self.conditions[0].value)])

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        prescribed, system, step = [], tape.system, tape.step
        for c, dofs, mask in _conditions(tape, self.conditions):
            unit_value = c.value if callable(c.value) else 1.0
            rates = amount(unit_value, system.mesh.points[c.nodes], step.t, step.factor)
            prescribed.append(PrescribedSeeds(dofs[mask], _one(int(mask.sum())), rates[mask]))
        return InputSeeds(prescribed=prescribed)

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        for number in self.numbers:
            condition = definition.conditions[number]
            changed_value: Any = _changed(condition.value, float(value[0]))
            definition.conditions[number] = replace(condition, value=changed_value)

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        curvatures = []
        for c, dofs, mask in _conditions(tape, self.conditions):
            dX = displacement(others, c.nodes)
            if callable(c.value) and dX.any():
                rates = slope(_values(c, tape, dX), _span(tape) / float(np.abs(dX).max()))
                curvatures.append(PrescribedSeeds(dofs[mask], _one(int(mask.sum())), rates[mask]))
        return curvatures


@dataclass(frozen=True, eq=False)
class NodeCoordinates:
    """Places of nodes: along an axis, each for itself, or all together along a mode.

    weights: (points, dim, k) how the places move with each component. base: its components now.
    Data and starts stay with their elements and nodes.
    """

    key: Key
    mesh: Mesh
    targets: Integers
    directions: Array
    base: Array
    scalar: bool = False

    @property
    def value(self) -> Array:
        """See `Input`."""
        return self.base.copy()

    def seeds(self, tape: Tape) -> InputSeeds:
        """See `Input`."""
        columns: list[InputColumn] = []
        for block in tape.system.blocks.values():
            if block.kernel.coordinates:
                columns += self._of_nodes(block.name, block.nodes)
        element_blocks = {b.name: b for b in tape.problem.assembler.blocks}
        definition = tape.system.definition
        assert definition is not None
        names = {*tape.system.blocks, *(f.label for f in definition.forces)}
        for name in element_blocks:
            if name not in names:
                raise StudyError(f"by: places of nodes are not followed through {name!r}")
        for force in definition.forces:
            if isinstance(force.kernel, Tie) and callable(force.kernel.offset):
                raise StudyError(f"{force.label}: an offset that depends on places is not followed")
            if force.label in element_blocks and not isinstance(force.kernel, Spring | Tie):
                independent = isinstance(force.kernel, NodalForce) and not callable(
                    force.kernel.value
                )
                columns += [] if independent else self._of_nodes(force.label, force.nodes)
        return InputSeeds(columns, [*self._prescribed(tape)])

    def put(self, definition: ProblemDefinition, value: Array) -> None:
        """See `Input`."""
        points, mask = definition.mesh.points.astype(np.float64), self.targets >= 0
        moved = (value - self.base)[self.targets[mask]]
        points[mask] += moved[:, None] * self.directions[mask]
        definition.mesh = replace(definition.mesh, points=points)

    def _of_nodes(self, name: str, nodes: Integers) -> Iterator[InputColumn]:
        for k in range(nodes.shape[1]):
            for axis in range(self.mesh.dimension):
                factor = self.directions[nodes[:, k], axis]
                if factor.any():
                    column = k * self.mesh.dimension + axis
                    yield InputColumn(name, column, self.targets[nodes[:, k]], factor)

    def _prescribed(self, tape: Tape) -> Iterator[PrescribedSeeds]:
        """Functions of places that prescribe values."""
        step, wide = tape.step, _WIDE * float(np.ptp(self.mesh.points, axis=0).max())
        for c, dofs, mask in _conditions(tape, tape.system.conditions):
            if not callable(c.value):
                continue
            nodes = c.nodes[mask]
            coordinates, along = self.mesh.points[nodes], wide * self.directions[nodes]
            rates = np.zeros(len(nodes))
            for k, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
                ahead, backward = (
                    amount(c.value, coordinates + s * k * along, step.t, step.factor)
                    for s in (1, -1)
                )
                rates += weight / (60.0 * wide) * (ahead - backward)
            yield PrescribedSeeds(dofs[mask], self.targets[nodes], rates)

    def displacement(self, seed: Array, nodes: Integers) -> Array:
        """Displacements (n, dim) of nodes with the components."""
        targets = self.targets[nodes]
        moved: Array = np.where(targets >= 0, seed[targets], 0.0)[:, None] * self.directions[nodes]
        return moved

    def prescribed_curvatures(self, tape: Tape, others: Sequence[Move]) -> list[PrescribedSeeds]:
        """See `Input`."""
        curvatures, span = [], _span(tape)
        for c, dofs, mask in _conditions(tape, tape.system.conditions):
            dX, axes = displacement(others, c.nodes), self.directions[c.nodes]
            if not callable(c.value) or not axes.any():
                continue
            factor = sum(m.seed[0] for m in others if _supports(m.item, c))
            rates = factor * slope(_values(c, tape, axes), span / float(np.abs(axes).max()))
            if dX.any():
                unit_axes, unit_move = axes / np.abs(axes).max(), dX / np.abs(dX).max()
                bend = mixed(_values(c, tape, unit_axes, unit_move), span)
                rates = rates + np.abs(axes).max() * np.abs(dX).max() * bend
            curvatures.append(PrescribedSeeds(dofs[mask], self.targets[c.nodes[mask]], rates[mask]))
        return curvatures


def _conditions(
    tape: Tape, conditions: Sequence[PrescribedValues]
) -> Iterator[tuple[PrescribedValues, Integers, Flags]]:
    """Conditions with the unknowns of their nodes, and a mask that has each unknown once."""
    earlier: Integers = np.empty(0, dtype=np.int64)
    for c in conditions:
        dofs = tape.system.numbering.nodal[c.name][c.nodes]
        yield c, dofs, (dofs >= 0) & ~np.isin(dofs, earlier)
        earlier = np.concatenate([earlier, dofs])


def displacement(moves: Sequence[Move], nodes: Integers) -> Array:
    """Displacements (n, dim) of nodes with all inputs; zeros where none moves them."""
    parts = [
        m.item.displacement(m.seed, nodes) for m in moves if isinstance(m.item, NodeCoordinates)
    ]
    return np.asarray(sum(parts, np.zeros((len(nodes), 1))))


def _supports(item: Input, condition: PrescribedValues) -> bool:
    """True if an input is a factor of a prescribed value."""
    return isinstance(item, SupportValue) and any(c is condition for c in item.conditions)


def _values(c: PrescribedValues, tape: Tape, *axes: Array) -> Callable[..., Array]:
    """Prescribed values (n,) at places that move along axes (n, dim)."""
    points, step = tape.system.mesh.points[c.nodes], tape.step

    def values(*steps: float) -> Array:
        moved = sum((s * axis for s, axis in zip(steps, axes, strict=True)), points)
        return amount(c.value, moved, step.t, step.factor)

    return values


def _span(tape: Tape) -> float:
    """Step of differences of functions of places."""
    return WIDE * float(np.ptp(tape.system.mesh.points, axis=0).max())


def varied_definition_of(
    definition: ProblemDefinition, changes: Sequence[tuple[Input, Array]]
) -> ProblemDefinition:
    """A copy of a definition with other values of inputs."""
    changed = definition.copy()
    for item, value in changes:
        item.put(changed, value)
    return changed


def _one(n: int) -> Integers:
    return np.zeros(n, dtype=np.int64)


def _number(value: Any) -> float:
    """A number itself, 1 for a function."""
    return 1.0 if callable(value) else float(value)


def _changed(current: Any, value: float) -> float | Callable[..., Any]:
    """Another number, or a multiple of a function."""
    if not callable(current):
        return value

    def multiple(*arguments: Any) -> Any:
        return value * np.asarray(current(*arguments))

    return multiple


def _amount(force: Load) -> str:
    if isinstance(force.kernel, Spring):
        return "stiffness"
    return "offset" if isinstance(force.kernel, Tie) else "value"
