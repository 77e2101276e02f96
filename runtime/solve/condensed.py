"""A problem R(x) = B(x) + L(x) of a body and a thin layer, and its system condensed onto the layer.

The layer L knows few of the unknowns. With the Schur complement S of a tangent of the body, made at
some state, and the condensed residual g of the body at an iterate x, the condensed system is

    S (a - a_x) + g(x) + L_shared(a, p) = 0,   L_own(a, p) = 0

in the unknowns a that both share and the unknowns p that only the layer has; these are eliminated
piece by piece.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import lapack

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.cut import Parts
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

    def layer_linearise(self, x: Array) -> tuple[Array, Parts]:
        """L(x), (m + k,), and its tangent, cut after the shared unknowns."""
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

    def linearise(self, y: Array) -> tuple[Array, Parts]:
        """Residual (m + k,) and the layer's part of the tangent."""
        r, L = self.problem.layer_linearise(y)
        shared = self.problem.shared
        r = r.copy()
        r[: len(shared)] += self.g + self.schur @ (y - self.at.x)[shared]
        return r, L

    def residual(self, y: Array) -> Array:
        """Residual (m + k,)."""
        r, shared = self.problem.layer_residual(y).copy(), self.problem.shared
        r[: len(shared)] += self.g + self.schur @ (y - self.at.x)[shared]
        return r

    def norm(self, r: Array) -> float:
        """Size of r as a part of a full residual."""
        full, m = np.zeros_like(self.at.x), len(self.problem.shared)
        full[self.problem.shared] = r[:m]
        full[self.problem.own] = r[m:]
        return residual_size(self.problem, full)

    def step(self, r: Array, L: Parts) -> Array:
        """Newton step (n,)."""
        x, m = solved(self.schur, L, r), len(self.problem.shared)
        step = np.zeros_like(self.at.x)
        step[self.problem.shared] = -x[:m]
        step[self.problem.own] = -x[m:]
        if not np.isfinite(step).all():
            raise SingularMatrix("the condensed system has no finite solution")
        return step

    def limit(self, x: Array, dx: Array) -> float:
        return self.problem.layer_limit(x, dx)


def solved(schur: Array, L: Parts, r: Array) -> Array:
    """Unknowns (m + k,) of the layer's tangent with S (m, m) added, for r (m + k,).

    Raises SingularMatrix.
    """
    x = L.cut.elimination.solve(schur, L.data, r)
    if x is None:  # a piece is singular, which the whole may not be
        A, m = L.matrix.toarray(order="F"), L.cut.m
        A[:m, :m] += schur
        _, _, x, info = lapack.dgesv(A, r, overwrite_a=True)
        if info:
            raise SingularMatrix("the condensed system has no LU factors")
    return np.asarray(x)


def residual_size(problem: NonlinearProblem, r: Array) -> float:
    norm = float(problem.norm(r)) if np.isfinite(r).all() else math.inf
    return norm if math.isfinite(norm) else math.inf
