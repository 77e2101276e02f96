"""Runs of a case side by side, in one process each, that report as if they ran here."""

from collections.abc import Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Any

from softehl.cases.harness.case_file import Solve
from softehl.cases.harness.observer import ContactState, FilmState, Observer, Outcome
from softehl.cases.harness.processes import processes
from softehl.cases.seal.parameters import ORing

_PATIENCE = 0.1  # seconds between looks at whether a process still works


@dataclass
class _Lane:
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
    solve: Solve, runs: Sequence[ORing], observers: Sequence[Observer]
) -> list[Outcome]:
    """Run each parameter set in its own process and return the outcomes in the order of `runs`.

    The observers are called in this process.  solve must be importable by name.  Raises what a run
    raises, RuntimeError if a process dies; the other runs then end at their next step.
    """
    lanes = []
    with processes(len(runs)) as pool:
        try:
            for run, observer in zip(runs, observers, strict=True):
                receiver, sender = Pipe(duplex=False)
                future = pool.submit(_run_lane, solve, run, sender)
                lanes.append(_Lane(observer, receiver, sender, future))
            return _collect(lanes)
        except BrokenProcessPool:
            raise RuntimeError("a run side by side ended without an outcome") from None
        finally:
            for lane in lanes:  # nobody listens any more: the next call fails
                lane.sender.close()
                lane.receiver.close()


def _collect(lanes: Sequence[_Lane]) -> list[Outcome]:
    """Make the calls that arrive, until every lane has its outcome."""
    speaking = {lane.receiver: lane for lane in lanes}
    while True:
        # in this order: what a lane told before it ended is in the pipe by then
        working = [lane for lane in lanes if not lane.future.done()]
        ready = wait(list(speaking), timeout=_PATIENCE if working else 0.0)
        for receiver in ready:
            assert isinstance(receiver, Connection)
            try:
                speaking[receiver].listen()
            except EOFError:  # it has ended; how is known to the future
                del speaking[receiver]
        outcomes = [lane.future.result() for lane in lanes if lane.future.done()]
        if not working and not ready:
            return outcomes


def _run_lane(solve: Solve, run: ORing, sender: "Connection[Any, Any]") -> Outcome:
    return solve(run, _Forwarder(sender))


@dataclass(frozen=True)
class _Forwarder(Observer):
    """The observer inside a process of its own: sends each call to the other side."""

    sender: "Connection[Any, Any]"

    def stage(self, name: str, **details: Any) -> None:
        self.sender.send(("stage", (name,), details))

    def step(self, **details: Any) -> None:
        self.sender.send(("step", (), details))

    def contact_state(self, state: ContactState) -> None:
        self.sender.send(("contact_state", (state,), {}))

    def film_state(self, state: FilmState) -> None:
        self.sender.send(("film_state", (state,), {}))
