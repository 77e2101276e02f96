"""From contact to a film: what contact holds the rod off is a film, which is squeezed out.

The gap and the pressure of contact are those of a film that begins to be squeezed. One implicit
step of the length tau from there,

    dq/dx + (h - h_contact) / tau = 0,

is contact for tau -> 0 and the steady film for tau -> infinity: a path whose nearest known state is
contact itself, at any distance of the rod. The section bears the same load all the way.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, inf, log, pi

import numpy as np
from scipy.sparse import coo_array, csc_array

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import DISPLACEMENT
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.film import FastFilm, film_on, start_speed, stays
from softehl.cases.seal.solve.grading import MULTIPLE, film_thickness, inlet_time
from softehl.cases.seal.solve.path import Followed, PathSettings, Stage, StageFailed
from softehl.cases.seal.states.contacts import Edge, contact_edges
from softehl.runtime.arrays import Array
from softehl.runtime.fem.rules import content_rule, pressure_nodes
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

_ROUNDING = 1e-4
"""Largest residual that rounding of the gap may leave: a film held for a time that is too short has
no other state than the one it begins at, to all digits that the gap has."""

_NO_WIDTH = 1e-6
"""Of the widest part of the arc around a node, below which it is between segments on a wall."""

_STEPS = StepRule(3.0, 0.05, 6.0, target_iterations=8)  # of log tau
_CAREFUL = replace(_STEPS, largest=3.0)  # where one edge after the other lets its oil go


def thinned_film(
    system: SealSystem, settings: PathSettings, stroke: Stroke, x: Array
) -> FilmLoads | None:
    """The first film of a stroke from the contact state x, without shear; None where the rod has
    to stay where contact holds it, or where nothing touches it.
    """
    if stays(system.parameters) or _inlet(system, stroke, x) is None:
        return None
    film = film_on(system, stroke, x, start_speed(system, settings))
    return replace(film, rod_offset=settings.offset)


def thinning_stage(fast: FastFilm, film: FilmLoads, x: Array) -> tuple[Stage, Array]:
    """Second stage, by squeezing: to a film without shear at film.speed; and its start (n,).

    x: the contact state. The path parameter is log tau.
    """
    system = fast.system
    edge = _inlet(system, film.stroke, x)
    assert edge is not None
    p = system.parameters
    unit = inlet_time(p, edge, film.speed)
    hold = gap_masses(system, x)
    first = max(_shortest(p, edge, film), _unrounded(system, film, hold, x))
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
    p, edge = system.parameters, _inlet(system, film.stroke, x)
    assert edge is not None
    steepest = max(
        (e for e in contact_edges(system, x) if e.rise < inf), key=lambda other: other.rise
    )
    unit = inlet_time(p, edge, film.speed)
    soon = min(exp(stage.start) * unit / _SOONER, _shortest(p, steepest, film))
    least = _unrounded(system, film, gap_masses(system, x), x)
    return replace(stage, start=log(max(soon, least) / unit), steps=_CAREFUL)


def _shortest(p: ORing, edge: Edge, film: FilmLoads) -> float:
    """The first tau, s, by an edge of the contact."""
    thicker = film.rod_offset / (MULTIPLE * film_thickness(p, [edge], film.speed))
    return _SHORT * inlet_time(p, edge, film.speed) / max(thicker, 1.0) ** 3


def _unrounded(system: SealSystem, film: FilmLoads, hold: csc_array[np.float64], x: Array) -> float:
    """Least tau, s, by `_ROUNDING`. hold: see `gap_masses`."""
    problem = system.film_problem(film)
    rounding = hold @ np.spacing(np.abs(x))
    rounding[problem.fixed] = 0.0
    return problem.norm(rounding) / _ROUNDING


def longer(stage: Stage) -> Stage:
    """What follows a stage of squeezing whose film is not steady yet."""
    return replace(stage, start=stage.stop, stop=log(_LONGER))


def settled(thinned: Followed) -> Array | None:
    """The last film (n,) of squeezing, if it was squeezed for so long that it may be steady."""
    if not isinstance(thinned, StageFailed):
        return thinned
    late = thinned.branch.points and thinned.reached >= log(_SETTLED)
    return thinned.branch.last.x if late else None


def pressed_film(system: SealSystem, x: Array, p_s: float) -> Array:
    """The contact state x (n,) with a film that has the pressures of the contact."""
    y, nodes = x.copy(), system.mesh.arc_nodes
    z, r = system.deformed(x)[nodes].T
    dz = np.diff(z)
    width = 0.5 * (np.append(dz, 0.0) + np.append(0.0, dz))
    force = np.maximum(-system.rod_multipliers(x), 0.0) * system.rod_areas
    low, sealed = system.dam, np.zeros(len(nodes))
    sealed[:low] = p_s
    if 0 < low < len(dz):
        sealed[low] = p_s * dz[low - 1] / (dz[low - 1] + dz[low])
    wide = width > _NO_WIDTH * width.max()
    pressures = np.divide(force, 2.0 * pi * r * width, out=np.zeros_like(r), where=wide) + sealed
    rows = system.pressure_dofs()
    y[rows] = np.stack([pressures[:-1], pressures[1:]], axis=1) @ _shapes(rows.shape[1] - 1).T
    return y


def gap_masses(system: SealSystem, x: Array) -> csc_array[np.float64]:
    """Rates (n, n) of what the film holds by the radial displacements of the arc, mm.

    Rows are the pressures'; what a film holds is lumped where these stand.
    """
    pressures, n = system.pressure_dofs(), system.layout.total
    segments, order = system.mesh.arc_segments, pressures.shape[1] - 1
    z = system.deformed(x)[:, 0]
    half = 0.5 * (z[segments[:, 1]] - z[segments[:, 0]])
    radii = system.layout.part(DISPLACEMENT).start + 2 * segments + 1
    masses = half[:, None, None] * (content_rule(order).weights[:, None] * _shapes(order))
    at = np.broadcast_arrays(pressures[..., None], radii[:, None])
    places = tuple(part.ravel() for part in at)
    return csc_array(coo_array((masses.ravel(), places), shape=(n, n)))


def _shapes(order: int) -> Array:
    """Of both nodes of a segment, (order + 1, 2), where its pressures stand."""
    xi = pressure_nodes(order)
    return np.stack([0.5 * (1.0 - xi), 0.5 * (1.0 + xi)], axis=1)


def _inlet(system: SealSystem, stroke: Stroke, x: Array) -> Edge | None:
    """The edge of the contact x where a stroke draws its film in."""
    edges = contact_edges(system, x)
    found = edges[0 if stroke == "out" else -1] if edges else None
    return found if found and 0.0 < found.rise < inf else None
