"""Many curves: each parameter set is a run in a folder of its own, here or on a cluster.

    from concurrent.futures import ProcessPoolExecutor
    import softehl

    cases = [softehl.ORing(sealed_pressure=p) for p in (0.5, 1.0, 2.0)]
    if __name__ == "__main__":
        with ProcessPoolExecutor(2) as executor:
            curves = softehl.solve_cases(cases, "results/sweep", executor)

A worker writes its folder itself, state by state, so that nothing computed is lost, and a worker
on another machine needs no more than the same file system.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from softehl.cases.harness.case_file import BadInput, Case
from softehl.cases.harness.curve import CurveRow
from softehl.cases.harness.processes import completed
from softehl.cases.harness.progress import Display
from softehl.cases.harness.session import record_case
from softehl.cases.seal.parameters import ORing
from softehl.runtime.io import number_text

CONTACTS = "contacts"
"""Folder beside the curves in which they leave their contact states for each other."""

_LONGEST = 120


@dataclass(frozen=True)
class Task:
    """A curve that is to be computed: the case, its folder, whether to keep what that has."""

    case: Case
    folder: Path
    resume: bool


@dataclass(frozen=True)
class Curve:
    """A curve that was computed.

    rows: the rows of `curve.csv`, one for each state. complaints: what was asked for and is not
    among them, and why, in words.
    """

    parameters: ORing
    folder: Path
    rows: tuple[CurveRow, ...]
    complaints: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether there is all that was asked for."""
        return not self.complaints


def solve_cases(
    cases: Iterable[ORing] | Mapping[str, ORing],
    folder: Path | str,
    executor: Executor | None = None,
    *,
    resume: bool = False,
) -> list[Curve]:
    """Run every parameter set into a folder of its own below `folder`; curves in the same order.

    cases: parameter sets, or folder name -> parameter set; without names a folder is called after
    all that is not at its default, such as `density=4-sealed_pressure=2`. executor: any
    `concurrent.futures.Executor` (its workers must see the same file system), None to run one after
    the other in this process. resume: keep the speeds that the folders have.

    Contact states are shared in `folder/contacts`. A run that does not reach everything is no
    error: see `Curve.complaints`. Raises BadInput, also for two curves of one name, and whatever
    else ends a run; curves that have not begun are then given up, what was reached is saved.
    """
    base = Path(folder).absolute()  # a worker may have another working directory
    tasks = [
        Task(Case("oring", parameters, base / CONTACTS), base / name, resume)
        for name, parameters in _named(cases).items()
    ]
    curves = {curve.folder: curve for curve in solved(tasks, executor)}
    return [curves[task.folder] for task in tasks]


def solved(tasks: Sequence[Task], executor: Executor | None) -> Iterator[Curve]:
    """The curves as they come in, begun in an order in which they share contact states."""
    for _, curve in completed(solve_task, in_order(tasks), executor):
        yield curve


def solve_task(task: Task) -> Curve:
    """Run one curve into its folder; this is what a worker does.  Raises BadInput."""
    record, complaints = record_case(
        task.case, task.folder, resume=task.resume, jobs=1, display=Display()
    )
    rows, parameters = tuple(record.curve.rows), task.case.parameters
    return Curve(parameters, task.folder, rows, tuple(complaints))


def in_order(tasks: Sequence[Task]) -> list[Task]:
    """Finest meshes first, which take longest, and of these one curve of each section first.

    Curves of one section at the same time would each solve its contact stage.
    """
    from softehl.cases.seal.contact_store import contact_key  # late: it loads the kernels

    seen: Counter[str] = Counter()
    ranked: list[tuple[int, int, int]] = []
    for task in tasks:
        key = contact_key(task.case.parameters)
        ranked.append((-task.case.parameters.density, seen[key], len(ranked)))
        seen[key] += 1
    return [tasks[number] for *_, number in sorted(ranked)]


def _named(cases: Iterable[ORing] | Mapping[str, ORing]) -> Mapping[str, ORing]:
    if isinstance(cases, Mapping):
        return cases
    given = list(cases)
    named = {_name(parameters): parameters for parameters in given}
    if len(named) < len(given):
        raise BadInput("two curves would have the same folder; allowed: a dict of named cases")
    return named


def _name(parameters: ORing) -> str:
    """What is not at its default, as a folder name; BadInput if that is too long for one."""
    name = "-".join(differences(parameters, ORing(), ("solver", "linear"))) or "default"
    if len(name) > _LONGEST:
        raise BadInput(f"a folder called {name} would be too long; allowed: a dict of named cases")
    return name


def differences(parameters: ORing, default: ORing, but: Iterable[str]) -> list[str]:
    """What is not as in `default`, as `key=value` for a folder name, but for some keys."""
    usual = default.model_dump()
    given = parameters.model_dump(exclude=set(but))
    return [f"{key}={_text(value)}" for key, value in given.items() if value != usual[key]]


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return "+".join(map(_text, value))
    return number_text(value) if isinstance(value, float) else str(value)
