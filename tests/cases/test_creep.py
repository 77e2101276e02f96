"""A section that creeps to its contact."""

from dataclasses import replace

import numpy as np
import pytest

from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact_solver import ContactSolver, CreepCorrector, Creeping
from softehl.cases.seal.solve.contact_stages import approach_stage, at_air_wall, contact_problem
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton

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
