"""MUMPS through PETSc, on all processes that mpirun started.

Process 0 is in the lead: it runs the program, and what it factorises is spread over all. The others
`serve`: they wait for it, do their part and know nothing else.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mpi import petsc, world
from softehl.runtime.solve.linear.linear_solver import (
    Factorisation,
    SingularMatrix,
    SparseMatrix,
    equilibrate,
)
from softehl.runtime.solve.linear.schur_complement import SchurBySolves

_PAUSE = 5e-4  # seconds between looks for a task: who waits leaves the core to the others


@dataclass(eq=False)
class MumpsTeam:
    """Process 0 and those that serve it. matrices: by number, those that are factorised."""

    matrices: dict[int, Any] = field(default_factory=dict)
    forgotten: list[int] = field(default_factory=list)
    numbers: int = 0

    def call(self, task: str, number: int, parts: list[Any]) -> list[Any]:
        """Results of a task on every process, each with its part; raises SingularMatrix."""
        comm, old = world(), tuple(self.forgotten)
        self.forgotten.clear()
        for rank in range(1, comm.size):
            comm.send((task, number, parts[rank], old), dest=rank)
        results: list[Any] = comm.gather(self.work(task, number, parts[0], old))
        errors = [f for f in results if isinstance(f, str)]
        if errors:
            raise SingularMatrix(f"MUMPS: {errors[0]}")
        return results

    def work(self, task: str, number: int, part: Any, old: tuple[int, ...]) -> Any:
        """One process's share of a task; a text if PETSc refuses."""
        for gone in old:
            self.matrices.pop(gone).destroy()
        try:
            if task == "factorise":
                self.matrices[number] = _factors(part)
                return None
            return _solution(self.matrices[number], part)
        except petsc().Error as error:
            return " ".join(str(error).split())

    def factorise(self, K: SparseMatrix) -> MumpsFactors:
        """Factors of K, (n, n), on all processes."""
        comm, rows = world(), csr_array(K)
        bounds = np.linspace(0, rows.shape[0], comm.size + 1).astype(int)
        parts = [_rows(rows, int(a), int(b)) for a, b in pairwise(bounds)]
        self.numbers += 1
        factors = MumpsFactors(self, self.numbers, bounds)
        weakref.finalize(factors, self.forgotten.append, self.numbers)
        self.call("factorise", self.numbers, parts)
        return factors


def _rows(K: csr_array[np.float64], first: int, last: int) -> tuple[Any, ...]:
    part = csr_array(K[first:last])
    kind = petsc().IntType
    return K.shape[0], last - first, part.indptr.astype(kind), part.indices.astype(kind), part.data


def _factors(rows: tuple[Any, ...]) -> Any:
    PETSc, comm = petsc(), world()
    size, n_rows, starts, columns, values = rows
    matrix = PETSc.Mat().createAIJ(((n_rows, size), (n_rows, size)), csr=(starts, columns, values))
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")
    ksp.setFromOptions()
    ksp.setUp()
    return ksp


def _solution(ksp: Any, b: Array) -> Array:
    """Own rows of the solution for own rows b, (k, j)."""
    PETSc = petsc()
    matrix = ksp.getOperators()[0]
    sizes = (matrix.getSizes()[0], (None, b.shape[1]))
    B = PETSc.Mat().createDense(sizes, array=np.asfortranarray(b).ravel(order="F"), comm=world())
    B.assemble()
    X = PETSc.Mat().createDense(sizes, comm=world())
    X.setUp()
    X.assemble()
    ksp.matSolve(B, X)
    rows = np.array(X.getDenseArray(readonly=True))
    B.destroy()
    X.destroy()
    return rows


@dataclass(eq=False)
class MumpsFactors:
    """A factorised matrix whose rows are spread over processes, from bounds[k] to bounds[k + 1]."""

    team: MumpsTeam
    number: int
    bounds: Integers

    def solve(self, b: Array) -> Array:
        """The solution for right sides b, (n,) or (n, j)."""
        table = b if b.ndim == 2 else b[:, None]
        parts = np.split(np.asarray(table), self.bounds[1:-1])
        solution = np.concatenate(self.team.call("solve", self.number, parts))
        return solution if b.ndim == 2 else solution[:, 0]


@dataclass(frozen=True)
class Mumps:
    """Sparse LU by MUMPS (Amestoy, Duff, L'Excellent, Koster), on all processes.

    refinement: steps of iterative refinement; a solution whose row-wise backward error still
    exceeds `accuracy` is refused.
    """

    team: MumpsTeam
    refinement: int = 1
    accuracy: float = 1e-6
    name: str = "petsc"

    @classmethod
    def of_all(cls) -> Mumps:
        """With the team of this program.  Raises MissingPetsc."""
        petsc()
        return cls(_team())

    def factorise(self, K: SparseMatrix) -> Factorisation:
        """Factors of K, square, shape (n, n), csc; raises SingularMatrix."""
        K, row_sums, units = equilibrate(K)
        factors = self.team.factorise(K)
        return Factorisation(K, factors, row_sums, self.refinement, self.accuracy, units=units)

    def condense(self, K: SparseMatrix, boundary: Integers) -> SchurBySolves:
        """See `Condenser`."""
        return SchurBySolves.of(K, boundary, self.team.factorise)


def require() -> None:
    """Raise MissingPetsc where PETSc is not installed."""
    petsc()


@cache
def _team() -> MumpsTeam:
    return MumpsTeam()


@contextmanager
def leading() -> Iterator[bool]:
    """True if this process is in the lead; the others serve, until it leaves the context."""
    comm = world()
    if comm.rank:
        _serve(comm)
        yield False
        return
    try:
        yield True
    finally:
        for rank in range(1, comm.size):
            comm.send(("end", 0, None, ()), dest=rank)


def _serve(comm: Any) -> None:
    """Carry out the tasks of process 0 until it ends."""
    team = _team()
    while True:
        while not comm.iprobe(source=0):
            time.sleep(_PAUSE)
        task, number, part, old = comm.recv(source=0)
        if task == "end":
            return
        comm.gather(team.work(task, number, part, old))
