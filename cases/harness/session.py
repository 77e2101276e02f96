"""One run from checked parameters to files: plan it, run it, record it, report it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import click

from softehl.cases.harness.case_file import BadInput, Case, Solve
from softehl.cases.harness.curve import CurveRow
from softehl.cases.harness.observer import (
    OSCILLATING,
    UNDER_RESOLVED,
    ContactState,
    FilmState,
    Observer,
    Outcome,
)
from softehl.cases.harness.progress import Display, make_display
from softehl.cases.harness.record import RunRecord, StageLog, strokes_of
from softehl.cases.harness.workers import solve_side_by_side
from softehl.cases.seal import report
from softehl.cases.seal.parameters import DENSITIES, ORing
from softehl.runtime.kernels import MissingKernelsError, StaleKernelsError
from softehl.runtime.solve.backends import Backend, MissingBackend, choose

NOT_CONVERGED = 3
"""Exit code of a run that did not reach everything it was asked for."""


def run_case(case: Case, folder: Path, *, resume: bool, jobs: int, quiet: bool) -> int:
    """Run a case into a folder; return the exit code, 0 or :data:`NOT_CONVERGED`.

    Raises BadInput where the parameters, the folder or the kernels cannot be used.
    """
    with make_display(quiet=quiet) as display:
        record, complaints = record_case(case, folder, resume=resume, jobs=jobs, display=display)
    with _writing(folder):
        return _finish(record, complaints, quiet=quiet)


def record_case(
    case: Case, folder: Path, *, resume: bool, jobs: int, display: Display
) -> tuple[RunRecord, list[str]]:
    """Run a case into a folder; return its record and what it did not reach, in words.

    Raises BadInput like :func:`run_case`.
    """
    _require_backend(case.parameters.linear)
    record = RunRecord(folder, case, resume=resume)
    outcomes: list[Outcome] = []
    with _recorded(record):
        for parameters in refinements(case.parameters):
            last = _solve(plan(parameters, record, jobs), case.load_solve(), record, display, jobs)
            outcomes = [*outcomes, *last]
    with _writing(folder):
        return record, _conclude(record, outcomes)


def refinements(parameters: ORing) -> list[ORing]:
    """The case, and where it has a tolerance the same on every finer mesh there is."""
    if parameters.tolerance is None:
        return [parameters]
    finer = [d for d in DENSITIES if d >= parameters.density]
    return [parameters.model_copy(update={"density": density}) for density in finer]


def _solve(
    runs: Sequence[ORing], solve: Solve, record: RunRecord, display: Display, jobs: int
) -> list[Outcome]:
    """Run parameter sets one after the other or, with jobs > 1, side by side."""
    lanes = [Reporter(record, display, run.stroke) for run in runs]
    if jobs > 1 and len(runs) > 1:
        return solve_side_by_side(solve, runs, lanes)
    return [solve(run, lane) for run, lane in zip(runs, lanes, strict=True)]


def plan(parameters: ORing, record: RunRecord, jobs: int) -> list[ORing]:
    """The parameter sets still to be run at this density: one for both strokes, or one for each.

    Strokes go separately where they can run side by side or miss different speeds.
    """
    density = parameters.density
    missing = {stroke: record.missing(stroke, density) for stroke in strokes_of(parameters)}
    missing = {stroke: speeds for stroke, speeds in missing.items() if speeds}
    if jobs == 1 and len(missing) == 2 and missing["out"] == missing["in"]:
        missing = {"both": missing["out"]}
    return [
        parameters.model_copy(update={"stroke": stroke, "speeds": speeds})
        for stroke, speeds in missing.items()
    ]


@dataclass
class Reporter(Observer):
    """Passes on what one lane of a run tells: to the record first, then to the display."""

    record: RunRecord
    display: Display
    lane: str
    log: StageLog | None = None

    def stage(self, name: str, *, sealed_pressure: float, stroke: str, steps: int | None) -> None:
        """See :class:`Observer`."""
        with _writing(self.record.folder):
            self.log = self.record.stage(name, sealed_pressure, stroke)
        self.display.stage(self.lane, f"{name}, p_s = {sealed_pressure:g} MPa, stroke {stroke}")

    def step(
        self,
        *,
        label: str,
        parameter: float,
        iterations: int,
        residuals: Sequence[float],
        fraction: float | None,
    ) -> None:
        """See :class:`Observer`."""
        if self.log is not None:
            self.log.step(parameter, iterations, residuals)
        self.display.step(self.lane, f"{label} = {parameter:.4g}", fraction)

    def contact_state(self, state: ContactState) -> None:
        """See :class:`Observer`."""
        with _writing(self.record.folder):
            self.record.contact(state)

    def film_state(self, state: FilmState) -> None:
        """See :class:`Observer`."""
        with _writing(self.record.folder):
            row = self.record.film(state)
        self.display.state(row)


def _require_backend(linear: Backend) -> None:
    try:
        choose(linear)
    except MissingBackend as error:
        raise BadInput(str(error)) from None


@contextmanager
def _recorded(record: RunRecord) -> Iterator[None]:
    """Leave a word in run.json if the run ends by an exception; unbuilt kernels are bad input."""
    try:
        yield
    except BaseException as error:
        if record.began:
            with suppress(OSError):  # what ended the run matters more
                record.save("interrupted", f"{type(error).__name__}: {error}")
        if isinstance(error, MissingKernelsError | StaleKernelsError):
            raise BadInput(str(error)) from None
        raise


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        where = error.filename or str(folder)
        raise BadInput(f"cannot write {where!r}: {error.strerror or error}") from None


def _conclude(record: RunRecord, outcomes: Sequence[Outcome]) -> list[str]:
    """Complete the record; return what is missing."""
    record.begin()
    record.set_outcomes(outcomes)
    complaints = [*_failures(outcomes), *_gaps(record)]
    record.save("not converged" if complaints else "converged", "; ".join(complaints))
    return complaints


def _finish(record: RunRecord, complaints: list[str], *, quiet: bool) -> int:
    """Draw and print the curve, and say what is missing."""
    report.write_plots(record.case.parameters, record.curve, record.rejected.rows)
    if not quiet and (record.curve.rows or record.rejected.rows):
        report.print_curve(record.curve.rows, record.rejected.rows)
        for note in _notes(record.curve.rows):
            click.echo(note)
    if not quiet:
        click.echo(f"written to {record.folder}")
    if not complaints:
        return 0
    reached = _named(record.curve.rows) or "nothing"
    complaints = [*complaints, f"reached and saved in {record.folder}: {reached}"]
    click.echo(f"softehl: not converged: {'; '.join(complaints)}", err=True)
    return NOT_CONVERGED


def _failures(outcomes: Sequence[Outcome]) -> list[str]:
    """What the runs that stopped early say."""
    return [
        f"{outcome.status.value}: {' '.join(outcome.message.split())}"
        for outcome in outcomes
        if not outcome.converged
    ]


def _gaps(record: RunRecord) -> list[str]:
    """The requested states that are not results, and why not."""
    rejected = record.rejected.rows
    speeds = {row.rod_speed_mm_s for row in [*record.curve.rows, *rejected]}
    missed = [f"U = {u:+g} mm/s" for u in record.requested() if u not in speeds]
    gaps = [f"not reached: {', '.join(missed)}"] if missed else []
    if rejected:
        advice = " ".join(sorted(record.advice))
        gaps.append(f"collapsed film, not a result: {_named(rejected)}. {advice}")
    outside = record.outside()
    if outside:
        gaps.append(f"h* not known to {record.case.parameters.tolerance:g} %: {_named(outside)}")
    return gaps


def _notes(rows: Sequence[CurveRow]) -> list[str]:
    """What is to be known of states that are kept but are not plain results."""
    doubts = {
        UNDER_RESOLVED: "the inlet is too short for this mesh, h* may be far off",
        OSCILLATING: "the film zigzags from node to node; h* holds, the profile does not",
    }
    chosen = [(word, [row for row in rows if row.verdict == word]) for word in doubts]
    return [
        f"{word}: {doubts[word]}: {_named(some)}; use a finer mesh (larger density)"
        for word, some in chosen
        if some
    ]


def _named(rows: Sequence[CurveRow]) -> str:
    return ", ".join(f"U = {row.rod_speed_mm_s:+g} mm/s" for row in rows)
