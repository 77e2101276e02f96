"""Loaded contact on other meshes: from states of the last path under less pressure."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact import contact_problem
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import Checkpoint, Checkpoints, ContactSolver
from softehl.cases.seal.solve.path import PathDriver
from softehl.cases.seal.states.state import Silent

LOADED = Seal(sealed_pressure=10.0, density=1)


def at(system: SealSystem, share: float) -> Checkpoint:
    """A state under a share of the sealed pressure; its unknown is that."""
    return Checkpoint(system, share * LOADED.sealed_pressure, np.array([share]))


@pytest.fixture(scope="module")
def system() -> SealSystem:
    """Any mesh."""
    return build_system(LOADED)


def share(checkpoints: Checkpoints, p: Seal = LOADED) -> float | None:
    found = checkpoints.restart(p)
    return found.pressure / p.sealed_pressure if found else None


def test_a_path_is_taken_up_again_under_half_of_the_pressure(system: SealSystem) -> None:
    checkpoints = Checkpoints()
    assert share(checkpoints) is None
    checkpoints.keep(at(system, 0.0))
    assert share(checkpoints) is None  # at rest
    for pressure in (0.2, 0.4, 0.45, 0.7, 1.0):
        checkpoints.keep(at(system, pressure))
    assert share(checkpoints) == pytest.approx(0.45)
    assert share(checkpoints, LOADED.model_copy(update={"housing_friction": 0.2})) is None


def test_a_new_path_replaces_what_lies_beyond_its_start(system: SealSystem) -> None:
    checkpoints, finer = Checkpoints(), build_system(LOADED.model_copy(update={"density": 2}))
    for pressure in (0.2, 0.4, 0.9):
        checkpoints.keep(at(system, pressure))
    checkpoints.begin(0.4 * LOADED.sealed_pressure)
    assert share(checkpoints) == pytest.approx(0.2)
    checkpoints.keep(at(finer, 0.5))
    found = checkpoints.restart(LOADED)
    assert found is not None
    assert found.system is finer


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
