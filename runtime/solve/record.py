"""The record of a path while it is followed, and the reasons why it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from softehl.runtime.solve.solution import Branch, LimitPoint, Point, Solution, Status

OnPoint: TypeAlias = Callable[[Point], object]
End: TypeAlias = tuple[Status, str]
"""End of a path, in code and in words."""

_NEAR, _STEEPER = 2.0, 2.0
"""A turning point is believed that is foreseen within so many lengths of the step that failed, or
where the slope has grown by such a factor over the last step.
"""
_BARRED = {Status.NOT_FINITE, Status.REFUSED}
_WORDS_OF_THEIR_OWN = {*_BARRED, Status.SINGULAR}
"""Failures of the shortest step that say more than that it was too long."""


@dataclass
class Record:
    """Record of a path so far: grows with every solve, and ends as a frozen Branch.

    slopes: change of x with the parameter over each of the last two steps, and where.
    """

    name: str
    keep_all: bool = False
    on_point: OnPoint | None = None
    points: list[Point] = field(default_factory=list)
    failures: list[Point] = field(default_factory=list)
    limit_points: list[LimitPoint] = field(default_factory=list)
    slopes: list[tuple[float, float]] = field(default_factory=list)
    factorisations: int = 0
    iterations: int = 0
    end: End | None = None

    def count(self, solution: Solution) -> Solution:
        """Add up the cost of a solve, converged or not, and pass it through."""
        self.factorisations += solution.factorisations
        self.iterations += solution.iterations
        return solution

    def accept(self, parameter: float, solution: Solution) -> Point:
        """Append a converged point, forget the x of the last but two, tell the caller."""
        point = Point(parameter, solution)
        if self.points and (way := parameter - self.points[-1].parameter):
            change = float(np.linalg.norm(solution.x - self.points[-1].solution.x))
            self.slopes = [*self.slopes[-1:], (parameter - 0.5 * way, change / abs(way))]
        self.points.append(point)
        if len(self.points) > 2 and not self.keep_all:
            old = self.points[-3]
            self.points[-3] = replace(old, solution=old.solution.forget())
        if self.on_point is not None:
            self.on_point(point)
        return point

    def refuse(self, parameter: float, solution: Solution) -> None:
        """Note a failed attempt."""
        self.failures.append(Point(parameter, solution.forget()))

    def branch(self, status: Status = Status.CONVERGED, message: str = "") -> Branch:
        """The path as it ended; as it is so far, with this status, where it has no end yet."""
        status, message = self.end or (status, message)
        return Branch(
            points=tuple(self.points),
            status=status,
            message=message,
            factorisations=self.factorisations,
            iterations=self.iterations,
            failures=tuple(self.failures),
            limit_points=tuple(self.limit_points),
        )

    def no_start(self, start: float, solution: Solution) -> None:
        """End where not even the start was solved."""
        self.refuse(start, solution)
        message = f"no solution at the start, {self.name} = {start:.9g}: {solution.message}"
        self.end = solution.status, message

    def too_small(self, step: float, smallest: float) -> None:
        """End because the last failure asks for a step below `smallest`; say what stands there."""
        here, failed = self.points[-1].parameter, self.failures[-1]
        less = f"the next step would be {step:.2g}, smaller than {smallest:.2g}"
        words = (
            f"reached {self.name} = {here:.9g}; {less if step else 'no shorter step is tried'}; "
            f"last attempt, at {failed.parameter:.9g}: "
            f"{failed.solution.status.value} ({failed.solution.message})"
        )
        reason = failed.solution.status
        fold = None if reason in _BARRED else self._turning_point(failed.parameter - here)
        if fold is not None:
            self.end = Status.TURNING_POINT, f"at about {self.name} = {fold:.5g}; {words}"
        elif step >= smallest:
            self.end = Status.ROUNDING, words
        elif reason in _WORDS_OF_THEIR_OWN:
            self.end = reason, words
        else:
            self.end = Status.STEP_TOO_SMALL, words

    def _turning_point(self, failed: float) -> float | None:
        """The parameter at which the slopes grow beyond all bounds as those of a parabola do:
        their inverse squares vanish in proportion to the distance. None where it is not believed.

        failed: the last step.
        """
        if len(self.slopes) < 2:
            return None
        (a, before), (b, now) = self.slopes
        if not 0.0 < before < now < math.inf:
            return None
        fold = b + (b - a) * before**2 / (now**2 - before**2)
        near = abs(fold - self.points[-1].parameter) <= _NEAR * abs(failed)
        return fold if near or now >= _STEEPER * before else None
