"""Chord Newton method on the Schur complement of a stale tangent.

For a problem R(x) = B(x) + L(x) of a body and a thin, strongly nonlinear layer on its boundary: the
body is nearly linear over the remaining change of x, so one condensation of it serves many
iterations. The layer L knows few of the unknowns. With the Schur complement S of a tangent of the
body, made at some state, and the condensed residual g of the body at an iterate x, the condensed
system is

    S (a - a_x) + g(x) + L_shared(a, p) = 0,   L_own(a, p) = 0

in the unknowns a that both share and the unknowns p that only the layer has; these are eliminated
by nested dissection. An outer iteration solves the condensed system by Newton's method; outer
iterates are mixed after Anderson (1965). The residual is always that of the full problem, so the
fixed point is the exact solution however stale the Schur complement is: staleness costs iterations
only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.linalg import lapack

from softehl.cases.seal.correctors.layer_split import Parts
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.linear.linear_solver import SchurComplement, SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import NonlinearProblem
from softehl.runtime.solve.solution import Solution, Status


class LayeredProblem(NonlinearProblem, Protocol):
    """A problem R(x) = B(x) + L(x) in n unknowns."""

    @property
    def shared(self) -> Integers:
        """Unknowns (m,) that occur in both parts, rising."""
        ...

    @property
    def interior(self) -> Integers:
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
        full[self.problem.interior] = r[m:]
        return residual_size(self.problem, full)

    def step(self, r: Array, L: Parts) -> Array:
        """Newton step (n,)."""
        x, m = solved(self.schur, L, r), len(self.problem.shared)
        step = np.zeros_like(self.at.x)
        step[self.problem.shared] = -x[:m]
        step[self.problem.interior] = -x[m:]
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


@dataclass
class AndersonMixing:
    """The latest iterates of one solve, at most depth + 1: `add` and `clear` change them."""

    problem: LayeredProblem
    depth: int
    iterates: list[Iterate] = field(default_factory=list)

    @property
    def latest(self) -> Iterate:
        return self.iterates[-1]

    def add(self, x: Array, r: Array) -> None:
        """Add x with its residual r, both (n,)."""
        problem, body = self.problem, r.copy()
        body[problem.shared] -= problem.layer_residual(x)[: len(problem.shared)]
        body[problem.interior] = 0.0
        self.iterates.append(Iterate(x, r, body))
        del self.iterates[: -self.depth - 1]

    def clear(self) -> None:
        self.iterates.clear()

    def mixed(self) -> Iterate:
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
        return Iterate(x, r, body) if self.problem.layer_limit(now.x, x - now.x) == 1.0 else now


_CUTS = (1.0, 0.3, 0.1, 0.03)  # of a step, one after the other
_MUCH = 1.5  # times the residual before
_STUCK = "the layer's own iteration failed"
_WILD, _WILD_STEPS = 1e3, 5
"""Times the least residual, and how many inner iterations in a row above that are in vain."""


@dataclass(frozen=True)
class ModifiedNewton:
    """Settings of the iteration.

    tolerance, stagnation: of the full residual, as for Newton. max_outer, max_inner: iterations
    of one solve and of one inner system. inner_gain: an inner system is solved to this fraction
    of the residual that the outer iteration has. contraction: slowest mean reduction of the
    residual over `window` iterations; a slower one ends the solve. depth: of Anderson's mixing,
    0 = none.
    """

    tolerance: float = 1e-9
    max_outer: int = 25
    stagnation: float = 100.0
    max_inner: int = 12
    inner_gain: float = 1e-3
    contraction: float = 0.6
    window: int = 3
    depth: int = 4

    def solve(self, problem: LayeredProblem, condensed: SchurComplement, x0: Array) -> Solution:
        """Solve R(x) = 0 from x0, (n,), with the body's condensation at a state near by."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return self._solve(problem, condensed, problem.admissible(x0))

    def _solve(self, problem: LayeredProblem, condensed: SchurComplement, x: Array) -> Solution:
        history = AndersonMixing(problem, self.depth)
        history.add(x, problem.residual(x))
        norms = [residual_size(problem, history.latest.r)]
        best = x
        while True:
            if norms[-1] == min(norms):
                best = x
            status = self._status(norms)
            if status is not None:
                return _solution(x, status, norms, best=best)
            start = history.latest if len(norms) < 3 else history.mixed()
            y = self._outer(problem, condensed, start, self._target(norms[-1]))
            if y is None:
                return _solution(x, Status.DIVERGED, norms, _STUCK, best)
            if len(norms) == 1:
                history.clear()  # the start does not fulfil the layer's equations, all others do
            x = y
            history.add(x, problem.residual(x))
            norms.append(residual_size(problem, history.latest.r))

    def _exhausted(self, previous: float, norm: float) -> bool:
        """True if nothing but rounding is left."""
        return 0.5 * previous < norm <= self.stagnation * self.tolerance

    def _target(self, norm: float) -> float:
        return max(0.1 * self.tolerance, self.inner_gain * norm)

    def _status(self, norms: list[float]) -> Status | None:
        """End of the solve at these norms, None if it goes on."""
        if norms[-1] <= self.tolerance:
            return Status.CONVERGED
        if len(norms) > 4 and self._exhausted(min(norms[1:-2]), min(norms[-2:])):
            return Status.CONVERGED
        if not math.isfinite(norms[-1]):
            return Status.NOT_FINITE
        if len(norms) > self.max_outer:
            return Status.MAX_ITERATIONS
        # the first norm is that of the start, which the layer had not met yet
        index = len(norms) - 1 - self.window
        if index >= 1 and norms[-1] > self.contraction**self.window * norms[index]:
            return Status.MAX_ITERATIONS
        return None

    def _outer(
        self, problem: LayeredProblem, condensed: SchurComplement, at: Iterate, target: float
    ) -> Array | None:
        """The next iterate, None if the inner iteration fails."""
        g, reduced = condensed.reduce(at.body)
        inner = CondensedSystem(problem, condensed.schur, g, at)
        y = self._inner(inner, at.x, target)
        if y is None:
            y = self._inner(inner, at.x, target, cautious=True)
        if y is None:
            return None
        dx = -condensed.extend(reduced, (at.x - y)[problem.shared])
        dx[problem.interior] = (y - at.x)[problem.interior]
        return np.asarray(at.x + dx)

    def _inner(
        self, inner: CondensedSystem, x: Array, target: float, *, cautious: bool = False
    ) -> Array | None:
        """x with the shared and own unknowns that solve the small system, or nearly do.

        cautious: whether its steps are shortened where they make the residual larger, which
        hinders as often as it helps.
        """
        best, lowest, last_norm, wild = x, math.inf, math.inf, 0
        for _ in range(self.max_inner):
            r, L = inner.linearise(x)
            norm = inner.norm(r)
            if norm < lowest:
                best, lowest = x, norm
            wild = wild + 1 if norm > _WILD * lowest and not cautious else 0
            ended = self._exhausted(last_norm, norm) or wild == _WILD_STEPS
            if norm <= target or ended or not math.isfinite(norm):
                break
            try:
                step = inner.step(r, L)
            except SingularMatrix:
                return None
            fraction = inner.limit(x, step)
            x = _along(inner, x, fraction * step, norm) if cautious else x + fraction * step
            last_norm = norm
        # an active set may cycle where the outer iterate is still rough: it need not be exact there
        enough = max(target, self.stagnation * self.tolerance, 0.1 * inner.start)
        return best if lowest <= enough else None


def _along(inner: CondensedSystem, x: Array, step: Array, norm: float) -> Array:
    """The next inner iterate (n,); nearer where the step makes the residual much larger.

    A kink of the layer may lie within a step, as where it begins to cavitate.
    """
    nearest, lowest = x, math.inf
    for cut in _CUTS:
        y = x + cut * step
        size = inner.norm(inner.residual(y))
        if size < lowest:
            nearest, lowest = y, size
        if lowest <= _MUCH * norm:
            break
    return nearest


def _solution(
    x: Array, status: Status, norms: list[float], message: str = "", best: Array | None = None
) -> Solution:
    return Solution(
        x=x,
        status=status,
        message=message or f"last norms {', '.join(f'{n:.1e}' for n in norms[-4:])}",
        residual_norms=tuple(norms),
        factorisations=0,
        iterations=len(norms) - 1,
        best=None if best is x or status is Status.CONVERGED else best,
    )
