"""Cost of rough films and films in time: seconds, and ratios to the smooth curve.

    OMP_NUM_THREADS=1 python -m benchmarks.films [--density 2] [--speeds 20] [--repeats 3]

Three runs of the O-ring of Table 1, at outstroke: a smooth curve, 2000 to 50 mm/s; the
Stribeck curve of a seal of 0.3 um, 0.01 to 2000 mm/s; and a cycle of 20 mm at 2 Hz with the same
roughness, without the steady film that it begins with. No error estimates, nothing is written. CPU
seconds of the process, the least of the repeats: on a shared machine the
ratios tell more.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.cases.cycle import CASE, Cycle
from softehl.cases.harness.observer import Observer, Outcome, State
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import Silent

ROUGHNESS = 0.3
SMOOTH, STRIBECK = (50.0, 2000.0), (0.01, 2000.0)
"""Slowest and fastest speeds, mm/s."""


@dataclass(frozen=True)
class Cost:
    """CPU seconds, steps (films or times) and iterations of a run."""

    seconds: float
    steps: int
    iterations: int


class CycleClock(Observer):
    """Looks at the clock where the cycle begins and where it ends."""

    def __init__(self) -> None:
        self.began = self.ended = 0.0
        self.row: Any = None

    def stage(self, name: str, **details: Any) -> None:
        """See :class:`Observer`."""
        self.began = time.process_time()

    def state(self, state: State) -> None:
        """See :class:`Observer`."""
        self.ended, self.row = time.process_time(), state.row


def curve(density: int, speeds: int, ends: tuple[float, float], **given: Any) -> Cost:
    """A curve of so many speeds between two, evenly in log U."""
    between = tuple(np.geomspace(*ends, speeds).tolist())
    keys = {"density": density, "speeds": between, "stroke": "out", "error_estimate": False}
    p, begun = Seal.model_validate({**keys, **given}), time.process_time()
    outcome = _reached(run(p, Silent()))
    seconds = time.process_time() - begun
    steps = sum(len(stage.parameters) for stage in outcome.stages)
    return Cost(seconds, steps, sum(stage.iterations for stage in outcome.stages))


def cycle(density: int) -> Cost:
    """The first cycle of a rod that goes to and fro."""
    given = {"density": density, "roughness": ROUGHNESS, "cycles": 1}
    clock = CycleClock()
    _reached(CASE.solve(Cycle.model_validate(Cycle.completed(given)), clock, None))
    return Cost(clock.ended - clock.began, clock.row.steps, clock.row.newton_iterations)


def measured(density: int, speeds: int, repeats: int) -> dict[str, Cost]:
    """Name -> cost of each run, the least of the repeats."""
    runs: dict[str, Callable[[], Cost]] = {
        "smooth curve": lambda: curve(density, speeds, SMOOTH),
        "mass-conserving": lambda: curve(density, speeds, SMOOTH, cavitation="mass-conserving"),
        "Stribeck curve": lambda: curve(density, speeds, STRIBECK, roughness=ROUGHNESS),
        "cycle": lambda: cycle(density),
    }
    return {
        name: min((one() for _ in range(repeats)), key=lambda cost: cost.seconds)
        for name, one in runs.items()
    }


def table(costs: dict[str, Cost]) -> str:
    """Markdown; ratios are to the first."""
    first = next(iter(costs.values())).seconds
    lines = ["| run | CPU, s | ratio | steps | iterations |", "|---|---|---|---|---|"]
    for name, cost in costs.items():
        own = f"{cost.seconds:.2f} | {cost.seconds / first:.2f} | {cost.steps} | {cost.iterations}"
        lines.append(f"| {name} | {own} |")
    return "\n".join(lines)


def _reached(outcome: Outcome[Any]) -> Outcome[Any]:
    if not outcome.converged:
        raise RuntimeError(outcome.message)
    return outcome


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    for name, default in (("density", 2), ("speeds", 20), ("repeats", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    given = parser.parse_args()
    print(table(measured(given.density, given.speeds, given.repeats)))


if __name__ == "__main__":
    main()
