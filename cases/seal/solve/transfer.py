"""Contact and film of one mesh of a section on another one: the start of their solution there.

Displacements, multipliers and element pressures of a contact are carried over and corrected by
Newton's method, which holds on to the pressures in its tangent (`correctors.perturbed_lagrangian`).
The multipliers are unknowns, so contact is stiff from the first iteration on. The equations are
those of a path (`cases.seal.solve.load_stages`); only the start is another one.

The contact of a film is known on both meshes. The change from contact to film is carried: it is
small and smooth where the state itself is not, as in the corners of a groove. A gap of a micrometre
does not survive that, so the film thickness is carried by itself, ln h over the place on the arc,
and the change of it is spread into the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.meshing.mesh_morphing import potential
from softehl.cases.seal.meshing.mesh_transfer import (
    transfer_boundary,
    transfer_chain,
    transfer_elements,
    transfer_nodes,
)
from softehl.cases.seal.solve.contact_stages import contact_problem, correction_stage
from softehl.cases.seal.solve.correctors import lagged
from softehl.cases.seal.solve.load_stages import Stage
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.quadrature import lagrange, pressure_nodes


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
