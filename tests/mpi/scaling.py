"""Time, memory and communication of one load step of the cube of n^3 hexahedra.

    mpiexec -n 2 python -m tests.mpi.scaling N [PETSc options]

prints a JSON object on process 0: seconds in kernels, in the matrix, in the solver (the slowest
process), and in all; peak memory of the largest process; bytes between processes in vectors of one
Newton step, as counted.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from typing import Any, cast

import numpy as np

from softehl.runtime.mpi import world
from softehl.runtime.parallel.distributed_problem import ParallelContext
from softehl.runtime.parallel.mpi_communicator import MpiCommunicator
from softehl.runtime.parallel.petsc import Petsc
from tests.mpi.problems import cube


def measured(n: int) -> dict[str, Any]:
    """Of one load step, lambda = 0.1."""
    engine, began = Petsc(), time.perf_counter()
    study = cube(n)
    ready = time.perf_counter()
    result = study.solve(steps=1, until=0.1, engine=engine)
    done, comm, times = time.perf_counter(), world(), engine.times
    team = cast(MpiCommunicator, result.system.comm).team
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # GB
    largest = {
        name: max(comm.allgather(value))
        for name, value in {
            "kernels s": times.kernels,
            "matrix s": times.matrix,
            "solver s": times.solver,
            "statement s": ready - began,
            "all s": done - began,
            "memory GB": memory,
            "copies": team.exchange.ghosts,
        }.items()
    }
    return {
        "processes": comm.size,
        "unknowns": len(result.x),
        **{name: round(value, 3) for name, value in largest.items()},
        "newton": times.solves,
        "krylov": times.iterations,
        "vector bytes a newton step": comm.allreduce(team.exchange.sent) // max(times.solves, 1),
        "matrix bytes a newton step": comm.allreduce(_entries_sent(team)),
        "norm": result.norm(),
    }


def _entries_sent(team: ParallelContext) -> int:
    """Bytes of element entries whose row belongs to another process."""
    foreign = np.ones(len(team.part.unknowns), dtype=bool)
    foreign[team.part.owned] = False
    blocks = team.part.system.assembler.blocks
    return sum(8 * int(foreign[b.dofs].sum()) * b.dofs.shape[1] for b in blocks)


def main() -> None:
    found = measured(int(sys.argv[1]))
    if world().rank == 0:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
