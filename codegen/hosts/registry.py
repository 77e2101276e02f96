"""Every host by the name of its target."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from softehl.codegen.graph.evaluation import State
from softehl.codegen.hosts import (
    abaqus_element,
    abaqus_material,
    c_library,
    calculix,
    dolfinx,
    jax,
    ngsolve,
)
from softehl.codegen.hosts.element_interface import Interface
from softehl.codegen.hosts.material_common import States
from softehl.codegen.hosts.material_response import point
from softehl.codegen.language.material import Law

Files = dict[str, str]
"""Text of each file of a folder, by its name."""

Element = Callable[[Interface, Sequence[State]], Files]
"""Writer of the files of a page, with states for their tests."""
ELEMENTS: dict[str, Element] = {
    "c": c_library.c,
    "cpp": c_library.cpp,
    "abaqus": abaqus_element.uel,
    "jax": jax.module,
    "ngsolve": ngsolve.module,
}
"""Writers of the hosts that take a page of an element, with two states for their tests."""


def _at_a_point(write: Element) -> Callable[[Law, States], Files]:
    """A writer of elements for materials: a page of one point, with stress and modulus."""

    def files(law: Law, states: States) -> Files:
        page = Interface(point(law))
        return write(page, states(page.definition))

    return files


MATERIALS: dict[str, Callable[[Law, States], Files]] = {
    "abaqus": abaqus_material.umat,
    "calculix": calculix.library,
    "c": _at_a_point(c_library.c),
    "cpp": _at_a_point(c_library.cpp),
    "jax": _at_a_point(jax.module),
    "ufcx": dolfinx.module,
}
"""Writers of the hosts that take a material, with a function that gives states for their tests."""
HOSTS = tuple(dict.fromkeys([*ELEMENTS, *MATERIALS]))
"""Names of all targets that are hosts."""
