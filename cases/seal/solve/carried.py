"""A film of one mesh of a section on another one: the start of its solution there.

Displacements, multipliers, film pressures and element pressures are carried. A gap of a micrometre
does not survive the interpolation of displacements of a millimetre, so the film thickness is
carried by itself, ln h over the place on the arc, and what that changes is spread into the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.sparse import coo_array, csr_array
from scipy.sparse.linalg import spsolve

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.refinement import carried_elements, carried_unknowns
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.fem.lagged_pressure import element_pressures
from softehl.runtime.fem.rules import lagrange, pressure_nodes
from softehl.runtime.mesh.sections import SectionMesh

_THINNEST = 1e-9  # mm: h of rough surfaces may be negative, and has no logarithm there


@dataclass(frozen=True, eq=False)
class Carrier:
    """From a mesh to another one of the same section."""

    old: SealSystem
    new: SealSystem

    def state(self, x: Array) -> Array:
        """All unknowns (n',) of the film x (n,)."""
        y = carried_unknowns(self.old, self.new, x)
        self._film(x, y)
        inside = self._inside
        radial = self.new.displacements(y)[:, 1]
        nodes = self.new.mesh.arc_nodes[inside]
        miss = self._thickness(x)[inside] - self.new.arc_film(y)[1][inside]
        radial += spread(self.new.mesh, nodes, miss)
        return y

    def pressures(self, x: Array) -> Array:
        """Mean stresses (Q',) of the elements."""
        return carried_elements(
            self.old, self.new, element_pressures(self.old.problem, self.old.solids, x)
        )

    def _thickness(self, x: Array) -> Array:
        h = self.old.arc_film(x)[1]
        places = self.old.section.places
        if self.old.parameters.rough:
            return np.asarray(PchipInterpolator(places, h)(self._places))
        log_h = np.log(np.maximum(h, _THINNEST))
        return np.asarray(np.exp(PchipInterpolator(places, log_h)(self._places)))

    def _film(self, x: Array, y: Array) -> None:
        """Film pressures, by the segment of the old mesh that each of the new ones is in."""
        before = self.old.section.places
        nodes = pressure_nodes(self.new.parameters.pressure_order)
        share, places = 0.5 * (1.0 + nodes), self._places
        at = places[:-1, None] + np.diff(places)[:, None] * share
        at = np.clip(at, before[0], before[-1])
        segment = np.clip(np.searchsorted(before, at, side="right") - 1, 0, len(before) - 2)
        local = 2.0 * (at - before[segment]) / np.diff(before)[segment] - 1.0
        modes = lagrange(nodes, np.clip(local.ravel(), -1.0, 1.0))[:, :, 0]
        weights = modes.reshape(*segment.shape, -1)
        for field in self.old.film_fields():
            rows = x[self.old.pressure_dofs(field.name)]
            values = np.einsum("skm,skm->sk", weights, rows[segment])
            y[self.new.pressure_dofs(field.name)] = values

    @cached_property
    def _places(self) -> Array:
        """Places (arc nodes,) of the new arc on the old one, mm; beyond its ends outside."""
        before, after = (s.mesh for s in (self.old, self.new))
        turn = after.length
        way = (after.places[0] - before.places[0] + 0.5 * turn) % turn - 0.5 * turn
        places = way + self.new.section.places
        ends = self.old.section.places[[0, -1]]
        near = 1e-9 * turn
        places[np.abs(places - ends[0]) < near] = ends[0]
        places[np.abs(places - ends[1]) < near] = ends[1]
        return np.asarray(places)

    @property
    def _inside(self) -> Flags:
        first, last = self.old.section.places[[0, -1]]
        return np.asarray((self._places >= first) & (self._places <= last))


def spread(mesh: SectionMesh, nodes: Integers, values: Array) -> Array:
    """Values (V,) at all nodes: given at some of the boundary, zero at its others, smooth inside.

    Each inner node has the mean of its neighbours, nearer ones counting more.
    """
    result = np.zeros(len(mesh.points))
    result[nodes] = values
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    laplacian = _laplacian(mesh)[inner]
    result[inner] = -np.asarray(spsolve(laplacian[:, inner].tocsc(), laplacian @ result))
    return result


def _laplacian(mesh: SectionMesh) -> csr_array[np.float64]:
    a, b = mesh.quads.ravel(), np.roll(mesh.quads, -1, axis=1).ravel()
    weight = 1.0 / ((mesh.points[a] - mesh.points[b]) ** 2).sum(axis=1)
    n = len(mesh.points)
    rows, columns = np.concatenate([a, b]), np.concatenate([b, a])
    links = coo_array((np.concatenate([weight, weight]), (rows, columns)), shape=(n, n)).tocsr()
    diagonal = np.arange(n)
    degree = coo_array((np.asarray(links.sum(axis=1)).ravel(), (diagonal, diagonal)), shape=(n, n))
    return csr_array(degree.tocsr() - links)
