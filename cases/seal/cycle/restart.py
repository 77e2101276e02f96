"""A march in time put into tables, at the end of a cycle or within it, and taken up from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from softehl.cases.seal.cycle.transient import Instant, March, Reading
from softehl.runtime.arrays import Array

STEP = "next_step_s"
"""Column of the step that comes next, the same in every line."""

Tables = Mapping[str, Mapping[str, Array]]
"""Name of a table -> column -> values (n,)."""


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
    content = march.behind[0].content
    length = 6 + content.size + len(march.behind[0].x)
    if len(table[STEP]) != length:
        raise ValueError(f"a state of {len(table[STEP])} numbers does not fit {length}")
    ends = 2, 4, 6, 6 + content.size
    behind = []
    for name in sorted(name for name in table if name != STEP):
        (t, held), fluxes, volumes, filled, x = np.split(table[name], ends)
        filled = filled.reshape(content.shape)
        behind.append(Instant(float(t), x, filled, float(held), fluxes, volumes))
    march.behind, march.dt = behind, float(table[STEP][0])


def repeated(march: March, loop: Mapping[str, Array]) -> list[Reading]:
    """The readings of a cycle from its table; what its outstrokes left is on the rod again."""
    names = [field.name for field in fields(Reading)]
    rows = zip(*(loop[name].tolist() for name in names), strict=True)
    past = [Reading(*row) for row in rows]
    for reading in past:
        march.initial_direction(reading)
    return past


def drafted(march: March, cycle: Tables) -> dict[str, Array]:
    """A cycle in the middle of it: its tables so far, the march and its tangent."""
    tangent = march.corrector.tangent
    assert tangent.state is not None
    assert tangent.accepted is not None
    numbers = np.array([march.condensed_at, float(tangent.outdated)])
    held = {"state": tangent.state, "accepted": tangent.accepted, "numbers": numbers}
    tables: Tables = {**cycle, "march": packed(march), "tangent": held}
    return {f"{t}/{name}": column for t, table in tables.items() for name, column in table.items()}


def taken_up(march: March, arrays: Mapping[str, Array]) -> Tables:
    """Put a march where `drafted` took it; the tables of the cycle so far."""
    tables: dict[str, dict[str, Array]] = {}
    for name, column in arrays.items():
        table, _, own = name.partition("/")
        tables.setdefault(table, {})[own] = column
    unpacked(march, tables["march"])
    tangent = tables["tangent"]
    t, outdated = tangent["numbers"].tolist()
    march.condense(t, tangent["state"])
    march.corrector.tangent.accepted = tangent["accepted"]
    march.corrector.tangent.outdated = bool(outdated)
    return tables
