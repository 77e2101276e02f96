"""The solution path of section 4 of the paper: contact, from contact to film, falling speed.

A stage is a family of problems in one parameter. During contact the rod is held 10 micrometres
off; the film starts at high speed and without shear, where its equations are mild.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from softehl.cases.seal.section import OringSection, film_guard, flux_scales
from softehl.cases.seal.stage import Stage
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.solution import Point
from softehl.runtime.solve.steps import StepRule

Stroke = Literal["out", "in"]


@dataclass(frozen=True)
class PathSettings:
    """Numbers that steer the path; none of them changes a result.

    offset: distance of the rod in the contact stage, mm. spring: axial stiffness during the
    squeeze, N/mm^3. first_contact: where the squeeze begins at density 1, 0 = just touching and
    1 = all the way; it falls with density^2, so that the first contact is as many nodes wide.
    start_speed: least |U| at which the film is built up, mm/s. The rest: step rules.
    """

    offset: float = 0.01
    spring: float = 0.1
    first_contact: float = 0.2
    start_speed: float = 6400.0
    longest_squeeze: float = 0.3
    load_steps: StepRule = field(default_factory=lambda: StepRule(0.2, 1e-3, 0.6))
    weight_steps: StepRule = field(default_factory=lambda: StepRule(0.02, 1e-5))
    shear_steps: StepRule = field(default_factory=lambda: StepRule(1.0, 1e-3))
    order_steps: StepRule = field(default_factory=lambda: StepRule(0.02, 1e-4))
    release_steps: StepRule = field(default_factory=lambda: StepRule(0.1, 1e-3))
    speed_steps: StepRule = field(
        default_factory=lambda: StepRule(math.log(2.0), 4e-3, math.log(2.0) + 1e-9)
    )


@dataclass(frozen=True, eq=False)
class Film:
    """Loads of the film stages.

    speed: |U|, mm/s. weight: of the film forces, 1 - weight of the contact forces. shear: weight of
    the shear stress. multipliers, gap: (arc nodes,) rod multipliers, MPa, and distance of the rod,
    mm, of the contact stage.
    moment: moment on the section (N mm) if it is free to roll, None if its rotation is held.
    """

    sealed_pressure: float
    stroke: Stroke
    speed: float
    multipliers: Array
    gap: Array
    weight: float = 1.0
    shear: float = 1.0
    moment: float | None = None

    @property
    def rod_speed(self) -> float:
        """U, positive for outstroke, mm/s."""
        return self.speed if self.stroke == "out" else -self.speed


def squeeze_problem(section: OringSection, settings: PathSettings, closed: float) -> Problem:
    """Rod and housing on their way from touching the free section (0) to their radii (1), p_s = 0.

    A weak axial spring holds the section until the walls do; it is gone at 1.
    """
    p = section.parameters
    rod_gap = 0.5 * (p.inner_diameter - p.rod_diameter)
    housing_gap = 0.5 * (p.housing_diameter - p.inner_diameter) - p.section_diameter
    return section.problem.with_parameters(
        rod={"offset": closed * settings.offset + (1.0 - closed) * max(rod_gap, 0.0)},
        housing={"offset": (1.0 - closed) * min(housing_gap, 0.0)},
        spring={"stiffness": settings.spring} if closed < 1.0 else None,
    )


def contact_problem(
    section: OringSection, settings: PathSettings, sealed_pressure: float
) -> Problem:
    """Frictionless contact (9)-(10) under a sealed pressure (8).

    The pressure also acts on the arc up to its lowest node, as the film will carry it there; the
    rod multipliers of that part are the contact pressure in excess of it.
    """
    load = {"pressure": sealed_pressure}
    return section.problem.with_parameters(
        rod={"offset": settings.offset}, sealed_side=load, sealed_arc=load
    )


def film_problem(section: OringSection, settings: PathSettings, film: Film) -> Problem:
    """Film forces (18) weighted by w, contact forces by 1 - w; Reynolds equation (25) in full.

    The rod multipliers are frozen, so their contact elements are springs of stiffness rho about
    the contact pressure: forces that fade without a constraint that would outlive them.
    """
    p, p_s, w = section.parameters, film.sealed_pressure, film.weight
    flow = {
        "rod_radius": section.rod_radius,
        "rod_speed": film.rod_speed,
        "viscosity": p.viscosity,
        "pressure_viscosity": p.pressure_viscosity,
    }
    problem = contact_problem(section, settings, p_s).with_parameters(
        rod={"force_weight": 1.0 - w} if w < 1.0 else None,
        sealed_arc={"pressure": p_s * (1.0 - w)},
        film={
            **flow,
            "cavitation_penalty": p.cavitation_penalty,
            "force_weight": w,
            "shear_weight": film.shear,
        },
        **({"facet": flow} if p.reynolds == "dg" else {}),
        **({"upwind": _upwinding(section, film)} if p.upwinding else {}),
    )
    fixed = [section.film_ends, section.layout.dofs("rod")]
    values: list[Array | float] = [np.array([p_s, 0.0]), film.multipliers]
    if film.moment is not None:
        fixed.append(section.layout.dofs("rotation"))
        values.append(film.moment)
    return replace(
        problem.with_fixed(fixed, values),
        scales={**problem.scales, "pressure": flux_scales(section, film.speed, film.gap)},
        guards=(*problem.guards, film_guard(section)),
    )


def _upwinding(section: OringSection, film: Film) -> dict[str, float]:
    """Parameters of the term that moves the load of the pressure bubbles downstream."""
    p = section.parameters
    return {
        "rod_radius": section.rod_radius,
        "rod_speed": film.rod_speed,
        "viscosity": p.viscosity,
        "shear_modulus": p.shear_modulus,
        "upwinding": p.upwinding * math.copysign(1.0, film.rod_speed),
        "force_weight": film.weight,
    }


def squeeze_stage(section: OringSection, settings: PathSettings) -> Stage:
    """First stage, without pressure: from the undeformed section into the groove."""
    first = min(settings.first_contact / section.parameters.density**2, 0.05)
    return Stage(
        name="squeeze",
        problem_at=lambda closed: squeeze_problem(section, settings, closed),
        start=first,
        stop=1.0,
        steps=StepRule(first, 0.01 * first, settings.longest_squeeze),
        sealed_pressure=0.0,
        stroke="both",
    )


def load_stage(section: OringSection, settings: PathSettings, sealed_pressure: float) -> Stage:
    """First stage, continued: the sealed pressure rises from 0."""
    return Stage(
        name="sealed pressure",
        problem_at=lambda p_s: contact_problem(section, settings, p_s),
        start=0.0,
        stop=sealed_pressure,
        steps=settings.load_steps,
        sealed_pressure=sealed_pressure,
        stroke="both",
    )


def contact_stage(
    section: OringSection,
    problem: NonlinearProblem,
    *,
    method: str,
    name: str = "",
    corrector: Corrector | None = None,
) -> Stage:
    """First stage in one step, from a state that is near; its name is by the density if left out.

    problem: the contact problem of the section at its sealed pressure, in whatever form.
    """
    p = section.parameters
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


def weight_stage(section: OringSection, settings: PathSettings, film: Film) -> Stage:
    """Second stage: the film takes over from the contact at film.speed, without shear."""
    return Stage(
        name="contact to film",
        problem_at=lambda w: film_problem(section, settings, replace(film, weight=w, shear=0.0)),
        start=0.0,
        stop=1.0,
        steps=settings.weight_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )


def release_stage(section: OringSection, settings: PathSettings, film: Film, x: Array) -> Stage:
    """Second stage, rotation = "free": the moment that held the section fades, without shear."""
    held = float(x[section.layout.part("rotation")][0])
    return Stage(
        name="release",
        problem_at=lambda s: film_problem(
            section, settings, replace(film, shear=0.0, moment=(1.0 - s) * held)
        ),
        start=0.0,
        stop=1.0,
        steps=settings.release_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )


def shear_stage(section: OringSection, settings: PathSettings, film: Film) -> Stage:
    """Second stage, continued: the shear stress of the film begins to act on the section."""
    return Stage(
        name="shear",
        problem_at=lambda s: film_problem(section, settings, replace(film, shear=s)),
        start=0.0,
        stop=1.0,
        steps=settings.shear_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )


def speed_stage(
    section: OringSection,
    settings: PathSettings,
    film: Film,
    speeds: Sequence[float],
    on_speed: Callable[[Film, Point], None],
) -> Stage:
    """Third stage: |U| falls from film.speed through `speeds` (none above it).

    The path parameter is log |U|, in which the film thickness is nearly straight. on_speed is
    told every step; the speeds it is given are exactly those that were asked for.
    """
    exact = {math.log(u): u for u in (*speeds, film.speed)}

    def at(parameter: float) -> Film:
        return replace(film, speed=exact.get(parameter, math.exp(parameter)))

    return Stage(
        name="falling speed",
        problem_at=lambda t: film_problem(section, settings, at(t)),
        start=math.log(film.speed),
        stop=math.log(min(speeds)),
        steps=settings.speed_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
        waypoints=tuple(math.log(u) for u in speeds),
        on_point=lambda point: on_speed(at(point.parameter), point),
        shown=lambda t: at(t).rod_speed,
    )
