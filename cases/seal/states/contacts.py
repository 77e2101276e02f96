"""Contacts of a section with the rod, one or several, and their edges."""

from __future__ import annotations

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
"""Gap that parts two dry contacts, mm: a film opens a groove whose ground is so near to the rod.
From 1e-5 to 1e-2 the films of an X-ring, a U-cup and a square ring are the same."""


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
    s, squares = system.section.places, system.rod_multipliers(x) ** 2
    flat, found = system.section.layout.flat, list[Edge]()
    for touching in contacts(system, x):
        for out, i in ((-1, touching), (1, touching[::-1])):
            if len(i) >= 3:
                outside = s[min(max(i[0] + out, 0), len(s) - 1)]
                found.append(_edge(s[i[:3]], squares[i[1:3]], outside if flat else None))
    return found


def _edge(s: Array, squares: Array, outside: float | None) -> Edge:
    """The edge of a contact whose first three nodes are at s, by the squares of the last two.

    outside: place of the node before them, where a flat may end: its corner has a peak, behind
    which pressure falls, and a straight line through it leads anywhere. Then the edge is half way
    between this node and the first, as steep as it must be for the second.
    """
    slope = (squares[1] - squares[0]) / (s[2] - s[1])
    place = s[1] - squares[0] / slope
    if outside is not None and not min(outside, s[0]) <= place <= max(outside, s[0]):
        place = 0.5 * (outside + s[0])
        slope = squares[0] / (s[1] - place)
    return Edge(float(place), abs(float(slope)))
