"""Outputs of a task: values, each with its row and column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from softehl.codegen.graph.graph import Node


class Slot(NamedTuple):
    """A row or column: a direct unknown, or a component (value, xi-derivative) of the basis."""

    basis: bool
    position: int


@dataclass(frozen=True)
class Entry:
    """One output value and where it goes."""

    row: Slot
    column: Slot | None
    node: Node


def replace_values(entries: Sequence[Entry], roots: Sequence[Node]) -> list[Entry]:
    """Entries with new values in the same rows and columns."""
    return [Entry(x.row, x.column, n) for x, n in zip(entries, roots, strict=True)]
