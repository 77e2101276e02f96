"""Initial state of a path: at rest, or the values of a result, matched by node and name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import (
    Block,
    ProblemDefinition,
    StudyError,
)
from softehl.runtime.equations.system import System, contacts_with_history
from softehl.runtime.equations.system_builder import build_system
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.results.result import Result
from softehl.runtime.solve.solution import Point, Solution, Status

SMALLEST = 1e-6
"""Of the whole load, or of the step in time that is asked for: a path ends where steps become
shorter.
"""
_NEAR = 1e-9  # of the size of a mesh: nodes closer than that are the same


@dataclass(frozen=True, eq=False)
class InitialState:
    """Time or load factor, unknowns (n,) of this process, and its point data by block."""

    t: float
    x: Array
    histories: dict[str, Array]


def at_rest(definition: ProblemDefinition) -> Result:
    """Return the initial state of a study as a result, with the values prescribed at its start."""
    system = build_system(definition)
    problem = system.resting()
    x = system.at_rest()
    x[problem.fixed] = problem.values
    solution = Solution(x, Status.CONVERGED, "", (), 0, 0)
    return Result(system, problem, Point(0.0, solution), system.histories())


def initial_state(system: System, start: Result | None) -> InitialState:
    """Return the initial state of a load or time path.

    start: a result, of this study or of another one on the same mesh; only its values are taken.
    Unknowns without a node and histories are matched by the names of blocks. A multiplier of a tie
    or a history that the result does not have begins as in a study at rest. Raises StudyError
    where the result does not fit.
    """
    if start is None:
        return InitialState(0.0, system.at_rest(), system.histories())
    if not isinstance(start, Result):
        raise StudyError(f"start is a {type(start).__name__}: a result is needed, as solve() gives")
    target, source = system.everywhere, start.system.everywhere
    if not _same(target.mesh, source.mesh):
        raise StudyError("start: the result is of another mesh, nodes or cells are not the same")
    x, values = target.at_rest(), start.x
    _take_nodal(target, source, x, values)
    _take_others(target, source, x, values)
    comm = system.comm
    histories = comm.restrict_state(_histories(target, source, start.state))
    return InitialState(start.t, comm.restrict(x), histories)


def _same(a: Mesh, b: Mesh) -> bool:
    if a is b:
        return True
    if a.points.shape != b.points.shape or a.cells.keys() != b.cells.keys():
        return False
    tolerance = _NEAR * float(np.ptp(a.points, axis=0).max())
    cells = all(np.array_equal(nodes, b.cells[kind]) for kind, nodes in a.cells.items())
    return cells and bool(np.abs(a.points - b.points).max() <= tolerance)


def _take_nodal(target: System, source: System, x: Array, values: Array) -> None:
    """Put values of the result at the nodes into x.  Raises StudyError where there are none."""
    nowhere = np.full(len(target.mesh.points), -1)
    for name, dofs in target.numbering.nodal.items():
        old = source.numbering.nodal.get(name, nowhere)
        defined = dofs >= 0
        common = defined & (old >= 0)
        x[dofs[common]] = values[old[common]]
        unsaid = defined & ~common & np.isnan(target.start.get(name, np.full(len(defined), np.nan)))
        if unsaid.any():
            node = int(unsaid.argmax())
            raise StudyError(
                f"start: the result has no {name!r} at node {node} "
                f"{place_text(target.mesh.points[node])}; say what it is: study.initial({name}=...)"
            )


def _take_others(target: System, source: System, x: Array, values: Array) -> None:
    """Put values of the result without a node into x: of elements, shared ones, multipliers."""
    named = set(target.numbering.nodal)
    for name, block in target.blocks.items():
        without_node = [(k, slot) for k, slot in enumerate(block.slots) if slot.node is None]
        named |= {slot.name for _, slot in without_node} | block.options.dof_tables.keys()
        old = source.blocks.get(name)
        if not (without_node or block.options.along) or old is None:
            continue
        _require_elements(block, old)
        for along, points in block.options.dof_tables.items():
            if np.array_equal(points, old.options.dof_tables.get(along, ())):
                target_rows, source_rows = (s.numbering.rows(name, along) for s in (target, source))
                x[target_rows] = values[source_rows]
        for k, slot in without_node:
            if slot in old.slots:
                source_rows = source.numbering.dofs[name][:, old.slots.index(slot)]
                x[target.numbering.dofs[name][:, k]] = values[source_rows]
    new, old_layout = target.numbering.layout, source.numbering.layout
    for name in new.names:
        if name not in named and name in old_layout.names:  # a tie's
            multipliers = values[old_layout.part(name)]
            if len(multipliers) == len(x[new.part(name)]):
                x[new.part(name)] = multipliers


def _histories(target: System, source: System, state: dict[str, Array]) -> dict[str, Array]:
    """History of points from the result, other point data as this study gives them."""
    histories = target.histories()
    for contact in contacts_with_history(target):
        others = {c.name: c for c in contacts_with_history(source)}
        if contact.name in others and others[contact.name].history_names == contact.history_names:
            histories[contact.name] = state[contact.name]
    for name, initial in target.histories().items():
        if name not in target.blocks:
            continue
        block, old = target.blocks[name], source.blocks.get(name)
        if isinstance(block.kernel, ModelKernel):
            histories[name] = _model_states(block, old, initial, state)
            continue
        common = [] if old is None else [n for n in block.kernel.history if n in old.kernel.history]
        if old is None or not common:
            continue
        _require_elements(block, old)
        if state[name].shape[1] != initial.shape[1]:
            raise StudyError(
                f"start: {name!r} has {initial.shape[1]} points in an element, in the result it "
                f"has {state[name].shape[1]}"
            )
        histories[name] = initial.copy()
        for n in common:
            column = old.kernel.point_data.index(n)
            histories[name][:, :, block.kernel.point_data.index(n)] = state[name][:, :, column]
    return histories


def _model_states(
    block: Block, old: Block | None, initial: Array, state: dict[str, Array]
) -> Array:
    """States of unit cells, whole; at rest where the result has no such cells."""
    if old is None or not isinstance(old.kernel, ModelKernel):
        return initial
    _require_elements(block, old)
    if old.kernel.signature != block.kernel.signature or state[block.name].shape != initial.shape:
        raise StudyError(
            f"start: {block.name!r} has other unit cells in the result; give it another name, or "
            "start from rest"
        )
    return state[block.name]


def _require_elements(block: Block, old: Block) -> None:
    if not np.array_equal(block.nodes, old.nodes):
        raise StudyError(
            f"start: {block.name!r} has other elements in the result, and values that belong to "
            "elements; give it another name, or start from rest"
        )
