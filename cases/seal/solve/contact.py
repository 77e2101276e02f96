"""Stages of the dry contact: the rod approaches, then the sealed pressure rises.

The rod is held 10 micrometres off, where the film will be. Rod and housing start where they just
touch the free section, also where the rod then stretches it, and come to their radii. On that way
a multiplier holds the mean axial displacement of the section, in the middle of the groove. Then the
section is moved to the wall of the air side, and the pressure pushes it into it. Without a pressure
it stays held, as friction on the housing would hold it, and the force of that is reported.
"""

from __future__ import annotations

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import ContactLoads
from softehl.cases.seal.equations.system import BORE, ROD
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.solve import remedies
from softehl.cases.seal.solve.correctors import PressureNewton
from softehl.cases.seal.solve.path import Stage
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.steps import StepRule

OFFSET = 0.01
"""Distance of the rod in contact, mm."""

TOUCH = 1e-4
"""How far the section is moved into the wall before the pressure holds it there, in section
diameters: enough to tell which nodes touch."""

STEPS = StepRule(0.05, 3e-4, 0.3)
"""Steps of the way of the rod, of the pressure over the shear modulus, of what friction takes."""

COARSE_STEPS = StepRule(0.05, 1e-2, 0.3)
"""Steps of the pressure where a section can creep on (`solve.contact_relaxation`): it takes 10
iterations from steps of 3e-3 to 3e-4 to the end of a path, and 44 to creep on."""


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
    """The way on which contact is found, in words: with friction the result depends on it."""
    words = "squeezed with its mean place and rotation held"
    if p.sealed_pressure > 0.0:
        words += ", moved to the wall of the air side"
    if p.rubs:
        words += ", let go by a fading force and moment"
    return words + (", loaded by the pressure from 0" if p.sealed_pressure > 0.0 else "")


def approach_problem(system: SealSystem, closed: float) -> Problem:
    """Rod and housing on their way from touching the free section (0) to their radii (1)."""
    p = system.parameters
    rod_gap = 0.5 * (p.inner_diameter - p.rod_diameter)
    housing_gap = 0.5 * (p.housing_diameter - p.inner_diameter) - p.section_diameter
    offsets = {
        ROD: closed * OFFSET + (1.0 - closed) * rod_gap,
        BORE: (1.0 - closed) * housing_gap,
    }
    return system.contact_problem(ContactLoads(offsets=offsets, place=0.0))


def contact_problem(system: SealSystem, sealed_pressure: float) -> Problem:
    """Contact under a sealed pressure."""
    p = system.parameters
    loads = ContactLoads(sealed_pressure, {ROD: OFFSET}, place=held_place(p), moment=held_moment(p))
    return system.contact_problem(loads)


def approach_stage(system: SealSystem) -> Stage:
    """First stage, without pressure: from the free section into the groove."""
    p = system.parameters
    return Stage(
        name="rod approach",
        problem_at=lambda closed: approach_problem(system, closed),
        start=0.0,
        stop=1.0,
        steps=STEPS,
        sealed_pressure=0.0,
        ended=lambda share: remedies.not_squeezed(p, share),
    )


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

    return Stage(
        name="release",
        problem_at=at,
        start=0.0,
        stop=1.0,
        steps=STEPS,
        sealed_pressure=0.0,
        ended=lambda _: remedies.not_released(p),
    )


def load_stage(system: SealSystem, begin: float = 0.0, place: float | None = None) -> Stage:
    """Last stage: the sealed pressure rises, from where it began before, MPa.

    place: where the section is held as long as there is no pressure, mm.
    """
    p = system.parameters

    def at(p_s: float) -> Problem:
        if p_s > 0.0 or place is None:
            return contact_problem(system, p_s)
        return system.contact_problem(ContactLoads(0.0, {ROD: OFFSET}, place))

    return Stage(
        name="sealed pressure",
        problem_at=at,
        start=begin,
        stop=p.sealed_pressure,
        steps=(STEPS if p.rubs else COARSE_STEPS).scaled(p.shear_modulus),
        sealed_pressure=p.sealed_pressure,
        ended=lambda reached: remedies.not_loaded(p, reached),
    )


def correction_stage(
    system: SealSystem,
    problem: NonlinearProblem,
    *,
    method: str,
    name: str = "",
) -> Stage:
    """A stage of one step, from a state that is near; its name is by the density if left out.

    problem: the contact problem of the section at its sealed pressure, in whatever form.
    """
    p = system.parameters
    label = name or f"contact at density {p.density}"
    return Stage(
        name=label,
        problem_at=lambda _: problem,
        start=p.sealed_pressure,
        stop=p.sealed_pressure,
        steps=StepRule(1.0, 1.0),
        sealed_pressure=p.sealed_pressure,
        ended=lambda _: remedies.not_carried(p, label),
        method=method,
    )


def path_corrector(system: SealSystem, newton: Newton) -> Corrector | None:
    """Corrector of the steps of a contact path, None for Newton's method as it stands."""
    p = system.parameters
    if p.solver != "auto" or p.rubs:
        return None
    return PressureNewton(newton, system)
