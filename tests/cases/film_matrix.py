"""Films drawn at random, by number, as a user would type them: what runs, what is refused and how.

`python -m tests.cases.film_matrix FIRST LAST [SECONDS]` prints a line for each: its command, the
exit code (0 done, 2 refused, 3 not converged, - out of time, ! a crash), what was said, and the
verdicts.
"""

from __future__ import annotations

import contextlib
import csv
import io
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import softehl
from softehl.cases.seal.gland.sections.shapes import SECTIONS

SEED = 16
LIMIT = 60  # seconds

COMMON: dict[str, tuple[str, ...]] = {
    "roughness": ("", "", "0.1", "0.4", "[0.2,0.1]", "[0.3,0]"),
    "cavitation": ("", "", "penalty", "mass-conserving"),
    "cavitation_pressure": ("", "", "-0.05"),
    "pressure_order": ("", "", "1", "2", "3", "6"),
    "density": ("1", "1", "2"),
    "section": ("", "", *(name for name in SECTIONS if name != "round")),
    "sealed_pressure": ("", "0", "0.2", "3", "'30 bar'"),
    "boundary_friction": ("", "", "0", "0.3"),
    "housing_friction": ("", "", "", "0.2"),
    "rotation": ("", "", "free"),
}
FILMS: dict[str, tuple[str, ...]] = {
    "speeds": ("", "[500,50]", "[100,1]", "[10,0.1]", "[2000]"),
    "stroke": ("", "out", "in"),
    "reynolds": ("", "", "", "dg"),
    "solver": ("", "", "monolithic"),
    "error_estimate": ("", "false"),
    "mesh": ("", "", "uniform"),
}
CYCLES: dict[str, tuple[str, ...]] = {
    "motion": (
        *("", "{stroke=20,frequency=2}", "{stroke=5,frequency=10,shape='trapezoidal'}"),
        *("[[0,100],[0.2,100],[0.25,-100],[0.45,-100],[0.5,100]]", "[[0,-50],[1,-50]]"),
    ),
    "supply": ("", "returned"),
    "time_order": ("", "1"),
    "pressures": ("", "", "[[0,1],[0.25,2],[0.5,1]]"),
    "cycles": ("1",),
}
"""Values that a key may have; empty: it is not given."""


def drawn(number: int) -> list[str]:
    """The command of a number: case and settings."""
    rng = np.random.default_rng([SEED, number])
    case = "cycle" if number % 3 == 2 else "oring"
    table = {**COMMON, **(CYCLES if case == "cycle" else FILMS)}
    chosen = {key: values[int(rng.integers(len(values)))] for key, values in table.items()}
    return [case, *(f"--set={key}={value}" for key, value in chosen.items() if value)]


def tried(command: list[str], seconds: int = LIMIT) -> tuple[str, str, list[str]]:
    """Exit code, what was said on stderr, and the verdicts of a command."""

    def late(*_: Any) -> None:
        raise TimeoutError

    errors = io.StringIO()
    signal.signal(signal.SIGALRM, late)
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(errors):
        out = Path(folder) / "run"
        signal.alarm(seconds)
        try:
            code = str(softehl.main(["run", *command, "--out", str(out), "--quiet"]))
        except TimeoutError:
            code = "-"
        except Exception as error:  # this is what is looked for
            code = "!"
            errors.write(f"{type(error).__name__}: {error}")
        finally:
            signal.alarm(0)
        return code, errors.getvalue().strip(), _verdicts(out / "curve.csv")


def _verdicts(path: Path) -> list[str]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8") as file:
        return [row["verdict"] for row in csv.DictReader(file)]


def main() -> None:
    """Try the numbers from the first to before the last."""
    first, last = (int(v) for v in sys.argv[1:3])
    seconds = int(sys.argv[3]) if len(sys.argv) > 3 else LIMIT
    for number in range(first, last):
        begun = time.monotonic()
        code, words, verdicts = tried(command := drawn(number), seconds)
        took = time.monotonic() - begun
        settings = " ".join(c.removeprefix("--set=") for c in command)
        print(f"{number} [{code}] {took:.0f} s {settings}: {words} {verdicts}", flush=True)


if __name__ == "__main__":
    main()
