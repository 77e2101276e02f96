"""`softehl sweep`: the runs of a study on processes, Dask or MPI, their table and pictures."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import click

from softehl.cases.harness.errors import BadInput, one_line
from softehl.cases.harness.parameters import keys_of
from softehl.cases.harness.processes import processes
from softehl.cases.harness.progress import make_counter
from softehl.cases.harness.responses import draw_responses
from softehl.cases.harness.session import NOT_CONVERGED, writing
from softehl.cases.harness.sweep import Task, kept_task, solved
from softehl.cases.harness.sweep_record import RUNS, TABLE, SweepRecord


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


def _run(record: SweepRecord, tasks: Sequence[Task], workers: Workers, *, quiet: bool) -> None:
    with workers.executor() as executor, _progress(record, quiet=quiet) as told:
        try:
            for curve in solved(tasks, executor, kept_task):
                record.add(curve)
                told()
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
    with make_counter(total - len(record.missing), total) as told:
        yield told


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
