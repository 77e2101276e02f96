"""Contact stages of the path: squeezed, pushed against a wall, loaded by the sealed pressure.

The rod is held 10 micrometres off, where the film will be. Rod and housing start where they just
touch the free section, also where the rod then stretches it. What holds the section axially is a
multiplier on its mean displacement: in the middle of the groove until there is a pressure; then it
pushes the section against the wall of the air side a little, and fades as the pressure rises.
Without a pressure it stays, as friction on the housing would, and its force is reported.
"""

from __future__ import annotations

from math import pi

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import ContactLoads
from softehl.cases.seal.equations.system import AIR_WALL, BORE, ROD, SEALED_WALL
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.path import PathSettings, Stage
from softehl.cases.seal.solve.pressure_newton import PressureNewton
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.kernels import load_kernel
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.steps import StepRule

_CORNERED = 2.0  # shear moduli

WEDGED = 2
"""Nodes that touch each wall where the groove holds the section without help."""


def held_place(p: ORing) -> float | None:
    """Mean axial displacement (mm) at which contact and film hold a section, None if it is free.

    With the arc of the paper's scheme it is free: the walls of a narrow groove hold it. So it is
    with friction at housing and walls.
    """
    free = p.sealed_pressure > 0.0 or p.given_arc is not None or p.rubs
    return None if free else 0.0


def held_moment(p: ORing) -> float | None:
    """Moment (N mm) on the section in contact and film, None where its mean rotation is held."""
    return 0.0 if p.rubs else None


def assembly(p: ORing) -> str:
    """The way on which contact is found, in words: with friction the result depends on it."""
    words = "squeezed with its mean place and rotation held"
    if p.sealed_pressure > 0.0:
        words += ", moved to the wall of the air side and pushed into it, unless both walls hold it"
    words += ", rotation let go by a fading moment" if p.rubs else ""
    if p.sealed_pressure > 0.0:
        return words + ", loaded by the pressure from 0 while the push fades"
    return words + (", place by a fading force" if p.rubs else "")


def squeeze_problem(
    system: SealSystem, settings: PathSettings, closed: float, place: float | None = 0.0
) -> Problem:
    """Rod and housing on their way from touching the free section (0) to their radii (1), p_s = 0.

    place: mean axial displacement at which the section is held, mm.
    """
    rod_gap, housing_gap = _ways(system.parameters)
    offsets = {
        ROD: closed * settings.offset + (1.0 - closed) * rod_gap,
        BORE: (1.0 - closed) * housing_gap,
    }
    return system.contact_problem(ContactLoads(offsets=offsets, place=place))


def _ways(p: ORing) -> tuple[float, float]:
    """How far rod and housing move from where they touch the free section, mm, + = outwards."""
    rod = 0.5 * (p.inner_diameter - p.rod_diameter)
    return rod, 0.5 * (p.housing_diameter - p.inner_diameter) - p.section_diameter


def contact_problem(
    system: SealSystem, settings: PathSettings, sealed_pressure: float, force: float = 0.0
) -> Problem:
    """Contact under a sealed pressure, the rod where the contact stage holds it.

    force: that pushes the section to the air side, N, where it is not held.
    """
    place = held_place(system.parameters)
    moment = held_moment(system.parameters)
    loads = ContactLoads(sealed_pressure, {ROD: settings.offset}, place, force, moment)
    return system.contact_problem(loads)


def squeeze_stage(system: SealSystem, settings: PathSettings, cut: float = 1.0) -> Stage:
    """First stage, without pressure: from the undeformed section into the groove.

    cut: factor on the first step.
    """
    p = system.parameters
    way = max(map(abs, _ways(p)))
    first = cut * min(settings.first_contact / p.density**2, 0.05)
    first = min(first, cut * settings.first_way * p.section_diameter / way)
    return Stage(
        name="squeeze",
        problem_at=lambda closed: squeeze_problem(system, settings, closed),
        start=first,
        stop=1.0,
        steps=StepRule(first, 0.01 * first, settings.longest_squeeze),
        sealed_pressure=0.0,
        stroke="both",
    )


def wedged(system: SealSystem, x: Array) -> bool:
    """Whether both walls of the groove hold the section."""
    touching = [int((system.pressing(w, x) > 0.0).sum()) for w in (SEALED_WALL, AIR_WALL)]
    return min(touching) >= (1 if system.parameters.given_arc else WEDGED)


def against_wall(system: SealSystem, x: Array) -> tuple[Array, float]:
    """The squeezed section x moved rigidly until it touches the wall of the air side, and how far.

    It fulfils the equations of the squeeze at its new place: rod and housing are cylinders.
    """
    p, y = system.parameters, x.copy()
    wall = p.air_wall
    shift = wall - float(system.deformed(x)[:, 0].max())
    system.displacements(y)[:, 0] += shift
    return y, shift


def lean_stage(system: SealSystem, settings: PathSettings, place: float) -> Stage:
    """First stage, continued: the hold pushes the section from `place` into the wall it touches."""
    far = settings.lean * system.parameters.section_diameter
    return Stage(
        name="lean",
        problem_at=lambda part: squeeze_problem(system, settings, 1.0, place + part * far),
        start=0.0,
        stop=1.0,
        steps=StepRule(0.25, 0.005),
        sealed_pressure=0.0,
        stroke="both",
    )


def let_go_stage(system: SealSystem, settings: PathSettings, x: Array) -> Stage:
    """First stage, with friction: what holds the section x fades, and friction takes its place.

    The force of the hold stays where a pressure will replace it.
    """
    p, moment, force = system.parameters, system.moment(x), system.axial_force(x)
    rest = 1.0 if p.sealed_pressure > 0.0 else 0.0

    def at(gone: float) -> Problem:
        left = force * (rest + (1.0 - rest) * (1.0 - gone))
        offsets = {ROD: settings.offset}
        loads = ContactLoads(0.0, offsets, None, left, (1.0 - gone) * moment)
        return system.contact_problem(loads)

    return Stage(
        name="let go",
        problem_at=at,
        start=0.0,
        stop=1.0,
        steps=settings.release_steps,
        sealed_pressure=0.0,
        stroke="both",
    )


def released(p: ORing, force: float) -> float:
    """Sealed pressure (MPa) that holds the section as a force (N) on the gland's area does."""
    area = 0.25 * pi * (p.housing_diameter**2 - p.rod_diameter**2)
    return min(abs(force) / area, p.sealed_pressure)


def load_stage(
    system: SealSystem, settings: PathSettings, *, force: float = 0.0, begin: float = 0.0
) -> Stage:
    """First stage, continued: the sealed pressure rises from 0, or from where it began before, MPa.

    force: of the hold before, N; it fades as the pressure on the gland replaces it.
    """
    p = system.parameters
    gone, steps = released(p, force), settings.reload_steps if begin else settings.load_steps

    def at(p_s: float) -> Problem:
        rest = force * max(0.0, 1.0 - p_s / gone) if gone else 0.0
        return contact_problem(system, settings, p_s, rest)

    return Stage(
        name="sealed pressure",
        problem_at=at,
        start=begin,
        stop=p.sealed_pressure,
        steps=steps.scaled(p.shear_modulus),
        sealed_pressure=p.sealed_pressure,
        stroke="both",
        predictor="previous" if lies_in_corner(system) else "secant",
    )


def lies_in_corner(system: SealSystem) -> bool:
    """Whether the sealed pressure holds a round section in the corner between rod and wall."""
    p = system.parameters
    return not system.section.layout.flat and p.sealed_pressure > _CORNERED * p.shear_modulus


def along(system: SealSystem, newton: Newton) -> Corrector | None:
    """What corrects the steps of a contact path, None for Newton's method as it stands."""
    p = system.parameters
    if p.solver != "auto" or p.rubs:
        return None
    return PressureNewton(
        newton, system.solids, load_kernel("follower_pressure"), system.bulk_moduli
    )


def contact_stage(
    system: SealSystem,
    problem: NonlinearProblem,
    *,
    method: str,
    name: str = "",
    corrector: Corrector | None = None,
) -> Stage:
    """First stage in one step, from a state that is near; its name is by the density if left out.

    problem: the contact problem of the section at its sealed pressure, in whatever form.
    """
    p = system.parameters
    return Stage(
        name=name or f"contact at density {p.density}",
        problem_at=lambda _: problem,
        start=p.sealed_pressure,
        stop=p.sealed_pressure,
        steps=StepRule(1.0, 1.0),
        sealed_pressure=p.sealed_pressure,
        stroke="both",
        method=method,
        corrector=corrector,
    )
