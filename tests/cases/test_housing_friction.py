"""Friction at housing and walls: the section is found instead of held, forces are in balance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome
from softehl.cases.harness.row import OK
from softehl.cases.seal.equations.definition import SHEAR, WALLS
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.contact_stages import contact_problem
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.state import FilmState, Silent


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
