"""Cost of a curve: curves an hour and parts of the time, beside those of another checkout.

    OMP_NUM_THREADS=1 python -m benchmarks.curves [--before CHECKOUT] [--rounds 3]

Seconds of CPU of one process on one thread, of the O-ring at density 2: a curve of a sweep (five
speeds of one stroke, with its files; four viscosities at two pressures, one after the other), with
and without the estimate of the error; the default run with its pictures; a ring of the catalogue.
Each checkout is measured in processes of its own, in turn; the medians count, and of two checkouts
the median of the ratios. Curves an hour are those of two such processes that do not hinder each
other.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmarks.clock import Clock

VISCOSITIES, PRESSURES = (3e-8, 5e-8, 7e-8, 9e-8), (1.0, 2.0)
RING = {"ring": "AS568-210", "rod": 19, "sealed_pressure": "30 bar"}
PROCESSES = 2
HOUR = 3600.0
PARTS = ("contact", "coarser films", "films", "files", "pictures", "else")


@contextmanager
def watched(clock: Clock) -> Iterator[None]:
    """The parts of all runs within it."""
    from softehl.cases.harness.run_record import RunRecord
    from softehl.cases.harness.runner import RecordingObserver
    from softehl.cases.oring import ORingCase
    from softehl.cases.seal.solve.adaptation import Adaptation
    from softehl.cases.seal.solve.contact_meshes import ContactMeshes
    from softehl.cases.seal.solve.driver import DryContact

    watched = [
        (ContactMeshes, "contact", lambda *_: "contact"),
        (DryContact, "adapted", lambda *_: "films"),
        (Adaptation, "_coarser", lambda *_: "coarser films"),
        (RecordingObserver, "state", lambda *_: "files"),
        (RecordingObserver, "files", lambda *_: "files"),
        (RunRecord, "begin", lambda *_: "files"),
        (RunRecord, "save", lambda *_: "files"),
        (ORingCase, "draw", lambda *_: "pictures"),
    ]
    patches = [
        patch.object(kind, name, clock.timed(getattr(kind, name), part))
        for kind, name, part in watched
    ]
    for one in patches:
        one.start()
    yield
    for one in patches:
        one.stop()


def spent(work: Callable[[], None], repeats: int) -> dict[str, float]:
    """Seconds by part of some work, for one of the repeats."""
    clock = Clock(PARTS)
    with watched(clock):
        clock.since = time.process_time()
        work()
        clock.turn()
    return {name: clock.seconds[name] / repeats for name in PARTS}


def sweep(folder: Path, **given: Any) -> None:
    """All curves of a sweep, as one of its workers computes them."""
    import softehl

    points = [(eta, p_s) for eta in VISCOSITIES for p_s in PRESSURES]
    cases = {
        f"{number}": softehl.Seal(viscosity=eta, sealed_pressure=p_s, stroke="out", **given)
        for number, (eta, p_s) in enumerate(points)
    }
    for curve in softehl.solve_cases(cases, folder):
        assert curve.converged, curve.complaints


def command(folder: Path, **given: Any) -> None:
    """A run as the command does it."""
    from softehl.__main__ import main

    keys = [f"--set={key}={value}" for key, value in given.items()]
    try:
        code: object = main(["run", "oring", "--quiet", "--overwrite", "--out", str(folder), *keys])
    except SystemExit as end:
        code = end.code
    if code:
        raise RuntimeError(f"the run ended with {code}")


def measure(name: str) -> dict[str, float]:
    """One of the measurements below, in this process."""
    number = len(VISCOSITIES) * len(PRESSURES)
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        begun = time.process_time()
        import softehl.cases.cli
        import softehl.cases.oring
        import softehl.cases.seal.solve.driver  # noqa: F401

        imports = time.process_time() - begun
        if name == "default run":
            return {"imports": imports, **spent(partial(command, base / "run"), 1)}
        if name == "catalogue ring":
            return {"imports": imports, **spent(partial(command, base / "run", **RING), 1)}
        keys = {"error_estimate": name == "curve with estimate"}
        command(base / "warm", speeds=[1600])
        return {"imports": 0.0, **spent(partial(sweep, base / "sweep", **keys), number)}


MEASUREMENTS = ("curve with estimate", "curve without", "default run", "catalogue ring")


def elsewhere(checkout: Path, name: str) -> dict[str, float]:
    """A measurement in a process of its own that imports softehl from a checkout."""
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": str(checkout / "src"),
    }
    call = [sys.executable, "-m", "benchmarks.curves", "--measure", name]
    here = Path(__file__).absolute().parents[1]
    done = subprocess.run(call, env=environment, cwd=here, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def table(found: dict[str, list[list[dict[str, float]]]]) -> str:
    """Markdown: measurement -> for each checkout its rounds."""
    names = ("imports", *PARTS)
    lines = [
        f"| CPU, s | after imports | ratio | curves an hour | {' | '.join(names)} |",
        "|" + "---|" * (len(names) + 4),
    ]
    for name, checkouts in found.items():
        wholes = [[sum(parts.values()) - parts["imports"] for parts in one] for one in checkouts]
        for number, (rounds, whole) in enumerate(zip(checkouts, wholes, strict=True)):
            ratio = statistics.median(w / f for w, f in zip(whole, wholes[0], strict=True))
            seconds = statistics.median(whole)
            hour = f"{PROCESSES * HOUR / seconds:.0f}" if "curve" in name else ""
            title = f"{name}, before" if number == 0 and len(checkouts) > 1 else name
            cells = [f"{statistics.median(one[part] for one in rounds):.2f}" for part in names]
            lines.append(
                f"| {title} | {seconds:.2f} | {ratio:.2f} | {hour} | {' | '.join(cells)} |"
            )
    return "\n".join(lines)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--before", type=Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", choices=MEASUREMENTS, action="append")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.measure:
        print(json.dumps(measure(given.measure)))
        return
    here = Path(__file__).absolute().parents[1]
    checkouts = [here] if given.before is None else [given.before.absolute(), here]
    found = {}
    for name in given.only or MEASUREMENTS:
        rounds = [[elsewhere(c, name) for c in checkouts] for _ in range(given.rounds)]
        found[name] = [list(one) for one in zip(*rounds, strict=True)]
    print(table(found))


if __name__ == "__main__":
    main()
