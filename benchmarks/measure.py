"""One case from start to end: derive, compile, verify, count, time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import compiling, counting
from benchmarks.candidate import Candidate
from benchmarks.compiling import COMMON_FLAGS, CompileError, Compiler
from benchmarks.deriving import DerivationError, TimeLimitError, derive
from benchmarks.problem import TOLERANCE, Case, Result, deviation, elements, reference
from benchmarks.routes import OURS, Generator
from benchmarks.timing import Driver, Loaded
from softehl.runtime.arrays import Array

SHIPPED = OURS.routes[0]
NOBODY = "-"
"""In place of the compiler where a generator wrote no C."""


@dataclass(frozen=True)
class Settings:
    """Settings of a run.

    They are the compilers, the samples of each kernel, whether each tool's own flags and every
    route are used, the seconds that a derivation and a compilation may take, and the reporter."""

    compilers: Sequence[Compiler]
    rounds: int
    own: bool
    every: bool
    limit: float
    say: Callable[[str], None]


@dataclass(frozen=True)
class Row:
    """Measurement of one route with one compiler; None: not measured, `outcome` says why.

    `outcome` is empty for a verified kernel.  `error` is the largest relative deviation from the
    50-digit reference (three elements) and from our kernel (all of them).  `nanoseconds` are per
    element, the median of the rounds, `least_nanoseconds` the smallest.  `ratio` is the median
    over the rounds of this route's time over that of our shipped page with the same compiler and
    the same kind of flags.
    """

    case: str
    generator: str
    route: str
    compiler: str
    outcome: str
    derive_seconds: float | None = None
    compile_seconds: float | None = None
    operations: int | None = None
    error: float | None = None
    nanoseconds: float | None = None
    least_nanoseconds: float | None = None
    ratio: float | None = None
    own_flags: str = ""
    own_outcome: str = ""
    own_nanoseconds: float | None = None
    own_least_nanoseconds: float | None = None
    own_ratio: float | None = None


@dataclass(frozen=True)
class Best:
    """A generator at its best: any route, compiler, flags (ours: the shipped page); `ratio` to
    ours at its best."""

    case: str
    generator: str
    route: str
    compiler: str
    flags: str
    operations: int | None
    nanoseconds: float
    least_nanoseconds: float
    ratio: float


@dataclass(frozen=True)
class Attempt:
    """A compilation: seconds, error, the kernel if it was verified, else why not."""

    outcome: str
    seconds: float | None = None
    error: float | None = None
    loaded: Loaded | None = None


@dataclass(frozen=True)
class Built:
    """One route with one compiler, before the clock."""

    candidate: Candidate
    compiler: Compiler
    operations: int | None
    common: Attempt
    own: Attempt


@dataclass(frozen=True)
class Measured:
    """A case: all rows (ours first), each generator at its best, the peak [operations per ns]."""

    rows: list[Row]
    best: list[Best]
    peak: float


def measure(
    case: Case, generators: Sequence[Generator], driver: Driver, folder: Path, settings: Settings
) -> Measured:
    """All routes of a case.  Raises RuntimeError when our own kernel fails the verification."""
    built: list[Built] = []
    failed: list[Row] = []
    ours: Result | None = None
    for generator in generators:
        routes = generator.of(case, every=settings.every)
        if not routes:
            failed.append(Row(case.title, generator.title, "any route", NOBODY, generator.fbar))
        for route in routes:
            settings.say(f"{case.title}: {generator.title}, {route}")
            place = folder / f"{case.name}_{len(built)}_{len(failed)}"
            try:
                candidate = derive(
                    generator.module, case, route, place.with_suffix(".pickle"), settings.limit
                )
            except (TimeLimitError, DerivationError) as error:
                failed.append(Row(case.title, generator.title, route, NOBODY, f"derive {error}"))
                continue
            for one in build(candidate, place, settings, ours):
                if ours is None:
                    ours = _own_result(one)
                built.append(one)
    settings.say(f"{case.title}: timing")
    return _timed(built, failed, driver, settings.rounds)


def build(
    candidate: Candidate, folder: Path, settings: Settings, ours: Result | None
) -> Iterator[Built]:
    """Compile and verify with every compiler and both kinds of flags, and count once."""
    sources = compiling.write(candidate, folder)
    operations = counting.count(candidate, folder, elements(), settings.limit)
    for k, compiler in enumerate(settings.compilers):
        attempts = []
        for label, flags in (("common", COMMON_FLAGS), ("own", candidate.own_flags)):
            if label == "own" and not settings.own:
                attempts.append(Attempt("not asked for"))
                continue
            target = folder / f"{label}_{k}.so"
            attempts.append(attempt(candidate, compiler, sources, target, flags, settings, ours))
        yield Built(candidate, compiler, operations, attempts[0], attempts[1])


def attempt(
    candidate: Candidate,
    compiler: Compiler,
    sources: Sequence[Path],
    target: Path,
    flags: Sequence[str],
    settings: Settings,
    ours: Result | None,
) -> Attempt:
    """One library; a kernel that fails the verification is not handed to the clock."""
    try:
        seconds = compiler.library(sources, target, flags, candidate.include, settings.limit)
    except TimeLimitError as error:
        return Attempt(f"compile {error}")
    except CompileError as error:
        return Attempt(f"compile: {str(error).splitlines()[-1]}")
    entry = Loaded.make(compiling.load(target), candidate.layout, candidate.case, elements())
    off = verify(entry.run(), candidate.case, ours)
    if off > TOLERANCE:
        return Attempt(f"off by {off:.0e}", seconds, off)
    return Attempt("", seconds, off, entry)


def verify(result: Result, case: Case, ours: Result | None) -> float:
    """Largest deviation from the 50-digit reference and from our kernel."""
    error = deviation(result, reference(case))
    return error if ours is None else max(error, deviation(result, ours))


def _own_result(first: Built) -> Result:
    if first.common.loaded is None:
        raise RuntimeError(f"{first.candidate.title}: {first.common.outcome}")
    return first.common.loaded.run()


def _timed(built: list[Built], failed: list[Row], driver: Driver, rounds: int) -> Measured:
    entries = {
        (k, label): loaded
        for k, b in enumerate(built)
        for label, loaded in (("common", b.common.loaded), ("own", b.own.loaded))
        if loaded is not None
    }
    times, peaks = driver.rounds(entries, rounds)
    base = {b.compiler: k for k, b in enumerate(built) if b.candidate.route == SHIPPED}
    rows = [_row(k, b, base[b.compiler], times) for k, b in enumerate(built)]
    return Measured(rows + failed, _best(built, times), float(np.median(peaks)) * 1e-9)


Times = Mapping[tuple[int, str], Array]


def _row(k: int, b: Built, base: int, times: Times) -> Row:
    c = b.candidate

    def of(label: str) -> tuple[float | None, float | None, float | None]:
        own, ours = times.get((k, label)), times.get((base, label))
        if own is None:
            return None, None, None
        return *_nanoseconds(own), None if ours is None else float(np.median(own / ours))

    return Row(
        c.case.title,
        c.generator,
        c.route,
        b.compiler.name,
        b.common.outcome,
        c.derive_seconds,
        b.common.seconds,
        b.operations,
        b.common.error,
        *of("common"),
        " ".join(c.own_flags),
        b.own.outcome,
        *of("own"),
    )


def _nanoseconds(seconds: Array) -> tuple[float, float]:
    """Median and least, of an element."""
    scale = 1e9 / len(elements())
    return float(np.median(seconds)) * scale, float(seconds.min()) * scale


def _best(built: list[Built], times: Times) -> list[Best]:
    fastest: dict[str, tuple[int, str]] = {}
    for key in times:
        candidate = built[key[0]].candidate
        name = candidate.generator
        if name == OURS.title and candidate.route != SHIPPED:
            continue
        if name not in fastest or np.median(times[key]) < np.median(times[fastest[name]]):
            fastest[name] = key
    ours, found = times[fastest[OURS.title]], []
    for name, (k, label) in fastest.items():
        b, spent = built[k], times[k, label]
        c = b.candidate
        flags = COMMON_FLAGS if label == "common" else c.own_flags
        names = (c.case.title, name, c.route, b.compiler.name, " ".join(flags))
        ratio = float(np.median(spent / ours))
        found.append(Best(*names, b.operations, *_nanoseconds(spent), ratio))
    return found
