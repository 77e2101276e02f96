"""The film as the layer of the modified Newton iteration."""

from __future__ import annotations

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.system import AIR_WALL, MOVED, ROTATION, SEALED_WALL, WALLS
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.layered import Layer

_AT_WALL = 0.02
"""Part of the section within which a node counts as one at a wall. Without these an O-ring at
14 MPa takes 64 % more factorisations; with all nodes of the arc, four seals take 3 to 11 % more
time."""


def film_layer(system: SealSystem, x: Array) -> Layer:
    """The film as the layer of the modified Newton iteration, near the state x.

    Displacements of the arc and the moment are shared with the section; the pressures but those at
    the ends are the film's own; all other unknowns of its blocks are prescribed. Multipliers of arc
    nodes at a wall are shared too: only the displacements of these nodes determine them.
    """
    moved = system.numbering.at(MOVED, system.mesh.arc_nodes[:, None]).ravel()
    moment = system.layout.dofs(ROTATION)
    shared = np.concatenate([moved, moment, _walls_of_arc(system, x)])
    own = [system.layout.dofs(field.name) for field in system.film_fields()]
    inner = np.concatenate(own)
    if system.parameters.conserving:  # side by side along the film: their matrix is a band
        inner = np.stack([pressures[1:-1] for pressures in own], axis=1).ravel()
    inner = inner[~np.isin(inner, system.film_ends)]
    names = [block.name for block in system.blocks if block.on_arc]
    return Layer.of(system.problem.assembler, names, shared, inner)


def _walls_of_arc(system: SealSystem, x: Array) -> Integers:
    """Multipliers (n,) of the walls at those nodes of the arc that touch them or are near."""
    found = []
    for name in (SEALED_WALL, AIR_WALL):
        nodes = system.section.chains[WALLS[name]][0]
        gap = system.obstacles[name].gap(system.deformed(x)[nodes])
        near = np.isin(nodes, system.mesh.arc_nodes)
        near &= gap < _AT_WALL * system.parameters.section_diameter
        found.append(system.layout.dofs(name)[near])
    return np.concatenate(found)
