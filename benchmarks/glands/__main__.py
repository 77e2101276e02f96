"""Run a sample of seals with the program of a checkout, or compare two such runs.

    python -m benchmarks.glands FILE --source CHECKOUT/src [--limit N] [--first K] [--timeout S]
    python -m benchmarks.glands FILE --source CHECKOUT/src --sections
    python -m benchmarks.glands --compare OLD NEW
    python -m benchmarks.glands FILE --page PAGE [--sections]

Each seal is a run of the command line in a process of its own. FILE gets a line of JSON for each as
soon as it has ended; seals that FILE has are not run again. --page writes the table of FILE between
the marks of a page of the documentation.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
import tempfile
from itertools import islice
from pathlib import Path
from typing import Any

from benchmarks.glands import OF_ALL_SECTIONS, STATES, Drawn, sample
from benchmarks.glands.table import comparison, read, results, theories
from benchmarks.marked import renew

RUN = ("-m", "softehl", "run", "seal.toml", "--out", "out", "--quiet", "--pictures", "none")
COLUMNS = (
    *("h_star_um", "rod_friction_N", "h_star_error_percent"),
    *("h_star_theory_um", "inlet_over_pocket", "h_star_theory_sealed_um", "h_star_theory_air_um"),
)
SHORT = {"case": "oring", "density": 1, "speeds": [800.0], "stroke": "out", "error_estimate": False}


def python(
    arguments: tuple[str, ...], source: Path, folder: Path, limit: float = 600.0
) -> subprocess.CompletedProcess[str]:
    """The end of Python in a folder, with one thread, killed after a limit in seconds of CPU."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, **threads, "PYTHONPATH": str(source.resolve())},
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit))),
    )


def prepare(source: Path) -> None:
    """Compile the kernels by a short run, and make sure that it is the program of the source."""
    where = python(("-c", "import softehl; print(softehl.__file__)"), source, Path("/"))
    if not Path(where.stdout.strip()).is_relative_to(source.resolve()):
        raise SystemExit(f"--source {source}: it has no package softehl; give the folder src")
    message = run(Drawn("short", "round", 0.0, SHORT), source, 600.0)["message"]
    if message:
        raise SystemExit(f"--source {source}: a short run failed: {message}")


def run(seal: Drawn, source: Path, limit: float) -> dict[str, Any]:
    """The run of a seal: one line of the file."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines = [f"{key} = {json.dumps(value)}\n" for key, value in seal.keys.items()]
        (folder / "seal.toml").write_text("".join(lines), encoding="utf-8")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = python(RUN, source, folder, limit)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        states = rows(folder / "out" / "curve.csv")
    message = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    if done.returncode < 0:
        message = f"killed by signal {-done.returncode}; the limit is {limit:g} s of CPU"
    return {
        "seal": seal.name,
        "section": seal.section,
        "p_s/mu": seal.ratio,
        "asked": STATES,
        "ok": sum(state["verdict"] == "ok" for state in states.values()),
        "cpu_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2),
        "message": message if done.returncode else "",
        "states": states,
        "keys": seal.keys,
    }


def rows(curve: Path) -> dict[str, Any]:
    """Verdict and `COLUMNS` of the states in a file of a curve, by the speed of the rod."""
    if not curve.exists():
        return {}
    with curve.open(encoding="utf-8", newline="") as lines:
        return {
            f"{float(row['rod_speed_mm_s']):+g}": {
                "verdict": row["verdict"],
                **{name: float(row[name]) for name in COLUMNS if name in row},
            }
            for row in csv.DictReader(lines)
        }


def main() -> None:
    """Run the seals that are missing in FILE, or print a comparison."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("file", type=Path, nargs="?", help="file of JSON lines")
    parser.add_argument("--source", type=Path, help="folder src of the program to run")
    parser.add_argument("--limit", type=int, help="number of seals to run now, at most")
    parser.add_argument("--first", type=int, help="only the first K seals of the sample")
    parser.add_argument("--sections", action="store_true", help="60 states of all sections")
    parser.add_argument("--timeout", type=float, default=240.0, help="seconds of CPU for a seal")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    parser.add_argument("--page", type=Path, help="page of the documentation to renew")
    given = parser.parse_args()
    if given.compare:
        print(comparison(*(read(file) for file in given.compare)))
        return
    if given.file and given.page:
        if given.sections:
            renew(given.page, "sections", results(read(given.file)))
            renew(given.page, "theory", theories(read(given.file)))
        else:
            renew(given.page, "glands", results(read(given.file)))
        return
    if not given.file or not given.source:
        parser.error("give FILE with --source or --page, or --compare OLD NEW")
    have = read(given.file) if given.file.exists() else {}
    prepare(given.source)
    few = {f"{section} {k}" for section, numbers in OF_ALL_SECTIONS.items() for k in numbers}
    seals = [seal for seal in sample() if not given.sections or seal.name in few]
    missing = (seal for seal in seals[: given.first] if seal.name not in have)
    for seal in islice(missing, given.limit):
        found = run(seal, given.source, given.timeout)
        with given.file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(found) + "\n")
        told = f"{found['ok']} of {STATES} ok, {found['cpu_s']} s of CPU {found['message']}"
        print(f"{seal.name}, p_s / mu = {seal.ratio}: {told}", flush=True)


if __name__ == "__main__":
    main()
