"""Every host by the name of its target."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from softehl.codegen.graph.evaluate import State
from softehl.codegen.hosts import abaqus, c
from softehl.codegen.hosts.interface import Interface

Files = dict[str, str]
"""Text of each file of a folder, by its name."""

ELEMENTS: dict[str, Callable[[Interface, Sequence[State]], Files]] = {
    "c": c.c,
    "cpp": c.cpp,
    "abaqus": abaqus.uel,
}
"""Writers of the hosts that take a page of an element, with two states for their tests."""
