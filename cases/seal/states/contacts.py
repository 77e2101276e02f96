"""Contacts of a section with the rod, one or several: their edges, pressures and what they lack."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

from softehl.cases.seal.equations.definition import AIR_WALL, BORE, ROD, SEALED_WALL, WALLS
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.surfaces import MICROMETRE
from softehl.cases.seal.meshing.outline_checks import crossing
from softehl.cases.seal.states.section_view import section_view
from softehl.cases.seal.states.state import ContactState
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.contact.rigid_obstacles import tributary_areas

CONTACT_FILM = 0.02
"""Film thickness that counts as contact, mm; a gap above it parts two contacts of a film."""

GROOVE = 2.0
"""Of the thinnest film: what parts two lobes whose groove is not as deep as `CONTACT_FILM`, and
what counts as contact of a film that is nowhere much thinner than that."""

GRAZED = MICROMETRE
"""Gap that parts two dry contacts: a film opens a groove whose ground is so near to the rod.
From 1e-5 to 1e-2 the films of an X-ring, a U-cup and a square ring are the same."""


@dataclass(frozen=True)
class ContactEdge:
    """An edge of the contact: its place on the arc, mm, and K^2 of its pressure, MPa^2/mm."""

    position: float
    rise: float


def groups(h: Array, inside: Flags, separation: float = CONTACT_FILM) -> list[Integers]:
    """The nodes (n,) of each contact: those inside it, where h (nodes,) between them stays low.

    separation: what h exceeds between two contacts, mm.
    """
    nodes = np.flatnonzero(inside)
    cuts = [
        k + 1
        for k, (a, b) in enumerate(pairwise(nodes))
        if b > a + 1 and h[a + 1 : b].max() > separation
    ]
    return [part for part in np.split(nodes, cuts) if len(part)]


def contact_level(h: Array) -> float:
    """Film thickness (mm) below which a film h (nodes,) is in contact; more in a thick film."""
    return max(CONTACT_FILM, GROOVE * float(h.min()))


def contact_film(h: Array, lobes: int = 1) -> float:
    """`contact_level` of a film h (nodes,) of a section with lobes, so that each has its contact.

    Less than `CONTACT_FILM` where a thick film fills a shallow groove: else both of its contacts
    would be one, with an inlet and an exit in its middle.
    """
    usual, thin = contact_level(h), GROOVE * float(h.min())
    single, parted = (len(groups(h, h < level, level)) for level in (usual, thin))
    return thin if single < lobes == parted else usual


def contacts(system: SealSystem, x: Array) -> list[Integers]:
    """Arc nodes of each contact with the rod in the contact state x, from the sealed side on."""
    _, h = system.arc_film(x)
    return groups(h - h.min(), system.rod_multipliers(x) < 0.0, GRAZED)


def contact_edges(system: SealSystem, x: Array) -> list[ContactEdge]:
    """Place and slope of both ends of each contact of the state x along the arc.

    The square of the pressure is a straight line there, taken from the second and third node that
    touch; none where fewer than three do. Two edges of each contact, from the sealed side on.
    """
    s, squares = system.section.positions, system.rod_multipliers(x) ** 2
    flat, edges = system.section.layout.flat, list[ContactEdge]()
    for touching in contacts(system, x):
        for out, i in ((-1, touching), (1, touching[::-1])):
            if len(i) >= 3:
                outside = s[min(max(i[0] + out, 0), len(s) - 1)]
                edges.append(_edge(s[i[:3]], squares[i[1:3]], outside if flat else None))
    return edges


def _edge(s: Array, squares: Array, outside: float | None) -> ContactEdge:
    """The edge of a contact whose first three nodes are at s, by the squares of the last two.

    outside: place of the node before them, where a flat may end: its corner has a peak, behind
    which pressure falls, and a straight line through it leads anywhere. Then the edge is half way
    between this node and the first, as steep as it must be for the second.
    """
    slope = (squares[1] - squares[0]) / (s[2] - s[1])
    position = s[1] - squares[0] / slope
    if outside is not None and not min(outside, s[0]) <= position <= max(outside, s[0]):
        position = 0.5 * (outside + s[0])
        slope = squares[0] / (s[1] - position)
    return ContactEdge(float(position), abs(float(slope)))


def contact_state(system: SealSystem, x: Array) -> ContactState:
    """The frictionless contact state with the unknowns x."""
    sealed_pressure = system.parameters.sealed_pressure
    pressure = contact_pressure(system, sealed_pressure, x)
    arc = system.deformed(x)[system.mesh.arc_nodes]
    return ContactState(
        sealed_pressure=sealed_pressure,
        x_mm=arc[:, 0].copy(),
        p_MPa=pressure,
        section=section_view(system, x, pressure),
    )


def contact_pressure(system: SealSystem, sealed_pressure: float, x: Array) -> Array:
    """True pressure (arc nodes,): multipliers per current area, plus p_s where it acts, MPa."""
    pressure = excess_pressure(system, x)
    pressure[: system.section.lowest] += sealed_pressure
    pressure[system.section.lowest] += 0.5 * sealed_pressure  # the pressure ends at this node
    return np.asarray(pressure)


def excess_pressure(system: SealSystem, x: Array) -> Array:
    """Multipliers per current area (arc nodes,), MPa: the pressure in excess of that of the oil."""
    mesh = system.mesh
    current = tributary_areas(system.deformed(x), mesh.arc_segments, mesh.arc_nodes)
    return np.asarray(-np.minimum(system.rod_multipliers(x), 0.0) * system.rod_areas / current)


def unsealed(system: SealSystem, x: Array) -> str:
    """Places where the sealed pressure ends outside the contact of the state x; empty if none."""
    if system.parameters.sealed_pressure == 0.0:
        return ""
    if not system.pressing(ROD, x)[system.section.lowest] > 0.0:
        return "at the lowest point of the section"
    crown = system.section.chains[WALLS[BORE]][0] == system.section.pressed_ends[1]
    return "" if (system.pressing(BORE, x)[crown] > 0.0).all() else "at its crown"


def overlap(system: SealSystem, x: Array) -> str:
    """Bodies that the deformed outline of the state x overlaps, in words; empty if none.

    Contact of a section with itself, as of the lips of a cup, is not modelled, nor with the rod
    beyond the film.
    """
    deformed = system.deformed(x)
    point = crossing(deformed[system.mesh.boundary])
    if point is not None:
        return f"into itself at z = {point[0]:.3g}, r = {point[1]:.4g} mm"
    z, r = deformed[system.mesh.outer_nodes].T
    within = int(np.argmin(r))
    if r[within] < system.rod_radius:
        return f"into the rod beyond its film at z = {z[within]:.3g} mm"
    return ""


def contact_peaks(system: SealSystem, sealed_pressure: float, x: Array) -> tuple[float, ...]:
    """The largest pressure of each contact of the state x, from the sealed side on, MPa."""
    pressure = contact_pressure(system, sealed_pressure, x)
    return tuple(float(pressure[nodes].max()) for nodes in contacts(system, x))


def contact_numbers(system: SealSystem, x: Array) -> dict[str, float]:
    """Fit of the ring in its gland; axial forces on it in the contact state x, + to the air side.

    The sealed pressure acts on what lies between its two ends; forces of the walls are in excess of
    it. Their sum with that of the hold is zero in equilibrium.
    """
    p, section = system.parameters, system.section
    bottom, crown = system.deformed(x)[list(section.pressed_ends), 1]
    forces = {
        "air_wall_N": -system.reaction(AIR_WALL, x),
        "sealed_wall_N": system.reaction(SEALED_WALL, x),
        "hold_N": system.axial_force(x),
        "housing_friction_N": system.housing_friction(x),
        "sealed_pressure_N": p.sealed_pressure * pi * abs(float(crown**2 - bottom**2)),
    }
    return {
        "stretch_percent": p.stretch_percent,
        "squeeze_percent": p.squeeze_percent,
        "fill_percent": p.fill_percent,
        **forces,
        "axial_sum_N": sum(forces.values()),
        **mean_motion(system, x),
    }


def mean_motion(system: SealSystem, x: Array) -> dict[str, float]:
    """Mean rotation of the section, from z towards r, and mean axial displacement."""
    residuals = {}
    for name in ("rotation", "hold"):
        block, values = system.problem.assembler.block(name), system.problem.parameters[name]
        residuals[name] = float(block.residual(x, values)[:, -1].sum())
    return {
        "mean_rotation_degrees": system.side * float(np.degrees(residuals["rotation"])),
        "mean_place_mm": residuals["hold"],
    }
