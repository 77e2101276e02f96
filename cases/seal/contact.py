"""Contact stages of the path: the section is squeezed, then loaded by the sealed pressure.

The rod is held 10 micrometres off, where the film will be.
"""

from __future__ import annotations

from softehl.cases.seal.equations import SealSystem
from softehl.cases.seal.loads import ContactLoads
from softehl.cases.seal.path import PathSettings, Stage
from softehl.cases.seal.system import BORE, ROD
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.steps import StepRule


def squeeze_problem(system: SealSystem, settings: PathSettings, closed: float) -> Problem:
    """Rod and housing on their way from touching the free section (0) to their radii (1), p_s = 0.

    A weak axial spring holds the section until the walls do; it is gone at 1.
    """
    p = system.parameters
    rod_gap = 0.5 * (p.inner_diameter - p.rod_diameter)
    housing_gap = 0.5 * (p.housing_diameter - p.inner_diameter) - p.section_diameter
    offsets = {
        ROD: closed * settings.offset + (1.0 - closed) * max(rod_gap, 0.0),
        BORE: (1.0 - closed) * min(housing_gap, 0.0),
    }
    spring = settings.spring if closed < 1.0 else 0.0
    return system.contact_problem(ContactLoads(offsets=offsets, spring=spring))


def contact_problem(system: SealSystem, settings: PathSettings, sealed_pressure: float) -> Problem:
    """Frictionless contact under a sealed pressure, the rod where the contact stage holds it."""
    return system.contact_problem(ContactLoads(sealed_pressure, {ROD: settings.offset}))


def squeeze_stage(system: SealSystem, settings: PathSettings) -> Stage:
    """First stage, without pressure: from the undeformed section into the groove."""
    first = min(settings.first_contact / system.parameters.density**2, 0.05)
    return Stage(
        name="squeeze",
        problem_at=lambda closed: squeeze_problem(system, settings, closed),
        start=first,
        stop=1.0,
        steps=StepRule(first, 0.01 * first, settings.longest_squeeze),
        sealed_pressure=0.0,
        stroke="both",
    )


def load_stage(system: SealSystem, settings: PathSettings, sealed_pressure: float) -> Stage:
    """First stage, continued: the sealed pressure rises from 0."""
    return Stage(
        name="sealed pressure",
        problem_at=lambda p_s: contact_problem(system, settings, p_s),
        start=0.0,
        stop=sealed_pressure,
        steps=settings.load_steps,
        sealed_pressure=sealed_pressure,
        stroke="both",
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
