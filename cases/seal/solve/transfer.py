"""Contact and film of one mesh of a section on another one: the start of their solution there.

Displacements, multipliers and element pressures of a contact are carried over and corrected by
Newton's method, which holds on to the pressures in its tangent (`correctors.perturbed_lagrangian`).
The multipliers are unknowns, so contact is stiff from the first iteration on. The equations are
those of a path (`cases.seal.solve.load_stages`); only the start is another one.

The contact of a film is known on both meshes. The change from contact to film is carried: it is
small and smooth where the state itself is not, as in the corners of a groove. A gap of a micrometre
does not survive that, so the film thickness is carried by itself, ln h over the place on the arc,
and the change of it is spread into the body.

Nodal values go through the cells inside, values of the boundary by place along it. A point gets the
value of the cell that it lies in, so that nothing crosses a mouth. With cubic splines through the
nodes around each cell, films of an O-ring, an X-ring and a U-cup took as many iterations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.meshing.mesh_morphing import potential
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.solve.contact_stages import contact_problem, correction_stage
from softehl.cases.seal.solve.correctors import lagged
from softehl.cases.seal.solve.load_stages import Stage
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.quadrature import lagrange, pressure_nodes
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.point_location import Located, PointLocator

_WITHIN = 1e-12  # of the size of the mesh: a point so near to a cell is in it


def carried_contact(
    old: SealSystem,
    new: SealSystem,
    x: Array,
    sealed_pressure: float,
    name: str = "",
) -> tuple[Stage, Array]:
    """A stage of one step that solves for contact on another mesh of a section, and its start.

    x: unknowns of the contact state on the old mesh, under a sealed pressure, MPa. name: of the
    stage, by the density if left out.
    """
    pressures, y = old.element_pressures(x), carried_unknowns(old, new, x)
    bare = contact_problem(new, sealed_pressure).since(y)
    problem = lagged(new, bare, transfer_elements(old.mesh, new.mesh, pressures))
    return correction_stage(new, problem, "newton, carried from another mesh", name), y


def carried_unknowns(old: SealSystem, new: SealSystem, x: Array) -> Array:
    """Every field that contact knows, (n',), on another mesh; those of the film are zero."""
    y = new.at_rest()
    for field in old.contact_fields():
        values = x[old.layout.part(field.name)]
        if field.on == "nodes":
            values = transfer_nodes(old.mesh, new.mesh, values.reshape(-1, 2)).ravel()
        elif field.on != "section":
            old_nodes, new_nodes = (system.section.chains[field.on][0] for system in (old, new))
            if len(old_nodes) == len(old.mesh.boundary):
                values = transfer_boundary(old.mesh, new.mesh, values)
            else:
                values = transfer_chain(
                    old.mesh, new.mesh, nodes=old_nodes, new_nodes=new_nodes, values=values
                )
        y[new.layout.part(field.name)] = values
    return y


@dataclass(frozen=True, eq=False)
class FilmTransfer:
    """From a mesh to another one of the same section; dry: contact states (n,), (n',) on both."""

    old: SealSystem
    new: SealSystem
    dry: tuple[Array, Array]

    def state(self, x: Array) -> Array:
        """All unknowns (n',) of the film x (n,)."""
        y = self.dry[1] + carried_unknowns(self.old, self.new, x - self.dry[0])
        self._film(x, y)
        inside, mesh = self._inside, self.new.mesh
        miss = np.zeros((len(mesh.points), 1))
        carried = self.new.arc_film(y)[1][inside]
        miss[mesh.arc_nodes[inside], 0] = self._thickness(x, self._positions[inside]) - carried
        self.new.displacements(y)[:, 1] += potential(mesh, miss)[:, 0]
        return y

    def pressures(self, x: Array) -> Array:
        """Mean stresses (Q',) of the elements."""
        change = self.old.element_pressures(x) - self.old.element_pressures(self.dry[0])
        contact_pressures = self.new.element_pressures(self.dry[1])
        return contact_pressures + transfer_elements(self.old.mesh, self.new.mesh, change)

    def _thickness(self, x: Array, positions: Array) -> Array:
        """Film thickness (n,) at places (n,) on the old arc."""
        h, old_positions = self.old.arc_film(x)[1], self.old.section.positions
        if self.old.parameters.rough:  # which may interpenetrate
            return np.asarray(PchipInterpolator(old_positions, h)(positions))
        return np.asarray(np.exp(PchipInterpolator(old_positions, np.log(h))(positions)))

    def _film(self, x: Array, y: Array) -> None:
        """Write the film pressures of x (n,) into y (n',).

        Each segment takes them from that of the old mesh in which it is.
        """
        nodes, positions = pressure_nodes(self.new.parameters.pressure_order), self._positions
        at = positions[:-1, None] + np.diff(positions)[:, None] * (0.5 * (1.0 + nodes))
        segment, weights = modes_at(self.old.section.positions, nodes, at)
        for film in self.old.film_fields():
            rows = x[self.old.pressure_dofs(film.name)]
            y[self.new.pressure_dofs(film.name)] = np.einsum("skm,skm->sk", weights, rows[segment])

    @cached_property
    def _positions(self) -> Array:
        """Places (arc nodes,) of the new arc on the old one, mm; beyond its ends outside."""
        old_mesh, after = (s.mesh for s in (self.old, self.new))
        turn = after.length
        shift = (after.positions[0] - old_mesh.positions[0] + 0.5 * turn) % turn - 0.5 * turn
        positions = shift + self.new.section.positions
        end_positions = self.old.section.positions[[0, -1]]
        tolerance = 1e-9 * turn
        positions[np.abs(positions - end_positions[0]) < tolerance] = end_positions[0]
        positions[np.abs(positions - end_positions[1]) < tolerance] = end_positions[1]
        return np.asarray(positions)

    @property
    def _inside(self) -> Flags:
        first, last = self.old.section.positions[[0, -1]]
        return np.asarray((self._positions >= first) & (self._positions <= last))


def modes_at(old_positions: Array, nodes: Array, at: Array) -> tuple[Integers, Array]:
    """Segment (s, m) of an arc with nodes at these places that holds a place, (s, m); its modes
    there, (s, m, n). nodes: (n,) parent coordinates of its pressures.
    """
    segment = np.clip(
        np.searchsorted(old_positions, at, side="right") - 1, 0, len(old_positions) - 2
    )
    local = 2.0 * (at - old_positions[segment]) / np.diff(old_positions)[segment] - 1.0
    modes = lagrange(nodes, np.clip(local.ravel(), -1.0, 1.0))[:, :, 0]
    return segment, modes.reshape(*segment.shape, -1)


def transfer_nodes(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Nodal values (V', k) on the new mesh from those, (V, k), on the old: bilinear."""
    located = _nearest(old, new.points)
    weights = CELLS["quad4"].shape(located.parent[:, :2])
    return np.asarray(np.einsum("na,nak->nk", weights, values[old.quads[located.row]]))


def transfer_elements(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Element values (Q',) on the new mesh from those, (Q,), on the old, by their middles."""
    return np.asarray(values[_nearest(old, new.points[new.quads].mean(axis=1)).row])


def _nearest(mesh: SectionMesh, points: Array) -> Located:
    """The cell that holds each place (n, 2), or is nearest to it."""
    tolerance = _WITHIN * float(np.ptp(mesh.points, axis=0).max())
    return PointLocator(mesh.points, {"quad4": mesh.quads}, tolerance).nearest(points)


def transfer_boundary(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Values (B',) at the whole boundary of the new mesh from those, (B,), of the old, by place.

    Shape preserving: no value beyond its neighbours.
    """
    period = old.length
    at = np.concatenate([old.positions - period, old.positions, old.positions + period])
    positions = old.positions[0] + np.mod(
        new.positions * (period / new.length) - old.positions[0], period
    )
    return np.asarray(PchipInterpolator(at, np.tile(values, 3))(positions))


def transfer_chain(
    old: SectionMesh, new: SectionMesh, nodes: Integers, new_nodes: Integers, values: Array
) -> Array:
    """Values (n',) at new_nodes of the boundary from those, (n,), at nodes, by place.

    Both run counterclockwise without gaps. Shape preserving; beyond the old nodes as at their ends.
    """
    at = places_of(old, nodes)
    positions = places_of(new, new_nodes) * (old.length / new.length)
    turns = np.round((0.5 * (at[0] + at[-1]) - 0.5 * (positions[0] + positions[-1])) / old.length)
    positions = np.clip(positions + turns * old.length, at[0], at[-1])
    return np.asarray(PchipInterpolator(at, values)(positions))


def places_of(mesh: SectionMesh, nodes: Integers) -> Array:
    """Places (n,) of boundary nodes that run counterclockwise, mm, rising."""
    index = np.full(len(mesh.points), -1, dtype=np.int64)
    index[mesh.boundary] = np.arange(len(mesh.boundary))
    at = mesh.positions[index[nodes]]
    back = np.concatenate([[0], np.cumsum(np.diff(at) < 0.0)])
    return np.asarray(at + back * mesh.length)
