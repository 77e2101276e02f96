"""Contacts of a section with the rod, one or several, and their edges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.runtime.arrays import Array, Flags, Integers

CONTACT_FILM = 0.02
"""Film thickness that counts as contact, mm; a gap above it parts two contacts of a film."""

GROOVE = 2.0
"""Of the thinnest film: what parts two lobes whose groove is not as deep as `CONTACT_FILM`, and
what counts as contact of a film that is nowhere much thinner than that."""

GRAZED = 1e-3
"""Gap that parts two dry contacts, mm: a film opens a groove whose ground is so near to the rod."""


@dataclass(frozen=True)
class Edge:
    """An edge of the contact: its place on the arc, mm, and K^2 of its pressure, MPa^2/mm."""

    place: float
    rise: float


def groups(h: Array, inside: Flags, apart: float = CONTACT_FILM) -> list[Integers]:
    """The nodes (n,) of each contact: those inside it, where h (nodes,) between them stays low.

    apart: what h exceeds between two contacts, mm.
    """
    nodes = np.flatnonzero(inside)
    cuts = [
        k + 1
        for k, (a, b) in enumerate(pairwise(nodes))
        if b > a + 1 and h[a + 1 : b].max() > apart
    ]
    return [part for part in np.split(nodes, cuts) if len(part)]


def contact_level(h: Array) -> float:
    """Film thickness (mm) below which a film h (nodes,) is in contact; more in a thick film."""
    return max(CONTACT_FILM, GROOVE * float(h.min()))


def contact_film(h: Array, lobes: int = 1) -> float:
    """`contact_level` of a film h (nodes,) of a section with lobes, so that each has its contact.

    Less than `CONTACT_FILM` where a thick film fills a shallow groove: else both of its contacts
    would be one, with an inlet and an exit in its middle.
    """
    usual, thin = contact_level(h), GROOVE * float(h.min())
    whole, parted = (len(groups(h, h < level, level)) for level in (usual, thin))
    return thin if whole < lobes == parted else usual


def contacts(system: SealSystem, x: Array) -> list[Integers]:
    """Arc nodes of each contact with the rod in the contact state x, from the sealed side on."""
    _, h = system.arc_film(x)
    return groups(h - h.min(), system.rod_multipliers(x) < 0.0, GRAZED)


def contact_edges(system: SealSystem, x: Array) -> list[Edge]:
    """Place and slope of both ends of each contact of the state x along the arc.

    The square of the pressure is a straight line there, taken from the second and third node that
    touch; none where fewer than three do. Two edges of each contact, from the sealed side on.
    """
    found: list[Edge] = []
    for touching in contacts(system, x):
        found += _edges(system, x, touching)
    return found


def _edges(system: SealSystem, x: Array, touching: Integers) -> Iterator[Edge]:
    """Both edges of a contact that these nodes of the arc belong to."""
    s, pressure = system.section.places, -system.rod_multipliers(x)
    if len(touching) < 3:
        return
    for way, i in ((-1, touching), (1, touching[::-1])):
        edge = _edge(s[i[1:3]], pressure[i[1:3]] ** 2)
        if system.section.layout.flat:
            outside = s[min(max(i[0] + way, 0), len(s) - 1)]
            edge = _bracketed(edge, (outside, s[i[0]]), (s[i[1]], pressure[i[1]] ** 2), -way)
        yield edge


def _edge(s: Array, y: Array) -> Edge:
    """The zero of the straight line through two points, and its slope."""
    slope = (y[1] - y[0]) / (s[1] - s[0])
    return Edge(float(s[0] - y[0] / slope), abs(float(slope)))


def _bracketed(
    edge: Edge, between: tuple[float, float], second: tuple[float, float], inwards: int
) -> Edge:
    """An edge between the first node that touches and its neighbour outside.

    The corner of a flat has a peak, behind which pressure falls: a straight line through it leads
    anywhere. Then half way between the two, and as steep as it must be for the second node.
    """
    low, high = sorted(between)
    if low <= edge.place <= high and np.isfinite(edge.rise):
        return edge
    place = 0.5 * (low + high)
    return Edge(place, second[1] / max(inwards * (second[0] - place), 1e-12))
