"""The record of a path while it is followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from softehl.runtime.solve.solution import Branch, LimitPoint, Point, Solution, Status

OnPoint: TypeAlias = Callable[[Point], object]


@dataclass
class Record:
    """What has been met on a path so far: grows with every solve, and ends as a frozen Branch."""

    name: str
    keep_all: bool
    on_point: OnPoint | None
    points: list[Point] = field(default_factory=list)
    failures: list[Point] = field(default_factory=list)
    limit_points: list[LimitPoint] = field(default_factory=list)
    factorisations: int = 0
    iterations: int = 0

    def count(self, solution: Solution) -> Solution:
        """Add up the cost of a solve, converged or not, and pass it through."""
        self.factorisations += solution.factorisations
        self.iterations += solution.iterations
        return solution

    def accept(self, parameter: float, solution: Solution) -> Point:
        """Append a converged point, forget the x of the last but two, tell the caller."""
        point = Point(parameter, solution)
        self.points.append(point)
        if len(self.points) > 2 and not self.keep_all:
            old = self.points[-3]
            self.points[-3] = replace(old, solution=old.solution.forget())
        if self.on_point is not None:
            self.on_point(point)
        return point

    def refuse(self, parameter: float, solution: Solution) -> None:
        self.failures.append(Point(parameter, solution.forget()))

    def branch(self, status: Status, message: str) -> Branch:
        return Branch(
            points=tuple(self.points),
            status=status,
            message=message,
            factorisations=self.factorisations,
            iterations=self.iterations,
            failures=tuple(self.failures),
            limit_points=tuple(self.limit_points),
        )

    def no_start(self, start: float, solution: Solution) -> Branch:
        self.refuse(start, solution)
        message = f"no solution at the start, {self.name} = {start:.9g}: {solution.message}"
        return self.branch(solution.status, message)

    def too_small(self, step: float, smallest: float) -> Branch:
        """The path ends because the last failure asks for a step below `smallest`."""
        reached, failed = self.points[-1].parameter, self.failures[-1]
        message = (
            f"reached {self.name} = {reached:.9g}; the next step would be {step:.2g}, smaller than "
            f"{smallest:.2g}; last attempt, at {failed.parameter:.9g}: "
            f"{failed.solution.status.value} ({failed.solution.message})"
        )
        return self.branch(Status.STEP_TOO_SMALL, message)
