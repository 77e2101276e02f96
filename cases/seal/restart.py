"""A march in time put into a table at the end of a cycle, and taken up again from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from softehl.cases.seal.transient import March, Reading
from softehl.runtime.arrays import Array

STEP = "next_step_s"
"""Column of the step that comes next, the same in every line."""


def packed(march: March) -> dict[str, Array]:
    """What the next step starts from: a column for each of the last instants, newest first.

    A column holds the time, what the film holds, fluxes and volumes at both ends, the content of
    the segments and the unknowns, (n,) in all.
    """
    columns = {
        f"instant_{k}": np.concatenate([[i.t, i.held], i.fluxes, i.volumes, i.content.ravel(), i.x])
        for k, i in enumerate(march.behind)
    }
    return {**columns, STEP: np.full(len(columns["instant_0"]), march.dt)}


def unpacked(march: March, table: Mapping[str, Array]) -> None:
    """Put a march where `packed` took it; it has begun.  ValueError for another mesh."""
    begun = march.behind[0]
    shape, size = begun.content.shape, len(begun.x)
    length = 6 + begun.content.size + size
    if len(table[STEP]) != length:
        raise ValueError(f"a state of {len(table[STEP])} numbers does not fit {length}")
    names = sorted(name for name in table if name != STEP)
    march.behind = [
        replace(
            begun,
            t=float(column[0]),
            held=float(column[1]),
            fluxes=column[2:4],
            volumes=column[4:6],
            content=column[6:-size].reshape(shape),
            x=column[-size:],
        )
        for column in (table[name] for name in names)
    ]
    march.dt = float(table[STEP][0])


def readings(loop: Mapping[str, Array]) -> list[Reading]:
    """The readings of a cycle from its table."""
    names = [field.name for field in fields(Reading)]
    rows = zip(*(loop[name].tolist() for name in names), strict=True)
    return [Reading(**dict(zip(names, row, strict=True))) for row in rows]


def leave_films(march: March, past: list[Reading]) -> None:
    """Put what these outstrokes left back on the rod."""
    for reading in past:
        left = march.left(reading)
        if left is not None:
            march.rod.leave(reading.place_mm, left)
