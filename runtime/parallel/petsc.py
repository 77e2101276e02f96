"""The engine `petsc`: the same script, run plainly or under mpirun."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.equations.system import System
from softehl.runtime.mpi import petsc, world
from softehl.runtime.parallel.distributed_problem import DistributedSolver, ParallelContext
from softehl.runtime.parallel.halo_exchange import HaloExchange
from softehl.runtime.parallel.matrix_free import levels_of, require_products
from softehl.runtime.parallel.mpi_communicator import MpiCommunicator, PartitionedMeshCommunicator
from softehl.runtime.parallel.partitioning import (
    CellGraph,
    LocalSystem,
    local_system_of_partitioned_mesh,
    part_of,
    partition,
)
from softehl.runtime.parallel.petsc_matrix import PetscSolver, SolverTimes
from softehl.runtime.parallel.static_condensation import ExternalUnknowns
from softehl.runtime.solve.newton import Newton

_AXES = ("x", "y", "z")


@dataclass(eq=False)
class Petsc:
    """Engine that assembles and solves on all processes of mpirun by PETSc.

    Parameters
    ----------
    options : mapping of str to object
        PETSc's options, {"ksp_type": "cg", "pc_type": "gamg"}; those of the command line and of
        PETSC_OPTIONS apply, too.
    matrix_free : bool
        True: the tangent is a shell matrix, with p-multigrid.
    times : Times
        Time that it took so far.

    Raises
    ------
    MissingPetsc
        PETSc is not installed.
    """

    options: Mapping[str, object] = field(default_factory=dict)
    matrix_free: bool = False
    times: SolverTimes = field(default_factory=SolverTimes)

    def __post_init__(self) -> None:
        petsc()

    def distribute(self, system: System) -> System:
        """See `Engine`."""
        system = system.everywhere
        if system.contacts:
            raise StudyError('contact: its pairs are sought in one process, engine="serial"')
        if system.definition is not None and system.definition.rigids:
            raise StudyError('rigid: a body is solved for in one process, engine="serial"')
        if system.mesh.piece is not None:
            if self.matrix_free:
                system.mesh.require_whole('linear = "matrix-free"')
            part, exchange, interleaved = local_system_of_partitioned_mesh(
                system, system.mesh.piece
            )
            return replace(
                system, comm=PartitionedMeshCommunicator(self._team(part, exchange, interleaved))
            )
        order = self._order(system)
        comm = world()
        cells = CellGraph.of(system)
        cut = partition(system, cells, _cut(system, cells), comm.size)
        part = part_of(system, cut, comm.rank)
        exchange = HaloExchange.of(cut.numbers[part.unknowns], part.owned, cut.starts)
        team = self._team(part, exchange, cut.interleaved)
        if order:
            pages = [part.system.assembler.block(name) for name in system.blocks]
            team.levels = levels_of(part.system, pages, order, 1)
        return replace(part.system, comm=MpiCommunicator(team))

    def _team(self, part: LocalSystem, exchange: HaloExchange, interleaved: int) -> ParallelContext:
        outer = ExternalUnknowns.of(exchange, part.system.assembler)
        nullspace = _rigid_motions(part, interleaved, outer)
        solver = PetscSolver(self.options, nullspace, _fields(part, outer), self.times)
        return ParallelContext(part, exchange, outer, interleaved, solver)

    def _order(self, system: System) -> int:
        """Order of the cells of pages with products, 0 for a matrix.  Raises StudyError."""
        if not self.matrix_free:
            return 0
        if any(isinstance(b.kernel, Tie) for b in system.assembler.blocks):
            raise StudyError(
                'linear = "matrix-free": ties are taken in one process, leave engine out'
            )
        return require_products(system)[1]

    def newton(self, system: System, requested: Newton | None) -> Newton:
        """See `Engine`."""
        return replace(requested or Newton(), linear=DistributedSolver())


def _cut(system: System, cells: CellGraph) -> Integers:
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


def _rigid_motions(part: LocalSystem, interleaved: int, outer: ExternalUnknowns) -> Any:
    """Rigid-body motions for multigrid, where the only unknowns are displacements; else None."""
    mesh, owned = part.system.mesh, outer.owned
    parts = _spans(part, owned)
    stems = {name.rpartition("_")[0] for name in parts}
    axes = tuple(name.rpartition("_")[2] for name in parts)
    if interleaved < 2 or len(stems) > 1 or axes != _AXES[: mesh.dimension]:
        return None
    owned_coordinates = np.empty(len(owned))
    for axis, (name, mask) in enumerate(parts.items()):
        numbers = part.system.numbering.nodal[name]
        nodes = np.flatnonzero(numbers >= 0)
        local = np.empty(part.system.size)
        local[numbers[nodes]] = mesh.points[nodes, axis]
        owned_coordinates[mask] = local[owned[mask]]
    vector = outer.exchange.to_petsc(owned_coordinates)
    vector.setBlockSize(mesh.dimension)
    return petsc().NullSpace().createRigidBody(vector)


def _spans(part: LocalSystem, owned: Integers) -> dict[str, Flags]:
    """Unknown -> which of own ones, by their local numbers, are of that name; no internal ones."""
    layout, blocks = part.system.numbering.layout, part.system.assembler.blocks
    inner = {name for block in blocks for name in block.internal}
    spans = {name: layout.part(name) for name in layout.names if name not in inner}
    return {name: (owned >= span.start) & (owned < span.stop) for name, span in spans.items()}


def _fields(part: LocalSystem, outer: ExternalUnknowns) -> dict[str, Integers]:
    """Field -> where its own unknowns stand in this process's piece; displacements are one."""
    fields: dict[str, list[Integers]] = {}
    for name, mask in _spans(part, outer.owned).items():
        stem, _, axis = name.rpartition("_")
        label = stem if stem and axis in (*_AXES, "r") else name
        fields.setdefault(label, []).append(outer.exchange.positions[mask])
    return {label: np.sort(np.concatenate(positions)) for label, positions in fields.items()}
