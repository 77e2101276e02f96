"""PARDISO against closed forms, singular matrices, other matrices of a pattern, its memory."""

from __future__ import annotations

import gc
import math
import resource

import numpy as np
import pytest
from scipy.sparse import csc_array, random_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import pardiso
from softehl.runtime.solve.linear.direct import MissingBackend, direct_solver
from softehl.runtime.solve.linear.linear_solver import Factorisation, LinearSolver, SingularMatrix
from softehl.runtime.solve.linear.pardiso import Idle, Pardiso
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Status
from tests.runtime.test_linear import grid, laplacian

installed = pytest.mark.skipif(not pardiso.available(), reason="the extra `fast` is not installed")
GENERAL, SYMMETRIC = 11, 1


def kind(factors: Factorisation) -> int:
    """Matrix type that was chosen."""
    return int(factors.factors.handle.structure.kind)


def test_auto_is_superlu_where_pardiso_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pardiso, "available", lambda: False)
    assert direct_solver("auto") == direct_solver("superlu") == SuperLU()
    with pytest.raises(MissingBackend, match=r'allowed here: "auto" or "superlu"'):
        direct_solver("pardiso")


@installed
def test_auto_is_pardiso_where_it_is_installed() -> None:
    assert direct_solver("auto").name == direct_solver("pardiso").name == "pardiso"
    assert direct_solver("superlu").name == "superlu"


@installed
def test_second_differences_reproduce_the_parabola() -> None:
    x = np.linspace(0.0, 1.0, 101)[1:-1]
    factors = Pardiso().factorise(csc_array(laplacian(99)))
    assert kind(factors) == SYMMETRIC
    assert factors.solve(np.ones(99)) == pytest.approx(x * (1.0 - x) / 2.0, rel=1e-11)


@installed
def test_patterns_that_are_not_symmetric_are_solved_as_general_ones() -> None:
    upper = csc_array(np.triu(np.ones((6, 6))))
    factors = Pardiso().factorise(upper)
    assert kind(factors) == GENERAL
    assert factors.solve(np.ones(6)) == pytest.approx([0, 0, 0, 0, 0, 1], abs=1e-14)
    no_diagonal = csc_array(np.array([[0.0, 2.0], [4.0, 0.0]]))
    assert Pardiso().factorise(no_diagonal).solve(np.array([2.0, 4.0])) == pytest.approx([1.0, 1.0])


@installed
def test_agrees_with_superlu(rng: np.random.Generator) -> None:
    K = csc_array(random_array((300, 300), density=0.02, rng=rng) + 5.0 * np.eye(300))
    b = rng.normal(size=300)
    x = Pardiso().factorise(K).solve(b)
    assert x == pytest.approx(SuperLU().factorise(K).solve(b), rel=1e-10)
    assert b == pytest.approx(K @ x, abs=1e-11)


@installed
@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([[1.0, 2.0], [0.0, 0.0]], "row 1 of the matrix is zero"),
        ([[0.0, 2.0], [0.0, 1.0]], "singular"),
        ([[2.0, 1.0], [1.0, 0.5]], "singular"),
        ([[1.0, math.nan], [0.0, 1.0]], "entries that are not finite"),
    ],
)
def test_singular_or_not_finite_is_refused(rows: list[list[float]], reason: str) -> None:
    with pytest.raises(SingularMatrix, match=reason):
        Pardiso().factorise(csc_array(np.array(rows))).solve(np.array([1.0, 2.3]))


@installed
def test_a_pattern_is_analysed_once_and_factors_in_use_are_left_alone() -> None:
    solver, K, b = Pardiso(), grid(8), np.ones(64)
    first = solver.factorise(K)
    second = solver.factorise(csc_array(2.0 * K))
    assert first.factors.handle is not second.factors.handle
    assert first.solve(b) == pytest.approx(2.0 * second.solve(b), rel=1e-12)
    handle = first.factors.handle
    del first
    third = solver.factorise(csc_array(4.0 * K))
    assert third.factors.handle is handle  # nobody used it any more
    assert second.solve(b) == pytest.approx(2.0 * third.solve(b), rel=1e-12)
    other = solver.factorise(grid(7))
    assert other.factors.handle not in (handle, second.factors.handle)


@installed
def test_memory_of_forgotten_factors_is_freed() -> None:
    def megabytes() -> float:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    solver = Pardiso(idle=Idle(keep=1))
    shapes = [25 + k % 3 for k in range(60)]  # patterns take turns: none is idle when it is needed
    grids = {n: grid(n) for n in set(shapes)}
    for n in shapes[:6]:
        solver.factorise(grids[n]).solve(np.ones(n * n))
    before = megabytes()
    for n in shapes:
        solver.factorise(grids[n]).solve(np.ones(n * n))
    gc.collect()
    assert megabytes() < before + 10.0
    assert len(solver.idle.handles) == 1


@installed
def test_the_wrong_factors_are_noticed() -> None:
    """The check of the solution must fail where the factors belong to another matrix."""
    solver = Pardiso()
    factors = solver.factorise(grid(8))
    factors.factors.handle.factorise(csc_array(3.0 * grid(8)), np.empty(0))
    with pytest.raises(SingularMatrix):
        factors.solve(np.ones(64))


class Cubic:
    """x_i^3 - x_(i+1) = c, cyclic, with the solution x = 2 everywhere for c = 6."""

    def residual(self, x: Array) -> Array:
        return x**3 - np.roll(x, -1) - 6.0

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        K = np.diag(3.0 * x**2) - np.roll(np.eye(len(x)), 1, axis=1)
        return self.residual(x), csc_array(K)

    def norm(self, r: Array) -> float:
        return float(np.abs(r).max())

    def step_limit(self, x: Array, dx: Array) -> float:
        return 1.0


@installed
@pytest.mark.parametrize("linear", [Pardiso(), SuperLU()], ids=["pardiso", "superlu"])
def test_newton_takes_either_solver(linear: LinearSolver) -> None:
    solution = Newton(linear=linear).solve(Cubic(), np.full(5, 3.0))
    assert solution.x == pytest.approx(np.full(5, 2.0), rel=1e-12)
    singular = Newton(linear=linear).solve(Cubic(), np.zeros(5) + math.sqrt(1.0 / 3.0))
    assert singular.status is Status.SINGULAR
