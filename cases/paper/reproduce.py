"""`softehl reproduce`: the items of the paper by name, their runs, pictures, tables and captions.

Each run is computed once, several at a time; complete runs are kept.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from softehl.cases.harness.case import Run
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.process_pool import processes
from softehl.cases.harness.resume import Existing
from softehl.cases.harness.sweep import Curve, SweepTask, shared_folder, solved
from softehl.cases.oring import CASE
from softehl.cases.paper import (
    blind_predictions,
    checks,
    claims,
    curves,
    inverse_theory,
    profiles,
    stabilisation,
    tables,
)
from softehl.cases.paper.drawing import write_picture
from softehl.cases.paper.figure_spec import Item, Scope
from softehl.cases.paper.states import ENDED, Request, Store, merged
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.run_plan import rod_speeds, strokes_of
from softehl.runtime.io import read_json, write_csv, write_text
from softehl.runtime.suggestions import did_you_mean


def compute(requests: Sequence[Request], store: Store, *, resume: bool, jobs: int) -> None:
    """Run what is requested into the folders of the store; with `resume` only what is missing.

    A run that does not reach a speed is no error: its states say so. Raises BadInput for kernels
    that are to be built or folders that cannot be written to.
    """
    existing: Existing = "resume" if resume else "overwrite"
    waiting = [r for r in requests if not (resume and is_complete(r, store))]
    tasks = [
        SweepTask(_run(request, store, resume), store.run_folder(request.setup), existing)
        for request in waiting
    ]
    with _progress(len(tasks)) as advance, _executor(jobs) as executor:
        for curve in solved(tasks, executor):
            advance(curve)


def _executor(jobs: int) -> AbstractContextManager[Executor | None]:
    return processes(jobs) if jobs > 1 else nullcontext()


def is_complete(request: Request, store: Store) -> bool:
    """True if a run that was asked for all these speeds (reached or not) has ended."""
    earlier = _earlier(request, store)
    if earlier is None or earlier[0] not in ENDED or not _has_its_files(request, store):
        return False
    parameters = request.parameters
    return set(strokes_of(parameters)) <= set(strokes_of(earlier[1])) and set(
        parameters.speeds
    ) <= set(earlier[1].speeds)


def _has_its_files(request: Request, store: Store) -> bool:
    """True if every file that run.json names is there: a lost one is computed again."""
    folder = store.run_folder(request.setup)
    content = read_json(folder / "run.json")
    rows = [*content.get("states", ()), *content.get("rejected", ())]
    return all((folder / name).exists() for row in rows for name in row.get("files", ()))


def _run(request: Request, store: Store, resume: bool) -> Run:
    """The run to be made: the speeds asked for, with those of an earlier run that is kept."""
    speeds = set(request.speeds)
    earlier = _earlier(request, store) if resume else None
    if earlier:
        speeds |= set(rod_speeds(earlier[1]))
    parameters = Request(request.setup, frozenset(speeds)).parameters
    return Run(CASE, parameters, shared_folder(CASE, store.folder))


def _earlier(request: Request, store: Store) -> tuple[str, Seal] | None:
    """Status and parameters of an earlier run in the folder, None if there is none to be read."""
    path = store.run_folder(request.setup) / "run.json"
    try:
        content = read_json(path)
        return str(content["status"]), Seal(**content["parameters"])
    except (OSError, ValueError, TypeError, KeyError):
        return None


class _Advance:
    """Called with each curve when it is there."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self.progress, self.total, self.done = progress, total, 0
        self.task = progress.add_task("runs", total=total) if progress else None

    def __call__(self, curve: Curve) -> None:
        self.done += 1
        note = f"{curve.folder.name}: {'; '.join(curve.complaints) or 'done'}"
        if self.progress and self.task is not None:
            self.progress.update(self.task, advance=1)
            self.progress.console.print(note, highlight=False, markup=False)
        else:
            click.echo(f"[{self.done}/{self.total}] {note}", err=True)


@contextmanager
def _progress(total: int) -> Iterator[_Advance]:
    """A bar over the runs on a terminal, a line a run elsewhere, both on stderr."""
    console = Console(stderr=True)
    if not console.is_terminal or total == 0:
        yield _Advance(None, total)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=32),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        yield _Advance(progress, total)


_PAPER = [*tables.ITEMS, *profiles.ITEMS, *curves.ITEMS]


def _number(item: Item) -> tuple[bool, int]:
    return item.name.startswith("fig"), int(item.name.removeprefix("table").removeprefix("fig"))


ITEMS: dict[str, Item] = {
    item.name: item
    for item in [
        *sorted(_PAPER, key=_number),
        *checks.ITEMS,
        *checks.CHOICE_ITEMS,
        *blind_predictions.ITEMS,
        *checks.ONSET_ITEMS,
        *checks.POINT_ITEMS,
        *inverse_theory.ITEMS,
        *claims.ITEMS,
        *stabilisation.ITEMS,
    ]
}


def select_items(names: Sequence[str]) -> list[Item]:
    """The items of these names, all of them if there are none.  Raises BadInput."""
    for name in names:
        if name not in ITEMS:
            hint = did_you_mean(name, ITEMS)
            raise BadInput(f"no table or figure {name!r}{hint}; allowed: {', '.join(ITEMS)}")
    return [ITEMS[name] for name in dict.fromkeys(names or ITEMS)]


def reproduce_items(
    names: Sequence[str], scope: Scope, folder: Path, *, resume: bool, jobs: int
) -> int:
    """Compute and write the items; return the exit code.  Raises BadInput."""
    items = select_items(names)
    store = Store(folder / "runs")
    requests = merged(request for item in items for request in item.requests(scope))
    compute(requests, store, resume=resume, jobs=jobs)
    try:
        for item in items:
            write_item(item, store, scope, folder)
    except OSError as error:
        where = error.filename or str(folder)
        raise BadInput(f"cannot write {where!r}: {error.strerror or error}") from None
    click.echo(f"written to {folder}: {', '.join(item.name for item in items)}")
    return 0


def write_item(item: Item, store: Store, scope: Scope, folder: Path) -> None:
    """Write <stem>.csv for each table of an item, <name>.png and <name>.txt, the caption."""
    product = item.make(store, scope)
    folder.mkdir(parents=True, exist_ok=True)
    for stem, table in product.tables.items():
        write_csv(folder / f"{stem}.csv", table.header, table.rows)
    write_text(folder / f"{item.name}.txt", f"{item.title}. {product.caption}\n")
    write_picture(product, folder / f"{item.name}.png")
