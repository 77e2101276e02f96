"""Run a sample of seals with the program of a checkout, or compare two such runs.

    python -m benchmarks.glands FILE --source CHECKOUT/src [--limit N] [--first K] [--timeout S]
    python -m benchmarks.glands --compare OLD NEW

Each seal is a run of the command line in a process of its own. FILE gets a line of JSON for each as
soon as it has ended; seals that FILE has are not run again.
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
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from benchmarks.glands import STATES, Drawn, sample
from benchmarks.glands.table import comparison, read

WALL = 20.0  # seconds that may pass for a second of CPU, on a machine with other work


def environment(source: Path) -> dict[str, str]:
    """The environment of a run: the program of this folder, one thread."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": str(source.resolve())}


def python(
    arguments: Sequence[str], source: Path, folder: Path, limit: float = 600.0
) -> subprocess.CompletedProcess[str]:
    """The end of a Python process in a folder, killed after a limit in seconds of CPU."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit)))

    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment(source),
        capture_output=True,
        text=True,
        timeout=WALL * limit,
        preexec_fn=limited,
    )


def prepare(source: Path, folder: Path) -> None:
    """Compile the kernels by a short run, and make sure that it is the program of the source."""
    done = python(["-c", "import softehl; print(softehl.__file__)"], source, folder)
    if not Path(done.stdout.strip()).is_relative_to(source.resolve()):
        raise SystemExit(f"--source {source}: there is no package softehl; give the folder src")
    short = ("density=1", "speeds=[800.0]", "stroke=out", "error_estimate=false")
    done = python(command("oring", [a for s in short for a in ("--set", s)]), source, folder)
    if done.returncode:
        raise SystemExit(f"--source {source}: a short run failed: {last(done.stderr)}")


def command(case: str, more: Sequence[str] = ()) -> list[str]:
    """The arguments of a run into the folder `out`."""
    options = ("--out", "out", "--overwrite", "--quiet", "--pictures", "none")
    return ["-m", "softehl", "run", case, *options, *more]


def last(text: str) -> str:
    """The last line that is not empty."""
    return next((line for line in reversed(text.splitlines()) if line.strip()), "no message")


def run(seal: Drawn, source: Path, limit: float) -> dict[str, Any]:
    """What came out of a seal: one line of the file."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines = [f"{key} = {json.dumps(value)}\n" for key, value in seal.keys.items()]
        (folder / "seal.toml").write_text("".join(lines), encoding="utf-8")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            done = python(command("seal.toml"), source, folder, limit)
            message = ended(done, folder / "out", limit)
        except subprocess.TimeoutExpired:
            message = f"not ended within {WALL * limit:g} s of wall time"
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        states = rows(folder / "out" / "curve.csv")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found = {"seal": seal.name, "section": seal.section, "p_s/mu": seal.ratio, "asked": STATES}
    ok = sum(state["verdict"] == "ok" for state in states.values())
    return {
        **{**found, "ok": ok, "cpu_s": round(cpu, 2), "message": message},
        **{"states": states, "keys": seal.keys},
    }


def ended(done: subprocess.CompletedProcess[str], out: Path, limit: float) -> str:
    """Why a run ended before all its states; empty where it did not."""
    if done.returncode < 0:
        return f"killed by signal {-done.returncode}; it may take {limit:g} s of CPU"
    if done.returncode and (out / "run.json").exists():
        found = json.loads((out / "run.json").read_text(encoding="utf-8"))["message"]
        return str(found) or last(done.stderr)
    return last(done.stderr) if done.returncode else ""


def rows(curve: Path) -> dict[str, Any]:
    """Verdict, h* and friction of the states in a file of a curve, by the speed of the rod."""
    if not curve.exists():
        return {}
    with curve.open(encoding="utf-8", newline="") as lines:
        return {
            f"{float(row['rod_speed_mm_s']):+g}": {
                "verdict": row["verdict"],
                "h_star_um": float(row["h_star_um"]),
                "rod_friction_N": float(row["rod_friction_N"]),
            }
            for row in csv.DictReader(lines)
        }


def main() -> None:
    """Run what FILE does not have, or print a comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, nargs="?", help="file of JSON lines")
    parser.add_argument("--source", type=Path, help="folder src of the program to run")
    parser.add_argument("--limit", type=int, help="number of seals to run at most now")
    parser.add_argument("--first", type=int, default=60, help="only the first K seals")
    parser.add_argument("--timeout", type=float, default=240.0, help="seconds of CPU for a seal")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    given = parser.parse_args()
    if given.compare:
        print(comparison(*(read(file) for file in given.compare)))
        return
    if not given.file or not given.source:
        parser.error("give FILE and --source, or --compare OLD NEW")
    have = read(given.file) if given.file.exists() else {}
    wanted = [seal for seal in islice(sample(), given.first) if seal.name not in have]
    with tempfile.TemporaryDirectory() as folder:
        prepare(given.source, Path(folder))
    for seal in wanted[: given.limit]:
        found = run(seal, given.source, given.timeout)
        with given.file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(found) + "\n")
        told = f"{found['ok']} of {STATES} ok, {found['cpu_s']} s of CPU {found['message']}"
        print(f"{seal.name}, p_s / mu = {seal.ratio}: {told}", flush=True)


if __name__ == "__main__":
    main()
