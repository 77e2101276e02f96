"""Loaded contact on other meshes: from states of the last path under less pressure."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.contact_stages import contact_problem
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.state import Silent
from softehl.runtime.solve.solution import Point, Solution, Status

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
    found = solver.checkpoint
    return found.pressure / LOADED.sealed_pressure if found else None


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
    assert solver.checkpoint is not None
    assert solver.checkpoint.system is system
    solver.keep(finer, at(0.4))
    assert solver.checkpoint.system is finer
    assert share(solver) == pytest.approx(0.4)


def test_a_path_from_rest_leaves_its_own_state(system: SealSystem) -> None:
    light = build_system(LOADED.model_copy(update={"sealed_pressure": 1.0, "mesh": "uniform"}))
    solver = ContactSolver(PathDriver(Silent()))
    solver.keep(system, at(0.5))
    solver.from_rest(light)
    assert solver.checkpoint is not None
    assert solver.checkpoint.system is light
    assert 0.0 < solver.checkpoint.pressure <= 0.5


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
