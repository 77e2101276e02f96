"""Glands drawn at random, by number: the sample of docs/limits.md.

`python -m tests.cases.gland_matrix FIRST LAST` solves some and prints a line for each.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from softehl.cases.harness.row import OK
from softehl.cases.seal.catalogue import as568
from softehl.cases.seal.method import run
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.state import Silent

SEED = 13
SPEEDS = (1000.0, 100.0, 10.0)


def drawn(number: int) -> ORing:
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
        return ORing(
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


def main(first: int, last: int) -> None:
    """Solve and print; a line of its states for each gland."""
    for number in range(first, last):
        p, begin = drawn(number), time.process_time()
        outcome = run(p, Silent())
        seconds = time.process_time() - begin
        words = [f"{s.rod_speed:+g}: {s.verdict} {s.h_star_um:.4g}" for s in outcome.states]
        ok = sum(s.verdict == OK for s in outcome.states)
        ratio = p.sealed_pressure / p.shear_modulus
        print(
            f"{number} p_s/mu {ratio:.2f} {seconds:.0f} s, {ok} of {2 * len(SPEEDS)} ok; ", end=""
        )
        print(", ".join(words), "" if outcome.converged else outcome.message, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
