"""Intel MKL PARDISO through the library that pypardiso brings: several times SuperLU's speed.

Structurally symmetric matrices are factorised as such (type 1), all others as general ones (type
11). The symbolic analysis is done once for each pattern and used again by later matrices; the
memory of factors goes back when they are no longer referred to. The matrix is passed row by row.
"""

from __future__ import annotations

import ctypes
import weakref
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.linear.linear_solver import (
    Factorisation,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
    equilibrate,
)

Small = NDArray[np.int32]

_STRUCTURALLY_SYMMETRIC, _GENERAL = 1, 11
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _BACKWARD, _RELEASE = 11, 22, 33, 331, 333, -1
_ERRORS = {-2: "not enough memory", -3: "no ordering", -4: "a zero pivot", -7: "singular diagonal"}


@cache
def available() -> bool:
    """True if the library is installed and can be loaded."""
    try:
        _library()
    except (ImportError, OSError, AttributeError):
        return False
    return True


@cache
def _library() -> Any:
    from pypardiso import PyPardisoSolver  # it knows where its library lies

    function = PyPardisoSolver().libmkl.pardiso
    integer, pointer = ctypes.POINTER(ctypes.c_int32), ctypes.c_void_p
    function.argtypes = [pointer, *[integer] * 5, *[pointer] * 4, integer, pointer, integer]
    function.argtypes += [pointer, pointer, integer]
    function.restype = None
    return function


@dataclass(frozen=True, eq=False)
class _Structure:
    """A pattern by rows. indptr, indices: of csr, counted from 1; order: (nnz,) positions of the
    entries in csc data; last: (n,) flags of the unknowns that stay in the Schur complement.
    """

    kind: int
    csc: tuple[Small, Small]
    indptr: Small
    indices: Small
    order: NDArray[np.intp]
    last: Small

    @classmethod
    def of(cls, K: SparseMatrix, boundary: Integers) -> _Structure:
        n = K.shape[0]
        count = csc_array((np.arange(1.0, K.nnz + 1.0), K.indices, K.indptr), shape=(n, n)).tocsr()
        count.sort_indices()
        mirrored = np.array_equal(count.indptr, K.indptr)
        mirrored = mirrored and np.array_equal(count.indices, K.indices)
        rows = np.repeat(np.arange(n), np.diff(count.indptr))
        mirrored = mirrored and int((rows == count.indices).sum()) == n
        last = np.zeros(n, dtype=np.int32)
        last[boundary] = 1
        return cls(
            kind=_STRUCTURALLY_SYMMETRIC if mirrored else _GENERAL,
            csc=(K.indptr.copy(), K.indices.copy()),
            indptr=(count.indptr + 1).astype(np.int32),
            indices=(count.indices + 1).astype(np.int32),
            order=count.data.astype(np.intp) - 1,
            last=last,
        )

    def fits(self, K: SparseMatrix, boundary: Integers) -> bool:
        """True if K has this pattern, and the boundary is the same."""
        return (
            np.array_equal(self.csc[0], K.indptr)
            and np.array_equal(self.csc[1], K.indices)
            and int(self.last.sum()) == len(boundary)
            and bool(self.last[boundary].all())
        )


class _Handle:
    """PARDISO's own memory for one pattern, and the one matrix that it holds the factors of."""

    def __init__(self, structure: _Structure, perturbation: int) -> None:
        self.structure = structure
        self.size = len(structure.indptr) - 1
        self._memory = np.zeros(64, dtype=np.int64)
        self._settings = _settings(structure, perturbation)
        self._data = np.empty(0)
        self.perturbed = 0
        nothing = np.empty(0)
        release = weakref.finalize(
            self,
            _call,
            phase=_RELEASE,
            memory=self._memory,
            settings=self._settings,
            structure=structure,
            data=nothing,
            b=nothing,
            x=nothing,
        )
        release.atexit = False

    def factorise(self, K: SparseMatrix, schur: Array) -> None:
        """Factorise a matrix of the pattern; the Schur complement (m, m) is written to `schur`."""
        fresh = not len(self._data)
        self._data = K.data[self.structure.order]
        if fresh:
            self.call(_ANALYSE, np.zeros(self.size), np.zeros(self.size))
        self.call(_FACTORISE, np.zeros(self.size), schur)
        self.perturbed = int(self._settings[13])

    def call(self, phase: int, b: Array, x: Array) -> None:
        """One phase with this right side, writing to x; raises SingularMatrix."""
        _call(phase, self._memory, self._settings, self.structure, self._data, b, x)

    def solve(self, b: Array) -> Array:
        """x of K x = b, shapes (n,), without a check."""
        x = np.empty(self.size)
        self.call(_SOLVE, np.ascontiguousarray(b, dtype=np.float64), x)
        return x


def _settings(structure: _Structure, perturbation: int) -> Small:
    general, condensed = structure.kind == _GENERAL, bool(structure.last.any())
    iparm = np.zeros(64, dtype=np.int32)
    iparm[0] = 1  # these settings, no defaults
    iparm[1] = 2  # nested dissection
    iparm[9] = perturbation  # pivots below 10^-perturbation |K| are lifted to it
    iparm[10] = iparm[12] = int(general)  # scaling and matching look at values: not once a pattern
    iparm[23] = int(condensed)  # the factorisation that the Schur complement asks for
    iparm[35] = 2 * int(condensed)
    return iparm


def _call(
    phase: int,
    memory: Integers,
    settings: Small,
    structure: _Structure,
    data: Array,
    b: Array,
    x: Array,
) -> None:
    """PARDISO itself; raises SingularMatrix on its errors."""

    def number(value: int) -> Any:
        return ctypes.byref(ctypes.c_int32(value))

    error = ctypes.c_int32(0)
    _library()(
        memory.ctypes.data,
        *(number(v) for v in (1, 1, structure.kind, phase, len(structure.indptr) - 1)),
        *(a.ctypes.data for a in (data, structure.indptr, structure.indices, structure.last)),
        number(1),
        settings.ctypes.data,
        number(0),
        b.ctypes.data,
        x.ctypes.data,
        ctypes.byref(error),
    )
    if error.value and phase != _RELEASE:
        reason = _ERRORS.get(error.value, f"error {error.value}")
        raise SingularMatrix(f"PARDISO, phase {phase}: {reason}")


@dataclass(frozen=True, eq=False)
class _Lent:
    """Lease of a handle; after its release another matrix of the pattern may use the handle."""

    handle: _Handle

    def solve(self, b: Array) -> Array:
        return self.handle.solve(b)


@dataclass(frozen=True, eq=False)
class PartialFactors:
    """Factors of all but the boundary unknowns; see `SchurComplement`."""

    handle: _Handle
    boundary: Integers
    schur: Array

    def reduce(self, r: Array) -> tuple[Array, Array]:
        """See `SchurComplement`."""
        y = np.empty(self.handle.size)
        self.handle.call(_FORWARD, np.ascontiguousarray(r, dtype=np.float64), y)
        return y[self.boundary].copy(), y

    def extend(self, reduced: Array, x: Array) -> Array:
        """See `SchurComplement`."""
        y, full = reduced.copy(), np.empty(self.handle.size)
        y[self.boundary] = x
        self.handle.call(_BACKWARD, y, full)
        full[self.boundary] = x
        return full


@dataclass(eq=False)
class Idle:
    """Analysed patterns that are free for the next matrix: changes with every matrix.

    handles: the oldest first, at most `keep` of them.
    """

    keep: int = 2
    handles: list[_Handle] = field(default_factory=list)

    def take(self, K: SparseMatrix, boundary: Integers) -> _Handle | None:
        """A handle that fits the pattern of K, no longer idle; None if there is none."""
        for handle in self.handles:
            if handle.structure.fits(K, boundary):
                self.handles.remove(handle)
                return handle
        return None

    def give_back(self, handle: _Handle) -> None:
        """Make a handle idle."""
        self.handles.append(handle)
        del self.handles[: -self.keep]


@dataclass
class Pardiso:
    """MKL PARDISO with the symbolic analysis kept for the next matrix of the same pattern.

    perturbation: pivots below 10^-perturbation |K| are lifted to it, which multipliers with a zero
    diagonal need; `refinement` steps give the digits back. accuracy: as for SuperLU. settled:
    largest relative size of the last correction; a singular matrix is found out by it.
    All of these are settings; `idle` changes with every matrix.
    """

    perturbation: int = 8
    refinement: int = 2
    accuracy: float = 1e-6
    settled: float = 1e-3
    name: str = "pardiso"
    idle: Idle = field(default_factory=Idle, compare=False, repr=False)

    def factorise(self, K: SparseMatrix) -> Factorisation:
        """Factors of K, square, shape (n, n), csc; raises SingularMatrix."""
        K, row_sums, units = equilibrate(K)
        handle = self._handle(K, np.empty(0, dtype=np.int64))
        handle.factorise(K, np.empty(0))
        lent = _Lent(handle)
        weakref.finalize(lent, self.idle.give_back, handle).atexit = False
        return Factorisation(
            matrix=K,
            factors=lent,
            row_sums=row_sums,
            refinement=self.refinement,
            accuracy=self.accuracy,
            settled=self.settled,
            units=units,
        )

    def condense(self, K: SparseMatrix, boundary: Integers) -> PartialFactors:
        """Factors of K, (n, n), without those unknowns, (m,), and their Schur complement."""
        checked_row_sums(K)
        order = np.sort(boundary)
        if not np.array_equal(order, boundary):
            raise ValueError("condense: the boundary unknowns must be given in rising order")
        handle = self._handle(K, boundary)
        schur = np.zeros((len(boundary), len(boundary)))
        handle.factorise(K, schur)
        partial = PartialFactors(handle, boundary, schur)
        weakref.finalize(partial, self.idle.give_back, handle).atexit = False
        return partial

    def _handle(self, K: SparseMatrix, boundary: Integers) -> _Handle:
        """A handle for this pattern that nobody uses; analysed already if there is one."""
        handle = self.idle.take(K, boundary)
        return handle or _Handle(_Structure.of(K, boundary), self.perturbation)
