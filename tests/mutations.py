"""Small faults in the sources, one at a time, and the tests that must see each of them.

    python -m tests.mutations [--tests FOLDER] [NUMBER ...]

The sources are copied to a temporary folder; each fault is made there, the tests that should see it
are run up to the first that fails, and the fault is taken back.  Printed is one line a fault; the
exit code is 1 if one was not seen.  `--tests` takes the tests of another version, to compare two.

A fault on a page of the shipped models makes it differ from its C, which only the oracle sees;
where `generated` names a model, its C is made anew from the page, which only the references see.
The test that compares the C with what the generator writes now sees both and is never among them.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("benchmarks", "cases", "codegen", "docs", "generated", "runtime", "src", "tests")
PATIENCE = 600.0
"""Seconds after which tests count as hanging: the fault is seen."""

GENERATE = """
import sys
from softehl.codegen import pipeline
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, output_files
for name, text in output_files.files([pipeline.compile_model(ALL[sys.argv[1]]())]).items():
    if name.startswith(sys.argv[1]):
        (build.GENERATED / name).write_text(text, encoding="utf-8")
"""


@dataclass(frozen=True)
class Fault:
    """A text in a file that becomes another one; tests: arguments of pytest."""

    file: str
    old: str
    new: str
    tests: str
    generated: str = ""


FAULTS = tuple(
    Fault(**fault)
    for faults in json.loads(
        Path(__file__).with_suffix(".json").read_text(encoding="utf-8")
    ).values()
    for fault in faults
)
"""`mutations.json`, where they are in sections; numbers count through all of them."""


def main() -> int:
    """Make the faults that were asked for, all by default."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutations")
    parser.add_argument("numbers", nargs="*", type=int, help="faults by number, from 1")
    parser.add_argument("--tests", type=Path, default=ROOT / "tests", help="folder of the tests")
    asked = parser.parse_args()
    numbers, missed = asked.numbers or range(1, len(FAULTS) + 1), list[int]()
    with tempfile.TemporaryDirectory(prefix="softehl-faults-") as scratch:
        copy = copied(Path(scratch), asked.tests.resolve())
        for number in numbers:
            fault, start = FAULTS[number - 1], time.monotonic()
            seen = made(fault, copy)
            seconds = time.monotonic() - start
            print(f"{number:3} {fault.file:40} {seconds:5.0f} s  {seen or 'NOT SEEN'}", flush=True)
            missed += [] if seen else [number]
    print(f"{len(list(numbers)) - len(missed)} of {len(list(numbers))} seen")
    return 1 if missed else 0


def copied(to: Path, tests: Path) -> Path:
    """The sources with these tests, as they stand in a clone."""
    skipped = shutil.ignore_patterns("__pycache__", "*.so", "*.sha256")
    for name in COPIED:
        source = tests if name == "tests" else ROOT / name
        shutil.copytree(source, to / name, symlinks=True, ignore=skipped)
    for path in ROOT.glob("*.*"):
        if path.is_file():
            shutil.copy(path, to)
    return to


def made(fault: Fault, copy: Path) -> str:
    """The test that sees a fault in the copy, empty if none does; the fault is taken back."""
    path, generated = copy / fault.file, copy / "generated"
    text = path.read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise SystemExit(
            f"{fault.file} holds {fault.old!r} {text.count(fault.old)} times, not once"
        )
    before = {p: p.read_bytes() for p in generated.iterdir() if p.is_file()}
    path.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    try:
        if fault.generated:
            made_anew = run(copy, "-c", GENERATE, fault.generated)
            if made_anew.returncode != 0:
                raise SystemExit(f"{fault.generated} is not generated\n{made_anew.stderr[-2000:]}")
        return failing(copy, fault.tests)
    finally:
        path.write_text(text, encoding="utf-8")
        for p, data in before.items():
            p.write_bytes(data)


def failing(copy: Path, tests: str) -> str:
    """The first test that fails, or why none ran."""
    words = ["-m", "pytest", "-x", "-q", "--tb=no", "-p", "no:cacheprovider", *tests.split()]
    try:
        done = run(copy, *words)
    except subprocess.TimeoutExpired:
        return "hangs"
    if done.returncode == 0:
        return ""
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    if found is None:
        raise SystemExit(f"no test ran: {tests}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return found[1]


def run(copy: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python in the copy, with what the user's cache would hold in a cache beside it."""
    fresh = {
        "PYTHONPATH": str(copy / "src"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "SOFTEHL_CACHE": os.environ.get("SOFTEHL_CACHE", str(copy / "cache")),
    }
    return subprocess.run(
        [sys.executable, *words],
        cwd=copy,
        env={**os.environ, **fresh},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


if __name__ == "__main__":
    sys.exit(main())
