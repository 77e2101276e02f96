"""Time of a compiled kernel for one element, measured where it was compiled."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from pathlib import Path
from time import thread_time

from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import samples
from softehl.codegen.tools.batch import Batch

ELEMENTS = 64
"""All in one state: a batch that stays in the cache."""
LEAST = 2e-3
"""Seconds of one sample, of which there are `SAMPLES`: the shortest one counts."""
SAMPLES = 5


def nanoseconds(d: Definition, tasks: Iterable[str], library: Path) -> dict[str, float]:
    """Nanoseconds of one element by task; `samples.NoStateError` if no state is found."""
    (state,) = samples.admissible(d, 1)
    along = [1.0] * len(state.dofs)
    batch = Batch(d, ctypes.CDLL(str(library)), [state] * ELEMENTS, [along] * ELEMENTS)
    return {t: 1e9 * _shortest(batch.prepared(t)[2]) / ELEMENTS for t in tasks}


def _shortest(run: Callable[[], None]) -> float:
    """Seconds of one call."""
    run()
    calls = 1
    while _timed(run, calls) < LEAST:
        calls *= 2
    return min(_timed(run, calls) for _ in range(SAMPLES)) / calls


def _timed(run: Callable[[], None], calls: int) -> float:
    start = thread_time()
    for _ in range(calls):
        run()
    return thread_time() - start
