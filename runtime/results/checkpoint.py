"""Checkpoints of a march in time: what a restart needs, in a file that knows its study."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from itertools import chain
from pathlib import Path

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.communicator import Communicator
from softehl.runtime.equations.system import System
from softehl.runtime.io import read_arrays, write_arrays


@dataclass(frozen=True, eq=False)
class TimeLevels:
    """Everything that passes from one time step to the next.

    times: of the last states, latest first, at most three. states: (k, n) their unknowns.
    histories: block -> point data after the last step. dt: length of the next step.
    """

    times: tuple[float, ...]
    states: Array
    histories: Mapping[str, Array]
    dt: float

    @property
    def t(self) -> float:
        """The present time."""
        return self.times[0]

    def save(
        self, path: Path, comm: Communicator, requested_dt: float, digests: Mapping[str, Array]
    ) -> None:
        """Write a checkpoint for any number of processes, atomically.

        requested_dt: length of step of the march. digests: of the study, see `digests_of`.
        """
        state, states = comm.gather_state(self.histories), comm.gather(self.states)
        parts = {f"history {name}": values for name, values in state.items()}
        steps = {"dt": np.array(self.dt), "asked": np.array(requested_dt)}
        if comm.is_root:
            arrays = {"times": np.array(self.times), "states": states, **steps, **parts}
            write_arrays(path, {**arrays, **digests})

    @classmethod
    def load(cls, path: Path, system: System, requested_dt: float) -> TimeLevels:
        """Read a checkpoint.  Raises StudyError if it does not belong to the study.

        If another length of step is requested than at that time, the next step has it.
        """
        arrays = read_arrays(path)
        if arrays is None:
            raise StudyError(f"restart: {str(path)!r} is missing or damaged")
        for part, digest in digests_of(system.everywhere).items():
            if not np.array_equal(arrays.get(part, ()), digest):
                raise StudyError(f"restart: {str(path)!r} is of another study: other {part}")
        histories = {n[8:]: v for n, v in arrays.items() if n.startswith("history ")}
        states, times = system.comm.restrict(arrays["states"]), tuple(arrays["times"].tolist())
        dt = float(arrays["dt"]) if arrays["asked"] == requested_dt else requested_dt
        return cls(times, states, system.comm.restrict_state(histories), dt)


def digests_of(system: System) -> dict[str, Array]:
    """Digests of the study that a checkpoint belongs to, by its parts."""
    nodal, layout = system.numbering.nodal, system.numbering.layout
    parts: dict[str, list[object]] = {
        "nodes or cells": [system.mesh.points, *chain(*sorted(system.mesh.cells.items()))],
        "pages or elements": [
            item
            for block in system.blocks.values()
            for item in (block.name, block.kernel.signature, sorted(block.shared), block.nodes)
        ],
        "unknowns": [layout.counts, *(name for name in layout.names if name in nodal)],
    }
    return {name: _digest(items) for name, items in parts.items()}


def _digest(items: Iterable[object]) -> Array:
    """The bytes of a hash, as numbers."""
    digest = sha256()
    for item in items:
        digest.update(item.tobytes() if isinstance(item, np.ndarray) else repr(item).encode())
    return np.frombuffer(digest.digest(), dtype=np.uint8).astype(np.float64)
