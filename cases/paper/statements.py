"""Statements of the paper, each with the number measured here and whether it holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from softehl.cases.paper import blind, checks, curves, inverse, onset, profiles, tables
from softehl.cases.paper.findings import FINDINGS, Finding, Query
from softehl.cases.paper.item import Item, Product, Scope, Table
from softehl.cases.paper.states import Request, Store

WORDS = {True: "yes", False: "no", None: "-"}
"""True if a statement holds; None where a number that it takes was not reached."""

_SOURCES: Sequence[Item] = (
    *tables.ITEMS,
    *profiles.ITEMS,
    *curves.ITEMS,
    *checks.ITEMS,
    *blind.ITEMS,
    *inverse.ITEMS,
    *onset.ITEMS,
)


@dataclass(frozen=True)
class Statement:
    """A statement: where the paper makes it, what it says, and how it is measured."""

    place: str
    words: str
    measure: Callable[[Query], Finding]


STATEMENTS = tuple(Statement(*entry) for entry in FINDINGS)


def _requests(scope: Scope) -> list[Request]:
    return [request for item in _SOURCES for request in item.requests(scope)]


def statements(store: Store, scope: Scope) -> Product:
    """Every statement with its measured number."""
    query = Query(store, scope)
    rows = []
    for number, statement in enumerate(STATEMENTS, start=1):
        try:
            finding = statement.measure(query)
        except ValueError as error:  # a state that it needs was not reached
            finding = Finding(str(error), None)
        words = WORDS[finding.holds]
        rows.append((str(number), statement.place, statement.words, finding.text, words))
    header = ("number", "place", "statement", "measured", "holds")
    caption = "Measured from the runs of the other items."
    return Product({"statements": Table(header, rows)}, caption)


ITEMS = (Item("statements", "The paper's statements", statements, _requests),)
