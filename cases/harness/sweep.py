"""Many curves: each parameter set is a run in a folder of its own, here or on a cluster.

A worker writes its folder itself, state by state, so that nothing computed is lost, and a worker
on another machine needs no more than the same file system.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from softehl.cases.harness.case import AnyCase, Run
from softehl.cases.harness.earlier import Existing
from softehl.cases.harness.errors import BadInput, one_line
from softehl.cases.harness.parameters import Parameters
from softehl.cases.harness.processes import completed
from softehl.cases.harness.progress import Display
from softehl.cases.harness.record import RunRecord
from softehl.cases.harness.session import compute
from softehl.runtime.io import number_text

_LONGEST = 120


@dataclass(frozen=True)
class Task:
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
        Of the class of the case, such as `softehl.Seal`.
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
        Task(Run(case, parameters, shared_folder(case, base)), base / name, existing)
        for name, (case, parameters) in runs.items()
    ]
    curves = {curve.folder: curve for curve in solved(tasks, executor)}
    return [curves[task.folder] for task in tasks]


def shared_folder(case: AnyCase, base: Path) -> Path | None:
    """Folder below `base` for the files that runs of a case share; None if they share none."""
    return base / case.shared if case.shared else None


def solved(
    tasks: Sequence[Task],
    executor: Executor | None,
    solve: Callable[[Task], Curve] | None = None,
) -> Iterator[Curve]:
    """The curves as they come in, begun in an order in which they use what others leave.

    solve: what a worker does, :func:`solve_task` if left out.
    """
    for _, curve in completed(solve or solve_task, in_order(tasks), executor):
        yield curve


def solve_task(task: Task) -> Curve:
    """Run one curve into its folder; this is what a worker does.  Raises BadInput."""
    with RunRecord(task.folder, task.run, task.existing) as record:
        complaints = compute(record, jobs=1, display=Display())
    return Curve(task.run.parameters, task.folder, tuple(record.curve.rows), tuple(complaints))


def kept_task(task: Task) -> Curve:
    """As :func:`solve_task`, but a run in which the program fails does not end the others.

    Raises BadInput, which no other run would be spared either.
    """
    try:
        return solve_task(task)
    except BadInput:
        raise
    except Exception as error:
        return Curve(task.run.parameters, task.folder, (), (one_line(error),), failed=True)


def in_order(tasks: Sequence[Task]) -> list[Task]:
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
    given: Iterable[Parameters] | Mapping[str, Parameters],
    case_of: Callable[[Parameters], AnyCase],
) -> dict[str, tuple[AnyCase, Parameters]]:
    """Folder name -> case and parameters.

    Raises BadInput for two of one name, for one too long, and for one that is no plain name.
    """
    if isinstance(given, Mapping):
        pairs = [(case_of(parameters), parameters) for parameters in given.values()]
        for name, (case, _) in zip(given, pairs, strict=True):
            _require_plain(name, case)
        return dict(zip(given, pairs, strict=True))
    pairs = [(case_of(parameters), parameters) for parameters in given]
    found = {_name(*pair): pair for pair in pairs}
    if len(found) < len(pairs):
        raise BadInput("two curves would have the same folder; allowed: a dict of named cases")
    return found


def _require_plain(name: object, case: AnyCase) -> None:
    """Raise BadInput unless a name is one component of a path, and none that has a meaning."""
    wrong = not isinstance(name, str) or name != name.strip() or name in ("", ".", "..")
    if wrong or set(str(name)) & {"/", "\\", "\0"} or name == case.shared:
        taken = f", and {case.shared!r} is taken" if case.shared else ""
        raise BadInput(f"{name!r} is no name for a curve; allowed: a plain folder name{taken}")
    if len(str(name)) > _LONGEST:
        raise BadInput(f"the name {str(name)[:20]}... is too long; allowed: {_LONGEST} letters")


def _name(case: AnyCase, parameters: Parameters) -> str:
    """Folder name of the keys that are not at their defaults; BadInput if it is too long."""
    name = "-".join(differences(parameters, case.parameters(), case.ways)) or "default"
    if len(name) > _LONGEST:
        raise BadInput(f"a folder called {name} would be too long; allowed: a dict of named cases")
    return name


def differences(parameters: Parameters, default: Parameters, but: Iterable[str]) -> list[str]:
    """Keys that differ from `default`, as `key=value` for a folder name, but for some keys."""
    usual = default.model_dump()
    given = parameters.model_dump(exclude=set(but))
    return [f"{key}={_text(value)}" for key, value in given.items() if value != usual[key]]


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return "+".join(map(_text, value))
    return number_text(value) if isinstance(value, float) else str(value)
