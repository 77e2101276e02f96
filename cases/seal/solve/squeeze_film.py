"""A film that is squeezed out from the dry contact: the time behind pseudo-transient continuation.

The gap that contact leaves is a film that begins to be squeezed out, with the pressures of contact.
An implicit step of length tau,

    dq/dx + w (h - h_n) / tau = 0,

is contact for tau -> 0 and the steady film for tau -> infinity; the section bears the same load all
the way. The scales are those of the inlet (`solve.inlet`): a length l, the time T = l / U in which
the rod passes it, and a thickness h_r. The local weight w = min(1, (h_r / h_n)^a) lets the oil flow
sooner where there is much more of it than the film needs, as in a groove.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np
from scipy.sparse import coo_array, csc_array

from softehl.cases.seal.correctors.layer_split import Layer, Layered
from softehl.cases.seal.correctors.proximal_term import Relaxed
from softehl.cases.seal.equations.definition import (
    AIR_WALL,
    DISPLACEMENT,
    MOVED,
    ROTATION,
    SEALED_WALL,
    WALLS,
)
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.solve.arc_meshing import NO_WIDTH
from softehl.cases.seal.solve.contact_stages import OFFSET, held_moment, held_place
from softehl.cases.seal.solve.inlet import InletScales
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.quadrature import content_rule, pressure_nodes

_AT_WALL = 0.02
"""Part of the section within which a node counts as one at a wall. Without these an O-ring at
14 MPa takes 64 % more factorisations; with all nodes of the arc, four seals take 3 to 11 % more
time."""

EXPONENT = 1.5
"""a of the local time steps. On X-rings at the slowest speed 1 found no film and 2 was as good."""

FIRST = 1e-2
"""First step, of T. From 1e-3 an X-ring without pressure has no film at 1600 mm/s."""


def film_layer(system: SealSystem, x: Array) -> Layer:
    """The film as the layer of the modified Newton iteration, near the state x.

    Displacements of the arc and the moment are shared with the section; the pressures but those at
    the ends are the film's own; all other unknowns of its blocks are prescribed. Multipliers of arc
    nodes at a wall are shared too: only the displacements of these nodes determine them.
    """
    moved = system.numbering.at(MOVED, system.mesh.arc_nodes[:, None]).ravel()
    moment = system.layout.dofs(ROTATION)
    shared = np.concatenate([moved, moment, _walls_of_arc(system, x)])
    film_dofs = [system.layout.dofs(field.name) for field in system.film_fields()]
    inner = np.concatenate(film_dofs)
    if system.parameters.conserving:  # side by side along the film: their matrix is a band
        inner = np.stack([pressures[1:-1] for pressures in film_dofs], axis=1).ravel()
    inner = inner[~np.isin(inner, system.film_ends)]
    names = [block.name for block in system.blocks if block.on_arc]
    return Layer.of(system.problem.assembler, names, shared, inner)


def _walls_of_arc(system: SealSystem, x: Array) -> Integers:
    """Multipliers (n,) of the walls at those nodes of the arc that touch them or are near."""
    multipliers = []
    for name in (SEALED_WALL, AIR_WALL):
        nodes = system.section.chains[WALLS[name]][0]
        gap = system.obstacles[name].gap(system.deformed(x)[nodes])
        selected = np.isin(nodes, system.mesh.arc_nodes)
        selected &= gap < _AT_WALL * system.parameters.section_diameter
        multipliers.append(system.layout.dofs(name)[selected])
    return np.concatenate(multipliers)


def film_loads(system: SealSystem, stroke: Stroke, speed: float, x: Array) -> FilmLoads:
    """The loads of a film at |U| (mm/s) from the contact state x (n,)."""
    p = system.parameters
    return FilmLoads(
        p.sealed_pressure,
        stroke,
        speed,
        gap=system.arc_film(x)[1],
        shear=1.0 if p.shear_traction else 0.0,
        position=held_place(p),
        moment=0.0 if p.rotation == "free" else held_moment(p),
    )


@dataclass(frozen=True, eq=False)
class SqueezeFilm:
    """A film that is squeezed out; satisfies `Transient`, its time in units of T.

    film: loads of the steady film. dry: (n,) the contact state on its mesh. moment: that holds the
    rotation of the section at the start, N mm; it fades as the shear stress begins to act, where
    the section is free to roll.
    """

    system: SealSystem
    layer: Layer
    film: FilmLoads
    scales: InletScales
    dry: Array
    moment: float = 0.0

    def at(self, speed: float) -> SqueezeFilm:
        """Film at another |U|, mm/s."""
        film = replace(self.film, speed=speed, entrance=0.0)
        return replace(self, film=film, scales=self.scales.at(speed / self.film.speed))

    def carried(self, system: SealSystem, x: Array, dry: Array) -> SqueezeFilm:
        """Film on the mesh of another system; x: (n,) carried to it, dry: contact."""
        film = replace(self.film, gap=system.arc_film(x)[1] + OFFSET, entrance=0.0)
        return replace(self, system=system, layer=film_layer(system, x), film=film, dry=dry)

    def step(self, previous: Array, tau: float, load: float) -> Relaxed:
        """See `Transient`; the load is the shear stress of the film."""
        film = replace(self.film, shear=load * self.film.shear)
        if self.system.parameters.rotation == "free":
            film = replace(film, moment=(1.0 - load) * self.moment)
        return Relaxed(
            self.system.film_problem(film).since(previous),
            self.layer,
            (self.system.film_guard(),),
            hold=self._masses(previous),
            state=previous,
            rate=-1.0 / (tau * self.scales.time),
        )

    def steady(self, previous: Array) -> Layered:
        """The equations of the steady film, from a state (n,) near by."""
        problem = self.system.film_problem(self.film).since(previous)
        return Layered(problem, self.layer, (self.system.film_guard(),))

    def change(self, previous: Array, after: Array) -> float:
        """Largest change of ln h along the arc; of h over its size between rough surfaces."""
        (_, h), (_, k) = self.system.arc_film(previous), self.system.arc_film(after)
        if self.system.parameters.rough:
            minimum = self.system.parameters.surfaces.sigma
            return float(np.max(np.abs(k - h) / np.maximum(np.abs(h), minimum)))
        return float(np.abs(np.log(k / h)).max()) if k.min() > 0.0 else inf

    @property
    def first(self) -> float:
        """Length of the first step from the contact, where a thicker film flows sooner."""
        return float(FIRST * min(1.0, self.scales.thickness / OFFSET) ** EXPONENT)

    def _masses(self, x: Array) -> csc_array[np.float64]:
        """Rates of what the film holds, by the local time steps; see `gap_masses`."""
        h = self.system.arc_film(x)[1]
        relative = self.scales.thickness / np.maximum(h, self.scales.thickness)
        return gap_masses(self.system, x, relative**EXPONENT)


def pressed_film(system: SealSystem, x: Array, p_s: float) -> Array:
    """The contact state x (n,) with a film that has the pressures of the contact."""
    y, nodes = x.copy(), system.mesh.arc_nodes
    z, r = system.deformed(x)[nodes].T
    dz = np.diff(z)
    width = 0.5 * (np.append(dz, 0.0) + np.append(0.0, dz))
    force = np.maximum(-system.rod_multipliers(x), 0.0) * system.rod_areas
    low, sealed = system.section.lowest, np.zeros(len(nodes))
    sealed[:low] = p_s
    if 0 < low < len(dz):
        sealed[low] = p_s * dz[low - 1] / (dz[low - 1] + dz[low])
    wide = width > NO_WIDTH * width.max()
    pressures = (
        np.divide(force, 2.0 * pi * np.abs(r) * width, out=np.zeros_like(r), where=wide) + sealed
    )
    rows = system.pressure_dofs()
    y[rows] = np.stack([pressures[:-1], pressures[1:]], axis=1) @ _shapes(rows.shape[1] - 1).T
    return y


def gap_masses(system: SealSystem, x: Array, weights: Array | None = None) -> csc_array[np.float64]:
    """Rates (n, n) of what the film holds by the radial displacements of the arc, mm.

    Rows are the pressures'; what a film holds is lumped where these stand. weights: (arc nodes,) of
    the displacements, 1 if left out.
    """
    pressures, n = system.pressure_dofs(), system.layout.total
    segments, order = system.mesh.arc_segments, pressures.shape[1] - 1
    z = system.deformed(x)[:, 0]
    half = 0.5 * (z[segments[:, 1]] - z[segments[:, 0]])
    radii = system.layout.part(DISPLACEMENT).start + 2 * segments + 1
    masses = half[:, None, None] * (content_rule(order).weights[:, None] * _shapes(order))
    if weights is not None:
        masses = masses * np.stack([weights[:-1], weights[1:]], axis=1)[:, None, :]
    at = np.broadcast_arrays(pressures[..., None], radii[:, None])
    indices = tuple(part.ravel() for part in at)
    return csc_array(coo_array((masses.ravel(), indices), shape=(n, n)))


def _shapes(order: int) -> Array:
    """Of both nodes of a segment, (order + 1, 2), where its pressures stand."""
    xi = pressure_nodes(order)
    return np.stack([0.5 * (1.0 - xi), 0.5 * (1.0 + xi)], axis=1)
