"""Every host by the name of its target."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from softehl.codegen.graph.evaluate import State
from softehl.codegen.hosts import abaqus, abaqus_material, c, calculix, jax, ngsolve
from softehl.codegen.hosts.interface import Interface
from softehl.codegen.hosts.solid import States
from softehl.codegen.language.material import Law

Files = dict[str, str]
"""Text of each file of a folder, by its name."""

ELEMENTS: dict[str, Callable[[Interface, Sequence[State]], Files]] = {
    "c": c.c,
    "cpp": c.cpp,
    "abaqus": abaqus.uel,
    "jax": jax.module,
    "ngsolve": ngsolve.module,
}
"""Writers of the hosts that take a page of an element, with two states for their tests."""

MATERIALS: dict[str, Callable[[Law, States], Files]] = {
    "abaqus": abaqus_material.umat,
    "calculix": calculix.library,
}
"""Writers of the hosts that take a material, with a function that gives states for their tests."""
HOSTS = tuple(dict.fromkeys([*ELEMENTS, *MATERIALS]))
"""Names of all targets that are hosts."""
