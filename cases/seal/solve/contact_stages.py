"""Stages of the dry contact: the rod approaches, then the sealed pressure rises.

The rod is held 10 micrometres off, where the film will be. Rod and housing start where they just
touch the free section, also where the rod then stretches it, and come to their radii. On that way
a multiplier holds the mean axial displacement of the section, in the middle of the groove. Then the
section is moved to the wall of the air side, and the pressure pushes it into it. Without a pressure
it stays held, as friction on the housing would hold it, and the force of that is reported.
"""

from __future__ import annotations

from dataclasses import replace

from softehl.cases.seal.equations.definition import BORE, ROD
from softehl.cases.seal.equations.loads import ContactLoads
from softehl.cases.seal.equations.scales import GAP
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.solve import failure_messages
from softehl.cases.seal.solve.load_stages import STEPS, Stage
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.solve.continuation import StepRule
from softehl.runtime.solve.newton import NonlinearProblem

OFFSET = GAP
"""Distance of the rod in contact, mm."""

TOUCH = 1e-4
"""How far the section is moved into the wall before the pressure holds it there, in section
diameters: enough to tell which nodes touch."""

COARSE_STEPS = StepRule(0.05, 1e-2, 0.3)
"""Steps of the pressure where a section can creep on (`solve.contact_relaxation`): it takes 10
iterations from steps of 3e-3 to 3e-4 to the end of a path, and 44 to creep on."""

LEG_STEPS = replace(COARSE_STEPS, first=0.25)
"""Steps from a state under a lower pressure: a leg takes 10 to 18 iterations, not 20."""


def held_place(p: Seal) -> float | None:
    """Mean axial displacement (mm) at which contact and film hold a section, None if it is free.

    With the arc of the paper's scheme it is free: the walls of a narrow groove hold it. So it is
    with friction at housing and walls.
    """
    free = p.sealed_pressure > 0.0 or p.given_arc is not None or p.rubs
    return None if free else 0.0


def held_moment(p: Gland) -> float | None:
    """Moment (N mm) on the section in contact and film, None where its mean rotation is held."""
    return 0.0 if p.rubs else None


def assembly(p: Seal) -> str:
    """The way on which contact is found, in text: with friction the result depends on it."""
    text = "squeezed with its mean place and rotation held"
    if p.sealed_pressure > 0.0:
        text += ", moved to the wall of the air side"
    if p.rubs:
        text += ", let go by a fading force and moment"
    return text + (", loaded by the pressure from 0" if p.sealed_pressure > 0.0 else "")


def contact_problem(
    system: SealSystem, sealed_pressure: float, position: float | None = None
) -> Problem:
    """Contact under a sealed pressure; position: of the section, left out: as of a film."""
    p = system.parameters
    position = held_place(p) if position is None else position
    loads = ContactLoads(sealed_pressure, {ROD: OFFSET}, position=position, moment=held_moment(p))
    return system.contact_problem(loads)


def approach_stage(system: SealSystem) -> Stage:
    """First stage, without pressure: from the free section into the groove."""
    p = system.parameters
    rod_gap = 0.5 * (p.inner_diameter - p.rod_diameter)
    housing_gap = 0.5 * (p.housing_diameter - p.inner_diameter) - p.section_diameter

    def at(closed: float) -> Problem:
        left = 1.0 - closed
        offsets = {ROD: closed * OFFSET + left * rod_gap, BORE: left * housing_gap}
        return system.contact_problem(ContactLoads(offsets=offsets, position=0.0))

    return Stage("rod approach", at, lambda share: failure_messages.not_squeezed(p, share))


def at_air_wall(system: SealSystem, x: Array) -> tuple[Array, float]:
    """The section x (n,), held in the groove, moved to the wall of the air side; how far, mm.

    It fulfils the equations, but for those of the wall: rod and housing are cylinders.
    """
    p, y = system.parameters, x.copy()
    shift = p.air_wall - float(system.deformed(x)[:, 0].max()) + TOUCH * p.section_diameter
    system.displacements(y)[:, 0] += shift
    return y, shift


def release_stage(system: SealSystem, x: Array) -> Stage:
    """With friction: what holds the section x (n,) fades, and friction takes its place."""
    p, moment, force = system.parameters, system.moment(x), system.axial_force(x)

    def at(gone: float) -> Problem:
        left = 1.0 - gone
        return system.contact_problem(
            ContactLoads(0.0, {ROD: OFFSET}, None, left * force, left * moment)
        )

    return Stage("release", at, lambda _: failure_messages.not_released(p))


def load_stage(system: SealSystem, begin: float = 0.0, position: float | None = None) -> Stage:
    """Last stage: the sealed pressure rises, from where it began before, MPa.

    position: where the section is held as long as there is no pressure, mm.
    """
    p = system.parameters
    return Stage(
        name="sealed pressure",
        problem_at=lambda p_s: contact_problem(system, p_s, None if p_s > 0.0 else position),
        ended=lambda reached: failure_messages.not_loaded(p, reached),
        start=begin,
        stop=p.sealed_pressure,
        steps=(LEG_STEPS if begin else STEPS if p.rubs else COARSE_STEPS).scaled(p.shear_modulus),
        sealed_pressure=p.sealed_pressure,
    )


def correction_stage(
    system: SealSystem, problem: NonlinearProblem, method: str, name: str = ""
) -> Stage:
    """A stage of one step, from a state that is near; its name is by the density if left out.

    problem: the contact problem of the section at its sealed pressure, in whatever form.
    """
    p = system.parameters
    label = name or f"contact at density {p.density}"
    return Stage(
        name=label,
        problem_at=lambda _: problem,
        ended=lambda _: failure_messages.not_carried(p, label),
        start=p.sealed_pressure,
        stop=p.sealed_pressure,
        sealed_pressure=p.sealed_pressure,
        method=method,
    )
