"""Runs of a case side by side, in one process each, that report as if they ran here."""

import multiprocessing
import os
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from cases.case_file import BadInput, Solve
from cases.observer import ContactState, FilmState, Observer, Outcome
from cases.oring_parameters import ORing
from runtime.kernels import MissingKernelsError, StaleKernelsError

_Call = tuple[str, tuple[object, ...], dict[str, Any]]


def solve_side_by_side(
    solve: Solve, runs: Sequence[ORing], observers: Sequence[Observer]
) -> list[Outcome]:
    """Run each parameter set in its own process and return the outcomes in the order of `runs`.

    The observers are called in this process.  solve must be importable by name.  Raises BadInput
    for kernels to be built, RuntimeError if a process dies; the other processes are then ended.
    """
    # two processes of several threads each would only get in each other's way
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = multiprocessing.get_context("spawn")
    lanes: dict[Connection, int] = {}
    processes = []
    try:
        for number, run in enumerate(runs):
            receiver, sender = context.Pipe(duplex=False)
            process = context.Process(target=_run_lane, args=(solve, run, sender), daemon=True)
            process.start()
            sender.close()  # so that the receiver sees the end when the process ends
            processes.append(process)
            lanes[receiver] = number
        return _collect(lanes, observers)
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _collect(lanes: dict[Connection, int], observers: Sequence[Observer]) -> list[Outcome]:
    """Make the calls that arrive, until every lane has sent its outcome."""
    outcomes: dict[int, Outcome] = {}
    while len(outcomes) < len(lanes):
        waiting = [receiver for receiver, lane in lanes.items() if lane not in outcomes]
        for receiver in wait(waiting):
            assert isinstance(receiver, Connection)
            lane = lanes[receiver]
            try:
                message: _Call | Outcome | BadInput = receiver.recv()
            except EOFError:
                raise RuntimeError("a run side by side ended without an outcome") from None
            if isinstance(message, BadInput):
                raise message
            if isinstance(message, Outcome):
                outcomes[lane] = message
            else:
                method, args, details = message
                getattr(observers[lane], method)(*args, **details)
    return [outcomes[lane] for lane in range(len(lanes))]


def _run_lane(solve: Solve, run: ORing, sender: "Connection[Any, Any]") -> None:
    try:
        sender.send(solve(run, _Forwarder(sender)))
    except (MissingKernelsError, StaleKernelsError) as error:
        sender.send(BadInput(str(error)))


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
