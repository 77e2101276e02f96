"""Stages of a rough film: from dry contact to slow sliding, then rising speed.

Rough surfaces carry each other where there is no film, so that no weighting leads from contact to
film: the rod is brought as near as asperities let it, the film finds its pressures on the section
as it stands there, then both move together. Speeds rise from there, in log U.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import PRESSURE, VOID
from softehl.cases.seal.solve.contact import along, approach_stage
from softehl.cases.seal.solve.film import film_on, release_stage, shear_stage, speed_stage
from softehl.cases.seal.solve.path import PathSettings, Stage
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point
from softehl.runtime.solve.steps import StepRule

NEAR = 1.0 / 3.0
"""Offset of the rod, in sigma, at which asperities carry about what the contact does."""

SLOWEST = 0.01
"""Speed of the first film, mm/s, if none that is asked for is slower."""

_SMALLEST = 1e-3  # step to contact of asperities, in its whole way
_ONE_STEP = StepRule(1.0, 1e-3)
_RISING_STEPS = StepRule(math.log(2.0), 0.004, math.log(8.0), target_iterations=14)


def settle_stage(system: SealSystem, settings: PathSettings, newton: Newton) -> Stage:
    """The rod comes nearer, from where the contact stage holds it, without friction.

    In the logarithm of its offset: on fine meshes nodes come into contact one after the other.
    """
    near = min(NEAR * system.parameters.surfaces.sigma, settings.offset)
    stage = approach_stage(system, settings, near)
    steps = replace(stage.steps, smallest=_SMALLEST * stage.steps.first)
    return replace(
        stage, name="contact of asperities", steps=steps, corrector=along(system, newton)
    )


def dry_film(system: SealSystem, stroke: Stroke, x: Array) -> FilmLoads:
    """The slowest film of a stroke, on the contact state x of asperities, without shear."""
    return film_on(system, stroke, x, min(SLOWEST, *system.parameters.speeds))


def wetting_stages(system: SealSystem, film: FilmLoads, x: Array) -> list[Stage]:
    """The film alone on the held section (n,), then all together; neither has shear."""
    free = [system.layout.dofs(name) for name in (PRESSURE, VOID)]
    held = np.setdiff1d(np.arange(len(x)), np.concatenate(free))
    together = Stage(
        name="dry film",
        problem_at=lambda _: system.film_problem(film),
        start=0.0,
        stop=0.0,
        steps=_ONE_STEP,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )
    alone = replace(
        together,
        name="film on the held section",
        problem_at=lambda _: system.film_problem(film).also_fixed(held, x[held]),
    )
    return [alone, together]


def sliding_stages(
    system: SealSystem, settings: PathSettings, film: FilmLoads, x: Array
) -> list[Stage]:
    """A section that is free to roll is let go, then friction begins to act."""
    stages = []
    if system.parameters.rotation == "free":
        stages.append(release_stage(system, settings, film, x))
    if system.parameters.shear_traction:
        stages.append(replace(shear_stage(system, settings, film), name="friction"))
    return stages


def rising_stage(
    system: SealSystem,
    settings: PathSettings,
    film: FilmLoads,
    speeds: Sequence[float],
    on_speed: Callable[[FilmLoads, Point], None],
) -> Stage:
    """|U| rises from film.speed through `speeds` (none below it)."""
    stage = speed_stage(system, settings, film, speeds, on_speed)
    stop = math.log(max(speeds))
    return replace(stage, name="rising speed", stop=stop, steps=_RISING_STEPS)
