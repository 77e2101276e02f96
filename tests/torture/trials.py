"""What the trials share: commands in processes of their own, and what counts as survived."""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

CASE = ("--set", "density=1", "--set", "speeds=[1600, 800, 400, 200]", "--quiet")
RUN = ("run", "oring", *CASE, "--out")
PAGE = """
from softehl import Definition, Model, quadrature


def spring() -> Definition:
    m = Model("spring", nodes=1, rule=quadrature.point_rule(), unroll=True)
    ((X,),) = m.coordinates("X")
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N/mm]")
    m.potential(k / 2 * u**2 + k / 4 * (X + u) ** 4)
    return m.finish()
"""


@dataclass
class Tally:
    """One line of the table: what was tried, how often, and how often it survived."""

    name: str
    means: str
    tried: int = 0
    survived: int = 0
    failures: list[str] = field(default_factory=list)

    def count(self, failure: str) -> None:
        """Add a trial; an empty failure is a survival."""
        self.tried += 1
        self.survived += not failure
        if failure:
            self.failures.append(failure)


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def fault(self) -> str:
        """What no command may do, empty if it did not: a traceback, a crash, a code of its own."""
        if "Traceback" in self.err or "Traceback" in self.out:
            return f"traceback: {self.err.strip().splitlines()[-1][:200]}"
        if self.code not in (0, 1, 2, 3):
            return f"exit code {self.code}: {self.err.strip()[:200]}"
        if self.code == 2 and len(self.err.strip().splitlines()) != 1:
            return f"bad input in {len(self.err.strip().splitlines())} lines"
        return ""


def begun(
    *arguments: str,
    cwd: Path,
    cache: Path | None = None,
    largest: int | None = None,
    by: Sequence[str] = (),
) -> subprocess.Popen[str]:
    """A command in a session of its own. largest: bytes that a file may have; by: what starts
    softehl instead of Python alone.
    """
    environment = dict(os.environ)
    if cache is not None:
        environment["SOFTEHL_CACHE"] = str(cache)

    def limit() -> None:
        import resource

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        if largest is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))

    return subprocess.Popen(
        [*(by or (sys.executable,)), "-m", "softehl", *arguments],
        cwd=cwd,
        env=environment,
        start_new_session=True,
        preexec_fn=limit,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process: subprocess.Popen[str]) -> Ended:
    """How a command ends by itself."""
    out, err = process.communicate(timeout=600)
    return Ended(process.returncode, out, err)


def done(
    *arguments: str,
    cwd: Path,
    cache: Path | None = None,
    largest: int | None = None,
    by: Sequence[str] = (),
) -> Ended:
    """How a command ended."""
    return ended(begun(*arguments, cwd=cwd, cache=cache, largest=largest, by=by))


def killed(process: subprocess.Popen[str], after: float) -> bool:
    """Kill a command and all its processes after some seconds; False if it had ended."""
    try:
        process.wait(after)
        process.communicate()
        return False
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True


def curve(folder: Path) -> dict[str, tuple[float, str]]:
    """Speed -> h* and verdict, of a folder; empty if there is no curve."""
    path = folder / "curve.csv"
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {row["rod_speed_mm_s"]: (float(row["h_star_um"]), row["verdict"]) for row in rows}


def wounds(folder: Path) -> str:
    """What is broken in the folder of a run that was killed, empty if nothing is."""
    try:
        rows = curve(folder)
        if (folder / "run.json").exists():
            json.loads((folder / "run.json").read_text())
    except (OSError, ValueError, KeyError) as error:
        return f"half a file: {error}"
    for speed in rows:
        at = f"1MPa_{'in' if speed.startswith('-') else 'out'}_{speed.lstrip('-')}mm_s"
        for name in (f"profile_{at}.csv", f"section_{at}.vtu"):
            path = folder / name
            if not path.exists() or not path.read_text().rstrip().endswith(
                ("\n", ">", *"0123456789")
            ):
                return f"{name} is missing or cut"
    return ""


def same(a: dict[str, tuple[float, str]], b: dict[str, tuple[float, str]]) -> str:
    """How two curves differ, empty if they do not."""
    if a.keys() != b.keys():
        return f"rows {sorted(a)} instead of {sorted(b)}"
    for speed, (h, verdict) in b.items():
        if verdict != a[speed][1] or abs(a[speed][0] / h - 1.0) > 1e-6:
            return f"U = {speed}: {a[speed]} instead of {(h, verdict)}"
    return ""


def damage(path: Path, kind: str, rng: random.Random) -> None:
    """Do something to a file that disks and editors do."""
    content = path.read_bytes()
    if kind == "lost":
        path.unlink()
    elif kind == "emptied":
        path.write_bytes(b"")
    elif kind == "cut":
        path.write_bytes(content[: rng.randrange(max(len(content), 1))])
    elif kind == "garbled":
        at = rng.randrange(max(len(content) - 8, 1))
        path.write_bytes(content[:at] + rng.randbytes(8) + content[at + 8 :])
    else:
        path.write_bytes(rng.randbytes(64))


DAMAGES = ("lost", "emptied", "cut", "garbled", "replaced")


class Clock:
    """How much of the time that was given is left."""

    def __init__(self, minutes: float) -> None:
        self.end = time.monotonic() + 60.0 * minutes

    def left(self) -> float:
        """Seconds."""
        return self.end - time.monotonic()
