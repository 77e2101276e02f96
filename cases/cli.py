"""Commands of the cases: `softehl run`, `sweep`, `report`, `keys`, `design`, `reproduce` and `app`.

Heavy modules are imported when a command needs them.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from softehl.cases.harness.errors import BadInput
from softehl.cases.shipped import SHIPPED

if TYPE_CHECKING:
    from softehl.cases.harness.report.part import FinishedRun, Part
    from softehl.cases.harness.resume import Existing

_NAMES = ", ".join(SHIPPED)
_RECORDS = ("run.json", "curve.csv", "sweep.csv")
"""Files by which a folder is known to hold a run."""
_Command = TypeVar("_Command", bound=Callable[..., Any])


def _into(help_text: str) -> Callable[[_Command], _Command]:
    """The folder that a command writes to; None if it is left out."""
    kind = click.Path(path_type=Path)
    return click.option("--out", "folder", metavar="DIR", type=kind, help=help_text)


def _jobs(help_text: str) -> Callable[[_Command], _Command]:
    """The number of processes."""
    kind = click.IntRange(min=1)
    return click.option("--jobs", metavar="N", type=kind, default=1, help=help_text)


@click.command(
    help=f"""Run CASE: a TOML file, a case that ships ({_NAMES}) or MODULE:ATTRIBUTE.

    A seal sits in the housing and slides on a rod (rod = "36 f7"), or in a piston and slides on a
    bore (bore = "40 H8").

    Writes curve.csv, files of each state, plots and run.json to DIR, each state as soon as it is
    computed. Without --out, --resume and --overwrite use the folder that was written to last.
    `softehl keys CASE` lists the keys. Exit code: 0 done, 2 bad input, 3 some states did not
    converge (the others are saved).
    """
)
@click.argument("case", metavar="CASE")
@click.option(
    "--set",
    "assignments",
    metavar="KEY=VALUE",
    multiple=True,
    help="Set a key; VALUE is a TOML value, a bare word is a string. Repeatable.",
)
@_into("Folder for the files  [default: results/CASE, or results/CASE-2, ... if that is taken]")
@click.option(
    "--tolerance",
    metavar="PERCENT",
    help="Largest estimated error of h*, as in 1%; states with a larger one run on finer meshes.",
)
@click.option(
    "--sensitivity",
    is_flag=True,
    help="Also write sensitivity.csv: exact derivatives by every parameter, in % for 1 %.",
)
@click.option("--resume", is_flag=True, help="Keep the states in DIR and compute the others.")
@click.option("--overwrite", is_flag=True, help="Replace the run in DIR.")
@_jobs("Run up to N parts (such as the two strokes) in parallel processes.")
@click.option(
    "--engine",
    type=click.Choice(["serial", "petsc"]),
    default="serial",
    show_default=True,
    help="petsc: factorise with MUMPS on all processes of mpirun (sets the key linear).",
)
@click.option("--quiet", is_flag=True, help="No progress and no table.")
@click.option(
    "--pictures",
    type=click.Choice(["png", "svg", "both", "none"]),
    default="png",
    show_default=True,
    help="Format of the pictures; with --resume a finished run draws them again.",
)
@click.option("--report", is_flag=True, help="Write report.html, as `softehl report DIR` does.")
def run(
    case: str,
    assignments: tuple[str, ...],
    folder: Path | None,
    tolerance: str | None,
    sensitivity: bool,
    resume: bool,
    overwrite: bool,
    jobs: int,
    engine: str,
    quiet: bool,
    pictures: str,
    report: bool,
) -> int:
    """Run a case."""
    from softehl.cases.cli import leading
    from softehl.cases.harness.case_file import read_case
    from softehl.cases.harness.pictures import CHOICES
    from softehl.cases.harness.resume import existing_of
    from softehl.cases.harness.runner import run_case

    options = {} if tolerance is None else {"tolerance": tolerance.strip().removesuffix("%")}
    if sensitivity:
        options["sensitivity"] = "true"
    with leading(engine, jobs) as leads:
        if not leads:
            return 0
        if engine == "petsc":
            assignments = (*assignments, _by_petsc(case))
        read = read_case(case, SHIPPED, assignments, options)
        read = replace(read, pictures=CHOICES[pictures])
        existing = existing_of(resume=resume, overwrite=overwrite)
        target = folder or _unnamed(read.case.name, existing)
        code = run_case(read, target, existing, jobs=jobs, quiet=quiet)
        if report:
            code = _report_of(target, code, quiet=quiet)
        return code


@click.command()
@click.argument("study", metavar="STUDY.toml")
@click.option(
    "--set", "assignments", metavar="KEY=VALUE", multiple=True, help="As in `softehl run`."
)
@_into("Folder for table, pictures and runs  [default: results/STUDY, results/STUDY-2, ...]")
@click.option("--resume", is_flag=True, help="Keep the runs in DIR and run the others.")
@click.option("--overwrite", is_flag=True, help="Replace the sweep in DIR.")
@_jobs("Run N runs in parallel processes.")
@click.option("--dask", metavar="ADDRESS", help="Run on the workers of this Dask scheduler.")
@click.option("--mpi", is_flag=True, help="Run on the processes that mpiexec started.")
@click.option("--quiet", is_flag=True, help="No progress.")
def sweep(
    study: str,
    assignments: tuple[str, ...],
    folder: Path | None,
    resume: bool,
    overwrite: bool,
    jobs: int,
    dask: str | None,
    mpi: bool,
    quiet: bool,
) -> int:
    """Run a case many times: a grid, a list, a Latin hypercube or random tolerances of its keys.

    STUDY.toml names the case, its fixed keys and how others vary (docs/many-curves.md). Writes
    sweep.csv, pictures of each result over each key, and a folder for each run, to DIR. Exit code:
    0 done, 2 bad input, 3 some runs did not converge (the others are saved).
    """
    from softehl.cases.harness.resume import existing_of
    from softehl.cases.harness.study_file import read_study
    from softehl.cases.harness.sweep import SweepRecord, Workers, sweep_study

    read = read_study(study, SHIPPED, assignments)
    existing = existing_of(resume=resume, overwrite=overwrite)
    target = folder or _unnamed(Path(study).stem, existing)
    return sweep_study(SweepRecord(target, read, existing), Workers(jobs, dask, mpi), quiet=quiet)


@click.command(name="report")
@click.argument(
    "folders", metavar="DIR...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option(
    "--out",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="File of the report  [default: report.html in DIR, of several comparison.html in the "
    "first]",
)
@click.option("--xlsx", is_flag=True, help="Also write its tables as .xlsx.")
@click.option(
    "--system",
    metavar="FOLDER",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write friction and leakage over speed and pressure to FOLDER instead of a report: tables "
    "for Modelica, parameters for Simscape, CSV.",
)
def report_runs(
    folders: tuple[Path, ...], out: Path | None, xlsx: bool, system: Path | None
) -> int:
    """Write one HTML file on the run in DIR, on several runs side by side, or on a sweep.

    The report works offline. It has the input, the gland, the deformed section and the film for
    each speed, the curve with errors and verdicts, friction, leakage, tolerances, limits and
    versions. For several runs it also has the differences from the first, in per cent.
    """
    if system is not None:
        return _hand_over(folders, system)
    name = "report.html" if len(folders) == 1 else "comparison.html"
    _write_report(folders, out or folders[0] / name, xlsx=xlsx, quiet=False)
    return 0


def _hand_over(folders: tuple[Path, ...], target: Path) -> int:
    """Write what a simulation of a system needs of the runs, or of a sweep over pressures."""
    from softehl.cases.harness.report.page import read_finished
    from softehl.cases.harness.report.sweep_page import is_sweep, read_sweep
    from softehl.cases.seal.report.system_export import write_hand_over

    runs = []
    for folder in folders:
        if is_sweep(folder):
            points = read_sweep(folder, SHIPPED).points
            runs += [point.run for point in points if point.run is not None]
        else:
            runs.append(read_finished(folder, SHIPPED))
    try:
        lines = write_hand_over(target, runs)
    except OSError as error:
        raise BadInput(f"cannot write {target}: {error.strerror or error}") from None
    for line in lines:
        click.echo(line)
    return 0


def _unnamed(name: str, existing: "Existing") -> Path:
    """The folder of results for a run of this name; which, is said where it is not the first."""
    folder, word = unnamed_folder(Path("results", name), existing)
    if word:
        click.echo(word, err=True)
    return folder


def unnamed_folder(first: Path, existing: "Existing") -> tuple[Path, str]:
    """A folder of the series `first`, `first`-2, `first`-3, ... and a word on it for the user.

    A new run takes the first one that is free; one that is to be resumed or overwritten is the one
    that was written to last. The word is empty where nothing was there.
    """
    if existing == "refuse":
        others = (first.with_name(f"{first.name}-{number}") for number in count(2))
        output = next(folder for folder in chain([first], others) if _is_free(folder))
        return output, "" if output == first else f"{first} is taken; this run goes to {output}"
    output = _newest(first)
    return output, f"--{existing}: {output}" if _holds_records(output) else ""


def _is_free(folder: Path) -> bool:
    """True if a folder has hidden files at most, and no run is under way in it."""
    if not folder.exists():
        return True
    try:
        names = [path.name for path in folder.iterdir()]
    except OSError:  # a file, or a folder that cannot be read
        return False
    return ".lock" not in names and all(name[0] == "." for name in names)


def _newest(first: Path) -> Path:
    """The folder of the series that was written to last, `first` where there is none."""
    if not first.parent.is_dir():
        return first
    name = re.compile(rf"{re.escape(first.name)}(-\d+)?")
    folders = [p for p in first.parent.iterdir() if name.fullmatch(p.name) and _holds_records(p)]
    return max(folders, key=_written, default=first)


def _holds_records(folder: Path) -> bool:
    return any((folder / name).exists() for name in _RECORDS)


def _written(folder: Path) -> float:
    """When the record of a run was last written."""
    return max((folder / n).stat().st_mtime for n in _RECORDS if (folder / n).exists())


def _report_of(folder: Path, code: int, *, quiet: bool) -> int:
    """Report a run that is done; its exit code, or 2 where there is nothing that says so yet."""
    try:
        _write_report((folder,), folder / "report.html", xlsx=False, quiet=quiet)
    except BadInput as error:
        click.echo(f"softehl: no report: {error}", err=True)
        return code or 2
    return code


def _write_report(folders: tuple[Path, ...], path: Path, *, xlsx: bool, quiet: bool) -> None:
    from softehl.cases.harness.report.page import parts_of, read_finished
    from softehl.cases.harness.report.sweep_page import is_sweep, read_sweep, sweep_parts

    _require_page(path, "--out")
    runs, title = [], ""
    if len(folders) == 1 and is_sweep(folders[0]):
        sweep = read_sweep(folders[0], SHIPPED)
        parts, title = sweep_parts(sweep), sweep.title
    else:
        runs = [read_finished(folder, SHIPPED) for folder in folders]
        parts = parts_of(runs)
    _write(path, runs, parts, title, xlsx=xlsx, quiet=quiet)


def _require_page(path: Path, option: str) -> None:
    if path.suffix not in (".html", ".htm"):
        pdf = " (a browser prints it to PDF)" if path.suffix.lower() == ".pdf" else ""
        raise BadInput(
            f'{option} {str(path)!r}: a report is a page{pdf}; allowed: a name with ".html"'
        )


def _write(
    path: Path,
    runs: "Sequence[FinishedRun]",
    parts: "Sequence[Part]",
    title: str,
    *,
    xlsx: bool = False,
    quiet: bool,
) -> None:
    """Write a page and its tables, and say so.  Raises BadInput."""
    from softehl.cases.harness.report.page import write_page, write_xlsx

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        size = write_page(runs, parts, path, title)
        if xlsx:
            write_xlsx(parts, path.with_suffix(".xlsx"))
    except OSError as error:
        raise BadInput(f"cannot write {path}: {error.strerror or error}") from None
    if not quiet:
        size_text = f"{size / 1e6:.1f} MB" if size >= 1e5 else f"{size / 1e3:.0f} kB"
        click.echo(f"written to {path} ({size_text})")
        if xlsx:
            click.echo(f"written to {path.with_suffix('.xlsx')}")


@contextmanager
def leading(engine: str, jobs: int) -> Iterator[bool]:
    """Yield True in the process that runs the case; the others have done their part by then.

    engine: "serial" or "petsc".  Raises BadInput where PETSc is missing, or for jobs beside it.
    """
    if engine == "serial":
        yield True
        return
    from softehl.runtime.mpi import MissingPetsc
    from softehl.runtime.solve.linear import mumps

    if jobs > 1:
        raise BadInput(
            f"--jobs {jobs} with --engine petsc: allowed is 1; the processes of mpirun work "
            "together, start more of them"
        )
    try:
        mumps.require()
    except MissingPetsc as error:
        raise BadInput(f"--engine {error}") from None
    with mumps.leading() as leads:
        yield leads


def _by_petsc(case: str) -> str:
    """Settings of a case by which PETSc solves its linear systems.  Raises BadInput."""
    from softehl.cases.harness.case_file import find_case

    named_case = find_case(case, SHIPPED)[0]
    if "linear" not in named_case.parameters.model_fields:
        raise BadInput(
            f"--engine petsc: {named_case.name} has no linear systems worth several processes; "
            "allowed: --engine serial"
        )
    return "linear=petsc"


@click.command(
    help="""List the keys of CASE (as in `softehl run`): default, unit, bounds, meaning.

    A key is set by `softehl run CASE --set KEY=VALUE` or in a TOML file.
    """
)
@click.argument("case", metavar="CASE")
def keys(case: str) -> int:
    """Print the keys of a case."""
    from softehl.cases.harness.case_file import find_case
    from softehl.cases.harness.table import print_keys

    print_keys(find_case(case, SHIPPED)[0].parameters)
    return 0


@click.command(
    help="""Find the values of keys that bring a result of CASE to TARGET.

    Example: `softehl design oring "friction -10%" --by rod_diameter`. Other targets: "friction
    below 5 N", "h_star above 0.5 um", "leakage below 1 mm3 a cycle"; several bounds are joined by
    "and". Exact sensitivities give the value, and a nonlinear solve checks it. The state is that of
    the first speed, at outstroke unless stroke = in; a cycle has both, and a bound on friction,
    film or pressure holds in both. Exit code: 0 done, 2 bad input, or a target that cannot be met.
    """,
    context_settings={"ignore_unknown_options": True},  # a target that begins with a minus sign
)
@click.argument("case", metavar="CASE")
@click.argument("target", metavar="TARGET", nargs=-1, required=True)
@click.option(
    "--by",
    "by",
    metavar="KEY",
    required=True,
    multiple=True,
    help="The key to change; several times for several keys.",
)
@click.option(
    "--set", "assignments", metavar="KEY=VALUE", multiple=True, help="As in `softehl run`."
)
@click.option(
    "--report",
    "page",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Also write a page: curve of the design; results, gland and section before and after.",
)
def design(
    case: str,
    target: tuple[str, ...],
    by: tuple[str, ...],
    assignments: tuple[str, ...],
    page: Path | None,
) -> int:
    """Find the values of keys."""
    from softehl.cases.harness.case_file import read_case
    from softehl.cases.harness.progress import make_display
    from softehl.cases.harness.runner import DisplayObserver
    from softehl.cases.seal.gland.parameters import Seal
    from softehl.cases.seal.sensitivity.design import design_case, design_lines

    read = read_case(case, SHIPPED, assignments)
    if type(read.parameters) is not Seal:
        raise BadInput(f"{read.case.name} has no sensitivities; allowed: a seal, such as oring")
    if page is not None:
        _require_page(page, "--report")
        if not page.parent.is_dir():
            raise BadInput(f"--report {str(page)!r}: there is no folder {str(page.parent)!r}")
    with make_display(read.case.foreword(read.parameters), quiet=False) as display:
        observer = DisplayObserver(display, read.case)
        result = design_case(read.parameters, " ".join(target), by, observer)
    for line in design_lines(result):
        click.echo(line)
    if page is not None:
        from softehl.cases.seal.report.design import design_parts, design_title

        parts = design_parts(result, read.case)
        title = design_title(result, read.case.titled(read.parameters))
        _write(page, [], parts, title, quiet=False)
    return 0


@click.command()
@click.argument("items", metavar="[ITEM]...", nargs=-1)
@click.option(
    "--density",
    metavar="N",
    type=click.Choice(["1", "2", "4", "8", "16"]),
    help="Finest mesh density; 16 is the paper's. An item is never made finer than the paper's.",
)
@click.option(
    "--out",
    "folder",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("results", "reproduce"),
    show_default=True,
    help="Folder for pictures, tables and runs.",
)
@click.option("--resume", is_flag=True, help="Keep the states in DIR and compute the others.")
@_jobs("Run N runs in parallel processes.")
def reproduce(
    items: tuple[str, ...], density: str | None, folder: Path, resume: bool, jobs: int
) -> int:
    """Reproduce the paper: all of it, or each ITEM (table1, table2, fig4 ... fig20).

    Writes ITEM.png, ITEM.csv (what is drawn) and ITEM.txt (the caption) to DIR; items share the
    runs in DIR/runs. States whose verdict is not ok are marked and named in the caption. Exit
    code: 0 done, 2 bad input.
    """
    from softehl.cases.paper.figure_spec import Scope
    from softehl.cases.paper.reproduce import reproduce_items

    scope = Scope(density=int(density) if density else None)
    return reproduce_items(items, scope, folder, resume=resume, jobs=jobs)


_MISSING = "softehl app needs Panel: pip install 'softehl[app]'"


@click.command()
@click.option(
    "--folder",
    metavar="DIR",
    default="results",
    show_default=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the runs; the app also shows runs that it already has.",
)
@click.option(
    "--port",
    metavar="N",
    default=0,
    type=click.IntRange(0, 65535),
    help="Port of the address  [default: a free one]",
)
@click.option("--no-browser", is_flag=True, help="Print the address, open no browser.")
def app(folder: Path, port: int, no_browser: bool) -> int:
    """Choose a seal, run it and compare runs, in a browser on this machine.

    Prints the address with its token; the server refuses requests without it. Ctrl-C ends the
    app and the runs that it started; their computed states are saved.
    """
    try:
        from softehl.cases.app.server import serve
    except ImportError as error:
        raise BadInput(f"{_MISSING} ({error})") from None
    serve(folder, port, show=not no_browser)
    return 0
