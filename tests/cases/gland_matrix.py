"""Glands drawn at random, by number: the O-rings of docs/validation/glands.md.

`python -m tests.cases.gland_matrix FIRST LAST FILE` solves some, prints a line for each and adds
it to a file of JSON lines; those that are there already are not solved again. `--density 4` solves
them on a finer mesh, `--every 10` takes every tenth, `--limit` is the time for one, s of CPU.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.catalogue import as568
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import FilmState, Silent

SEED = 13
SPEEDS = (1000.0, 100.0, 10.0)


def drawn(number: int) -> Seal:
    """A general ring on a rod of 3 to 500 mm in a groove that it does not overfill.

    Stretch 0 to 6 %, squeeze 6 to 30 %, width 1.02 to 2 sections, fill up to 95 %, shear modulus 1
    to 6 MPa, kappa 200 to 2000 MPa, p_s / mu 0 to 5 and p_s up to 20 MPa, oil of 5 to 500 mPa s.
    """
    rng = np.random.default_rng([SEED, number])
    rings = list(as568().values())
    while True:
        ring = rings[int(rng.integers(len(rings)))]
        d = ring.section_diameter
        stretch, squeeze = rng.uniform(0.0, 0.06), rng.uniform(0.06, 0.30)
        width, rod = rng.uniform(1.02, 2.0) * d, ring.inner_diameter * (1.0 + stretch)
        depth = d * (1.0 - squeeze)
        if d < 1.6 or not 3.0 <= rod <= 500.0:
            continue
        mu, kappa = rng.uniform(1.0, 6.0), math.exp(rng.uniform(math.log(200.0), math.log(2000.0)))
        p_s = rng.uniform(0.0, 5.0) * mu
        if 0.25 * math.pi * d**2 > 0.95 * depth * width or p_s > 20.0:
            continue
        return Seal(
            inner_diameter=ring.inner_diameter,
            section_diameter=d,
            rod_diameter=round(rod, 4),
            housing_diameter=round(rod + 2.0 * depth, 4),
            groove_width=round(width, 3),
            mu_1=round(0.83 * mu, 3),
            mu_2=round(0.17 * mu, 3),
            bulk_modulus=round(kappa, 1),
            sealed_pressure=round(p_s, 3),
            viscosity=float(f"{10.0 ** rng.uniform(-8.3, -6.3):.3g}"),
            speeds=SPEEDS,
        )


class _Late(BaseException):
    """The time for one gland is over."""


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise _Late in what takes longer, in CPU time."""

    def late(*_: object) -> None:
        raise _Late

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


class Watch(Silent):
    """Keeps the stages and states that were reached, also of a run that is stopped."""

    def __init__(self) -> None:
        """Nothing was reached."""
        self.stages: list[str] = []
        self.states: list[FilmState] = []

    def stage(self, name: str, **marks: Any) -> None:
        """See `Observer`."""
        self.stages.append(f"{name}, {marks['stroke']}")

    def film_state(self, state: FilmState) -> None:
        """See `Observer`."""
        self.states.append(state)


def solved(
    number: int, limit: float, draw: Callable[[int], Seal] = drawn, **changes: Any
) -> dict[str, Any]:
    """What came out of a gland, as it is written to the file."""
    p, watch, begin = draw(number).model_copy(update=changes), Watch(), time.process_time()
    message, factorisations = f"not ended within {limit:g} s", 0
    try:
        with _limited(limit):
            outcome = run(p, watch)
            message = "" if outcome.converged else outcome.message
            factorisations = sum(stage.factorisations or 0 for stage in outcome.stages)
    except _Late:
        message += f": {watch.stages[-1]}"
    keys = ("h_star_um", "h_star_error_percent", "inlet_ratio", "inlet_segments", "verdict")
    return {
        "number": number,
        "section": p.section,
        "density": p.density,
        "p_s/mu": round(p.sealed_pressure / p.shear_modulus, 2),
        "seconds": round(time.process_time() - begin, 1),
        "factorisations": factorisations,
        "message": message,
        "states": [
            {"speed": s.rod_speed_mm_s, **{k: getattr(s, k) for k in keys}, "advice": s.advice}
            for s in watch.states
        ],
    }


def main(draw: Callable[[int], Seal], words: str | None) -> None:
    """Solve, print and keep what the command line asks for."""
    arguments = asked(words)
    file, done = Path(arguments.file), set[int]()
    if file.exists():
        done = {int(json.loads(line)["number"]) for line in file.read_text().splitlines()}
    for number in range(arguments.first, arguments.last, arguments.every):
        if number in done:
            continue
        found = solved(number, arguments.limit, draw, density=arguments.density)
        with file.open("a") as lines:
            lines.write(json.dumps(found) + "\n")
        each = [f"{s['speed']:+g}: {s['verdict']} {s['h_star_um']:.4g}" for s in found["states"]]
        ok = sum(s["verdict"] == OK for s in found["states"])
        print(
            f"{number} {found['section']} p_s/mu {found['p_s/mu']} {found['seconds']} s, ", end=""
        )
        print(f"{ok} of {2 * len(SPEEDS)} ok;", ", ".join(each), found["message"], flush=True)


def asked(words: str | None) -> argparse.Namespace:
    """The options of the command line."""
    parser = argparse.ArgumentParser(description=words)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("file")
    parser.add_argument("--density", type=int, default=2)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--limit", type=float, default=100.0)
    return parser.parse_args()


if __name__ == "__main__":
    main(drawn, __doc__)
