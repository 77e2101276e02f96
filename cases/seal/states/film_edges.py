"""Where a film ends and where it holds pockets of oil, for a mesh that is made for it.

Contact without a film does not always show that. A groove between two lobes has a pressure that
only the film knows. Where a lip lies nearly along the rod the film's own suction pulls it down, and
it ends far outside the contact. Under a surface that is flat oil may stay in a shallow pocket.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.states.contacts import Edge
from softehl.cases.seal.states.section_view import film_pressure
from softehl.runtime.arrays import Array

_THIN = 2.0
"""Films, in h*, from which on a surface is not in the contact."""

_STOPS = 3
"""Edges between that of the film and that of the contact."""

_GENTLEST = 0.01  # rise of an edge, of the steepest: pressure may fall from a pocket on

_FEWEST = 3  # nodes of a thin part of a film that are not a zigzag


def film_edges(system: SealSystem, x: Array, h_star: float) -> list[Edge]:
    """Both edges of each part of the film x (n,) that is thin, from the sealed side on.

    h_star: mm. The rise of an edge is that of the square of the pressure, in excess of what it is
    there, over the distance: the largest in the nearer half of the part.
    """
    s, p = system.section.places, film_pressure(system, x)
    _, h = system.arc_film(x)
    level = _THIN * h_star
    thin = np.flatnonzero(np.diff(np.concatenate([[0], h < level, [0]])))
    found = []
    for start, end in thin.reshape(-1, 2):
        if end - start < _FEWEST or start == 0 or end == len(h):
            continue
        for inside, outside, way in ((start, start - 1, 1), (end - 1, end, -1)):
            share = (level - h[inside]) / (h[outside] - h[inside])
            place = float(s[inside] + share * (s[outside] - s[inside]))
            half = inside + way * np.arange(1, max((end - start) // 2, 1) + 1)
            excess = np.maximum(p[half] - p[inside], 0.0)
            rise = float((excess**2 / np.abs(s[half] - place)).max())
            found.append(Edge(place, rise, sealed=way > 0))
    least = _GENTLEST * max((edge.rise for edge in found), default=0.0)
    return [replace(edge, rise=max(edge.rise, least)) for edge in found] if least > 0.0 else []


def between(film: Sequence[Edge], dry: Sequence[Edge]) -> list[Edge]:
    """Edges on the way from the outer ones of a film to those of the contact.

    At other speeds the film ends there.
    """
    found = []
    for edge, end in ((film[0], dry[0]), (film[-1], dry[-1])) if film and dry else ():
        outside = (end.place > edge.place) is edge.sealed
        if outside and edge.sealed is end.sealed:
            shares = np.arange(1, _STOPS + 1) / (_STOPS + 1)
            places = edge.place + shares * (end.place - edge.place)
            found += [replace(edge, place=float(place)) for place in places]
    return found
