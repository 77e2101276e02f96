"""The sealed pressure ends where something touches: found from the contact, not from the shape."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from softehl.cases.seal.equations.definition import BORE, ROD
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.meshing.outline import Outline, Shape
from softehl.cases.seal.meshing.section_mesher import Sizes
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.arc_meshing import contact_layout
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver, State
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.contacts import contact_pressure, unsealed
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array

P = Seal(ring="AS568-210", rod=19.0, gland="dynamic", density=1, sealed_pressure=3.0)


def route() -> ContactMeshes:
    return ContactMeshes(ContactSolver(PathDriver(Silent())))


def elsewhere(system: SealSystem, x: Array, new: SealSystem) -> Array:
    """The contact state x on another mesh: carried to it, else from rest."""
    found = ContactSolver(PathDriver(Silent())).from_mesh(system, x, new)
    return found[1]


@cache
def usual() -> State:
    return route().contact(P)


def place(angle: float | None) -> float | None:
    """That on the circle at an angle from its bottom, degrees, mm."""
    return None if angle is None else float(np.radians(angle)) * 0.5 * P.section_diameter


def ending_at(lip: float | None, crown: float | None) -> State:
    """The state on the mesh of the usual one, its pressure ending at other angles, degrees."""
    system, x = usual()
    layout = system.section.layout
    pressure_boundaries = place(lip), place(crown)
    new = build_system(P, replace(layout, pressure_boundaries=pressure_boundaries))
    return new, elsewhere(system, x, new)


def corrected(system: SealSystem, x: Array) -> Layout:
    rod, housing = (system.pressing(name, x) for name in (ROD, BORE))
    return system.section.layout.with_sealed_ends(system.mesh, rod, housing, P.sealed_pressure)


def test_where_in_the_contact_pressure_ends_does_not_matter() -> None:
    system, x = usual()
    assert unsealed(system, x) == ""
    assert corrected(system, x).pressure_boundaries == (None, None)
    other, y = ending_at(12.0, -170.0)
    assert unsealed(other, y) == ""
    assert other.section.pressed_ends != system.section.pressed_ends
    assert other.displacements(y) == pytest.approx(system.displacements(x), abs=1e-4)
    there, here = contact_pressure(other, 3.0, y), contact_pressure(system, 3.0, x)
    away = np.ones(len(here), dtype=bool)
    away[[system.section.lowest, other.section.lowest]] = False  # half of p_s, near enough
    assert np.abs(there - here)[away].max() < 1e-3 * here.max()


@pytest.mark.parametrize(
    ("lip", "crown", "where"), [(-33.0, None, "lowest point"), (None, -95.0, "crown")]
)
def test_pressure_that_ends_outside_the_contact_is_led_to_it(
    lip: float | None, crown: float | None, where: str
) -> None:
    """A state that was `uncertain`: the pressure missed a part of the section, or had too much."""
    right, _ = usual()
    system, x = ending_at(lip, crown)
    assert where in unsealed(system, x)
    layout = corrected(system, x)
    assert layout.pressure_boundaries != system.section.layout.pressure_boundaries
    new = build_system(P, layout)
    y = elsewhere(system, x, new)
    assert unsealed(new, y) == ""
    wrong = np.abs(system.displacements(x) - right.displacements(usual()[1])).max()
    assert wrong > 1e-3
    error = np.abs(new.displacements(y) - right.displacements(usual()[1])).max()
    assert error < 0.1 * wrong


def test_meshes_are_made_until_the_pressure_ends_in_the_contact() -> None:
    """The whole route, from a state whose pressure ends before the contact begins."""
    start = ending_at(-33.0, None)
    found = route()._sealed(P, start)
    system, x = found
    assert unsealed(system, x) == ""
    layout = contact_layout(*start, P)
    assert layout.pressure_boundaries[0] is not None
    assert system.section.layout.pressure_boundaries[0] == layout.pressure_boundaries[0]


def test_places_are_measured_round_the_circle() -> None:
    shape = Shape.facing(Outline.circle((0.0, 10.0), 1.0), (0.0, 11.0), "ring")
    layout = Layout(
        shape, shape.film, Sizes(), pressure_boundaries=(np.radians(-20.0), np.radians(-179.5))
    )
    mesh = layout.mesh(2)
    z, r = (mesh.points[mesh.arc_nodes[layout.lowest(mesh)]] - [0.0, 10.0]).T
    assert np.degrees(np.arctan2(z, -r)) == pytest.approx(-20.0, abs=2.0)
    z, r = (mesh.points[mesh.outer_nodes[layout.pressed(mesh)]] - [0.0, 10.0]).T
    assert abs(np.degrees(np.arctan2(z, -r))) == pytest.approx(179.5, abs=5.0)


@pytest.mark.slow
def test_pressure_ends_in_the_contact_on_finer_meshes_too() -> None:
    """The contact of a cup presses hardly more than the oil: at density 4 p_s ended beside it."""
    cup = Seal(ring="U-cup 25x35x8", density=4, sealed_pressure=1.0, speeds=(400.0,), stroke="out")
    assert unsealed(*route().contact(cup)) == ""
