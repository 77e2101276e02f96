"""The step rule of continuation, and the parameters at which a step ends."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from softehl.runtime.solve.solution import Status

_ROUNDING = 1e-9  # a step this close to a waypoint, relatively, goes there


@dataclass(frozen=True)
class StepRule:
    """Step control by iteration count; lengths > 0, in units of the parameter or arc length.

    first: length of the first step; smallest: a failed step is not cut below it;
    largest: no step is longer; growth: largest ratio of successive steps;
    cut: factor after a failure (its square after a wild one), and least ratio after a success;
    target_iterations: Newton iterations at which the step stays as it is.
    """

    first: float
    smallest: float
    largest: float = math.inf
    growth: float = 2.0
    cut: float = 0.5
    target_iterations: int = 6

    def __post_init__(self) -> None:
        """Raise ValueError unless 0 < smallest <= first <= largest and the factors make sense."""
        if not 0.0 < self.smallest <= self.first <= self.largest:
            raise ValueError(f"need 0 < smallest <= first <= largest, got {self}")
        if not (0.0 < self.cut < 1.0 <= self.growth and self.target_iterations >= 1):
            raise ValueError(f"need 0 < cut < 1 <= growth and target_iterations >= 1, got {self}")

    def scaled(self, unit: float) -> StepRule:
        """The rule with its lengths in other units, of which one is `unit` of the new ones."""
        first, smallest, largest = (unit * a for a in (self.first, self.smallest, self.largest))
        return replace(self, first=first, smallest=smallest, largest=largest)

    def after_success(self, step: float, taken: float, iterations: int) -> float:
        """Next step when `taken`, possibly shortened from `step` by a waypoint, has converged."""
        factor = self.target_iterations / max(iterations, 1)
        proposal = taken * min(max(factor, self.cut), self.growth)
        if iterations <= self.target_iterations:
            proposal = max(proposal, step)  # a waypoint's short step says nothing against `step`
        return min(max(proposal, self.smallest), self.largest)

    def after_failure(self, taken: float, status: Status) -> float:
        """Next step when `taken` has failed; it may come out below `smallest`: then give up."""
        wild = status in (Status.DIVERGED, Status.NOT_FINITE)
        return taken * (self.cut**2 if wild else self.cut)


def goals_of(start: float, stop: float, waypoints: Iterable[float]) -> list[float]:
    """Waypoints and stop in the order of travel, each once, without start."""
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise ValueError(f"start and stop must be finite, got {start} and {stop}")
    goals = {float(waypoint) for waypoint in waypoints} | {float(stop)}
    low, high = min(start, stop), max(start, stop)
    outside = sorted(goal for goal in goals if not low <= goal <= high)
    if outside:
        raise ValueError(f"waypoints {outside} lie outside [{low}, {high}]")
    return sorted(goals - {float(start)}, reverse=stop < start)


def next_parameter(here: float, goal: float, step: float) -> float:
    """Next parameter: the goal itself within a step, half-way within two (no sliver remains)."""
    remaining = abs(goal - here)
    if remaining <= step * (1.0 + _ROUNDING):
        return goal
    return here + math.copysign(min(step, 0.5 * remaining), goal - here)
