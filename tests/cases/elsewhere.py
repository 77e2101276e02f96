"""What tests have done in other processes, which load no more than this file to do it."""

import os
import time
from pathlib import Path

from softehl.cases.harness.observer import Observer, Outcome
from softehl.cases.harness.process_pool import processes
from softehl.runtime.solve.solution import Status


def double(value: int) -> int:
    return 2 * value


def touch(path: Path) -> None:
    path.write_text("")
    time.sleep(0.02)
    1 / int(path.name)


def wait_in_a_worker(target: Path) -> None:
    with processes(1) as executor:
        executor.submit(tell_and_wait, target)


def tell_and_wait(target: Path) -> None:
    part = target.with_name("part")
    part.write_text(str(os.getpid()))
    part.rename(target)
    time.sleep(60.0)


def tell_and_end(number: int, observer: Observer) -> Outcome[int]:
    """500 stages, then the number."""
    for count in range(500):
        observer.stage(str(count))
    return Outcome((number,), Status.CONVERGED, "")


def fail(error: Exception) -> None:
    """Raise what was sent."""
    raise error
