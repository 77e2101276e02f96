"""Bifurcations of a path: its tangent becomes singular without a turn of the load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.log import warn
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import CondensedMap, symmetric
from softehl.runtime.equations.system import System
from softehl.runtime.results.result import ModeShape, Result
from softehl.runtime.solve.eigen import nearest_zero
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Branch, Point

_SEARCHES = 20
_LOCATED = 1e-9
"""Of the load factor: a bifurcation is located where the next step is shorter."""


class MissedBifurcations(RuntimeWarning):
    """Bifurcations of a path are not detected: its tangent is unsymmetric or singular."""


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """State from which another branch leaves; `Study.follow(start=...)` follows that branch.

    Attributes
    ----------
    state : Result
        The result there.
    mode : ModeShape
        Direction of the other branch, 1 at its largest displacement.
    directions : int
        Number of directions that lost or gained stability in this step.
    located : bool
        False if the search failed: the state is then the nearer end of the step.
    """

    state: Result
    mode: ModeShape
    directions: int
    located: bool

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Bifurcation at t = {self.t:.6g}: {self.directions} directions>"

    @property
    def t(self) -> float:
        """Load factor."""
        return self.state.t

    @property
    def reversed(self) -> Bifurcation:
        """Bifurcation with the opposite direction of the other branch, at this state."""
        return replace(self, mode=ModeShape.of(self.state, -self.mode.x))


@dataclass(frozen=True, eq=False)
class CriticalPoint:
    """A point near a bifurcation: the eigenvalue next to zero, and its vector (n,)."""

    t: float
    x: Array
    value: float
    mode: Array


@dataclass(eq=False)
class BifurcationDetector:
    """Looks at a path after each of its points.

    skip: the first point is on a bifurcation itself. folds: limit points that were met. blind: it
    was told that a step cannot be judged.
    """

    system: System
    newton: Newton
    skip: bool = False
    bifurcations: list[Bifurcation] = field(default_factory=list)
    folds: int = 0
    blind: bool = False

    def look(self, results: Sequence[Result], branch: Branch) -> None:
        """Look for a bifurcation between the last two results."""
        folds, self.folds = len(branch.limit_points) - self.folds, len(branch.limit_points)
        previous, after = results[-2:]
        if self.skip and len(results) == 2:
            return
        if previous.unstable is None or after.unstable is None:
            if not self.blind:
                self.blind = True
                warn(
                    f"no symmetric, regular tangent at load factor {after.t:.4g} (friction, "
                    "contact, follower loads): bifurcations of such a path are not seen",
                    MissedBifurcations,
                    stacklevel=2,
                )
            return
        change = after.unstable - previous.unstable
        if change and not (folds == 1 and abs(change) == 1):
            self.bifurcations.append(self._locate(previous, after, abs(change)))

    def _locate(self, previous: Result, after: Result, directions: int) -> Bifurcation:
        """By the secant of the eigenvalue next to zero, over the load factor (Illinois)."""
        a, b = (critical_point(r.problem, r.t, r.point.solution.x) for r in (previous, after))
        nearest, located = min(a, b, key=lambda end: abs(end.value)), False
        low, high = a.value, b.value
        for _ in range(_SEARCHES):
            if low * high >= 0.0 or a.t == b.t:
                break
            share = low / (low - high)
            t = a.t + share * (b.t - a.t)
            old, histories = previous.point.solution.x, previous.histories
            problem = self.system.problem(self.system.quasi_static_step(t, old, histories))
            with np.errstate(all="ignore"):
                solution = self.newton.solve(problem, a.x + share * (b.x - a.x))
            if not solution.converged:
                break
            change = abs(t - nearest.t)
            nearest = critical_point(problem, t, solution.x)
            located = change <= _LOCATED * max(abs(t), abs(after.t - previous.t))
            if located or nearest.value == 0.0:
                located = True
                break
            if nearest.value * high < 0.0:
                a, low = b, high
            else:
                low *= 0.5
            b, high = nearest, nearest.value
        return self._bifurcation(previous, nearest, directions, located=located)

    def _bifurcation(
        self, previous: Result, critical: CriticalPoint, directions: int, *, located: bool
    ) -> Bifurcation:
        old, histories = previous.point.solution.x, previous.histories
        problem = self.system.problem(self.system.quasi_static_step(critical.t, old, histories)).at(
            critical.x
        )
        solution = replace(previous.point.solution, x=critical.x)
        state = Result(self.system, problem, Point(critical.t, solution), previous.histories)
        mode = critical.mode / np.abs(displacements(self.system, critical.mode)).max()
        return Bifurcation(state, ModeShape.of(state, mode), directions, located)


def critical_point(problem: Problem, t: float, x: Array) -> CriticalPoint:
    """Of a problem at unknowns x, (n,), with the contacts that it has there."""
    contact_problem = problem.at(x)
    K = contact_problem.assembler.linearise(x, contact_problem.parameters)[1]
    free = CondensedMap.of(contact_problem, K)
    value, mode = nearest_zero(symmetric(free.matrix(K)))
    return CriticalPoint(t, x, value, free.expand(mode))


def displacements(system: System, x: Array) -> Array:
    """Of unknowns (n,) the displacements u_x, u_y, u_z at the nodes; all at nodes without them."""
    nodal = system.numbering.nodal
    names = [name for name in ("u_x", "u_y", "u_z") if name in nodal] or list(nodal)
    return np.concatenate([x[nodal[name][nodal[name] >= 0]] for name in names])


def require_detect(detect: object) -> None:
    """Raise StudyError for anything but "bifurcation"."""
    if detect not in (None, "bifurcation"):
        raise StudyError(f'detect = {detect!r}: allowed are "bifurcation" and None')
