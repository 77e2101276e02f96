"""The tangent with a lagged element pressure: consistency, the volume's derivatives, evolution."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.cases.seal.correctors.perturbed_lagrangian import LaggedPressure, element_pressures
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.solve.contact_stages import contact_problem
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.kernel import load_kernel
from tests.cases.oring_cases import oring

KAPPA = 500.0


@pytest.fixture(scope="module")
def system() -> SealSystem:
    return build_system(oring(density=1))


@pytest.fixture(scope="module")
def problem(system: SealSystem) -> Problem:
    return contact_problem(system, 1.0)


@pytest.fixture
def state(system: SealSystem, rng: np.random.Generator) -> Array:
    x = system.at_rest()
    u = 0.02 * (system.mesh.points - system.mesh.points.mean(axis=0))
    system.displacements(x)[:] = u + (1e-4 * rng.normal(size=u.size)).reshape(u.shape)
    return x


def lagged(problem: Problem, pressures: Array) -> LaggedPressure:
    return LaggedPressure.of(
        problem, ("solid",), load_kernel("follower_pressure"), pressures, KAPPA
    )


def volumes(system: SealSystem, x: Array) -> Array:
    """Volumes of the rings by Pappus: area times the path of the centroid, in closed form."""
    a = system.deformed(x)[system.mesh.quads]
    b = np.roll(a, -1, axis=1)
    cross = a[..., 0] * b[..., 1] - b[..., 0] * a[..., 1]
    return np.asarray(2.0 * np.pi * ((a[..., 1] + b[..., 1]) * cross).sum(axis=1) / 6.0)


def test_with_the_true_pressures_the_tangent_is_the_problem_s(
    problem: Problem, state: Array
) -> None:
    own = lagged(problem, element_pressures(problem, ("solid",), state))
    r, K = own.linearise(state)
    r0, K0 = problem.linearise(state)
    assert np.array_equal(r, r0)
    assert np.array_equal(r, own.residual(state)) or r == pytest.approx(own.residual(state))
    assert K.data == pytest.approx(K0.data, rel=1e-12, abs=1e-9)


def test_an_excess_pressure_adds_the_second_derivative_of_the_volume(
    system: SealSystem, problem: Problem, state: Array, rng: np.random.Generator
) -> None:
    excess = rng.normal(size=len(system.mesh.quads))
    pressures = element_pressures(problem, ("solid",), state)
    dx = np.zeros_like(state)
    moved = system.displacements(dx)
    moved[:] = rng.normal(size=moved.shape)
    added = lagged(problem, pressures + excess).linearise(state)[1] @ dx
    added = added - problem.linearise(state)[1] @ dx
    h = 1e-3
    second = volumes(system, state + h * dx) - 2 * volumes(system, state)
    second = (second + volumes(system, state - h * dx)) / h**2
    assert dx @ added == pytest.approx(excess @ second, rel=1e-6)


def test_pressures_follow_the_linearised_volume(
    system: SealSystem, problem: Problem, state: Array, rng: np.random.Generator
) -> None:
    start = lagged(problem, np.zeros(len(system.mesh.quads)))
    assert start.volumes == pytest.approx(volumes(system, system.at_rest()), rel=1e-3)
    dx = np.zeros_like(state)
    moved = system.displacements(dx)
    moved[:] = 1e-7 * rng.normal(size=moved.shape)
    change = KAPPA * (volumes(system, state + dx) - volumes(system, state)) / start.volumes
    pressures = start.after(state, state + dx).pressures
    before = element_pressures(problem, ("solid",), state)
    assert pressures - before == pytest.approx(change, rel=1e-4, abs=1e-8)
    assert np.abs(change).max() > 1e-5  # there was something to see
