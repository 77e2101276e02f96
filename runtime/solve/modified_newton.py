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
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy import linalg as dense
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.linear import Condensed, SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import NonlinearProblem
from softehl.runtime.solve.solution import Solution, Status


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


@dataclass(frozen=True)
class Chord:
    """Settings of the chord iteration.

    tolerance, stagnation: of the full residual, as for Newton. max_outer, max_inner: iterations
    of one solve and of one inner system. inner_gain: an inner system is solved to this fraction
    of the residual that the outer iteration has. contraction: slowest mean reduction of the
    residual over `patience` iterations; a slower one ends the solve. depth: of Anderson's mixing,
    0 = none.
    """

    tolerance: float = 1e-9
    max_outer: int = 25
    stagnation: float = 100.0
    max_inner: int = 12
    inner_gain: float = 1e-3
    contraction: float = 0.6
    patience: int = 3
    depth: int = 4

    def solve(self, problem: LayeredProblem, condensed: Condensed, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,), with the body's condensation at a state near by."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return self._solve(problem, condensed, problem.admissible(x0))

    def _solve(self, problem: LayeredProblem, condensed: Condensed, x: Array) -> Solution:
        history = _History(problem, self.depth)
        history.add(x, problem.residual(x))
        norms = [_size(problem, history.latest.r)]
        while True:
            status = self._status(norms)
            if status is not None:
                return _solution(x, status, norms)
            start = history.latest if len(norms) < 3 else history.mixed()
            y = self._outer(problem, condensed, start, self._target(norms[-1]))
            if y is None:
                return _solution(x, Status.DIVERGED, norms, "the layer's own iteration failed")
            if len(norms) == 1:
                history.clear()  # the start does not fulfil the layer's equations, all others do
            x = y
            history.add(x, problem.residual(x))
            norms.append(_size(problem, history.latest.r))

    def _exhausted(self, before: float, norm: float) -> bool:
        """Whether nothing but rounding is left."""
        return 0.5 * before < norm <= self.stagnation * self.tolerance

    def _target(self, norm: float) -> float:
        return max(0.1 * self.tolerance, self.inner_gain * norm)

    def _status(self, norms: list[float]) -> Status | None:
        """How the solve ends at these norms, None if it goes on."""
        if norms[-1] <= self.tolerance:
            return Status.CONVERGED
        if len(norms) > 4 and self._exhausted(min(norms[1:-2]), min(norms[-2:])):
            return Status.CONVERGED
        if not math.isfinite(norms[-1]):
            return Status.NOT_FINITE
        if len(norms) > self.max_outer:
            return Status.MAX_ITERATIONS
        # the first norm is that of the start, which the layer had not met yet
        before = len(norms) - 1 - self.patience
        if before >= 1 and norms[-1] > self.contraction**self.patience * norms[before]:
            return Status.MAX_ITERATIONS
        return None

    def _outer(
        self, problem: LayeredProblem, condensed: Condensed, at: _Iterate, target: float
    ) -> Array | None:
        """The next iterate, None if the inner iteration fails."""
        g, reduced = condensed.reduce(at.body)
        y = self._inner(_Inner(problem, condensed.schur, g, at), at.x, target)
        if y is None:
            return None
        dx = -condensed.extend(reduced, (at.x - y)[problem.shared])
        dx[problem.own] = (y - at.x)[problem.own]
        return np.asarray(at.x + dx)

    def _inner(self, inner: _Inner, x: Array, target: float) -> Array | None:
        """x with the shared and own unknowns that solve the small system, or nearly do."""
        best, least, before = x, math.inf, math.inf
        for _ in range(self.max_inner):
            r, L = inner.linearise(x)
            norm = inner.norm(r)
            if norm < least:
                best, least = x, norm
            exhausted = self._exhausted(before, norm)
            if norm <= target or exhausted or not math.isfinite(norm):
                break
            try:
                step = inner.step(r, L)
            except SingularMatrix:
                return None
            x, before = x + inner.limit(x, step) * step, norm
        # an active set may cycle where the outer iterate is still rough: it need not be exact there
        enough = max(target, self.stagnation * self.tolerance, 0.1 * inner.start)
        return best if least <= enough else None


@dataclass(frozen=True, eq=False)
class _Iterate:
    """An outer iterate x with the residual r and the body's part of it, all (n,)."""

    x: Array
    r: Array
    body: Array


@dataclass(frozen=True, eq=False)
class _Inner:
    """The small system at the outer iterate `at`, with its condensed residual g (m,)."""

    problem: LayeredProblem
    schur: Array
    g: Array
    at: _Iterate

    @property
    def start(self) -> float:
        """Size of the residual at the outer iterate."""
        return _size(self.problem, self.at.r)

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
        return _size(self.problem, full)

    def step(self, r: Array, L: SparseMatrix) -> Array:
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
        step = np.zeros_like(self.at.x)
        step[self.problem.shared] = -a
        step[self.problem.own] = eliminated[:, :m] @ a - eliminated[:, m]
        if not np.isfinite(step).all():
            raise SingularMatrix("the condensed system has no finite solution")
        return step

    def limit(self, x: Array, dx: Array) -> float:
        return self.problem.layer_limit(x, dx)


def solve_banded(A: SparseMatrix, b: Array) -> Array:
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
class _History:
    """The latest iterates, for Anderson's mixing."""

    problem: LayeredProblem
    depth: int
    iterates: list[_Iterate] = field(default_factory=list)

    @property
    def latest(self) -> _Iterate:
        return self.iterates[-1]

    def add(self, x: Array, r: Array) -> None:
        """Add x with its residual r, both (n,)."""
        problem, body = self.problem, r.copy()
        body[problem.shared] -= problem.layer_residual(x)[: len(problem.shared)]
        body[problem.own] = 0.0
        self.iterates.append(_Iterate(x, r, body))
        del self.iterates[: -self.depth - 1]

    def clear(self) -> None:
        self.iterates.clear()

    def mixed(self) -> _Iterate:
        """The combination of the iterates with the smallest residual, were it linear in x."""
        now, others = self.latest, self.iterates[:-1]
        if not others:
            return now
        scaled = self.problem.scaled(now.r)
        changes = np.stack([self.problem.scaled(o.r) - scaled for o in others], axis=1)
        weights = np.linalg.lstsq(changes, -scaled, rcond=1e-10)[0]
        x, r, body = now.x, now.r, now.body
        for weight, other in zip(weights, others, strict=True):
            x = x + weight * (other.x - now.x)
            r = r + weight * (other.r - now.r)
            body = body + weight * (other.body - now.body)
        return _Iterate(x, r, body) if self.problem.layer_limit(now.x, x - now.x) == 1.0 else now


def _size(problem: NonlinearProblem, r: Array) -> float:
    norm = float(problem.norm(r)) if np.isfinite(r).all() else math.inf
    return norm if math.isfinite(norm) else math.inf


def _solution(x: Array, status: Status, norms: list[float], message: str = "") -> Solution:
    return Solution(
        x=x,
        status=status,
        message=message or f"chord, last norms {', '.join(f'{n:.1e}' for n in norms[-4:])}",
        residual_norms=tuple(norms),
        factorisations=0,
        iterations=len(norms) - 1,
    )
