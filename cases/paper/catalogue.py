"""Every item of `softehl reproduce` by its name, in the order of the paper."""

from softehl.cases.paper import (
    blind,
    checks,
    choices,
    curves,
    inverse,
    onset,
    points,
    profiles,
    stabilisation,
    statements,
    tables,
)
from softehl.cases.paper.item import Item

_PAPER = [*tables.ITEMS, *profiles.ITEMS, *curves.ITEMS]


def _number(item: Item) -> tuple[bool, int]:
    return item.name.startswith("fig"), int(item.name.removeprefix("table").removeprefix("fig"))


ITEMS: dict[str, Item] = {
    item.name: item
    for item in [
        *sorted(_PAPER, key=_number),
        *checks.ITEMS,
        *choices.ITEMS,
        *blind.ITEMS,
        *onset.ITEMS,
        *points.ITEMS,
        *inverse.ITEMS,
        *statements.ITEMS,
        *stabilisation.ITEMS,
    ]
}
