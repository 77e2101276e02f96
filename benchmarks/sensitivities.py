"""`python -m benchmarks.sensitivities [RUNS]`: what the sensitivities of a default run cost.

Seconds of CPU of a solved curve, and what all quantities by all parameters take of it; the least of
some runs of one session, on one thread.
"""

from __future__ import annotations

import os
import sys
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

from benchmarks.clock import Clock
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.sensitivity import sensitivity
from softehl.cases.seal.solve import driver
from softehl.cases.seal.states.state import Silent


def measured(p: Seal) -> tuple[float, float, int]:
    """Seconds of a run without its sensitivities, those of the sensitivities, its states."""
    clock = Clock(("sensitivities", "solving"))
    timed: dict[str, Any] = {
        name: clock.timed(getattr(sensitivity, name), lambda *_: "sensitivities")
        for name in ("rates_of", "sensitivities")
    }
    with patch.multiple(sensitivity, **timed):
        states = driver.run(p, Silent(), differentiate=sensitivity.differentiation(p)).states
    clock.turn()
    return clock.seconds["solving"], clock.seconds["sensitivities"], len(states)


def main(runs: int) -> None:
    """Print a line."""
    found = [measured(Seal(sensitivity=True)) for _ in range(runs)]
    solving, spent = (min(times) for times in list(zip(*found, strict=True))[:2])
    print(
        f"{found[0][2]} states: solving {solving:.2f} s, sensitivities {spent:.2f} s "
        f"({100.0 * spent / solving:.0f} %)"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
