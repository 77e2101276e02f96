"""Work that is spread over processes or machines, by the standard `concurrent.futures.Executor`.

Any executor will do: :func:`processes` on this machine, Dask's `client.get_executor()` or mpi4py's
`MPIPoolExecutor` on a cluster. Functions, arguments and results cross by pickle, and so do errors,
which are raised here as what they are.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from multiprocessing.connection import wait
from threading import Thread
from typing import TypeVar

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
