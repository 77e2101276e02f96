"""From contact to a film: what contact holds the rod off is a film, which is squeezed out.

The gap and the pressure of contact are those of a film that begins to be squeezed. One implicit
step of the length tau from there,

    dq/dx + (h - h_contact) / tau = 0,

is contact for tau -> 0 and the steady film for tau -> infinity: a path whose nearest known state is
contact itself, at any distance of the rod. The section bears the same load all the way.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, inf, log

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.film import FastFilm, film_on, start_speed, stays
from softehl.cases.seal.solve.grading import MULTIPLE, film_thickness, inlet_time
from softehl.cases.seal.solve.path import Followed, PathSettings, Stage, StageFailed
from softehl.cases.seal.solve.squeezing import gap_masses, inlet_edge, least_time, pressed_film
from softehl.cases.seal.states.contacts import Edge, contact_edges
from softehl.runtime.arrays import Array
from softehl.runtime.solve.steps import StepRule

_SHORT, _LONG = 0.02, 1e4
"""tau over the time in which the rod passes the inlet. The pressure of contact squeezes a film that
is k times as thick as the steady one k^3 times as fast: the first tau is shorter by as much."""

_LONGER = 1e9
"""The same where the film is not steady by then: above three shear moduli the pressure hardly rises
from the flatter edge, and what is held off there takes long to leave."""

_SETTLED = 1e2
"""The same after which a film may be steady but for what is held off far from its way."""

_SOONER = 1e3
"""How much sooner, at least, a film begins that is not solved where squeezing out begins: under a
lip that is as flat as the rod it is thicker than the gap that contact leaves, and fills at once."""

_STEPS = StepRule(3.0, 0.05, 6.0, target_iterations=8)  # of log tau
_CAREFUL = replace(_STEPS, largest=3.0)  # where one edge after the other lets its oil go


def thinned_film(
    system: SealSystem, settings: PathSettings, stroke: Stroke, x: Array
) -> FilmLoads | None:
    """The first film of a stroke from the contact state x, without shear; None where the rod has
    to stay where contact holds it, or where nothing touches it.
    """
    if stays(system.parameters) or inlet_edge(system, stroke, x) is None:
        return None
    film = film_on(system, stroke, x, start_speed(system, settings))
    return replace(film, rod_offset=settings.offset)


def thinning_stage(fast: FastFilm, film: FilmLoads, x: Array) -> tuple[Stage, Array]:
    """Second stage, by squeezing: to a film without shear at film.speed; and its start (n,).

    x: the contact state. The path parameter is log tau.
    """
    system = fast.system
    edge = inlet_edge(system, film.stroke, x)
    assert edge is not None
    p = system.parameters
    unit = inlet_time(p, edge, film.speed)
    hold = gap_masses(system, x)
    first = max(_shortest(p, edge, film), least_time(system.film_problem(film), hold, x))
    stage = Stage(
        name="contact to film",
        problem_at=lambda _: system.film_problem(film),
        start=log(first / unit),
        stop=log(_LONG),
        steps=_STEPS,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
        shown=exp,
    )
    stage = fast.thinning(stage, hold, x, lambda t: -exp(-t) / unit)
    return stage, pressed_film(system, x, film.sealed_pressure)


def sooner(system: SealSystem, stage: Stage, film: FilmLoads, x: Array) -> Stage:
    """A stage of squeezing that begins sooner: at the time of the steepest edge of the contact x.

    A lip that the pressure holds down lies flat on the rod, and its edge is so gentle that oil gets
    below it. The film is that of a steep edge behind, on the heel, which is squeezed out first.
    """
    p, edge = system.parameters, inlet_edge(system, film.stroke, x)
    assert edge is not None
    steepest = max(
        (e for e in contact_edges(system, x) if e.rise < inf), key=lambda other: other.rise
    )
    unit = inlet_time(p, edge, film.speed)
    soon = min(exp(stage.start) * unit / _SOONER, _shortest(p, steepest, film))
    least = least_time(system.film_problem(film), gap_masses(system, x), x)
    return replace(stage, start=log(max(soon, least) / unit), steps=_CAREFUL)


def _shortest(p: ORing, edge: Edge, film: FilmLoads) -> float:
    """The first tau, s, by an edge of the contact."""
    thicker = film.rod_offset / (MULTIPLE * film_thickness(p, [edge], film.speed))
    return _SHORT * inlet_time(p, edge, film.speed) / max(thicker, 1.0) ** 3


def longer(stage: Stage) -> Stage:
    """What follows a stage of squeezing whose film is not steady yet."""
    return replace(stage, start=stage.stop, stop=log(_LONGER))


def settled(thinned: Followed) -> Array | None:
    """The last film (n,) of squeezing, if it was squeezed for so long that it may be steady."""
    if not isinstance(thinned, StageFailed):
        return thinned
    late = thinned.branch.points and thinned.reached >= log(_SETTLED)
    return thinned.branch.last.x if late else None
