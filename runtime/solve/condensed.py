"""A problem R(x) = B(x) + L(x) of a body and a thin layer, and its system condensed onto the layer.

The layer L knows few of the unknowns. With the Schur complement S of a tangent of the body, made at
some state, and the condensed residual g of the body at an iterate x, the condensed system is

    S (a - a_x) + g(x) + L_shared(a, p) = 0,   L_own(a, p) = 0

in the unknowns a that both share and the unknowns p that only the layer has; these are eliminated
by a banded factorisation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import linalg as dense
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.linear import SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import NonlinearProblem


class LayeredProblem(NonlinearProblem, Protocol):
    """A problem R(x) = B(x) + L(x) in n unknowns."""

    @property
    def shared(self) -> Integers:
        """Unknowns (m,) that occur in both parts, rising."""
        ...

    @property
    def own(self) -> Integers:
        """Unknowns (k,) that only the layer has, numbered along it."""
        ...

    def admissible(self, x: Array) -> Array:
        """x with whatever values are prescribed."""
        ...

    def body(self, x: Array) -> SparseMatrix:
        """dB/dx, (n, n), csc; rows and columns of `own` are those of the identity."""
        ...

    def layer_residual(self, x: Array) -> Array:
        """L(x), (m + k,), shared unknowns first."""
        ...

    def layer_linearise(self, x: Array) -> tuple[Array, SparseMatrix]:
        """L(x), (m + k,), and its tangent, (m + k, m + k), csc."""
        ...

    def scaled(self, r: Array) -> Array:
        """Dimensionless residual, (n,); its 2-norm is `norm`."""
        ...

    def layer_limit(self, x: Array, dx: Array) -> float:
        """Largest fraction of the step dx that the layer admits, in (0, 1]."""
        ...


@dataclass(frozen=True, eq=False)
class Iterate:
    """An outer iterate x with the residual r and the body's part of it, all (n,)."""

    x: Array
    r: Array
    body: Array


@dataclass(frozen=True, eq=False)
class CondensedSystem:
    """The condensed system at the outer iterate `at`. g: (m,) condensed residual of the body."""

    problem: LayeredProblem
    schur: Array
    g: Array
    at: Iterate

    @property
    def start(self) -> float:
        """Size of the residual at the outer iterate."""
        return residual_size(self.problem, self.at.r)

    def linearise(self, y: Array) -> tuple[Array, SparseMatrix]:
        """Residual (m + k,) and the layer's part of the tangent."""
        r, L = self.problem.layer_linearise(y)
        shared = self.problem.shared
        r = r.copy()
        r[: len(shared)] += self.g + self.schur @ (y - self.at.x)[shared]
        return r, L

    def norm(self, r: Array) -> float:
        """Size of r as a part of a full residual."""
        full, m = np.zeros_like(self.at.x), len(self.problem.shared)
        full[self.problem.shared] = r[:m]
        full[self.problem.own] = r[m:]
        return residual_size(self.problem, full)

    def step(self, r: Array, L: SparseMatrix) -> Array:
        """Newton step (n,): the own unknowns by a banded solve, the shared by a dense one."""
        m = len(self.problem.shared)
        parts = Parts.of(L, m)
        eliminated = solve_banded(parts.own, np.column_stack([parts.shared[m:], r[m:]]))
        through = np.asarray(parts.right @ eliminated)[:m]
        A = self.schur + parts.shared[:m] - through[:, :m]
        b = r[:m] - through[:, m]
        try:
            a = dense.lu_solve(dense.lu_factor(A, check_finite=False), b, check_finite=False)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise SingularMatrix(f"the condensed system: {error}") from error
        step = np.zeros_like(self.at.x)
        step[self.problem.shared] = -a
        step[self.problem.own] = eliminated[:, :m] @ a - eliminated[:, m]
        if not np.isfinite(step).all():
            raise SingularMatrix("the condensed system has no finite solution")
        return step

    def limit(self, x: Array, dx: Array) -> float:
        return self.problem.layer_limit(x, dx)


@dataclass(frozen=True, eq=False)
class Entries:
    """Entries of a matrix (size, size): rows, columns and values, none twice."""

    size: int
    rows: Integers
    columns: Integers
    values: Array

    @classmethod
    def of(cls, A: SparseMatrix) -> Entries:
        """Those of a sparse matrix."""
        entries = A.tocoo()
        rows, columns = (part.astype(np.int64) for part in entries.coords)
        return cls(A.shape[0], rows, columns, entries.data)


@dataclass(frozen=True, eq=False)
class Parts:
    """A layer's tangent, cut between its shared and its own unknowns.

    shared: (m + k, m) its first columns, dense.  right: (m + k, k) the others.  own: (k, k).
    """

    shared: Array
    right: SparseMatrix
    own: Entries

    @classmethod
    def of(cls, L: SparseMatrix, m: int) -> Parts:
        """Cut L (m + k, m + k), csc without entries that are given twice."""
        size, first = L.shape[0], L.indptr[m]
        columns = np.repeat(np.arange(size), np.diff(L.indptr))
        shared = np.zeros((size, m))
        shared[L.indices[:first], columns[:first]] = L.data[:first]
        rows, data = L.indices[first:], L.data[first:]
        right = csc_array((data, rows, L.indptr[m:] - first), shape=(size, size - m))
        inner = (rows >= m) & (data != 0.0)  # elements couple more than their equations do
        chosen = rows[inner].astype(np.int64) - m, columns[first:][inner] - m
        return cls(shared, right, Entries(size - m, *chosen, data[inner]))


def solve_banded(A: Entries, b: Array) -> Array:
    """A^-1 b, (k, j), by LU of the band that holds A (k, k); raises SingularMatrix."""
    offset = A.rows - A.columns
    lower, upper = int(offset.max(initial=0)), int(-offset.min(initial=0))
    band = np.zeros((lower + upper + 1, A.size))
    band[upper + offset, A.columns] = A.values
    try:
        return np.asarray(dense.solve_banded((lower, upper), band, b, check_finite=False))
    except np.linalg.LinAlgError as error:
        raise SingularMatrix(f"the layer's own unknowns: {error}") from error


def residual_size(problem: NonlinearProblem, r: Array) -> float:
    norm = float(problem.norm(r)) if np.isfinite(r).all() else math.inf
    return norm if math.isfinite(norm) else math.inf
