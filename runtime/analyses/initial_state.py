"""Initial state of a path: at rest, or the values of a result, matched by node and name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.mesh import Mesh, place_text
from softehl.runtime.results.result import Result

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
    whole, before = system.everywhere, start.system.everywhere
    if not _same(whole.mesh, before.mesh):
        raise StudyError("start: the result is of another mesh, nodes or cells are not the same")
    x, values = whole.at_rest(), start.x
    _take_nodal(whole, before, x, values)
    _take_others(whole, before, x, values)
    comm = system.comm
    histories = comm.restrict_state(_histories(whole, before, start.state))
    return InitialState(start.t, comm.restrict(x), histories)


def _same(a: Mesh, b: Mesh) -> bool:
    if a is b:
        return True
    if a.points.shape != b.points.shape or a.cells.keys() != b.cells.keys():
        return False
    near = _NEAR * float(np.ptp(a.points, axis=0).max())
    cells = all(np.array_equal(nodes, b.cells[kind]) for kind, nodes in a.cells.items())
    return cells and bool(np.abs(a.points - b.points).max() <= near)


def _take_nodal(whole: System, before: System, x: Array, values: Array) -> None:
    """Put values of the result at the nodes into x.  Raises StudyError where there are none."""
    nowhere = np.full(len(whole.mesh.points), -1)
    for name, numbers in whole.numbering.nodal.items():
        old = before.numbering.nodal.get(name, nowhere)
        here = numbers >= 0
        known = here & (old >= 0)
        x[numbers[known]] = values[old[known]]
        unsaid = here & ~known & np.isnan(whole.start.get(name, np.full(len(here), np.nan)))
        if unsaid.any():
            node = int(unsaid.argmax())
            raise StudyError(
                f"start: the result has no {name!r} at node {node} "
                f"{place_text(whole.mesh.points[node])}; say what it is: study.start({name}=...)"
            )


def _take_others(whole: System, before: System, x: Array, values: Array) -> None:
    """Put values of the result without a node into x: of elements, shared ones, multipliers."""
    named = set(whole.numbering.nodal)
    for name, block in whole.blocks.items():
        own = [(k, slot) for k, slot in enumerate(block.slots) if slot.node is None]
        named |= {slot.name for _, slot in own} | block.form.places.keys()
        old = before.blocks.get(name)
        if not (own or block.form.along) or old is None:
            continue
        _require_elements(block, old)
        for along, places in block.form.places.items():
            if np.array_equal(places, old.form.places.get(along, ())):
                here, there = (s.numbering.rows(name, along) for s in (whole, before))
                x[here] = values[there]
        for k, slot in own:
            if slot in old.slots:
                there = before.numbering.dofs[name][:, old.slots.index(slot)]
                x[whole.numbering.dofs[name][:, k]] = values[there]
    new, old_layout = whole.numbering.layout, before.numbering.layout
    for name in new.names:
        if name not in named and name in old_layout.names:  # a tie's
            multipliers = values[old_layout.part(name)]
            if len(multipliers) == len(x[new.part(name)]):
                x[new.part(name)] = multipliers


def _histories(whole: System, before: System, state: dict[str, Array]) -> dict[str, Array]:
    """History of points from the result, other point data as this study gives them."""
    found = whole.histories()
    for name, initial in found.items():
        block, old = whole.blocks[name], before.blocks.get(name)
        kept = [] if old is None else [n for n in block.kernel.history if n in old.kernel.history]
        if old is None or not kept:
            continue
        _require_elements(block, old)
        if state[name].shape[1] != initial.shape[1]:
            raise StudyError(
                f"start: {name!r} has {initial.shape[1]} points in an element, in the result it "
                f"has {state[name].shape[1]}"
            )
        found[name] = initial.copy()
        for n in kept:
            column = old.kernel.point_data.index(n)
            found[name][:, :, block.kernel.point_data.index(n)] = state[name][:, :, column]
    return found


def _require_elements(block: Block, old: Block) -> None:
    if not np.array_equal(block.nodes, old.nodes):
        raise StudyError(
            f"start: {block.name!r} has other elements in the result, and values that belong to "
            "elements; give it another name, or start from rest"
        )
