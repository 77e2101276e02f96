"""Assembled tangent as a PETSc matrix, and its solution."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.sparsity import Structure
from softehl.runtime.mpi import petsc, world
from softehl.runtime.parallel.halo_exchange import HaloExchange
from softehl.runtime.parallel.static_condensation import (
    CondensedElements,
    ExternalUnknowns,
    InternalColumns,
    require_eliminated,
)
from softehl.runtime.solve.linear.linear_solver import SingularMatrix

DIRECT_BELOW = 200_000
"""Unknowns up to which the factors of MUMPS are the default."""


@dataclass(eq=False)
class SolverTimes:
    """Seconds of this process: in kernels, in putting their results into the matrix, in solving."""

    kernels: float = 0.0
    matrix: float = 0.0
    solver: float = 0.0
    solves: int = 0
    iterations: int = 0


@dataclass(eq=False)
class PetscMatrix:
    """The matrix that element blocks share: its structure is told PETSc once for a set of
    prescribed unknowns, whose rows and columns are dropped by negative numbers. Internal unknowns
    of elements are condensed before.

    matrix: PETSc's. values: one for each entry of every element, then one for each own unknown on
    the diagonal. fixed: local numbers of prescribed unknowns. columns: of blocks with internal
    unknowns. exchange: of all unknowns; outer: of those that PETSc has. pieces, own: what `fill`
    found: elements with internal unknowns, and the diagonal (k,).
    """

    matrix: Any
    values: Array
    fixed: Integers
    structure: Structure
    columns: dict[str, InternalColumns]
    exchange: HaloExchange
    outer: ExternalUnknowns
    pieces: list[CondensedElements] = field(default_factory=list)
    own_diagonal: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(
        cls,
        assembler: Assembler,
        fixed: Integers,
        exchange: HaloExchange,
        outer: ExternalUnknowns,
        block: int,
    ) -> PetscMatrix:
        """An empty matrix; `fixed` are local numbers of prescribed unknowns."""
        PETSc = petsc()
        petsc_numbers = np.full(len(exchange.numbers), -1, dtype=PETSc.IntType)
        petsc_numbers[outer.local_numbers] = outer.exchange.numbers
        owned_numbers = petsc_numbers[outer.owned]
        petsc_numbers[fixed] = -1
        columns = {b.name: InternalColumns.of(b) for b in assembler.blocks if b.internal}
        maps = [
            petsc_numbers[b.dofs[:, columns[b.name].outer] if b.internal else b.dofs]
            for b in assembler.blocks
        ]
        rows = np.concatenate(
            [*(np.repeat(m, m.shape[1], axis=1).ravel() for m in maps), owned_numbers]
        )
        across = np.concatenate([*(np.tile(m, m.shape[1]).ravel() for m in maps), owned_numbers])
        matrix = PETSc.Mat().create(comm=world())
        sizes = outer.exchange.vector.getSizes()
        matrix.setSizes((sizes, sizes), block)
        matrix.setType("aij")
        matrix.setPreallocationCOO(rows, across)
        values = np.zeros(len(rows))
        values[len(rows) - len(owned_numbers) :] = np.isin(outer.owned, fixed)
        return cls(matrix, values, fixed, assembler.structure, columns, exchange, outer)

    def serves(self, assembler: Assembler, fixed: Integers) -> bool:
        """True if it has the structure of these elements and prescribed unknowns."""
        return self.structure is assembler.structure and np.array_equal(self.fixed, fixed)

    @property
    def rows(self) -> HaloExchange:
        """Of PETSc's vectors."""
        return self.outer.exchange

    def element_entries(self, assembler: Assembler) -> Iterator[tuple[Any, Array]]:
        """Pieces of blocks, with the place of their tangents' entries."""
        first = 0
        for block in assembler.blocks:
            inner = len(self.columns[block.name].inner) if block.name in self.columns else 0
            width = (block.dofs.shape[1] - inner) ** 2
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
        times: SolverTimes,
    ) -> Array:
        """Evaluate all elements at x, (m,); their residuals with K times defect taken off, (m,)."""
        r, began = np.zeros(assembler.size), time.perf_counter()
        diagonal, free = np.zeros(assembler.size), np.ones(assembler.size, dtype=bool)
        free[self.fixed] = False
        moved = bool(defect.any())
        self.pieces = []
        for piece, entries in self.element_entries(assembler):
            if not len(piece.dofs):
                continue
            if piece.name not in parameters:
                entries[:] = 0.0
                continue
            local, tangents = piece.tangent(x, parameters[piece.name])
            entries[:] = self._condensed(piece, tangents, free).ravel()
            np.add.at(diagonal, piece.dofs, np.einsum("nii->ni", tangents))
            if moved:
                local = local - np.einsum("nij,nj->ni", tangents, defect[piece.dofs])
            np.add.at(r, piece.dofs.ravel(), local.ravel())
        self.own_diagonal = np.where(free[self.exchange.owned], self.exchange.added(diagonal), 1.0)
        between = time.perf_counter()
        self.matrix.setValuesCOO(self.values, petsc().InsertMode.INSERT_VALUES)
        times.kernels += between - began
        times.matrix += time.perf_counter() - between
        return r

    def _condensed(self, piece: ElementBlock, K: Array, free: Flags) -> Array:
        """Tangents of the other unknowns, internal ones being condensed."""
        columns = self.columns.get(piece.name)
        if columns is None:
            return K
        condensed = CondensedElements.of(columns, piece.dofs, K, free)
        self.pieces.append(condensed)
        return np.asarray(
            K[:, columns.outer][:, :, columns.outer] - condensed.back @ condensed.coupling
        )

    def solved(self, solver: PetscSolver, r: Array) -> Array:
        """Local x (m,) of K x = r, own values (k,).  Raises SingularMatrix on all processes."""
        if not self.columns:
            return solver.solve(self, r)
        require_eliminated(self.pieces, self.exchange)
        exchange, right = self.exchange, np.zeros(len(self.exchange.numbers))
        right[exchange.owned] = r
        original = right.copy()
        for piece in self.pieces:
            piece.eliminate(right)
        x = np.zeros(len(right))
        left = exchange.copied(exchange.added(right))
        x[self.outer.local_numbers] = solver.solve(self, left[self.outer.owned])
        for piece in self.pieces:
            piece.recover(x, original)
        return x

    def diagonal(self) -> Array:
        """Magnitudes of the diagonal of K, own rows, (k,)."""
        return np.abs(self.own_diagonal)

    def times(self, x: Array) -> Array:
        """K times own values x, (k,): own rows, (k,)."""
        return self._product(self.matrix, x, lambda entries: entries)

    def times_magnitudes(self, x: Array) -> Array:
        """|K| times own values x, (k,), at least 0, own rows, (k,): a bound of internal ones."""
        starts, columns, values = self.matrix.getValuesCSR()
        np.abs(values, out=values)
        csr = starts, columns, values
        magnitudes = petsc().Mat().createAIJ(self.matrix.getSizes(), csr=csr, comm=world())
        del starts, columns, values, csr
        product = self._product(magnitudes, x, np.abs)
        magnitudes.destroy()  # here and below: PETSc keeps what Python alone lets go
        return product

    def _product(self, matrix: Any, x: Array, of: Callable[[Array], Array]) -> Array:
        local = np.zeros(len(self.exchange.numbers))
        local[self.exchange.owned] = x
        rows = self.rows
        target, source = rows.vector.duplicate(), rows.to_petsc(local[self.outer.owned])
        matrix.mult(source, target)
        y = np.zeros(len(local))
        y[self.outer.owned] = target.array_r[rows.positions]
        target.destroy()
        source.destroy()
        if self.columns:
            local = self.exchange.copied(x)
            for piece in self.pieces:
                piece.add_product(y, local, of)
            return self.exchange.added(y)
        return np.asarray(y[self.exchange.owned])

    def prepare(self, ksp: Any, nullspace: Any) -> None:
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
        if nullspace is not None:
            self.matrix.setNearNullSpace(nullspace)

    def empty_row(self) -> int:
        """PETSc's number of a row of zeros, -1 if there is none."""
        starts, _, values = self.matrix.getValuesCSR()
        sums = np.add.reduceat(np.append(np.abs(values), 0.0), starts[:-1])
        sums[starts[:-1] == starts[1:]] = 0.0
        empty = self.outer.owned[sums[self.rows.positions] == 0.0]
        first = int(self.exchange.numbers[empty].min()) if len(empty) else -1
        return next((n for n in world().allgather(first) if n >= 0), -1)


class DistributedOperator(Protocol):
    """Interface of a distributed tangent to `PetscSolver` and Newton's method: `PetscMatrix`, whose
    docstrings describe the methods, or `MatrixFreeShell`.
    """

    @property
    def matrix(self) -> Any:
        """PETSc's."""
        ...

    @property
    def exchange(self) -> HaloExchange:
        """Of all unknowns."""
        ...

    @property
    def rows(self) -> HaloExchange:
        """Of PETSc's vectors."""
        ...

    def solved(self, solver: PetscSolver, r: Array) -> Array:
        """See the class."""
        ...

    def fill(
        self,
        assembler: Assembler,
        x: Array,
        parameters: Mapping[str, Array],
        defect: Array,
        times: SolverTimes,
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

    def prepare(self, ksp: Any, nullspace: Any) -> None:
        """See the class."""
        ...

    def empty_row(self) -> int:
        """See the class."""
        ...


@dataclass(eq=False)
class PetscSolver:
    """Krylov method and preconditioner, by PETSc's options; the default of a matrix is MUMPS below
    `DIRECT_BELOW` unknowns and GMRES with algebraic multigrid above.

    near: what multigrid should know of (rigid-body motions), or None. fields: name -> own numbers
    of unknowns, for `-pc_type fieldsplit`.
    """

    options: Mapping[str, object]
    nullspace: Any = None
    fields: Mapping[str, Integers] = field(default_factory=dict)
    times: SolverTimes = field(default_factory=SolverTimes)
    _ksp: Any = field(default=None, init=False, repr=False)

    def solve(self, tangent: DistributedOperator, r: Array) -> Array:
        """Local x of the matrix for own values r, both of `rows`.

        Raises SingularMatrix on all processes.
        """
        began = time.perf_counter()
        reason = 0
        with _options_of_petsc(self.options):
            ksp = self._prepared(tangent)
            b = tangent.rows.to_petsc(r)
            x = b.duplicate()
            try:
                ksp.solve(b, x)
                reason = ksp.getConvergedReason()
            except petsc().Error as error:
                raise SingularMatrix(f"PETSc: {_error_message(error)}") from None
            finally:
                self.times.solver += time.perf_counter() - began
        self.times.solves += 1
        self.times.iterations += ksp.getIterationNumber()
        size, solution = x.norm(), tangent.rows.local(x)
        b.destroy()
        x.destroy()
        if reason < 0 or not np.isfinite(size):
            row = tangent.empty_row()
            message = (
                f"PETSc's {ksp.getType()} with {ksp.getPC().getType()} failed (reason {reason})"
            )
            raise SingularMatrix(message, None if row < 0 else row)
        return solution

    @property
    def direct(self) -> bool:
        """True if a further right-hand side costs no iterations."""
        return self._ksp is not None and self._ksp.getType() == "preonly"

    def reset(self) -> None:
        """Destroy the solver of another matrix."""
        if self._ksp is not None:
            self._ksp.destroy()
        self._ksp = None

    def _prepared(self, tangent: DistributedOperator) -> Any:
        if self._ksp is None:
            self._ksp = self._new(tangent)
        self._ksp.setOperators(tangent.matrix)
        return self._ksp

    def _new(self, tangent: DistributedOperator) -> Any:
        PETSc = petsc()
        ksp = PETSc.KSP().create(world())
        pc = ksp.getPC()
        tangent.prepare(ksp, self.nullspace)
        ksp.setFromOptions()
        if pc.getType() == "fieldsplit":
            first = tangent.matrix.getOwnershipRange()[0]
            parts = [
                (name, PETSc.IS().createGeneral((first + positions).astype(PETSc.IntType), world()))
                for name, positions in self.fields.items()
            ]
            pc.setFieldSplitIS(*parts)
        return ksp


@contextmanager
def _options_of_petsc(options: Mapping[str, object]) -> Iterator[None]:
    """Options in PETSc's database for one solve: the database is global, and other solvers read it.

    Preconditioners read the options of their parts when they are set up, in the first solve.
    """
    database = petsc().Options()
    names = {name.removeprefix("-"): value for name, value in options.items()}
    before = {name: database.getString(name) for name in names if database.hasName(name)}
    for name, value in names.items():
        database[name] = value
    try:
        yield
    finally:
        for name in names:
            if name in before:
                database[name] = before[name]
            else:
                database.delValue(name)


def _error_message(error: BaseException) -> str:
    """Message of PETSc's error without the call stack."""
    return " ".join(str(error).split()).rsplit("] ", 1)[-1]
