"""The way to dry contact: creep, checkpoints, walls, gaps, ends of the pressure."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome
from softehl.cases.harness.row import OK
from softehl.cases.seal.equations.definition import BORE, ROD, SHEAR, WALLS
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.meshing.outline import Outline, Shape
from softehl.cases.seal.meshing.section_mesher import Sizes
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.arc_meshing import contact_layout
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import (
    LEG,
    ContactSolver,
    CreepCorrector,
    Creeping,
    State,
)
from softehl.cases.seal.solve.contact_stages import (
    approach_stage,
    at_air_wall,
    contact_problem,
    load_stage,
)
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.failure_messages import explained
from softehl.cases.seal.solve.load_stages import PathDriver, StageError
from softehl.cases.seal.states.contacts import contact_numbers, contact_pressure, unsealed
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Branch, Point, Solution, Status

# --- Loaded contact on other meshes: from states of the last path under less pressure -------------


LOADED = Seal(sealed_pressure=10.0, density=1)


@pytest.fixture(scope="module")
def system() -> SealSystem:
    """Any mesh."""
    return build_system(LOADED)


def at(share: float) -> Point:
    """A state under a share of the sealed pressure; its unknown is that."""
    solution = Solution(np.array([share]), Status.CONVERGED, "", (), 0, 0)
    return Point(share * LOADED.sealed_pressure, solution)


def share(solver: ContactSolver) -> float | None:
    found = solver.checkpoints
    return found[-1].pressure / LOADED.sealed_pressure if found else None


def test_a_path_is_taken_up_again_under_half_of_the_pressure(system: SealSystem) -> None:
    solver = ContactSolver(PathDriver(Silent()))
    assert share(solver) is None
    solver.keep(system, at(0.0))
    assert share(solver) is None  # at rest
    for pressure in (0.2, 0.4, 0.45, 0.7, 1.0):
        solver.keep(system, at(pressure))
    assert share(solver) == pytest.approx(0.45)


def test_a_path_with_friction_is_not_taken_up_again() -> None:
    solver = ContactSolver(PathDriver(Silent()))
    solver.keep(build_system(LOADED.model_copy(update={"housing_friction": 0.2})), at(0.4))
    assert share(solver) is None


def test_a_new_path_replaces_the_last_one(system: SealSystem) -> None:
    solver, finer = (
        ContactSolver(PathDriver(Silent())),
        build_system(LOADED.model_copy(update={"density": 2})),
    )
    for pressure in (0.2, 0.4, 0.9):
        solver.keep(system, at(pressure))
    assert solver.checkpoints[-1].system is system
    solver.keep(finer, at(0.4))
    assert solver.checkpoints[-1].system is finer
    assert share(solver) == pytest.approx(0.4)


def test_a_path_that_is_taken_up_keeps_a_state_of_each_leg(system: SealSystem) -> None:
    solver, leg = ContactSolver(PathDriver(Silent())), LEG * LOADED.shear_modulus
    solver.keep(system, at(0.4))
    begin = 0.5 * LOADED.sealed_pressure
    for pressure in (begin, begin + 0.5 * leg, begin + leg, begin + 1.3 * leg, 0.99 * 10.0):
        solver.keep(system, at(pressure / LOADED.sealed_pressure), begin)
    kept = [state.pressure for state in solver.checkpoints]
    assert kept == pytest.approx([4.0, begin, begin + leg])


def test_a_path_from_rest_leaves_its_own_state(system: SealSystem) -> None:
    light = build_system(LOADED.model_copy(update={"sealed_pressure": 1.0, "mesh": "uniform"}))
    solver = ContactSolver(PathDriver(Silent()))
    solver.keep(system, at(0.5))
    solver.from_rest(light)
    assert solver.checkpoints[-1].system is light
    assert 0.0 < solver.checkpoints[-1].pressure <= 0.5


def test_contact_above_three_shear_moduli_is_not_walked_from_rest_on_every_mesh() -> None:
    """189 factorisations; from rest on each of the four meshes it is more than 4 times 93."""
    p = Seal(
        inner_diameter=69.215,
        section_diameter=5.334,
        rod_diameter=71.0932,
        housing_diameter=80.7438,
        groove_width=9.226,
        mu_1=1.772,
        mu_2=0.363,
        bulk_modulus=944.4,
        sealed_pressure=6.727,
        viscosity=2.28e-7,
        density=1,
    )
    driver = PathDriver(Silent())
    found = ContactMeshes(ContactSolver(driver)).contact(p)
    assert sum(record.factorisations or 0 for record in driver.records) < 250
    system, x = found
    problem = contact_problem(system, p.sealed_pressure)
    assert problem.norm(problem.residual(x)) < 1e-8


# --- A section that creeps to its contact ---------------------------------------------------------


P = Seal(density=1, mesh="uniform", sealed_pressure=4.0)


@pytest.fixture(scope="module")
def squeezed() -> tuple[SealSystem, Array]:
    """A section in its gland, moved to the wall, without pressure."""
    system = build_system(P)
    x = PathDriver(Silent()).follow(approach_stage(system), system.at_rest())
    return system, at_air_wall(system, x)[0]


def test_all_of_the_pressure_at_once_leads_to_the_contact_of_its_path(
    squeezed: tuple[SealSystem, Array],
) -> None:
    system, x = squeezed
    problem = contact_problem(system, P.sealed_pressure).since(x)
    found = CreepCorrector(system, Newton()).solve(problem, x)
    assert found.converged
    path = ContactSolver(PathDriver(Silent())).from_rest(system)
    np.testing.assert_allclose(found.x, path, rtol=0.0, atol=1e-7)


def test_a_creep_that_does_not_go_on_is_no_contact(squeezed: tuple[SealSystem, Array]) -> None:
    system, x = squeezed
    problem = contact_problem(system, P.sealed_pressure).since(x)
    found = CreepCorrector(system, replace(Newton(), max_iterations=1)).solve(problem, x)
    assert not found.converged
    assert found.iterations > 0


def test_springs_hold_a_section_by_its_volume(squeezed: tuple[SealSystem, Array]) -> None:
    """A uniform displacement is held by mu V / d^2, V that of a torus: 2 pi R pi d^2 / 4."""
    system, x = squeezed
    y = x.copy()
    system.displacements(y)[:, 0] += 1.0
    held = Creeping(system).step(x, 1.0, 1.0)
    force = (held.term @ (y - x)).sum()
    radius = 0.5 * (P.inner_diameter + P.section_diameter)
    assert force == pytest.approx(P.shear_modulus * 0.5 * np.pi**2 * radius, rel=0.02)


# --- An open gap on the air side: the edge of the wall, the mesh at it, and how far contact goes


def found(**changes: Any) -> State:
    driver = PathDriver(Silent())
    p = Seal(**{"density": 1, "extrusion_gap": 0.1, **changes})
    return ContactMeshes(ContactSolver(driver)).contact(p)


def distance(places: np.ndarray, p: Seal) -> np.ndarray:
    """Distance of places (n, 2) from the wall and its rounded edge."""
    corner = np.array([0.5 * p.groove_width, 0.5 * p.rod_diameter + p.extrusion_gap])
    a = corner + p.corner_fillet - places
    outside = np.hypot(*np.maximum(a, 0.0).T) + np.minimum(a.max(axis=1), 0.0)
    return np.asarray(outside - p.corner_fillet)


def test_a_loaded_section_rests_on_the_wall_and_is_in_balance() -> None:
    system, x = found(sealed_pressure=4.0)
    p = system.parameters
    gap = distance(system.deformed(x)[system.mesh.boundary], p)
    touching = system.pressing("air_wall", x) > 0.0
    assert gap.min() > -1e-9
    assert abs(gap[touching]).max() < 1e-9
    assert touching.sum() > 3
    numbers = contact_numbers(system, x)
    assert abs(numbers["axial_sum_N"]) < 1e-10 * numbers["sealed_pressure_N"]


def sizes(system: SealSystem) -> np.ndarray:
    """Lengths of the segments of the boundary, from the sealed end of the arc."""
    boundary = system.mesh.points[system.mesh.boundary]
    return np.asarray(np.linalg.norm(np.diff(boundary, axis=0), axis=1))


def test_the_mesh_is_fine_where_the_section_meets_the_edge() -> None:
    """A quarter of the fillet: over the whole of the guide's edge, at the air end of the film."""
    p = Seal(density=2, extrusion_gap=0.1)
    guide = build_system(p.model_copy(update={"mesh": "uniform"}))
    centre = np.array([0.0, 0.5 * (p.inner_diameter + p.section_diameter)])
    z, r = (guide.mesh.points[guide.mesh.arc_nodes] - centre).T
    angle = np.degrees(np.arctan2(z, -r))
    edge = (angle[:-1] > 27.0) & (angle[1:] < 69.0)
    assert sizes(guide)[: guide.mesh.arc][edge].max() < 0.3 * p.corner_fillet
    system, _ = found(sealed_pressure=2.0)
    assert sizes(system)[system.mesh.arc] < 2 * 0.3 * p.corner_fillet  # density 1
    assert sizes(build_system(Seal(density=2))).min() > 0.3 * p.corner_fillet


def test_a_run_that_ends_in_the_gap_says_so() -> None:
    p = Seal(density=1, extrusion_gap=0.05, corner_fillet=0.2, sealed_pressure=9.0)
    stage = load_stage(build_system(p))
    failed = StageError(stage, Branch((), Status.STEP_TOO_SMALL, ""))
    text = explained(failed, p)[1]
    for word in ("0 of 9 MPa", "gap of 0.05 mm", "fillet 0.2 mm", "backup = true"):
        assert word in text


def test_a_closed_gap_is_the_wall_down_to_the_rod() -> None:
    closed, open_ = build_system(Seal(density=1)), build_system(Seal(extrusion_gap=0.1))
    kernels = [s.problem.assembler.block("air_wall").kernel.name for s in (closed, open_)]
    assert kernels == ["contact", "contact_corner"]
    assert Seal(backup=True) == Seal(backup=True, extrusion_gap=0.0)


@pytest.mark.slow
def test_contact_of_a_soft_ring_reaches_ten_megapascals_over_a_gap() -> None:
    system, x = found(density=2, sealed_pressure=10.0)
    assert system.deformed(x)[:, 0].max() > 0.5 * system.parameters.groove_width + 0.005


# --- Friction at housing and walls: the section is found instead of held, forces are in balance ---


def solved(**changes: Any) -> Outcome[FilmState]:
    given = {"density": 1, "speeds": (800.0,), "stroke": "out", "error_estimate": False}
    return run(Seal(**{**given, **changes}), Silent())


@pytest.mark.slow
def test_friction_carries_a_part_of_the_pressure_and_holds_the_section() -> None:
    """Forces are in balance without a hold; h* is 0.4 % below that without friction."""
    outcome = solved(density=2, housing_friction=0.3)
    assert outcome.converged, outcome.message
    (state,) = outcome.states
    assert state.verdict == OK
    assert state.h_star_um == pytest.approx(2.080, rel=5e-3)
    assert state.moment_N_mm == 0.0
    numbers = outcome.numbers
    assert abs(numbers["axial_sum_N"]) < 1e-9 * numbers["sealed_pressure_N"]
    assert -0.25 < numbers["housing_friction_N"] / numbers["sealed_pressure_N"] < -0.15
    assert numbers["hold_N"] == 0.0
    assert 1.0 < numbers["mean_rotation_degrees"] < 5.0
    assert "let go" in outcome.solvers["assembly"]


@pytest.mark.slow
def test_strokes_without_pressure_are_mirror_images_with_friction() -> None:
    outcome = solved(housing_friction=0.2, sealed_pressure=0.0, stroke="both")
    out, back = outcome.states
    assert out.h_star_um == pytest.approx(back.h_star_um, rel=1e-10)
    assert outcome.numbers["mean_rotation_degrees"] == pytest.approx(0.0, abs=1e-9)


def test_stresses_of_the_walls_stay_within_coulombs_cone() -> None:
    """In contact: nowhere above the limit, somewhere at it; a smaller coefficient is exceeded."""
    driver = PathDriver(Silent())
    route = ContactMeshes(ContactSolver(driver))
    p = Seal(density=1, mesh="uniform", arc_start=-60.0, arc_end=60.0, housing_friction=0.2)
    found = route.contact(p)
    system, x = found
    shares = []
    for name in WALLS:
        shear, normal = x[system.layout.part(SHEAR[name])], system.pressing(name, x)
        assert np.all(abs(shear[normal == 0.0]) == 0.0)
        shares += list(abs(shear[normal > 0.0]) / normal[normal > 0.0])
    assert max(shares) == pytest.approx(0.2, rel=1e-9)
    assert max(shares) > 0.19
    assert contact_problem(system, 1.0).since(x).residual(x) == pytest.approx(0.0, abs=1e-6)


# --- The sealed pressure ends where something touches: found from the contact, not from the shape


PRESSED = Seal(ring="AS568-210", rod=19.0, gland="dynamic", density=1, sealed_pressure=3.0)


def route() -> ContactMeshes:
    return ContactMeshes(ContactSolver(PathDriver(Silent())))


def elsewhere(system: SealSystem, x: Array, new: SealSystem) -> Array:
    """The contact state x on another mesh: carried to it, else from rest."""
    found = ContactSolver(PathDriver(Silent())).from_mesh(system, x, new)
    return found[1]


@cache
def usual() -> State:
    return route().contact(PRESSED)


def place(angle: float | None) -> float | None:
    """That on the circle at an angle from its bottom, degrees, mm."""
    return None if angle is None else float(np.radians(angle)) * 0.5 * PRESSED.section_diameter


def ending_at(lip: float | None, crown: float | None) -> State:
    """The state on the mesh of the usual one, its pressure ending at other angles, degrees."""
    system, x = usual()
    layout = system.section.layout
    pressure_boundaries = place(lip), place(crown)
    new = build_system(PRESSED, replace(layout, pressure_boundaries=pressure_boundaries))
    return new, elsewhere(system, x, new)


def corrected(system: SealSystem, x: Array) -> Layout:
    rod, housing = (system.pressing(name, x) for name in (ROD, BORE))
    return system.section.layout.with_sealed_ends(
        system.mesh, rod, housing, PRESSED.sealed_pressure
    )


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
    new = build_system(PRESSED, layout)
    y = elsewhere(system, x, new)
    assert unsealed(new, y) == ""
    wrong = np.abs(system.displacements(x) - right.displacements(usual()[1])).max()
    assert wrong > 1e-3
    error = np.abs(new.displacements(y) - right.displacements(usual()[1])).max()
    assert error < 0.1 * wrong


def test_meshes_are_made_until_the_pressure_ends_in_the_contact() -> None:
    """The whole route, from a state whose pressure ends before the contact begins."""
    start = ending_at(-33.0, None)
    found = route()._sealed(PRESSED, start)
    system, x = found
    assert unsealed(system, x) == ""
    layout = contact_layout(*start, PRESSED)
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
