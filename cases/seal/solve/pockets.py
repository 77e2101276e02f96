"""Oil that a film holds between what is one contact without it: trapped there, or on its way."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import ROD
from softehl.cases.seal.states.contact_results import contact_pressure
from softehl.cases.seal.states.contacts import CONTACT_FILM, contacts, groups
from softehl.runtime.arrays import Array, Integers

_OVER = 2
"""Segments over which the slope of the contact's pressure is taken."""


def traps(system: SealSystem, x: Array, y: Array, apart: float) -> bool:
    """Whether the film y (n,) holds oil between what is one contact in the contact state x (n,).

    apart: film thickness that parts two contacts, mm, or more than `CONTACT_FILM` of thick films.

    Squeezing a film out leaves some where contact presses less than on both sides, as under a
    groove that is pressed flat. It stays there, steadily, at a pressure of its own: there are two
    films then, and the mesh is that of the other one, unless there is none: see `fed`.
    """
    return 0 < len(contacts(system, x)) < len(_parts(system, y, apart))


def fed(
    system: SealSystem, film: FilmLoads, x: Array, y: Array, apart: float, h_star: float
) -> bool:
    """Whether all oil that the film y (n,) holds, see `traps`, is on the way of its flux.

    h_star: mm, of that flux. Where the film is thin it has the pressures of the contact x (n,), and
    by (14) they rise by 8 eta U / (9 h*^2) at most. Where contact rises more steeply behind the
    pocket it would not let the flux pass: there is no film without it. Oil gathers there until its
    pressure makes the rise gentle enough, as it does in the groove between two lobes. Where contact
    does not press at all a torn film may pass.
    """
    z, _ = system.arc_film(x)
    p = contact_pressure(system, film.sealed_pressure, x)
    steepest = 8.0 * system.parameters.viscosity * film.speed / (9.0 * h_star**2)
    presses, (_, h) = system.pressing(ROD, x) > 0.0, system.arc_film(y)
    for before, after in pairwise(_parts(system, y, apart)):
        within = slice(before[-1], after[0] + 1)
        pocket = int(within.start + np.argmax(h[within]))
        behind = slice(pocket, None) if film.stroke == "out" else slice(pocket, None, -1)
        rise = _steepest(np.abs(z[behind] - z[pocket]), p[behind])
        if rise <= steepest or not presses[within].all():
            return False
    return True


def _steepest(way: Array, p: Array) -> float:
    """The steepest rise of a pressure, MPa/mm."""
    far, rise = way[_OVER:] - way[:-_OVER], p[_OVER:] - p[:-_OVER]
    return float((rise[far > 0.0] / far[far > 0.0]).max(initial=0.0))


def _parts(system: SealSystem, y: Array, apart: float) -> list[Integers]:
    """The nodes of each thin part of the film y (n,)."""
    _, h = system.arc_film(y)
    apart = max(apart, CONTACT_FILM)
    return groups(h, h < apart, apart)
