"""Sparse LU: closed-form systems, weak pivots, and matrices that must be refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import SingularMatrix, SparseMatrix
from softehl.runtime.solve.linear.superlu import SuperLU


def laplacian(n: int) -> Array:
    """Second differences on n inner points of (0, 1), dense."""
    return (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) * (n + 1.0) ** 2


def grid(n: int) -> SparseMatrix:
    """Five-point Laplacian on n x n points, made unsymmetric in value by convection."""
    convected = laplacian(n) + (n + 1.0) * np.eye(n, k=1)
    return csc_array(np.kron(convected, np.eye(n)) + np.kron(np.eye(n), laplacian(n)))


def test_multiplier_rows_with_zero_diagonal_are_solved() -> None:
    # min |x|^2 / 2 - b.x with sum x = 0: x = b - mean b, multiplier mean b.
    b = np.arange(5.0) ** 2
    K = np.pad(np.eye(5), (0, 1), constant_values=1.0)
    K[5, 5] = 0.0
    solution = SuperLU().factorise(csc_array(K)).solve(np.append(b, 0.0))
    assert solution == pytest.approx([*(b - b.mean()), b.mean()], rel=1e-14)


def test_refinement_gives_back_the_digits_of_weak_pivots() -> None:
    # [[e, 1], [1, 1]] x = (1, 2): x = (1 / (1 - e), (1 - 2 e) / (1 - e)); pivot e loses 1/e.
    e = 1e-9
    K = csc_array(np.array([[e, 1.0], [1.0, 1.0]]))
    exact, b = np.array([1.0, 1.0 - 2.0 * e]) / (1.0 - e), np.array([1.0, 2.0])
    errors = [
        np.abs(SuperLU("NATURAL", True, 0.0, refinement).factorise(K).solve(b) - exact).max()
        for refinement in (0, 1)
    ]
    assert errors[0] > 1e-9
    assert errors[1] < 1e-14


def test_units_of_unknowns_change_nothing() -> None:
    """Springs that a multiplier in small units holds; also by the factors of the transpose."""
    a, b, c, unit = 0.1, 0.3, 0.7, 2.0**-60
    K = np.zeros((5, 5))
    for i, k in enumerate((a, b, c)):
        K[i : i + 2, i : i + 2] += [[k, -k], [-k, k]]
    K[0, 4] = K[4, 0] = unit
    factors = SuperLU("NATURAL").factorise(csc_array(K))
    turned = factors.transposed()
    assert factors.units is not None
    assert turned is not None
    pulled = [0.0, 1 / a, 1 / a + 1 / b, 1 / a + 1 / b + 1 / c, 1 / unit]
    for one in (factors, turned):
        assert one.solve(np.array([0.0, 0, 0, 1, 0])) == pytest.approx(pulled, rel=1e-14)


def test_solution_ruined_by_weak_pivots_is_refused() -> None:
    K = csc_array(np.array([[1e-20, 1.0], [1.0, 1.0]]))
    solver = SuperLU("NATURAL", pivot_threshold=0.0, refinement=0)
    factors = solver.factorise(K)
    with pytest.raises(SingularMatrix, match="backward error"):
        factors.solve(np.array([1.0, 2.0]))
    good = SuperLU().factorise(K).solve(np.array([1.0, 2.0]))
    assert good == pytest.approx([1.0, 1.0], rel=1e-14)


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([[1.0, 2.0], [0.0, 0.0]], "row 1 of the matrix is zero"),
        ([[0.0, 2.0], [0.0, 1.0]], "no LU factors"),
        ([[2.0, 1.0], [1.0, 0.5]], "no LU factors"),
        ([[1.0, math.nan], [0.0, 1.0]], "entries that are not finite"),
        ([[1.0, math.inf], [0.0, 1.0]], "entries that are not finite"),
    ],
)
def test_singular_or_not_finite_is_refused(rows: list[list[float]], reason: str) -> None:
    with pytest.raises(SingularMatrix, match=reason):
        SuperLU().factorise(csc_array(np.array(rows)))


def test_right_side_that_is_not_finite_is_refused() -> None:
    factors = SuperLU().factorise(csc_array(laplacian(3)))
    with pytest.raises(SingularMatrix, match="not finite"):
        factors.solve(np.array([1.0, math.nan, 1.0]))


def fill(K: SparseMatrix, solver: SuperLU) -> int:
    return int(solver.factors(K).nnz)


def test_factors_do_not_depend_on_what_was_factorised_before() -> None:
    used, b = SuperLU(), np.cos(np.arange(400.0))
    for K in (grid(20), 2.0 * grid(20), grid(20)):
        now = used.factorise(csc_array(K)).solve(b)
        assert np.array_equal(now, SuperLU().factorise(csc_array(K)).solve(b))
    assert len(used.orders.orders) == 1


def test_default_ordering_makes_less_fill_than_colamd_and_solves_as_well() -> None:
    K = grid(40)
    colamd = SuperLU("COLAMD", symmetric_mode=False, pivot_threshold=1.0)
    assert fill(K, SuperLU()) < 0.8 * fill(K, colamd)
    x = np.cos(np.arange(1600.0))
    assert SuperLU().factorise(K).solve(K @ x) == pytest.approx(x, abs=1e-11)
