"""Moving mesh of a film: velocities of its edges along the arc, and of the nodes with them.

On a mesh that rests on the section the edges pass from segment to segment: one per cent of a
housing moves them by many segments. The error of the mesh then changes fast, however small it is,
and its rate would be part of a derivative. Nodes that move with the edges hold the error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from softehl.cases.seal.meshing.mesh_morphing import potential
from softehl.cases.seal.sensitivity.frozen_mesh_map import FilmCase
from softehl.cases.seal.sensitivity.pseudo_loads import Inputs, rate_of
from softehl.cases.seal.sensitivity.quantities import SealQuantity
from softehl.cases.seal.states.mesh_indicators import INLET
from softehl.runtime.arrays import Array

WITH_EDGE = 0.25
"""Part of a contact whose nodes move as its edge does, from either edge on."""

_STEP = 1e-4
"""Step of the nodes, in lengths of the arc; it leaves an error of 1e-8."""


@dataclass(frozen=True)
class FilmEdge:
    """An edge of a film, where it narrows from ten to one and a half times h*.

    position: of its outer end on the undeformed arc, mm. opens: whether the film is thicker behind
    it. moved: how far it moves with the places and thicknesses of the arc nodes, mm. thickness: how
    far it moves as h* grows, mm for a unit of its logarithm.
    """

    position: float
    opens: bool
    moved: SealQuantity
    thickness: float

    def velocities(
        self, log_derivatives: Mapping[str, float], h_star: Mapping[str, float]
    ) -> dict[str, float]:
        """Parameter -> mm for a unit of its logarithm.

        log_derivatives: of `moved` by the parameters; h_star: those of the logarithm of h*.
        """
        return {
            name: slope + self.thickness * h_star[name] for name, slope in log_derivatives.items()
        }


def edges(case: FilmCase, x: Array, h_star: float) -> list[FilmEdge]:
    """The edges of a film x (n,), from the sealed side on.

    An edge is where ln (h / h*) is carried along: v of d ln (h / h*) = -v (ln h)' ds, by least
    squares of its nodes.
    """
    s, (_, h) = case.system.section.positions, case.system.arc_film(x)
    thin, rise = h < INLET[0] * h_star, np.gradient(h, s)
    edges_found = []
    for i in np.flatnonzero(np.diff(thin)):
        inwards = range(i, len(h)) if thin[i + 1] else range(i + 1, -1, -1)
        count = next((n for n, k in enumerate(inwards) if h[k] < INLET[1] * h_star), len(inwards))
        nodes = list(inwards[:count])
        slope = rise[nodes] / h[nodes]
        by_h = np.zeros(len(h))
        by_h[nodes] = -slope / (slope @ slope) / h[nodes]
        moved = SealQuantity(1.0, z=np.zeros(len(h)), h=by_h)
        thickness = float(slope.sum() / (slope @ slope))
        edges_found.append(FilmEdge(float(s[nodes[0]]), not thin[i + 1], moved, thickness))
    return edges_found


def velocities(case: FilmCase, film_edges: Sequence[FilmEdge]) -> list[Array]:
    """Of the nodes, (nodes, 2) each, as one edge moves along the arc at speed 1.

    The ends of the arc, corners and the other edges rest.
    """
    mesh, outline = case.system.mesh, case.system.section.layout.shape.outline
    along, parts = outline.tangent(mesh.positions[: mesh.arc + 1]), _parts(case, film_edges)
    moved = np.zeros((len(mesh.points), len(film_edges), 2))
    moved[mesh.arc_nodes] = parts[:, :, None] * along[:, None, :]
    moved = potential(mesh, moved.reshape(len(mesh.points), -1))
    return np.split(moved, len(film_edges), axis=1) if film_edges else []


def shifted(case: FilmCase, velocity: Array, by: float) -> FilmCase:
    """The film on the mesh whose nodes have moved by so many mm at this velocity (nodes, 2)."""
    system, section = case.system, case.system.section
    moved = replace(section.mesh, points=section.mesh.points + by * velocity)
    return replace(case, system=system.moved(system.parameters, replace(section, mesh=moved)))


def shift_rate(case: FilmCase, velocity: Array) -> Inputs:
    """The rate of the inputs of a film as its nodes move at this velocity (nodes, 2), per mm."""
    step = _STEP * float(case.system.section.positions[-1])
    return rate_of(lambda by: Inputs.of(shifted(case, velocity, by).problem), step, degree=2)


def _parts(case: FilmCase, film_edges: Sequence[FilmEdge]) -> Array:
    """Part (arc nodes, edges) that a node has in the movement of an edge."""
    mesh, s = case.system.mesh, case.system.section.positions
    corners = (case.system.section.layout.shape.outline.kinks - mesh.positions[0]) % mesh.length
    fixed_points = [0.0, *corners[corners < s[-1]], s[-1]]
    positions = [(position, -1) for position in fixed_points] + [
        (e.position, k) for k, e in enumerate(film_edges)
    ]
    for k, (a, b) in enumerate(pairwise(film_edges)):
        if b.opens:  # a contact lies between them
            reach = WITH_EDGE * (b.position - a.position)
            positions += [(a.position + reach, k), (b.position - reach, k + 1)]
    at, owner = np.array(sorted(positions)).T
    parts = np.zeros((len(s), len(film_edges)))
    for k in range(len(film_edges)):
        parts[1:-1, k] = np.interp(s[1:-1], at, owner == k)
    return parts
