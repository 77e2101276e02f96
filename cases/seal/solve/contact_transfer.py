"""The contact state of a mesh from that of another, without a path.

Displacements, multipliers and element pressures are carried over and corrected by Newton's method,
which holds on to the pressures in its tangent (`runtime.fem.lagged_pressure`). The multipliers are
unknowns, so contact is stiff from the first iteration on. What is solved is the same as on the
path of `cases.seal.solve.path`; only the start is another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.section.round_layout import RoundLayout
from softehl.cases.seal.solve.contact import contact_problem, correction_stage
from softehl.cases.seal.solve.path import Stage
from softehl.cases.seal.solve.pressure_newton import lagged
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.lagged_pressure import element_pressures
from softehl.runtime.mesh.carrying import (
    carry_boundary,
    carry_chain,
    carry_displacements,
    carry_elements,
)
from softehl.runtime.mesh.prolongation import (
    PARTS,
    prolong_chain,
    prolong_elements,
    prolong_loop,
    prolong_nodes,
    resampled_elements,
    resampled_nodes,
    restrict_chain,
    restrict_elements,
    restrict_nodes,
)
from softehl.runtime.mesh.sections import SectionMesh
from softehl.runtime.mesh.transfer import (
    transfer_chain,
    transfer_elements,
    transfer_loop,
    transfer_nodes,
)


@dataclass(frozen=True)
class _Carrier:
    """How values go from one mesh to another: of nodes, of elements, of a part of the boundary."""

    words: str
    nodes: Callable[[Array], Array]
    elements: Callable[[Array], Array]
    chain: Callable[[str, Array], Array]


_Values: TypeAlias = Callable[[SectionMesh, SectionMesh, Array], Array]


class _Transfer(NamedTuple):
    """From a mesh to any other: of nodes, of elements, of the whole boundary, of a part of it."""

    nodes: _Values
    elements: _Values
    loop: _Values
    chain: Callable[[SectionMesh, SectionMesh, Integers, Integers, Array], Array]


BY_ANGLE = _Transfer(transfer_nodes, transfer_elements, transfer_loop, transfer_chain)
"""Between meshes of a disc."""
BY_PLACE = _Transfer(carry_displacements, carry_elements, carry_boundary, carry_chain)
"""Between meshes of any outline."""


def _carrier(old: SealSystem, new: SealSystem) -> _Carrier:
    """The most accurate transfer: exact between meshes that share nodes, else by local splines."""
    before, after = old.section.layout, new.section.layout
    density = old.mesh.arc // before.long
    nested = isinstance(before, RoundLayout) and before == after
    parts = before.disc.parts if isinstance(before, RoundLayout) else PARTS
    if nested and new.mesh.arc == 2 * old.mesh.arc:
        return _Carrier(
            f"prolonged from density {density}",
            lambda values: prolong_nodes(values, density, parts),
            lambda values: prolong_elements(values, density, parts),
            lambda name, v: prolong_loop(v) if _closed(old, name) else prolong_chain(v),
        )
    if nested and old.mesh.arc == 2 * new.mesh.arc:
        return _Carrier(
            f"restricted from density {density}",
            lambda values: restrict_nodes(values, density, parts),
            lambda values: restrict_elements(values, density, parts),
            lambda _, values: restrict_chain(values),
        )
    meshes, how = (old.mesh, new.mesh), BY_ANGLE if isinstance(before, RoundLayout) else BY_PLACE
    sizes = Fraction(old.mesh.arc, before.long), Fraction(new.mesh.arc, after.long)

    def chain(name: str, values: Array) -> Array:
        if _closed(old, name):
            return how.loop(*meshes, values)
        here, there = (system.section.chains[name][0] for system in (old, new))
        return how.chain(*meshes, here, there, values)

    if nested:
        return _Carrier(
            "from another density",
            lambda values: resampled_nodes(values, *sizes, parts),
            lambda values: resampled_elements(values, *sizes, parts),
            chain,
        )
    return _Carrier(
        "moved from another mesh",
        lambda values: how.nodes(*meshes, values),
        lambda values: how.elements(*meshes, values),
        chain,
    )


def _closed(system: SealSystem, chain: str) -> bool:
    """Whether a chain is the whole boundary."""
    return len(system.section.chains[chain][0]) == len(system.mesh.boundary)


def carried_contact(
    old: SealSystem,
    new: SealSystem,
    x: Array,
    sealed_pressure: float,
    name: str = "",
) -> tuple[Stage, Array]:
    """A stage of one step that solves for contact on another mesh of a section, and its start.

    x: unknowns of the contact state on the old mesh, under a sealed pressure, MPa. name: of the
    stage, by the density if left out.
    """
    carry = _carrier(old, new)
    pressures = element_pressures(contact_problem(old, sealed_pressure), old.solids, x)
    y = _carried(old, new, carry, x)
    bare = contact_problem(new, sealed_pressure).since(y)
    problem = lagged(new, bare, carry.elements(pressures))
    stage = correction_stage(new, problem, method=f"newton, {carry.words}", name=name)
    return stage, y


def carried_unknowns(old: SealSystem, new: SealSystem, x: Array) -> Array:
    """Every field that contact knows, (n',), on another mesh; those of the film are zero."""
    return _carried(old, new, _carrier(old, new), x)


def carried_elements(old: SealSystem, new: SealSystem, values: Array) -> Array:
    """Values (Q',) of the elements of another mesh from those, (Q,), of one."""
    return _carrier(old, new).elements(values)


def _carried(old: SealSystem, new: SealSystem, carry: _Carrier, x: Array) -> Array:
    """Every field that contact knows, by what its unknowns stand on."""
    y = new.at_rest()
    for field in old.contact_fields():
        values = x[old.layout.part(field.name)]
        if field.on == "nodes":
            values = carry.nodes(values.reshape(-1, 2)).ravel()
        elif field.on != "section":
            values = carry.chain(field.on, values)
        y[new.layout.part(field.name)] = values
    return y
