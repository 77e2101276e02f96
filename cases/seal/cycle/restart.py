"""A march in time put into tables, at the end of a cycle or within it, and taken up from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace

import numpy as np

from softehl.cases.seal.cycle.transient import March, Reading
from softehl.runtime.arrays import Array

STEP = "next_step_s"
"""Column of the step that comes next, the same in every line."""


def packed(march: March) -> dict[str, Array]:
    """Start of the next step: a column for each of the last instants, newest first.

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


def drafted(
    march: March, past: Sequence[Reading], parts: Mapping[str, Sequence[Mapping[str, Array]]]
) -> dict[str, Array]:
    """A cycle in the middle of it: its readings so far, the march and its tangent.

    parts: name -> tables of the same columns that are kept as one.
    """
    tangent, loop = march.corrector.tangent, [asdict(reading) for reading in past]
    assert tangent.state is not None
    assert tangent.accepted is not None
    tables = {
        "loop": {name: np.array([r[name] for r in loop], dtype=float) for name in loop[0]},
        **{
            part: {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
            for part, tables in parts.items()
        },
        "march": packed(march),
        "tangent": {
            "state": tangent.state,
            "accepted": tangent.accepted,
            "numbers": np.array([march.condensed_at, float(tangent.outdated)]),
        },
    }
    return {f"{t}/{name}": column for t, table in tables.items() for name, column in table.items()}


def taken_up(
    march: March, arrays: Mapping[str, Array]
) -> tuple[list[Reading], Mapping[str, dict[str, Array]]]:
    """Put a march where `drafted` took it; the readings and the tables of the cycle so far."""
    tables: dict[str, dict[str, Array]] = {}
    for name, column in arrays.items():
        table, _, own = name.partition("/")
        tables.setdefault(table, {})[own] = column
    unpacked(march, tables["march"])
    past, tangent = readings(tables["loop"]), tables["tangent"]
    leave_films(march, past)
    t, outdated = tangent["numbers"].tolist()
    march.condense(t, tangent["state"])
    march.corrector.tangent.accepted = tangent["accepted"]
    march.corrector.tangent.outdated = bool(outdated)
    return past, tables
