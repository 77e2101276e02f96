"""Runner: one run from checked parameters to files; plan, solve, record and report."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import click

from softehl.cases.harness import table
from softehl.cases.harness.case import Alarm, AnyCase, Run
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.file_content import Content
from softehl.cases.harness.observer import Observer, Outcome, State, StepReport
from softehl.cases.harness.process_pool import solve_side_by_side
from softehl.cases.harness.progress import Display, make_display
from softehl.cases.harness.resume import Existing
from softehl.cases.harness.row import Row
from softehl.cases.harness.run_record import RunRecord, StageLog
from softehl.runtime.arrays import Array
from softehl.runtime.io import read_table
from softehl.runtime.kernels.kernel import MissingKernelsError, StaleKernelsError
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.solve.linear.direct import MissingBackend
from softehl.runtime.solve.solution import Status

NOT_CONVERGED = 3
"""Exit code of a run that did not reach everything it was asked for."""


def run_case(run: Run, folder: Path, existing: Existing, *, jobs: int, quiet: bool) -> int:
    """Run a case into a folder; return the exit code, 0 or :data:`NOT_CONVERGED`.

    existing: what to do with an earlier run there. Raises BadInput where the parameters, the
    folder or the kernels cannot be used.
    """
    with RunRecord(folder, run, existing) as record:
        for doubt in record.warnings:
            click.echo(f"softehl: {doubt}", err=True)
        for warning in () if quiet else run.case.warnings(run.parameters):
            click.echo(f"softehl: {warning}", err=True)
        with make_display(run.case.foreword(run.parameters), quiet=quiet) as display:
            complaints = compute(record, jobs=jobs, display=display)
        with writing(folder):
            return _finish(record, complaints, quiet=quiet)


def compute(record: RunRecord, *, jobs: int, display: Display) -> list[str]:
    """Run a case into its folder; return what it did not reach, in words.

    Raises BadInput like :func:`run_case`.
    """
    run, outcomes = record.run, list[Outcome[Any]]()
    with _recorded(record):
        for parameters in run.case.rounds(run.parameters):
            pieces = run.case.pieces(parameters, record.curve.rows, jobs)
            outcomes += _solve(run, pieces, record, display, jobs)
    with writing(record.folder):
        return _conclude(record, outcomes)


def _solve(
    run: Run, pieces: Sequence[Any], record: RunRecord, display: Display, jobs: int
) -> list[Outcome[Any]]:
    """Run parameter sets one after the other or, with jobs > 1, side by side."""
    reporters = [
        RecordingObserver(display, run.case, run.case.piece_name(piece), record=record)
        for piece in pieces
    ]
    if jobs > 1 and len(pieces) > 1:
        outcomes = solve_side_by_side(run.solve, pieces, reporters)
        return [
            replace(outcome, message=f"{reporter.worker}: {outcome.message}")
            if outcome.status is Status.KILLED
            else outcome
            for outcome, reporter in zip(outcomes, reporters, strict=True)
        ]
    return [run.solve(piece, reporter) for piece, reporter in zip(pieces, reporters, strict=True)]


@dataclass
class DisplayObserver(Observer):
    """Shows the stages, steps and states of a worker, and records nothing.

    worker: its name, empty where it is the only one.
    """

    display: Display
    case: AnyCase
    worker: str = ""

    def stage(self, name: str, **marks: Any) -> None:
        """See :class:`Observer`."""
        title, _ = self.case.stage_label(name, marks)
        self.display.begin_stage(self.worker, title)

    def step(self, **step: Unpack[StepReport]) -> None:
        """See :class:`Observer`."""
        text = f"{step['label']} = {step['parameter']:.4g}"
        self.display.step(self.worker, text, step["fraction"])

    def state(self, state: State) -> None:
        """See :class:`Observer`."""
        self.display.state(state.row)


@dataclass(kw_only=True)
class RecordingObserver(DisplayObserver):
    """Records what one worker of a run reports, then shows it."""

    record: RunRecord
    log: StageLog | None = None

    def stage(self, name: str, **marks: Any) -> None:
        """See :class:`Observer`."""
        _, where = self.case.stage_label(name, marks)
        with writing(self.record.folder):
            self.log = self.record.open_stage(name, where)
        super().stage(name, **marks)

    def step(self, **step: Unpack[StepReport]) -> None:
        """See :class:`Observer`."""
        if self.log is not None:
            self.log.step(step["parameter"], step["iterations"], step["residuals"])
        super().step(**step)

    def state(self, state: State) -> None:
        """See :class:`Observer`."""
        with writing(self.record.folder):
            self.record.state(state)
        super().state(state)

    def files(self, contents: Mapping[str, Content]) -> None:
        """See :class:`Observer`."""
        with writing(self.record.folder):
            self.record.files(contents)

    def saved_row(self, key: float) -> tuple[Row, Sequence[Mapping[str, Array]]] | None:
        """See :class:`Observer`."""
        for row in self.record.curve.rows:
            if row.key == key:
                paths = [self.record.folder / name for name in row.file_names()]
                return row, [read_table(path) for path in paths if path.suffix == ".csv"]
        return None

    def draft(self, key: float, arrays: Mapping[str, Array]) -> None:
        """See :class:`Observer`."""
        with writing(self.record.folder):
            self.record.draft(key, arrays)

    def drafted(self, key: float) -> Mapping[str, Array] | None:
        """See :class:`Observer`."""
        return self.record.drafted(key)


_OF_THE_USER = (MissingKernelsError, StaleKernelsError, MissingBackend, MeshError)
"""Errors that end a run and are no fault of the program."""


@contextmanager
def _recorded(record: RunRecord) -> Iterator[None]:
    """Leave a word in run.json if an exception ends the run; bad input for what a user can mend."""
    try:
        yield
    except BaseException as error:
        if record.began:
            with suppress(OSError):  # what ended the run matters more
                record.save("interrupted", f"{type(error).__name__}: {error}")
        if isinstance(error, _OF_THE_USER):
            raise BadInput(str(error)) from None
        raise


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Make an OSError bad input that names the file."""
    try:
        yield
    except OSError as error:
        where = error.filename or str(folder)
        raise BadInput(f"cannot write {where!r}: {error.strerror or error}") from None


def _conclude(record: RunRecord, outcomes: Sequence[Outcome[Any]]) -> list[str]:
    """Complete the record; return what is missing."""
    record.begin()
    record.set_outcomes(outcomes)
    complaints = [*_failures(outcomes), *_gaps(record)]
    _save(record, complaints)
    return complaints


def _save(record: RunRecord, complaints: Sequence[str]) -> None:
    record.save("not converged" if complaints else "converged", "; ".join(complaints))


def _finish(record: RunRecord, complaints: list[str], *, quiet: bool) -> int:
    """Draw and print the curve, and say what is missing."""
    case, rows, rejected = record.run.case, record.curve.rows, record.rejected.rows
    if rows:
        case.draw(record.run.parameters, record.folder, rows, rejected, record.run.pictures)
        _save(record, complaints)  # with the tables that were written meanwhile
    if not quiet and (rows or rejected):
        table.print_rows(case, rows, rejected)
        for line in case.summary(record.run.parameters, rows):
            click.secho(line, fg="red" if isinstance(line, Alarm) else None)
        for line in case.details(record.run.parameters, record.folder):
            click.echo(line)
        if assumptions := case.assumed(record.run.parameters, record.run.set_keys):
            click.echo(f"assumed: {'; '.join(assumptions)}")
        for note in case.notes(rows, record.advice):
            click.echo(note)
    if not quiet:
        click.echo(f"written to {record.folder}")
    if not complaints:
        return 0
    reached = f"reached and saved in {record.folder}: {case.named(rows) or 'nothing'}"
    click.echo(f"softehl: not converged: {'; '.join([*complaints, reached])}", err=True)
    return NOT_CONVERGED


def _failures(outcomes: Sequence[Outcome[Any]]) -> list[str]:
    """Messages of the runs that stopped early."""
    return [
        f"{outcome.status.value}: {' '.join(outcome.message.split())}"
        for outcome in outcomes
        if not outcome.converged
    ]


def _gaps(record: RunRecord) -> list[str]:
    """The requested states that are not results, and why not."""
    run, rows, rejected = record.run, record.curve.rows, record.rejected.rows
    reached = {row.key for row in [*rows, *rejected]}
    missed = [key for key in run.case.requested(run.parameters) if key not in reached]
    gaps = [f"not reached: {run.case.row.labels(missed)}"] if missed else []
    advice = " ".join(sorted({record.advice.get(row.key, "") for row in rejected}))
    return [*gaps, *run.case.complaints(run.parameters, rows, rejected, advice)]
