"""Outputs of a task: values, each with its row and column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

from softehl.codegen.graph.graph import Node


class OutputSlot(NamedTuple):
    """A row or column: a direct unknown, or a component (value, xi-derivative) of the basis."""

    basis: bool
    position: int


class OutputArray(Enum):
    """Place of an entry; the last three: of a tangent by products (`point_products`)."""

    OUTPUT = ""
    SLOPES = "B"
    MODULI = "M"
    ADDED = "k"


@dataclass(frozen=True)
class OutputEntry:
    """One output value and where it goes."""

    row: OutputSlot
    column: OutputSlot | None
    node: Node
    array: OutputArray = OutputArray.OUTPUT


def replace_values(entries: Sequence[OutputEntry], roots: Sequence[Node]) -> list[OutputEntry]:
    """Entries with new values in the same rows and columns."""
    return [replace(x, node=n) for x, n in zip(entries, roots, strict=True)]
