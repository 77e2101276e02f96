"""Loaded contact on other meshes: from states of the last path under less pressure."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.contact import contact_problem
from softehl.cases.seal.solve.contact_route import ContactRoute
from softehl.cases.seal.solve.path import PathDriver, PathSettings, StageFailed
from softehl.cases.seal.solve.trail import Trail
from softehl.cases.seal.states.state import Silent
from softehl.runtime.solve.solution import Point, Solution, Status

LOADED = ORing(sealed_pressure=10.0, density=1)


def at(pressure: float) -> Point:
    """A state whose unknown is its pressure."""
    return Point(pressure, Solution(np.array([pressure]), Status.CONVERGED, "", (), 0, 0))


@pytest.fixture(scope="module")
def system() -> SealSystem:
    """Any mesh."""
    return build_system(LOADED)


def test_a_path_is_taken_up_again_where_the_pressure_is_less(system: SealSystem) -> None:
    trail, mu = Trail(), LOADED.shear_modulus
    for share in (0.0, 0.2, 0.5, 1.0, 1.5, 2.5):
        trail.keep(system, at(share * mu))
    assert [p / mu for _, p, _ in trail.eased(LOADED)] == pytest.approx([1.5, 1.0, 0.5])


def test_a_new_path_replaces_what_lies_beyond_its_start(system: SealSystem) -> None:
    trail, finer = Trail(), build_system(LOADED.model_copy(update={"density": 2}))
    for pressure in (1.0, 3.0, 6.0, 9.0):
        trail.keep(system, at(pressure))
    trail.begin(3.0)
    trail.keep(finer, at(4.0))
    found = [(mesh is finer, p) for mesh, p, _ in trail.eased(LOADED)]
    assert found == [(True, 4.0), (False, 1.0)]


def test_nothing_is_known_before_a_path_and_nothing_gained_at_the_pressure_itself(
    system: SealSystem,
) -> None:
    trail = Trail()
    assert not trail.eased(LOADED)
    trail.keep(system, at(0.0))
    trail.keep(system, at(9.9))
    assert not trail.eased(LOADED)


def test_contact_above_three_shear_moduli_is_not_walked_from_rest_on_every_mesh() -> None:
    """189 factorisations; from rest on each of the four meshes it is more than 4 times 93."""
    p = ORing(
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
    found = ContactRoute(PathSettings(), driver.follow).contact(p)
    assert not isinstance(found, StageFailed)
    assert sum(record.factorisations or 0 for record in driver.records) < 250
    system, x = found
    problem = contact_problem(system, PathSettings(), p.sealed_pressure)
    assert problem.norm(problem.residual(x)) < 1e-8
