"""Runs of a case side by side, in one process each, that report as if they ran here."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Any

from softehl.cases.harness.case import Solve
from softehl.cases.harness.files import Content
from softehl.cases.harness.observer import Observer, Outcome, State
from softehl.cases.harness.processes import processes

_INTERVAL = 0.1  # seconds between looks at whether a process still works


@dataclass
class _Worker:
    """A run in another process: what it tells, to whom, and what it will have been in the end.

    sender: our copy of the other side's end, until the first call shows that it has its own.
    """

    observer: Observer
    receiver: "Connection[Any, Any]"
    sender: "Connection[Any, Any]"
    future: Future[Outcome]

    def listen(self) -> None:
        """Make the next call."""
        method, args, details = self.receiver.recv()
        self.sender.close()  # so that a process that dies in the middle of a call is noticed
        getattr(self.observer, method)(*args, **details)


def solve_side_by_side(
    solve: Solve, pieces: Sequence[Any], observers: Sequence[Observer]
) -> list[Outcome]:
    """Run each parameter set in its own process; the outcomes in the order of `pieces`.

    The observers are called in this process.  solve must cross by pickle.  Raises what a run
    raises, RuntimeError if a process dies; the other runs then end at their next step.
    """
    workers = []
    with processes(len(pieces)) as pool:
        try:
            for piece, observer in zip(pieces, observers, strict=True):
                receiver, sender = Pipe(duplex=False)
                future = pool.submit(_work, solve, piece, sender)
                workers.append(_Worker(observer, receiver, sender, future))
            return _collect(workers)
        except BrokenProcessPool:
            raise RuntimeError("a run side by side ended without an outcome") from None
        finally:
            for worker in workers:  # nobody listens any more: the next call fails
                worker.sender.close()
                worker.receiver.close()


def _collect(workers: Sequence[_Worker]) -> list[Outcome]:
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
        outcomes = [worker.future.result() for worker in workers if worker.future.done()]
        if not working and not ready:
            return outcomes


def _work(solve: Solve, piece: Any, sender: "Connection[Any, Any]") -> Outcome:
    return solve(piece, _Forwarder(sender))


@dataclass(frozen=True)
class _Forwarder(Observer):
    """The observer inside a process of its own: sends each call to the other side."""

    sender: "Connection[Any, Any]"

    def stage(self, name: str, **details: Any) -> None:
        self.sender.send(("stage", (name,), details))

    def step(self, **details: Any) -> None:
        self.sender.send(("step", (), details))

    def state(self, state: State) -> None:
        self.sender.send(("state", (state,), {}))

    def files(self, contents: Mapping[str, Content]) -> None:
        self.sender.send(("files", (contents,), {}))
