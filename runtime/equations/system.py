"""A study as equations: numbering, assembler, and the problem at a time or load factor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.pair_law import LawContact, PairLawKernel
from softehl.runtime.contact.search import ContactProblem, StateDependentBlocks
from softehl.runtime.definition.problem_definition import (
    Block,
    Load,
    Number,
    PrescribedValues,
    ProblemDefinition,
    StudyError,
)
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.communicator import SERIAL, Communicator
from softehl.runtime.discretisation.dofmap import Numbering
from softehl.runtime.discretisation.loads import Tie, amount
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.kernels.run_time_arrays import packed
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.suggestions import short_list

_SAME = 1e-12
"""Of the largest of them: prescribed values that differ by less are the same but for rounding."""


@dataclass(frozen=True, eq=False)
class Step:
    """State of a problem in time: its time or load factor, and the step before.

    factor: of all numbers in loads and supports. old: (n,) unknowns of the step
    before. rate, rate_offset: du/dt = rate u + rate_offset, (n,). dt: length of the step.
    histories: block -> (cells, points, k) point data. acceleration, acceleration_offset: likewise
    d2u/dt2; None is zero. weights: of the previous states in rate_offset, the latest first.
    """

    t: float
    factor: float
    old: Array
    rate: float
    rate_offset: Array
    dt: float
    histories: Mapping[str, Array]
    acceleration: float = 0.0
    acceleration_offset: Array | None = None
    weights: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class System:
    """Discrete equations of a study: mesh, numbering of the unknowns, elements.

    Attributes
    ----------
    mesh : Mesh
        The mesh.
    numbering : object
        Numbers of the unknowns: `nodal` by name (points,), `layout` of all fields.
    assembler : Assembler
        The elements.
    blocks : mapping of str to object
        Blocks of pages by name.
    conditions : tuple
        Prescribed values.
    implied : tuple
        Ties both sides of which are prescribed: checked, not solved.
    start : mapping of str to array (points,)
        Initial values, nan where there are none.
    comm : object
        Distribution of the unknowns over processes.
    whole : System, optional
        The equations of all processes, of a distributed system.
    definition : object
        Definition of the study.
    definition_size : int
        Size of the definition when the equations were made.
    contacts : tuple
        Contacts, whose elements are found at each iterate.
    """

    mesh: Mesh
    numbering: Numbering
    assembler: Assembler
    blocks: Mapping[str, Block]
    conditions: tuple[PrescribedValues, ...]
    implied: tuple[Load, ...] = ()
    start: Mapping[str, Array] = field(default_factory=dict)
    comm: Communicator = SERIAL
    whole: System | None = None
    definition: ProblemDefinition | None = field(default=None, repr=False)
    definition_size: int = 0
    contacts: tuple[StateDependentBlocks, ...] = ()

    def __repr__(self) -> str:
        """Summary in one line."""
        names = short_list(self.numbering.layout.names)
        return f"<System: {self.size} unknowns ({names}); blocks: {short_list(self.blocks)}>"

    @property
    def everywhere(self) -> System:
        """The equations of all processes."""
        return self.whole or self

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.numbering.layout.total

    def at_rest(self) -> Array:
        """Return the initial values of the unknowns.

        Returns
        -------
        array (n,)
            Zero where none are given.
        """
        x = np.zeros(self.size)
        for name, values in self.start.items():
            dofs = self.numbering.nodal[name]
            specified = (dofs >= 0) & ~np.isnan(values)
            x[dofs[specified]] = values[specified]
        return x

    def histories(self) -> dict[str, Array]:
        """Return the initial values of history.

        Returns
        -------
        dict of str to array (cells, points, k)
            Block -> values.
        """
        histories = {b.name: b.initial for b in self.blocks.values() if b.initial is not None}
        return histories | {c.name: c.history for c in contacts_with_history(self)}

    def quasi_static_step(self, t: float, old: Array, histories: Mapping[str, Array]) -> Step:
        """Return a quasi-static step.

        Parameters
        ----------
        t : float
            Load factor.
        old : array (n,)
            Unknowns of the previous step.
        histories : mapping of str to array
            History of the previous step.

        Returns
        -------
        Step
            With rates of zero.

        Raises
        ------
        StudyError
            A page needs the length of a time step.
        """
        for block in self.blocks.values():
            if "dt" in block.kernel.parameters and "dt" not in block.parameters:
                raise StudyError(
                    f"{block.name!r}: {block.kernel.name} has dt, the length of a step in time, "
                    "and here is no time: march, or give dt=..."
                )
        return Step(t, t, old, 0.0, np.zeros(self.size), 0.0, histories)

    def resting(self) -> Problem:
        """Return the problem at load factor 0, at the initial values.

        Returns
        -------
        Problem
            The problem.
        """
        return self.problem(self.quasi_static_step(0.0, self.at_rest(), self.histories()))

    def committed(
        self, problem: Problem, x: Array, previous: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Return the history after a converged step.

        Parameters
        ----------
        problem : Problem
            Equations of the step.
        x : array (n,)
            Unknowns at its end.
        previous : mapping of str to array
            History before it.

        Returns
        -------
        dict of str to array (cells, points, k)
            Block -> values.
        """
        after = dict(previous)
        for block in self.blocks.values():
            names = block.kernel.history
            if isinstance(block.kernel, ModelKernel):
                after[block.name] = problem.renewed(block.name, x)
            elif names:
                fields = problem.fields(block.name, x)
                state = previous[block.name].copy()
                for name in names:
                    state[:, :, block.kernel.point_data.index(name)] = fields[f"new_{name}"]
                after[block.name] = state
        for contact in contacts_with_history(self):
            assert isinstance(problem, ContactProblem)
            contact = replace(contact, history=previous[contact.name])
            after[contact.name] = contact.committed(x, problem.old, problem.parameters)
        return after

    def problem(self, step: Step) -> Problem:
        """Return the problem of a step, of all processes.

        Parameters
        ----------
        step : Step
            Load factor or time, rates and previous values.

        Returns
        -------
        Problem
            Equations with prescribed values.

        Raises
        ------
        StudyError
            Prescribed values contradict each other, or the study has changed since.
        """
        distributed: Problem = self.comm.distribute(self.local_problem(step))
        return distributed

    def local_problem(self, step: Step) -> Problem:
        """Return the problem of a step, with the elements of this process.

        Parameters
        ----------
        step : Step
            Load factor or time, rates and previous values.

        Returns
        -------
        Problem
            Equations with prescribed values.

        Raises
        ------
        StudyError
            As of `problem`.
        """
        if self.definition is not None and self.definition.size != self.definition_size:
            raise StudyError(
                "the study was changed on its way, which this path does not see: end the loop and "
                "go on from its last result, study.march(start=result, ...) or solve(start=result)"
            )
        fixed, values = self._prescribed(step)
        for tie in self.implied:
            self._require_tied(tie, step, dict(zip(fixed.tolist(), values.tolist(), strict=True)))
        assembler, parameters = self.assembler, {}
        for block in self.assembler.blocks:
            page = self.blocks.get(block.name)
            if page is None:
                parameter_values: Mapping[str, Number] = {
                    **{"t": step.t, "factor": step.factor},
                    "acceleration": step.acceleration,
                }
                if isinstance(block.kernel, PairLawKernel):
                    parameter_values = block.kernel.values
            else:
                parameter_values = {
                    **{"rate": step.rate, "dt": step.dt, "acceleration": step.acceleration},
                    **page.parameters,
                }
                if page.filled or page.initial is not None:
                    state = {"data": self._data(page, step)}
                    history = step.histories.get(page.name)
                    assembler = assembler.with_data(page.name, **state, point_data=history)
            numbers = [parameter_values[name] for name in block.kernel.parameters]
            array = np.array([v(step.t) if callable(v) else v for v in numbers])
            if page is not None and page.arrays:
                array = packed(array, [a.numbers for a in page.arrays.values()])
            parameters[block.name] = array
        layout = self.numbering.layout
        posed_on: dict[str, Any] = {"fixed": fixed, "values": values}
        if self.contacts:
            contacts = tuple(
                replace(c, history=step.histories[c.name])
                if isinstance(c, LawContact) and c.name in step.histories
                else c
                for c in self.contacts
            )
            posed_on |= {"contacts": contacts, "old": step.old}
        kind = ContactProblem if self.contacts else Problem
        return kind(assembler, layout, parameters, **posed_on)

    def _data(self, page: Block, step: Step) -> Array | None:
        """Data of the elements of a page, (n, k), in the kernel's order."""
        columns = []
        for name in page.kernel.data:
            if name in page.data:
                columns.append(page.data[name])
                continue
            slot, source = page.filled[name], step.old
            if name in page.rates:
                source = step.rate_offset
            elif name in page.accelerations:
                source = (
                    np.zeros(self.size)
                    if step.acceleration_offset is None
                    else step.acceleration_offset
                )
            columns.append(source[self.numbering.nodal[slot.name][page.nodes[:, slot.node or 0]]])
        return np.stack(columns, axis=1) if columns else None

    def _require_tied(self, tie: Load, step: Step, values: Mapping[int, float]) -> None:
        """Raise StudyError where values that are prescribed on both sides break a tie."""
        assert isinstance(tie.kernel, Tie)
        points = self.mesh.points[tie.nodes[:, 0]]
        offsets = amount(tie.kernel.offset, points, step.t, step.factor)
        dofs = self.numbering.nodal[tie.names[0]][tie.nodes]
        sizes = [abs(values[int(number)]) for number in dofs.ravel()]
        size = max([*sizes, *np.abs(offsets)], default=0.0)
        for (a, b), offset, node in zip(dofs, offsets, tie.nodes[:, 0], strict=True):
            difference = values[int(a)] - values[int(b)] - float(offset)
            if abs(difference) > _SAME * size:
                raise StudyError(
                    f"{tie.label}: at node {node} {place_text(self.mesh.points[node])} both sides "
                    f"are prescribed, and {difference:g} apart"
                )

    def _prescribed(self, step: Step) -> tuple[Integers, Array]:
        """Prescribed unknowns and values.  Raises StudyError for two values of one unknown."""
        prescribed = np.full(self.size, np.nan)
        by = np.full(self.size, -1)
        for k, condition in enumerate(self.conditions):
            dofs = self.numbering.nodal[condition.name][condition.nodes]
            points = self.mesh.points[condition.nodes]
            values = amount(condition.value, points, step.t, step.factor)
            defined = dofs >= 0
            dofs, values, nodes = dofs[defined], values[defined], condition.nodes[defined]
            conflicts = np.flatnonzero((by[dofs] >= 0) & (prescribed[dofs] != values))
            if len(conflicts):  # functions that agree at a corner do so but for rounding
                all_of = self.numbering.nodal[condition.name]
                size = np.nanmax(np.abs([*prescribed[all_of[all_of >= 0]], *values]))
                differences = np.abs(prescribed[dofs[conflicts]] - values[conflicts])
                conflicts = conflicts[differences > _SAME * size]
            if len(conflicts):
                i = int(conflicts[0])
                first = self.conditions[int(by[dofs[i]])]
                raise StudyError(
                    f"{condition.name} at node {nodes[i]} "
                    f"{place_text(self.mesh.points[nodes[i]])} is prescribed twice: "
                    f"{prescribed[dofs[i]]:g} by {first.call}, {values[i]:g} by {condition.call}"
                )
            prescribed[dofs], by[dofs] = values, k
        fixed = np.flatnonzero(by >= 0)
        return fixed, prescribed[fixed]


def contacts_with_history(system: System) -> tuple[LawContact, ...]:
    """Contacts by a law that has history."""
    laws = [c for c in system.contacts if isinstance(c, LawContact)]
    return tuple(c for c in laws if c.history_names)
