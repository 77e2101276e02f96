"""The engine `petsc`: the same script, run plainly or under mpirun."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.engines.exchange import Exchange, largest, total
from softehl.runtime.engines.levels import Levels
from softehl.runtime.engines.local import Part, part_of
from softehl.runtime.engines.matrix import Solver, Times
from softehl.runtime.engines.matrix_free import suitable
from softehl.runtime.engines.partition import Cells, Partition, partition
from softehl.runtime.engines.spread import Distributed, Spread, Team
from softehl.runtime.fem.loads import Tie
from softehl.runtime.fem.problem import Problem
from softehl.runtime.mpi import petsc, world
from softehl.runtime.share import Share
from softehl.runtime.solve.newton import Newton
from softehl.runtime.statement.records import StudyError
from softehl.runtime.system import System

_AXES = ("x", "y", "z")


@dataclass(eq=False)
class Petsc:
    """PETSc on all processes.

    options: by PETSc's own names, {"ksp_type": "cg", "pc_type": "gamg"}; those of the command line
    and of PETSC_OPTIONS count too. matrix_free: whether the tangent is a shell matrix, with
    multigrid in the order. times: what it has cost so far. Raises MissingPetsc.
    """

    options: Mapping[str, Any] = field(default_factory=dict)
    matrix_free: bool = False
    times: Times = field(default_factory=Times)

    def __post_init__(self) -> None:
        petsc()

    def spread(self, system: System) -> System:
        """See `Engine`."""
        system = system.everywhere
        if system.contacts:
            raise StudyError('contact: its pairs are sought in one process, engine="serial"')
        order = self._order(system)
        comm = world()
        cells = Cells.of(system)
        cut = partition(system, cells, _cut(system, cells), comm.size)
        part = part_of(system, cut, comm.rank)
        exchange = Exchange.of(part, cut)
        near = _rigid_motions(part, cut, exchange)
        solver = Solver(self.options, near, _fields(part, exchange), self.times)
        team = Team(part, exchange, cut.interleaved, solver)
        if order:
            pages = [part.system.assembler.block(name) for name in system.blocks]
            team.levels = Levels.of(part.system, pages, order, 1)
        return replace(part.system, share=Processes(team))

    def _order(self, system: System) -> int:
        """Order of the cells of pages with products, 0 for a matrix.  Raises StudyError."""
        if not self.matrix_free:
            return 0
        if any(isinstance(b.kernel, Tie) for b in system.assembler.blocks):
            raise StudyError(
                'linear = "matrix-free": ties are taken in one process, leave engine out'
            )
        return suitable(system)[1]

    def newton(self, system: System, given: Newton | None) -> Newton:
        """See `Engine`."""
        return replace(given or Newton(), linear=Distributed())


@dataclass(eq=False)
class Processes(Share):
    """See `Share`: what a process of several has."""

    team: Team

    @property
    def first(self) -> bool:  # type: ignore[override]
        """See `Share`."""
        return bool(world().rank == 0)

    @property
    def pieces(self) -> tuple[int, int]:  # type: ignore[override]
        """See `Share`."""
        return world().rank, world().size

    def posed(self, problem: Problem) -> Spread:
        """See `Share`."""
        return Spread(problem, self.team)

    def whole(self, x: Array) -> Array:
        """See `Share`."""
        part = self.team.part
        return _gathered(x[..., part.owned], part.unknowns[part.owned], self._whole.size)

    def own(self, x: Array) -> Array:
        """See `Share`."""
        return np.asarray(x[..., self.team.part.unknowns])

    def whole_cells(self, block: str, values: Array) -> Array:
        """See `Share`."""
        rows = self.team.part.elements[block]
        count = len(self._whole.blocks[block].nodes)
        return np.moveaxis(_gathered(np.moveaxis(values, 0, -1), rows, count), -1, 0)

    def own_cells(self, block: str, values: Array) -> Array:
        """See `Share`."""
        return np.asarray(values[self.team.part.elements[block]])

    def whole_forces(self, forces: Array) -> Array:
        """See `Share`."""
        part = self.team.part
        own = self.team.exchange.added(forces)
        return _gathered(own, part.unknowns[part.owned], self._whole.size)

    def largest(self, value: float) -> float:
        """See `Share`."""
        return largest(value)

    def together(self) -> None:
        """See `Share`."""
        world().Barrier()

    @property
    def _whole(self) -> System:
        return self.team.part.system.everywhere


def _gathered(values: Array, places: Integers, count: int) -> Array:
    """The array (..., count) of which each process has `values` at its own `places`."""
    flat = values.reshape(-1, values.shape[-1]) if values.ndim > 1 else values[None]
    found = np.zeros((len(flat), count))
    found[:, places] = flat
    return np.asarray(total(found).reshape(*values.shape[:-1], count))


def _cut(system: System, cells: Cells) -> Integers:
    """Process of each cell, by PETSc's partitioner."""
    PETSc, comm = petsc(), world()
    if comm.size == 1:
        return np.zeros(cells.count, dtype=np.int64)
    bounds = np.linspace(0, cells.count, comm.size + 1).astype(int)
    part = slice(int(bounds[comm.rank]), int(bounds[comm.rank + 1]))
    graph = cells.neighbours(part, system.mesh.dimension)
    starts, columns = graph.indptr.astype(PETSc.IntType), graph.indices.astype(PETSc.IntType)
    sizes = ((part.stop - part.start, cells.count),) * 2
    matrix = PETSc.Mat().createAIJ(sizes, csr=(starts, columns, graph.data), comm=comm)
    divider = PETSc.MatPartitioning().create(comm)
    divider.setAdjacency(matrix.convert("mpiadj"))
    divider.setType("ptscotch")
    divider.setFromOptions()
    processes = PETSc.IS().create(comm)
    divider.apply(processes)
    return np.concatenate(comm.allgather(processes.getIndices().astype(np.int64)))


def _rigid_motions(part: Part, cut: Partition, exchange: Exchange) -> Any:
    """Rigid-body motions for multigrid, where the only unknowns are displacements; else None."""
    mesh, layout = part.system.mesh, part.system.numbering.layout
    stems = {name.rpartition("_")[0] for name in layout.names}
    axes = tuple(name.rpartition("_")[2] for name in layout.names)
    if cut.interleaved < 2 or len(stems) > 1 or axes != _AXES[: mesh.dimension]:
        return None
    places = np.empty(len(exchange.owned))
    for axis, name in enumerate(layout.names):
        numbers = part.system.numbering.nodal[name]
        there = np.flatnonzero(numbers >= 0)
        local = np.empty(len(exchange.numbers))
        local[numbers[there]] = mesh.points[there, axis]
        own = (exchange.owned >= layout.part(name).start) & (
            exchange.owned < layout.part(name).stop
        )
        places[own] = local[exchange.owned[own]]
    coordinates = exchange.to_petsc(places)
    coordinates.setBlockSize(mesh.dimension)
    return petsc().NullSpace().createRigidBody(coordinates)


def _fields(part: Part, exchange: Exchange) -> dict[str, Integers]:
    """Field -> where its own unknowns stand in this process's piece; displacements are one."""
    layout = part.system.numbering.layout
    found: dict[str, list[Integers]] = {}
    for name in layout.names:
        stem, _, axis = name.rpartition("_")
        label = stem if stem and axis in (*_AXES, "r") else name
        span = layout.part(name)
        own = (exchange.owned >= span.start) & (exchange.owned < span.stop)
        found.setdefault(label, []).append(exchange.places[own])
    return {label: np.sort(np.concatenate(places)) for label, places in found.items()}
