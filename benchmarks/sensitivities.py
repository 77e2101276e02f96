"""`python -m benchmarks.sensitivities [RUNS]`: what the sensitivities of a default run cost.

Seconds of CPU of a solved curve, and what all quantities and one quantity take of it, by all
parameters; the least of some runs of one session, on one thread.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from functools import partial
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

from softehl.cases.seal import method, sensitivity
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.quantities import QUANTITIES
from softehl.cases.seal.state import Silent


class Clock:
    """Seconds of CPU in a function that it stands for."""

    def __init__(self, function: Any) -> None:
        self.function, self.seconds = function, 0.0

    def __call__(self, *arguments: Any) -> Any:
        """The function."""
        start = time.process_time()
        found = self.function(*arguments)
        self.seconds += time.process_time() - start
        return found


def measured(p: ORing, wanted: Sequence[str]) -> tuple[float, float, int]:
    """Seconds of a run without its sensitivities, those of these quantities, its states."""
    rates = Clock(sensitivity.rates_of)
    slopes = Clock(partial(sensitivity.sensitivities, wanted=wanted))
    with patch.object(method, "rates_of", rates), patch.object(method, "sensitivities", slopes):
        start = time.process_time()
        states = method.run(p, Silent()).states
        whole = time.process_time() - start
    spent = rates.seconds + slopes.seconds
    return whole - spent, spent, len(states)


def main(runs: int) -> None:
    """Print a line for all quantities, and one for h* alone."""
    p = ORing(sensitivity=True)
    for wanted in (QUANTITIES, ("h_star",)):
        found = [measured(p, wanted) for _ in range(runs)]
        solving, spent = (min(times) for times in list(zip(*found, strict=True))[:2])
        print(
            f"{len(wanted)} of {len(QUANTITIES)} quantities, {found[0][2]} states: solving "
            f"{solving:.2f} s, sensitivities {spent:.2f} s ({100.0 * spent / solving:.0f} %)"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
