"""`python -m tests.torture [MINUTES] [FILE.md]`: try every fault, print and write the table.

Bounded to 15 minutes. The exit code is 1 if anything was lost or ended in a traceback.
"""

from __future__ import annotations

import importlib.util
import json
import random
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from benchmarks.marked import renew
from tests.mpi.test_engine import mpiexec
from tests.torture.trials import (
    CASE,
    DAMAGES,
    PAGE,
    RUN,
    Clock,
    Ended,
    Tally,
    begun,
    curve,
    damage,
    done,
    ended,
    killed,
    same,
    wounds,
)

SCRIPT = """
import softehl
speeds = (1600.0, 800.0, 400.0)
cases = {
    str(p): softehl.Seal(density=1, sealed_pressure=p, speeds=speeds) for p in (1.0, 2.0)
}
if __name__ == "__main__":
    with softehl.processes(2) as executor:
        curves = softehl.solve_cases(cases, "swept", executor, resume=True)
    assert all(c.converged for c in curves), [c.complaints for c in curves]
"""


def kills(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """Runs of every mode, killed at random moments and resumed until they are done."""
    reference = work / "reference"
    assert done(*RUN, str(reference), cwd=work).code == 0
    expected = curve(reference)
    modes: list[tuple[str, ...]] = [(), ("--jobs", "2")]
    for number in range(30):
        if clock.left() < 0:
            break
        folder, more = work / f"killed{number}", modes[number % len(modes)]
        for _ in range(3):
            mode = (*RUN, str(folder), "--resume", *more)
            if not killed(begun(*mode, cwd=work), rng.uniform(0.3, 6.0)):
                break
            tally.count(wounds(folder))
        last = done(*RUN, str(folder), "--resume", cwd=work)
        tally.count(last.fault or same(curve(folder), expected))
        shutil.rmtree(folder, ignore_errors=True)


def disks(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """Files that cannot grow, folders that cannot be written, folders that are files."""
    for largest in (0, 300, 3000, 30_000, 200_000):
        folder = work / f"full{largest}"
        first = done(*RUN, str(folder), cwd=work, largest=largest)
        tally.count(first.fault or ("" if first.code in (0, 2) else f"exit code {first.code}"))
        tally.count(wounds(folder))
        again = done(*RUN, str(folder), "--resume", cwd=work)
        tally.count(again.fault or ("" if len(curve(folder)) == 8 else "rows are missing"))
    (work / "page.py").write_text(PAGE)
    for largest in (0, 300, 3000):
        cache = work / f"cache{largest}"
        tried = done("generate", "page.py", cwd=work, cache=cache, largest=largest)
        tally.count(tried.fault)
        tally.count(done("generate", "page.py", cwd=work, cache=cache).fault)
    (work / "file").write_text("mine")
    for out in ("file", "file/below", "/proc/nothing"):
        tried = done(*RUN, out, cwd=work)
        tally.count(tried.fault or ("" if tried.code == 2 else f"--out {out!r}: {tried.code}"))
    tally.count("" if (work / "file").read_text() == "mine" else "a user's file was changed")


def damages(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """Every kind of file of a run, damaged in every way, then resumed."""
    good = work / "good"
    assert done(*RUN, str(good), cwd=work).code == 0
    expected = curve(good)
    names = [
        "run.json",
        "curve.csv",
        "leakage.csv",
        "profile_1MPa_out_400mm_s.csv",
        "section_1MPa_out_400mm_s.vtu",
    ]
    trials = [(name, kind) for name in [*names, "contact_1MPa.csv"] for kind in DAMAGES]
    rng.shuffle(trials)
    for name, kind in trials:
        if clock.left() < 0:
            return
        folder = work / "damaged"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(good, folder)
        damage(folder / name, kind, rng)
        tried = done(*RUN, str(folder), "--resume", cwd=work)
        right = tried.code == 2 or not same(curve(folder), expected)
        tally.count(tried.fault or ("" if right else f"{name} {kind}: wrong rows"))


def caches(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """Every file of the user's cache, damaged in every way, then used."""
    (work / "page.py").write_text(PAGE)
    good = work / "cache"
    assert done("generate", "page.py", cwd=work, cache=good).code == 0
    assert done("run", "oring", *CASE, "--out", "warm", cwd=work, cache=good).code == 0
    files = sorted(p.relative_to(good) for p in good.rglob("*") if p.is_file())
    trials = [(name, kind) for name in files for kind in DAMAGES]
    rng.shuffle(trials)
    for name, kind in trials[:40]:
        if clock.left() < 0:
            return
        cache = work / "broken"
        shutil.rmtree(cache, ignore_errors=True)
        shutil.copytree(good, cache)
        damage(cache / name, kind, rng)
        tried = done("generate", "page.py", cwd=work, cache=cache)
        tally.count(tried.fault or ("" if tried.code == 0 else f"{name} {kind}: {tried.err}"))
        if "built" in name.parts or name.suffix not in (".json",):
            one = ("run", "oring", "--set", "density=1", "--set", "speeds=[1600]", "--quiet")
            tried = done(*one, "--overwrite", "--out", "used", cwd=work, cache=cache)
            tally.count(tried.fault or ("" if tried.code == 0 else f"{name} {kind}: {tried.err}"))


def pairs(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """Two processes at once on one folder, one cache, one sweep."""
    for more in ((), ("--resume",), ("--overwrite",)):
        both = [begun(*RUN, str(work / "shared"), *more, cwd=work) for _ in range(2)]
        ends = [ended(process) for process in both]
        codes = sorted(end.code for end in ends)
        for end in ends:
            tally.count(end.fault)
        tally.count("" if codes in ([0, 2], [0, 0]) else f"exit codes {codes}")
        tally.count("" if len(curve(work / "shared")) == 8 else "rows are missing")
    (work / "page.py").write_text(PAGE)
    for _ in range(2):
        cache = Path(tempfile.mkdtemp(dir=work))
        both = [begun("generate", "page.py", cwd=work, cache=cache) for _ in range(2)]
        for process in both:
            end = ended(process)
            tally.count(end.fault or ("" if end.code == 0 else end.err))
    cache = Path(tempfile.mkdtemp(dir=work))
    first = [begun(*RUN, str(work / f"first{k}"), cwd=work, cache=cache) for k in range(2)]
    for k, process in enumerate(first):
        end = ended(process)
        tally.count(end.fault or ("" if len(curve(work / f"first{k}")) == 8 else end.err))


def sweeps(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """A sweep on two processes, killed and begun again until it is done."""
    import subprocess

    (work / "sweep.py").write_text(SCRIPT)
    for _ in range(6):
        if clock.left() < 0:
            break
        process = subprocess.Popen(
            [sys.executable, "sweep.py"],
            cwd=work,
            start_new_session=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        was = killed(process, rng.uniform(1.0, 8.0))
        for name in ("1.0", "2.0"):
            tally.count(wounds(work / "swept" / name) if name == "1.0" else "")
        if not was:
            break
    last = subprocess.run(
        [sys.executable, "sweep.py"], cwd=work, capture_output=True, text=True, check=False
    )
    tally.count("" if last.returncode == 0 else last.stderr.strip()[-200:])


STUDY = """
case = "slider"
segments = 40
speeds = [400]
[latin_hypercube]
count = 200
between.h0 = ["1 um", "3 um"]
between.ratio = [1.5, 4]
"""


def studies(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """A study of 200 runs, killed twice and resumed: the table is that of an uninterrupted one."""
    (work / "study.toml").write_text(STUDY)
    command = ("sweep", "study.toml", "--quiet", "--jobs", "2", "--resume", "--out")
    tally.count(done(*command, "whole", cwd=work).fault)
    expected = (work / "whole" / "sweep.csv").read_bytes()
    for number in range(10):
        folder = f"killed{number}"
        for _ in range(2):
            if killed(begun(*command, folder, cwd=work), rng.uniform(3.0, 8.0)):
                tally.count(_half_tables(work / folder))
        last = done(*command, folder, cwd=work)
        table = (work / folder / "sweep.csv").read_bytes()
        tally.count(last.fault or ("" if table == expected else "another table"))
        if clock.left() < 0:
            break


def _half_tables(folder: Path) -> str:
    """What of a study that was killed is no whole file, empty if everything is."""
    for path in (*folder.glob("run.json"), *folder.glob("runs/*/run.json")):
        try:
            json.loads(path.read_text())
        except ValueError as error:
            return f"half a file: {path.name}: {error}"
    return ""


def engines(work: Path, clock: Clock, rng: random.Random, tally: Tally) -> None:
    """The same study by one process, by two, by workers of Dask and by MPI: equal tables."""
    (work / "study.toml").write_text(STUDY)
    command = ("sweep", "study.toml", "--quiet", "--out")
    tally.count(done(*command, "alone", cwd=work).fault)
    expected = (work / "alone" / "sweep.csv").read_bytes()
    ways: dict[str, Callable[[], Ended]] = {
        "processes": lambda: done(*command, "processes", "--jobs", "2", cwd=work)
    }
    if importlib.util.find_spec("distributed"):
        ways["Dask"] = lambda: _by_dask(work, *command, "Dask")
    if importlib.util.find_spec("mpi4py"):
        mpi = (*mpiexec(3), sys.executable, "-m", "mpi4py.futures")
        ways["MPI"] = lambda: done(*command, "MPI", "--mpi", cwd=work, by=mpi)
    tally.name = f"a study of 200 runs on {', '.join(ways)}"
    for name, way in ways.items():
        end = way()
        path = work / name / "sweep.csv"
        equal = path.exists() and path.read_bytes() == expected
        tally.count(end.fault or ("" if equal else f"{name}: another table; {end.err[-200:]}"))


def _by_dask(work: Path, *command: str) -> Ended:
    """A study on two workers of a scheduler of its own."""
    from distributed import LocalCluster

    given: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None}
    cluster: Any = LocalCluster(2, **given)  # type: ignore[no-untyped-call]
    with cluster:
        return done(*command, "--dask", cluster.scheduler_address, cwd=work)


GROUPS = (
    (kills, 0.2, "kill -9 of a run", "no incomplete file, nothing lost; resumed to the same curve"),
    (sweeps, 0.1, "kill -9 of a sweep", "no incomplete file; started again it ends"),
    (studies, 0.15, "kill -9 of a study of 200 runs", "resumed to the same table, byte by byte"),
    (engines, 0.05, "a study of 200 runs on processes, Dask, MPI", "equal tables, byte by byte"),
    (
        pairs,
        0.1,
        "two processes at once",
        "one of them or both are right; the other one says why it stops",
    ),
    (
        damages,
        0.15,
        "a damaged file of a run",
        "computed again or refused in one line; never used",
    ),
    (caches, 0.15, "a damaged file of the cache", "made again, without a message"),
    (
        disks,
        0.1,
        "a full disk, a folder that cannot be used",
        "an error of one line; existing files are unchanged",
    ),
)


def lines(tallies: list[Tally]) -> Iterator[str]:
    """The table as Markdown."""
    yield "| fault | tried | survived | what that means |"
    yield "|---|---|---|---|"
    for tally in tallies:
        yield f"| {tally.name} | {tally.tried} | {tally.survived} | {tally.means} |"


MINUTES = float(sys.argv[1]) if len(sys.argv) > 1 else 15.0


def main() -> int:
    """Try everything."""
    rng, tallies = random.Random(20261121), []
    for group, share, name, means in GROUPS:
        clock, tally = Clock(share * MINUTES), Tally(name, means)
        with tempfile.TemporaryDirectory(prefix="torture-") as folder:
            group(Path(folder), clock, rng, tally)
        tallies.append(tally)
        print(f"{name}: {tally.survived} of {tally.tried}", flush=True)
        for failure in tally.failures:
            print(f"  {failure}", flush=True)
    if len(sys.argv) > 2:
        renew(Path(sys.argv[2]), "table", "\n".join([*lines(tallies), ""]))
    return int(any(tally.failures for tally in tallies))


if __name__ == "__main__":
    sys.exit(main())
