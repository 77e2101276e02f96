"""Results of a contact state of a seal: pressures, forces of the walls, fit in the gland."""

from __future__ import annotations

from math import pi

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.system import AIR_WALL, BORE, ROD, SEALED_WALL, WALLS
from softehl.cases.seal.states.contacts import contacts
from softehl.cases.seal.states.section_view import section_view
from softehl.cases.seal.states.state import ContactState
from softehl.runtime.arrays import Array
from softehl.runtime.fem.contact import tributary_areas
from softehl.runtime.fem.problem import Problem
from softehl.runtime.mesh.outline_checks import crossing


def contact_state(
    system: SealSystem, problem: Problem, sealed_pressure: float, x: Array
) -> ContactState:
    """The frictionless contact state with the unknowns x."""
    mesh = system.mesh
    deformed = system.deformed(x)
    arc = deformed[mesh.arc_nodes]
    pressure = contact_pressure(system, sealed_pressure, x)
    touching = np.flatnonzero(system.rod_multipliers(x) < 0.0)
    ends = arc[touching[[0, -1]], 0] if len(touching) else np.full(2, np.nan)
    return ContactState(
        sealed_pressure=sealed_pressure,
        p_max_MPa=float(pressure.max()),
        contact_start_mm=float(ends[0]),
        contact_end_mm=float(ends[1]),
        x_mm=arc[:, 0].copy(),
        p_MPa=pressure,
        section=section_view(system, problem, x, pressure),
    )


def contact_pressure(system: SealSystem, sealed_pressure: float, x: Array) -> Array:
    """True pressure (arc nodes,): multipliers per current area, plus p_s where it acts, MPa."""
    mesh = system.mesh
    current = tributary_areas(system.deformed(x), mesh.arc_segments, mesh.arc_nodes)
    multipliers = np.minimum(system.rod_multipliers(x), 0.0)
    pressure = -multipliers * system.rod_areas / current
    pressure[: system.pressure_boundary] += sealed_pressure
    pressure[system.pressure_boundary] += 0.5 * sealed_pressure  # the pressure ends at this node
    return np.asarray(pressure)


def unsealed(system: SealSystem, x: Array) -> str:
    """Places where the sealed pressure ends outside the contact of the state x; empty if none."""
    if system.parameters.sealed_pressure == 0.0:
        return ""
    if not system.pressing(ROD, x)[system.pressure_boundary] > 0.0:
        return "at the lowest point of the section"
    crown = system.section.chains[WALLS[BORE]][0] == system.section.pressed_ends[1]
    return "" if (system.pressing(BORE, x)[crown] > 0.0).all() else "at its crown"


def overlap(system: SealSystem, x: Array) -> str:
    """Bodies that the deformed outline of the state x overlaps, in words; empty if none.

    Contact of a section with itself, as of the lips of a cup, is not modelled, nor with the rod
    beyond the film.
    """
    deformed = system.deformed(x)
    place = crossing(deformed[system.mesh.boundary])
    if place is not None:
        return f"into itself at z = {place[0]:.3g}, r = {place[1]:.4g} mm"
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
        block, given = system.problem.assembler.block(name), system.problem.parameters[name]
        residuals[name] = float(block.residual(x, given)[:, -1].sum())
    return {
        "mean_rotation_degrees": system.side * float(np.degrees(residuals["rotation"])),
        "mean_place_mm": residuals["hold"],
    }
