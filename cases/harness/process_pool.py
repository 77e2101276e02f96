"""Processes that share work: executors of tasks, and runs of a case that report to this process.

Any `concurrent.futures.Executor` will do: :func:`processes` on this machine, Dask's
`client.get_executor()` or mpi4py's `MPIPoolExecutor` on a cluster. Functions, arguments and results
cross by pickle, and so do errors, which are raised here as what they are. Runs of
:func:`solve_side_by_side` have one process each and call their observers here.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from threading import Thread
from typing import Any, TypeVar, Unpack

from softehl.cases.harness.case import Solve
from softehl.cases.harness.file_content import Content
from softehl.cases.harness.observer import Observer, Outcome, State, StepReport
from softehl.runtime.solve.solution import Status

T = TypeVar("T")
R = TypeVar("R")


def processes(count: int) -> ProcessPoolExecutor:
    """Return an executor of fresh processes on this machine, with one thread each.

    Parameters
    ----------
    count : int
        Number of processes.

    Returns
    -------
    ProcessPoolExecutor
        Its processes end with this one, and ignore Ctrl-C.
    """
    # several processes of several threads each would only get in each other's way
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=context, initializer=_end_with_parent)


def completed(
    function: Callable[[T], R], tasks: Sequence[T], executor: Executor | None
) -> Iterator[tuple[int, R]]:
    """(number of the task, its result) as they come in; without an executor one by one, here.

    Raises what a task raises, and then cancels those that have not begun.
    """
    if executor is None:
        yield from enumerate(map(function, tasks))
        return
    futures: dict[Future[R], int] = {executor.submit(function, t): n for n, t in enumerate(tasks)}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        for future in futures:
            future.cancel()


def _end_with_parent() -> None:
    """Let this process end when the one that started it does, however it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal sends it to all of us
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


_INTERVAL = 0.1  # seconds between looks at whether a process still works


@dataclass
class _Worker:
    """A run in another process: what it tells, to whom, and what it will have been in the end.

    sender: our copy of the other side's end, until the first call shows that it has its own.
    """

    observer: Observer
    receiver: "Connection[Any, Any]"
    sender: "Connection[Any, Any]"
    future: Future[Outcome[Any]]

    def listen(self) -> None:
        """Make the next call."""
        method, args, details = self.receiver.recv()
        self.sender.close()  # so that a process that dies in the middle of a call is noticed
        getattr(self.observer, method)(*args, **details)


def solve_side_by_side(
    solve: Solve, pieces: Sequence[Any], observers: Sequence[Observer]
) -> list[Outcome[Any]]:
    """Run each parameter set in its own process; the outcomes in the order of `pieces`.

    The observers are called in this process.  solve must cross by pickle.  A process that the
    system ends is an outcome that says so; the others go on.  Raises what a run raises; the other
    runs then end at their next step.
    """
    with ExitStack() as stack:
        workers = []
        for piece, observer in zip(pieces, observers, strict=True):
            # a pool each: where one process dies, its whole pool is lost
            pool = stack.enter_context(processes(1))
            receiver, sender = Pipe(duplex=False)
            future = pool.submit(_work, solve, piece, sender)
            workers.append(_Worker(observer, receiver, sender, future))
            stack.callback(receiver.close)  # nobody listens any more: the next call fails
            stack.callback(sender.close)
        return _collect(workers)


def _outcome(worker: _Worker) -> Outcome[Any]:
    try:
        return worker.future.result()
    except BrokenProcessPool:
        return Outcome(
            states=(),
            status=Status.KILLED,
            message="its process was ended from outside (killed, or out of memory)",
            unknowns={},
            kernel_signatures={},
        )


def _collect(workers: Sequence[_Worker]) -> list[Outcome[Any]]:
    """Make the calls that arrive, until every worker has its outcome."""
    speaking = {worker.receiver: worker for worker in workers}
    while True:
        # in this order: what a worker told before it ended is in the pipe by then
        working = [worker for worker in workers if not worker.future.done()]
        ready = wait(list(speaking), timeout=_INTERVAL if working else 0.0)
        for receiver in ready:
            assert isinstance(receiver, Connection)
            try:
                speaking[receiver].listen()
            except EOFError:  # it has ended; how is known to the future
                del speaking[receiver]
        for worker in workers:
            if worker.future.done() and not isinstance(_error(worker), BrokenProcessPool):
                worker.future.result()  # what a run raises ends the others
        if not working and not ready:
            return [_outcome(worker) for worker in workers]


def _error(worker: _Worker) -> BaseException | None:
    return worker.future.exception()


def _work(solve: Solve, piece: Any, sender: "Connection[Any, Any]") -> Outcome[Any]:
    return solve(piece, PipeObserver(sender))


@dataclass(frozen=True)
class PipeObserver(Observer):
    """The observer inside a process of its own: sends each call to the other side."""

    sender: "Connection[Any, Any]"

    def stage(self, name: str, **marks: Any) -> None:
        self.sender.send(("stage", (name,), marks))

    def step(self, **step: Unpack[StepReport]) -> None:
        self.sender.send(("step", (), dict(step)))

    def state(self, state: State) -> None:
        self.sender.send(("state", (state,), {}))

    def files(self, contents: Mapping[str, Content]) -> None:
        self.sender.send(("files", (contents,), {}))
