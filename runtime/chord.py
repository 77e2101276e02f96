"""Chord iteration for a body with a thin, strongly nonlinear layer on its boundary.

R(x) = B(x) + L(x), where the layer L knows few of the unknowns and the body B is nearly linear on
the way that x still has to go. The body is condensed once onto the unknowns that both share; then
an outer iteration takes

    S (a - a_x) + g(x) + L_shared(a, p) = 0,   L_own(a, p) = 0

with the Schur complement S of a frozen tangent and the exact, condensed residual g of the body at
x. The inner iteration solves this small system by Newton's method, the unknowns p that only the
layer has being eliminated by a banded factorisation. Outer iterates are mixed after Anderson
(1965). The fixed point is the exact solution, whatever the age of S: age costs iterations only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import linalg as dense
from scipy.sparse import csc_array

from runtime.linear import Condensed, Condenser, SingularMatrix, SparseMatrix
from runtime.newton import Newton, NonlinearProblem
from runtime.solution import Solution, Status, Vector

Integers = NDArray[np.int64]
Matrix = NDArray[np.float64]


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

    def admissible(self, x: Vector) -> Vector:
        """x with whatever values are prescribed."""
        ...

    def body(self, x: Vector) -> SparseMatrix:
        """dB/dx, (n, n), csc; rows and columns of `own` are those of the identity."""
        ...

    def layer_residual(self, x: Vector) -> Vector:
        """L(x), (m + k,), shared unknowns first."""
        ...

    def layer_linearise(self, x: Vector) -> tuple[Vector, SparseMatrix]:
        """L(x), (m + k,), and its tangent, (m + k, m + k), csc."""
        ...

    def layer_limit(self, x: Vector, dx: Vector) -> float:
        """Largest fraction of the step dx that the layer admits, in (0, 1]."""
        ...


@dataclass(frozen=True)
class Chord:
    """Settings of the chord iteration.

    tolerance: of the full residual, as for Newton. max_outer, max_inner: iterations of one solve
    and of one inner system. inner_gain: an inner system is solved to this fraction of the
    residual that the outer iteration has. contraction: slowest mean reduction of the residual
    over `patience` iterations; a slower one ends the solve. depth: of Anderson's mixing, 0 = none.
    """

    tolerance: float = 1e-9
    max_outer: int = 25
    max_inner: int = 12
    inner_gain: float = 0.02
    contraction: float = 0.6
    patience: int = 3
    depth: int = 4

    def solve(self, problem: LayeredProblem, condensed: Condensed, x0: Vector) -> Solution:
        """Solve R(x) = 0 from x0, (n,), with the body's condensation at a state near by."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return self._solve(problem, condensed, problem.admissible(x0))

    def _solve(self, problem: LayeredProblem, condensed: Condensed, x: Vector) -> Solution:
        mixing = _Mixing(self.depth)
        r = problem.residual(x)
        norms = [_size(problem, r)]
        while True:
            status = self._status(norms)
            if status is not None:
                return _solution(x, status, norms)
            target = max(0.1 * self.tolerance, self.inner_gain * norms[-1])
            y = self._outer(problem, condensed, x, r, target)
            if y is None:
                return _solution(x, Status.DIVERGED, norms, "the layer's own iteration failed")
            x = mixing.next(x, y)
            r = problem.residual(x)
            norms.append(_size(problem, r))

    def _status(self, norms: list[float]) -> Status | None:
        """How the solve ends at these norms, None if it goes on."""
        if norms[-1] <= self.tolerance:
            return Status.CONVERGED
        if not math.isfinite(norms[-1]):
            return Status.NOT_FINITE
        if len(norms) > self.max_outer:
            return Status.MAX_ITERATIONS
        # the first norm is that of the start, which the layer had not met yet
        before = len(norms) - 1 - self.patience
        if before >= 1 and norms[-1] > self.contraction**self.patience * norms[before]:
            return Status.DIVERGED
        return None

    def _outer(
        self, problem: LayeredProblem, condensed: Condensed, x: Vector, r: Vector, target: float
    ) -> Vector | None:
        """The next iterate, None if the inner iteration fails; r: residual at x."""
        m = len(problem.shared)
        body = r.copy()
        layer = problem.layer_residual(x)
        body[problem.shared] -= layer[:m]
        body[problem.own] = 0.0
        g, reduced = condensed.reduce(body)
        inner = _Inner(problem, condensed.schur, g, x, r)
        y = self._inner(inner, x, target)
        if y is None:
            return None
        dx = -condensed.extend(reduced, (x - y)[problem.shared])
        dx[problem.own] = (y - x)[problem.own]
        return x + dx

    def _inner(self, inner: _Inner, x: Vector, target: float) -> Vector | None:
        """x with the shared and own unknowns that solve the small system."""
        norm = math.inf
        for _ in range(self.max_inner):
            r, L = inner.linearise(x)
            norm = inner.norm(r)
            if norm <= target or not math.isfinite(norm):
                break
            try:
                step = inner.step(r, L)
            except SingularMatrix:
                return None
            x = x + inner.limit(x, step) * step
        else:
            norm = inner.norm(inner.linearise(x)[0])
        return x if norm <= max(target, 0.5 * inner.start) else None


@dataclass(frozen=True, eq=False)
class _Inner:
    """The small system at the outer iterate x with the residual r."""

    problem: LayeredProblem
    schur: Matrix
    g: Vector
    x: Vector
    r: Vector

    @property
    def start(self) -> float:
        """Size of the residual at the outer iterate."""
        return _size(self.problem, self.r)

    def linearise(self, y: Vector) -> tuple[Vector, SparseMatrix]:
        """Residual (m + k,) and the layer's part of the tangent."""
        r, L = self.problem.layer_linearise(y)
        shared = self.problem.shared
        r = r.copy()
        r[: len(shared)] += self.g + self.schur @ (y - self.x)[shared]
        return r, L

    def norm(self, r: Vector) -> float:
        """Size of r as a part of a full residual."""
        full, m = np.zeros_like(self.x), len(self.problem.shared)
        full[self.problem.shared] = r[:m]
        full[self.problem.own] = r[m:]
        return _size(self.problem, full)

    def step(self, r: Vector, L: SparseMatrix) -> Vector:
        """Newton step (n,): the own unknowns by a banded solve, the shared by a dense one."""
        m = len(self.problem.shared)
        own = L[m:, m:]
        right = np.column_stack([L[m:, :m].toarray(), r[m:]])
        eliminated = solve_banded(csc_array(own), right)
        A = self.schur + L[:m, :m].toarray() - L[:m, m:] @ eliminated[:, :m]
        b = r[:m] - L[:m, m:] @ eliminated[:, m]
        try:
            a = dense.lu_solve(dense.lu_factor(A, check_finite=False), b, check_finite=False)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise SingularMatrix(f"the condensed system: {error}") from error
        step = np.zeros_like(self.x)
        step[self.problem.shared] = -a
        step[self.problem.own] = eliminated[:, :m] @ a - eliminated[:, m]
        if not np.isfinite(step).all():
            raise SingularMatrix("the condensed system has no finite solution")
        return step

    def limit(self, x: Vector, dx: Vector) -> float:
        return self.problem.layer_limit(x, dx)


def solve_banded(A: SparseMatrix, b: Matrix) -> Matrix:
    """A^-1 b, (k, j), by LU of the band that holds A (k, k); raises SingularMatrix."""
    entries = A.tocoo()
    rows, columns = entries.coords
    offset = rows.astype(np.int64) - columns
    lower, upper = int(offset.max(initial=0)), int(-offset.min(initial=0))
    band = np.zeros((lower + upper + 1, A.shape[0]))
    band[upper + offset, columns] = entries.data
    try:
        return np.asarray(dense.solve_banded((lower, upper), band, b, check_finite=False))
    except np.linalg.LinAlgError as error:
        raise SingularMatrix(f"the layer's own unknowns: {error}") from error


@dataclass
class _Mixing:
    """Anderson's mixing of fixed-point iterates x -> y(x), over the last `depth` differences."""

    depth: int
    steps: list[Vector] = field(default_factory=list)
    images: list[Vector] = field(default_factory=list)

    def next(self, x: Vector, y: Vector) -> Vector:
        """The next x, from the pair (x, y(x)) and those before."""
        if not self.depth:
            return y
        self.steps.append(y - x)
        self.images.append(y)
        del self.steps[: -self.depth - 1], self.images[: -self.depth - 1]
        if len(self.steps) == 1:
            return y
        change = np.stack([b - self.steps[-1] for b in self.steps[:-1]], axis=1)
        images = np.stack([b - self.images[-1] for b in self.images[:-1]], axis=1)
        weights = np.linalg.lstsq(change, -self.steps[-1], rcond=1e-10)[0]
        return np.asarray(y + images @ weights)


def _size(problem: NonlinearProblem, r: Vector) -> float:
    norm = float(problem.norm(r)) if np.isfinite(r).all() else math.inf
    return norm if math.isfinite(norm) else math.inf


def _solution(x: Vector, status: Status, norms: list[float], message: str = "") -> Solution:
    return Solution(
        x=x,
        status=status,
        message=message or f"chord, last norms {', '.join(f'{n:.1e}' for n in norms[-4:])}",
        residual_norms=tuple(norms),
        factorisations=0,
        iterations=len(norms) - 1,
    )
