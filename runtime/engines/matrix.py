"""The tangent as a matrix of PETSc, filled from batches of element tangents, and its solution."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.engines.exchange import Exchange
from softehl.runtime.fem.assembly import Assembler
from softehl.runtime.mpi import petsc, world
from softehl.runtime.solve.linear import SingularMatrix

DIRECT_BELOW = 200_000
"""Unknowns up to which the factors of MUMPS are the default."""


@dataclass(eq=False)
class Times:
    """Seconds of this process: in kernels, in putting their results into the matrix, in solving."""

    kernels: float = 0.0
    matrix: float = 0.0
    solver: float = 0.0
    solves: int = 0
    iterations: int = 0


@dataclass(eq=False)
class Tangent:
    """The matrix that element blocks share: its structure is told PETSc once for a set of
    prescribed unknowns, whose rows and columns are dropped by negative numbers.

    matrix: PETSc's. values: one for each entry of every element, then one for each own unknown on
    the diagonal. owned: local numbers of own unknowns.
    """

    matrix: Any
    values: Array
    fixed: bytes
    exchange: Exchange

    @classmethod
    def of(cls, assembler: Assembler, fixed: Integers, exchange: Exchange, block: int) -> Tangent:
        """An empty matrix; `fixed` are local numbers of prescribed unknowns."""
        PETSc = petsc()
        numbers = exchange.numbers.astype(PETSc.IntType)
        own = numbers[exchange.owned]
        dropped = numbers.copy()
        dropped[fixed] = -1
        maps = [dropped[b.dofs] for b in assembler.blocks]
        rows = np.concatenate([*(np.repeat(m, m.shape[1], axis=1).ravel() for m in maps), own])
        columns = np.concatenate([*(np.tile(m, m.shape[1]).ravel() for m in maps), own])
        matrix = PETSc.Mat().create(comm=world())
        sizes = exchange.vector.getSizes()
        matrix.setSizes((sizes, sizes), block)
        matrix.setType("aij")
        matrix.setPreallocationCOO(rows, columns)
        values = np.zeros(len(rows))
        values[len(rows) - len(own) :] = np.isin(exchange.owned, fixed)
        return cls(matrix, values, fixed.tobytes(), exchange)

    def places(self, assembler: Assembler) -> Iterator[tuple[Any, Array]]:
        """Pieces of blocks, with the place of their tangents' entries."""
        first = 0
        for block in assembler.blocks:
            width = block.dofs.shape[1] ** 2
            for piece, _ in block.pieces(np.empty(0, dtype=np.int64)):
                last = first + width * len(piece.dofs)
                yield piece, self.values[first:last]
                first = last

    def fill(
        self,
        assembler: Assembler,
        x: Array,
        parameters: Mapping[str, Array],
        defect: Array,
        times: Times,
    ) -> Array:
        """Evaluate all elements at x, (m,); their residuals with K times defect taken off, (m,)."""
        r, began = np.zeros(assembler.size), time.perf_counter()
        moved = bool(defect.any())
        for piece, place in self.places(assembler):
            if not len(piece.dofs):
                continue
            if piece.name not in parameters:
                place[:] = 0.0
                continue
            local, tangents = piece.tangent(x, parameters[piece.name])
            place[:] = tangents.ravel()
            if moved:
                local = local - np.einsum("nij,nj->ni", tangents, defect[piece.dofs])
            np.add.at(r, piece.dofs.ravel(), local.ravel())
        between = time.perf_counter()
        self.matrix.setValuesCOO(self.values, petsc().InsertMode.INSERT_VALUES)
        times.kernels += between - began
        times.matrix += time.perf_counter() - between
        return r

    def diagonal(self) -> Array:
        """Magnitudes of the diagonal of K, own rows, (k,)."""
        found = self.exchange.vector.duplicate()
        self.matrix.getDiagonal(found)
        return self._own(np.abs(found.array_r), found)

    def times(self, x: Array) -> Array:
        """K times own values x, (k,): own rows, (k,)."""
        return self._product(self.matrix, x)

    def times_magnitudes(self, x: Array) -> Array:
        """|K| times own values x, (k,), at least 0: own rows, (k,)."""
        starts, columns, values = self.matrix.getValuesCSR()
        np.abs(values, out=values)
        csr = starts, columns, values
        magnitudes = petsc().Mat().createAIJ(self.matrix.getSizes(), csr=csr, comm=world())
        del starts, columns, values, csr
        found = self._product(magnitudes, x)
        magnitudes.destroy()  # here and below: PETSc keeps what Python alone lets go
        return found

    def _product(self, matrix: Any, x: Array) -> Array:
        found, given = self.exchange.vector.duplicate(), self.exchange.to_petsc(x)
        matrix.mult(given, found)
        return self._own(found.array_r, found, given)

    def _own(self, values: Array, *done: Any) -> Array:
        """Own values (k,), a copy, of a process's piece; vectors that are done with."""
        own = np.array(values[self.exchange.places])
        for vector in done:
            vector.destroy()
        return own

    def prepare(self, ksp: Any, near: Any) -> None:
        """Krylov method and preconditioner, where no option says otherwise.

        near: motions that multigrid should know of, or None.
        """
        pc = ksp.getPC()
        if self.matrix.getSize()[0] < DIRECT_BELOW:
            ksp.setType("preonly")
            pc.setType("lu")
            pc.setFactorSolverType("mumps")
        else:
            ksp.setType("gmres")
            ksp.setTolerances(rtol=1e-6, max_it=500)
            ksp.setGMRESRestart(60)
            pc.setType("gamg")
        if near is not None:
            self.matrix.setNearNullSpace(near)

    def empty_row(self) -> int:
        """PETSc's number of a row of zeros, -1 if there is none."""
        starts, _, values = self.matrix.getValuesCSR()
        sums = np.add.reduceat(np.append(np.abs(values), 0.0), starts[:-1])
        sums[starts[:-1] == starts[1:]] = 0.0
        empty = np.flatnonzero(sums == 0.0)
        first = self.matrix.getOwnershipRange()[0]
        found = [
            n for n in world().allgather(int(first + empty[0]) if len(empty) else -1) if n >= 0
        ]
        return found[0] if found else -1


class Operator(Protocol):
    """A tangent that is spread over processes, as `Solver` and Newton's method see it: `Tangent`,
    which says what its methods do, or `engines.shell.Shell`.
    """

    @property
    def matrix(self) -> Any:
        """PETSc's."""
        ...

    @property
    def exchange(self) -> Exchange:
        """Of its vectors."""
        ...

    def fill(
        self,
        assembler: Assembler,
        x: Array,
        parameters: Mapping[str, Array],
        defect: Array,
        times: Times,
    ) -> Array:
        """See the class."""
        ...

    def diagonal(self) -> Array:
        """See the class."""
        ...

    def times(self, x: Array) -> Array:
        """See the class."""
        ...

    def times_magnitudes(self, x: Array) -> Array:
        """See the class."""
        ...

    def prepare(self, ksp: Any, near: Any) -> None:
        """See the class."""
        ...

    def empty_row(self) -> int:
        """See the class."""
        ...


@dataclass(eq=False)
class Solver:
    """Krylov method and preconditioner, by PETSc's options; the default of a matrix is MUMPS below
    `DIRECT_BELOW` unknowns and GMRES with algebraic multigrid above.

    near: what multigrid should know of (rigid-body motions), or None. fields: name -> own numbers
    of unknowns, for `-pc_type fieldsplit`.
    """

    options: Mapping[str, Any]
    near: Any = None
    fields: Mapping[str, Integers] = field(default_factory=dict)
    times: Times = field(default_factory=Times)
    _ksp: Any = None

    def solve(self, tangent: Operator, r: Array) -> Array:
        """Local x (m,) of K x = r, own values (k,).  Raises SingularMatrix on all processes."""
        began = time.perf_counter()
        ksp = self._prepared(tangent)
        b = tangent.exchange.to_petsc(r)
        x = b.duplicate()
        reason = 0
        try:
            ksp.solve(b, x)
            reason = ksp.getConvergedReason()
        except petsc().Error as error:
            raise SingularMatrix(f"PETSc: {_words(error)}") from None
        finally:
            self.times.solver += time.perf_counter() - began
        self.times.solves += 1
        self.times.iterations += ksp.getIterationNumber()
        size, found = x.norm(), tangent.exchange.local(x)
        b.destroy()
        x.destroy()
        if reason < 0 or not np.isfinite(size):
            row = tangent.empty_row()
            words = f"PETSc's {ksp.getType()} with {ksp.getPC().getType()} failed (reason {reason})"
            raise SingularMatrix(words, None if row < 0 else row)
        return found

    @property
    def direct(self) -> bool:
        """True if a further right-hand side costs no iterations."""
        return self._ksp is not None and self._ksp.getType() == "preonly"

    def reset(self) -> None:
        """Forget what belongs to another matrix."""
        if self._ksp is not None:
            self._ksp.destroy()
        self._ksp = None

    def _prepared(self, tangent: Operator) -> Any:
        if self._ksp is None:
            self._ksp = self._new(tangent)
        self._ksp.setOperators(tangent.matrix)
        return self._ksp

    def _new(self, tangent: Operator) -> Any:
        PETSc = petsc()
        ksp = PETSc.KSP().create(world())
        pc = ksp.getPC()
        tangent.prepare(ksp, self.near)
        database = PETSc.Options()
        for name, value in self.options.items():
            database[name.removeprefix("-")] = value
        ksp.setFromOptions()
        if pc.getType() == "fieldsplit":
            first = tangent.matrix.getOwnershipRange()[0]
            parts = [
                (name, PETSc.IS().createGeneral((first + places).astype(PETSc.IntType), world()))
                for name, places in self.fields.items()
            ]
            pc.setFieldSplitIS(*parts)
        return ksp


def _words(error: BaseException) -> str:
    """Message of PETSc's error, after the calls that led there."""
    return " ".join(str(error).split()).rsplit("] ", 1)[-1]
