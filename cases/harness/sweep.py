"""Sweeps: many runs of a case, each in a folder of its own, on processes, Dask or MPI.

A worker writes its folder itself, state by state, so that nothing computed is lost, and a worker
on another machine needs no more than the same file system. `sweep.csv` follows from the folders of
the runs; `run.json` has the study and its status. A sweep that was killed is resumed from the runs
themselves.
"""

import json
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import click

from softehl.cases.harness.case import AnyCase, Run
from softehl.cases.harness.errors import BadInput, one_line
from softehl.cases.harness.parameters import Parameters, keys_of
from softehl.cases.harness.process_pool import completed, processes
from softehl.cases.harness.progress import Display, make_counter
from softehl.cases.harness.responses import draw_responses
from softehl.cases.harness.resume import Existing, holds_a_run, read_earlier
from softehl.cases.harness.run_record import (
    RunRecord,
    package_versions,
    refusal,
    require_empty,
    require_folder,
)
from softehl.cases.harness.runner import NOT_CONVERGED, compute, writing
from softehl.cases.harness.study_file import StudyFile
from softehl.folder_lock import FolderLock
from softehl.runtime.io import Cell, number_text, read_json, write_csv, write_json
from softehl.system import name_fault

_LONGEST = 120


@dataclass(frozen=True)
class SweepTask:
    """A curve that is to be computed: the run, its folder, what to do with what that has."""

    run: Run
    folder: Path
    existing: Existing


@dataclass(frozen=True)
class Curve:
    """A curve that was computed.

    Attributes
    ----------
    parameters : Parameters
        Of the class of the case.
    folder : Path
        Folder of its files.
    rows : tuple of Row
        The rows of `curve.csv`, one for each state.
    complaints : tuple of str
        Requested states that are missing, with reasons.
    failed : bool
        True if the program failed; a complaint has the error.
    """

    parameters: Any
    folder: Path
    rows: tuple[Any, ...]
    complaints: tuple[str, ...]
    failed: bool = False

    @property
    def converged(self) -> bool:
        """True if all requested states are there."""
        return not self.complaints


def solve_all(
    runs: Mapping[str, tuple[AnyCase, Parameters]],
    folder: Path,
    executor: Executor | None,
    existing: Existing,
) -> list[Curve]:
    """Run every case with its parameters into the folder of its name; curves in the same order.

    Files that runs share are in the shared folder of their case beside them.
    """
    base = folder.absolute()  # a worker may have another working directory
    tasks = [
        SweepTask(Run(case, parameters, shared_folder(case, base)), base / name, existing)
        for name, (case, parameters) in runs.items()
    ]
    curves = {curve.folder: curve for curve in solved(tasks, executor)}
    return [curves[task.folder] for task in tasks]


def shared_folder(case: AnyCase, base: Path) -> Path | None:
    """Folder below `base` for the files that runs of a case share; None if they share none."""
    return base / case.shared if case.shared else None


def solved(
    tasks: Sequence[SweepTask],
    executor: Executor | None,
    solve: Callable[[SweepTask], Curve] | None = None,
) -> Iterator[Curve]:
    """The curves as they come in, begun in an order in which they use what others leave.

    solve: what a worker does, :func:`solve_task` if left out.
    """
    for _, curve in completed(solve or solve_task, in_order(tasks), executor):
        yield curve


def solve_task(task: SweepTask) -> Curve:
    """Run one curve into its folder; this is what a worker does.  Raises BadInput."""
    with RunRecord(task.folder, task.run, task.existing) as record:
        complaints = compute(record, jobs=1, display=Display())
    return Curve(task.run.parameters, task.folder, tuple(record.curve.rows), tuple(complaints))


def kept_task(task: SweepTask) -> Curve:
    """As :func:`solve_task`, but a run in which the program fails does not end the others.

    Raises BadInput, which no other run would be spared either.
    """
    try:
        return solve_task(task)
    except BadInput:
        raise
    except Exception as error:
        return Curve(task.run.parameters, task.folder, (), (one_line(error),), failed=True)


def in_order(tasks: Sequence[SweepTask]) -> list[SweepTask]:
    """Tasks in the order in which they begin: the longest first, one of each shared name.

    Two curves that begin together would both compute what they could share.
    """
    seen: Counter[str] = Counter()
    ranked: list[tuple[float, int, int]] = []
    for task in tasks:
        cost, name = task.run.case.share(task.run.parameters)
        ranked.append((-cost, seen[name], len(ranked)))
        seen[name] += 1
    return [tasks[number] for *_, number in sorted(ranked)]


def named(
    cases: Iterable[Parameters] | Mapping[str, Parameters],
    case_of: Callable[[Parameters], AnyCase],
) -> dict[str, tuple[AnyCase, Parameters]]:
    """Folder name -> case and parameters.

    Raises BadInput for two of one name, for one too long, and for one that is no plain name.
    """
    if isinstance(cases, Mapping):
        pairs = [(case_of(parameters), parameters) for parameters in cases.values()]
        for name, (case, _) in zip(cases, pairs, strict=True):
            _require_plain(name, case)
        return dict(zip(cases, pairs, strict=True))
    pairs = [(case_of(parameters), parameters) for parameters in cases]
    named_pairs = {_name(case, parameters): (case, parameters) for case, parameters in pairs}
    if len(named_pairs) < len(pairs):
        raise BadInput("two curves would have the same folder; allowed: a dict of named cases")
    return named_pairs


def _require_plain(name: object, case: AnyCase) -> None:
    """Raise BadInput unless a name is one component of a path, and none that has a meaning."""
    invalid = not isinstance(name, str) or name != name.strip() or name in ("", ".", "..")
    why = name_fault(str(name))
    if invalid or why or name == case.shared:
        reserved = f", and {case.shared!r} is taken" if case.shared else ""
        reason = f" ({why})" if why and not invalid else ""
        allowed = f"a plain folder name{reserved}"
        raise BadInput(f"{name!r} is no name for a curve{reason}; allowed: {allowed}")
    if len(str(name)) > _LONGEST:
        raise BadInput(f"the name {str(name)[:20]}... is too long; allowed: {_LONGEST} letters")


def _name(case: AnyCase, parameters: Parameters) -> str:
    """Folder name of the keys that are not at their defaults; BadInput if it is too long."""
    name = "-".join(differences(parameters, case.parameters(), case.method_keys)) or "default"
    if len(name) > _LONGEST:
        raise BadInput(f"a folder called {name} would be too long; allowed: a dict of named cases")
    return name


def differences(parameters: Parameters, default: Parameters, but: Iterable[str]) -> list[str]:
    """Keys that differ from `default`, as `key=value` for a folder name, but for some keys."""
    usual = default.model_dump()
    values = parameters.model_dump(exclude=set(but))
    return [f"{key}={_text(value)}" for key, value in values.items() if value != usual[key]]


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return "+".join(map(_text, value))
    return number_text(value) if isinstance(value, float) else str(value)


TABLE, RUNS = "sweep.csv", "runs"
_INTERVAL = 2.0  # seconds between versions of the table while runs come in
_ENDED = {"converged": True, "not converged": False}


class SweepRecord:
    """Everything of a sweep but its runs, kept up to date; a context that locks the folder."""

    def __init__(self, folder: Path, study: StudyFile, existing: Existing) -> None:
        """Look at what is in `folder`.  Raises BadInput if it cannot hold or resume this study."""
        self.folder, self.study, self._existing = folder, study, existing
        self.curves: dict[int, Curve] = {}
        self.missing: list[SweepTask] = []
        self._lock = FolderLock(folder, error=BadInput)
        self._previous_seconds, self._began, self._saved = 0.0, time.monotonic(), 0.0
        require_folder(folder)
        self._earlier: Mapping[str, Any] = {}
        if self._holds():
            self._earlier = self._read()
        elif existing != "overwrite":
            require_empty(folder)

    def __enter__(self) -> Self:
        """Take the folder, and look what is there; a sweep that is not resumed is removed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock.take()
        if not self._earlier:
            self._remove_earlier()
        self._look()
        return self

    def __exit__(self, *_: object) -> None:
        """Release the folder."""
        self._lock.release()

    def _look(self) -> None:
        """Runs that are there become curves, the others are missing."""
        base, case = self.folder.absolute(), self.study.case
        shared = shared_folder(case, base)
        for number, parameters in enumerate(self.study.runs):
            if isinstance(parameters, str):
                continue
            folder = base / RUNS / f"{number + 1:05d}"
            result = self._resumed(SweepTask(Run(case, parameters, shared), folder, "resume"))
            if isinstance(result, Curve):
                self.curves[number] = result
            else:
                self.missing.append(result)

    def add(self, curve: Curve) -> None:
        """Keep a curve that has come in."""
        self.curves[int(curve.folder.name) - 1] = curve
        if time.monotonic() - self._saved > _INTERVAL:
            self.save("running")

    def save(self, status: str, message: str = "") -> None:
        """Write the table, then run.json."""
        rows = self.rows()
        write_csv(self.folder / TABLE, self.header, [[row[n] for n in self.header] for row in rows])
        content = {
            **self._described(),
            "status": status,
            "message": message,
            "counts": self.counts(),
            "versions": package_versions(),
            "seconds": self._previous_seconds + time.monotonic() - self._began,
        }
        write_json(self.folder / "run.json", content)
        self._saved = time.monotonic()

    @property
    def header(self) -> list[str]:
        """Columns of the table: number, varied keys, how the run ended, those of curve.csv."""
        columns = [name for name in self.study.case.row.header() if name not in self.study.keys]
        return ["run", *self.study.keys, "status", *columns, "words"]

    def rows(self) -> list[dict[str, Cell]]:
        """The table: a row for each state, one without numbers for a run that has none."""
        empty: dict[str, Cell] = dict.fromkeys(self.header, "")
        rows = []
        for number, point in enumerate(self.study.points):
            curve = self.curves.get(number)
            common = empty | {
                "run": number + 1,
                **{key: _cell(value) for key, value in point.items()},
                "status": self.status(number),
                "words": self._message(number),
            }
            states = [row.as_dict() for row in curve.rows] if curve else []
            rows += [common | _without(state, self.study.keys) for state in states or [{}]]
        return rows

    def counts(self) -> dict[str, int]:
        """Status at the end of a run -> number of such runs."""
        return dict(Counter(map(self.status, range(len(self.study.runs)))))

    def complaint(self) -> str:
        """Number of runs that are not as asked for, and the message of the first of them."""
        failed = [n for n in range(len(self.study.runs)) if self.status(n) != "converged"]
        if not failed:
            return ""
        first = f"run {failed[0] + 1} {self.status(failed[0])}: {self._message(failed[0])}"
        return f"{len(failed)} of {len(self.study.runs)} runs did not converge; {first}"

    def status(self, number: int) -> str:
        """Status of a run: converged, not converged, failed, not possible, or not run."""
        curve = self.curves.get(number)
        if curve is None:
            return "not possible" if isinstance(self.study.runs[number], str) else "not run"
        return "failed" if curve.failed else "converged" if curve.converged else "not converged"

    def _message(self, number: int) -> str:
        curve, parameters = self.curves.get(number), self.study.runs[number]
        if curve is None:
            return parameters if isinstance(parameters, str) else ""
        return "; ".join(curve.complaints)

    def _resumed(self, task: SweepTask) -> Curve | SweepTask:
        """The curve of a run that came to its end and can be believed, or what is to be done."""
        try:
            earlier = read_earlier(task.folder, task.run, package_versions()["softehl"])
        except BadInput:  # damaged, or begun by another version
            return replace(task, existing="overwrite")
        status = str(earlier.content.get("status"))
        if status not in _ENDED or earlier.warnings:
            return task
        complaints = () if _ENDED[status] else (str(earlier.content.get("message")),)
        return Curve(task.run.parameters, task.folder, earlier.rows, complaints)

    def _remove_earlier(self) -> None:
        """Remove the runs of an earlier sweep, by their names."""
        if (self.folder / TABLE).exists():
            for path in (self.folder / RUNS).glob("[0-9]" * 5):
                shutil.rmtree(path)

    def _holds(self) -> bool:
        return holds_a_run(self.folder) or (self.folder / TABLE).exists()

    def _read(self) -> Mapping[str, Any]:
        """Record of an earlier sweep, empty if it is overwritten.  Raises BadInput."""
        if self._existing == "overwrite":
            return {}
        if self._existing == "refuse":
            raise refusal(self.folder, "runs")
        try:
            content = read_json(self.folder / "run.json")
            points, now = content["points"], self._described()
            others = [key for key in ("case", "fixed", "keys") if content[key] != now[key]]
        except (OSError, ValueError, KeyError) as error:
            raise BadInput(
                f"--resume: {self.folder} holds no sweep that can be read ({error}); --overwrite "
                "begins anew"
            ) from None
        if now["points"][: len(points)] != points:
            others.append("points")
        if others:
            raise BadInput(
                f"--resume: {self.folder} holds a sweep with other {' and '.join(others)}; "
                "allowed: the same, or more points behind them; --overwrite begins anew"
            )
        seconds = content.get("seconds", 0.0)
        self._previous_seconds = float(seconds) if isinstance(seconds, int | float) else 0.0
        return content

    def _described(self) -> dict[str, Any]:
        """The study as run.json has it."""
        study = self.study
        described = {
            "case": study.case.reference,
            "way": study.scheme,
            "fixed": dict(study.fixed),
            "keys": list(study.keys),
            "points": [list(point.values()) for point in study.points],
        }
        text: dict[str, Any] = json.loads(json.dumps(described, default=str))
        return text


def _without(state: Mapping[str, Cell], keys: tuple[str, ...]) -> dict[str, Cell]:
    return {name: cell for name, cell in state.items() if name not in keys}


def _cell(value: object) -> Cell:
    """A value of a key in the table."""
    if value is None:
        return ""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        return value
    return json.dumps(value, default=str)


@dataclass(frozen=True)
class Workers:
    """Who runs: a number of processes, a Dask scheduler by its address, or those of mpiexec."""

    jobs: int = 1
    dask: str | None = None
    mpi: bool = False

    @contextmanager
    def executor(self) -> Iterator[Executor | None]:
        """The executor, None for this process alone.  Raises BadInput."""
        if self.mpi + (self.dask is not None) + (self.jobs > 1) > 1:
            raise BadInput("--jobs, --dask and --mpi exclude one another; allowed: one of them")
        if self.dask is not None:
            with _dask(self.dask) as executor:
                yield executor
        elif self.mpi:
            with _mpi() as executor:
                yield executor
        elif self.jobs > 1:
            with processes(self.jobs) as executor:
                yield executor
        else:
            yield None


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ImportError:
        raise BadInput("--dask needs: pip install 'softehl[cluster]'") from None
    try:
        client: Any = Client(address, timeout="10s")  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise BadInput(f"--dask {address}: no scheduler there ({error})") from None
    with client:
        yield client.get_executor()


@contextmanager
def _mpi() -> Iterator[Executor]:
    try:
        from mpi4py.futures import MPIPoolExecutor
    except ImportError:
        raise BadInput("--mpi needs mpi4py: pip install 'softehl[mpi]'") from None
    with MPIPoolExecutor() as executor:
        if executor.num_workers < 1:
            raise BadInput(
                "--mpi: no workers; start with mpiexec -n N python -m mpi4py.futures "
                "-m softehl sweep STUDY.toml --mpi"
            )
        yield executor


def sweep_study(record: SweepRecord, workers: Workers, *, quiet: bool) -> int:
    """Run what is missing of a study; 0, or 3 where a run did not reach everything.

    Raises BadInput.
    """
    with writing(record.folder), record:
        record.save("running")
        try:
            _run(record, record.missing, workers, quiet=quiet)
        except BaseException as error:
            record.save("interrupted", one_line(error))
            raise
        return _finish(record, quiet=quiet)


def _run(record: SweepRecord, tasks: Sequence[SweepTask], workers: Workers, *, quiet: bool) -> None:
    with workers.executor() as executor, _progress(record, quiet=quiet) as count:
        try:
            for curve in solved(tasks, executor, kept_task):
                record.add(curve)
                count()
        except BrokenExecutor:
            raise BadInput(
                "a process was ended from outside (killed, or out of memory); what was reached is "
                f"saved in {record.folder}, --resume goes on"
            ) from None


@contextmanager
def _progress(record: SweepRecord, *, quiet: bool) -> Iterator[Callable[[], None]]:
    """Shows how many runs are done; what it gives is called after each."""
    if quiet:
        yield lambda: None
        return
    total = len(record.study.runs)
    with make_counter(total - len(record.missing), total) as count:
        yield count


def _finish(record: SweepRecord, *, quiet: bool) -> int:
    """Draw the responses, and say what is missing."""
    study, counts = record.study, record.counts()
    done = counts.get("converged", 0) == len(study.runs)
    record.save("done" if done else "not converged", record.complaint())
    units = {key.name: key.unit for key in keys_of(study.case.parameters)}
    keys = {key: units[key] for key in study.keys}
    pictures = draw_responses(record.folder, record.rows(), keys, study.case.row)
    if not quiet:
        click.echo(", ".join(f"{number} {status}" for status, number in counts.items()))
        files = ", ".join([TABLE, *pictures, f"{RUNS}/"])
        click.echo(f"written to {record.folder}: {files}")
    if done:
        return 0
    click.echo(f"softehl: {record.complaint()} (status and words in {TABLE})", err=True)
    return NOT_CONVERGED
