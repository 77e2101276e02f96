"""Condensation by one factorisation with the boundary last, against that by solves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.runtime.arrays import Integers
from softehl.runtime.solve.linear import superlu
from softehl.runtime.solve.linear.schur_complement import SchurByFactors, SchurBySolves
from softehl.runtime.solve.linear.superlu import SuperLU

SIDE, HELD = 9, 4
N = SIDE * SIDE + HELD
"""A square of unknowns, and multipliers that hold some of its first ones."""

BOUNDARY: Integers = np.array([40, 3, 72, N - 1])
"""Inside, at a held unknown, at the edge, and a multiplier; in no order."""


def body(rng: np.random.Generator, *, floating: bool = False) -> csc_array[np.float64]:
    """Unsymmetric in value, symmetric in pattern, with zeros on the diagonal of multipliers."""
    A = np.zeros((N, N))
    for k in range(SIDE * SIDE):
        for j in (k + 1, k + SIDE):
            if j < SIDE * SIDE and (j != k + 1 or j % SIDE):
                A[k, j], A[j, k] = -1.0, -1.0 if floating else -rng.uniform(0.5, 1.5)
    A -= np.diag(A.sum(axis=1) - (0.0 if floating else 0.1))
    for k in range(HELD):
        m = SIDE * SIDE + k
        A[m, k] = A[k, m] = 0.0 if floating else 1e3
        A[m, m] = 1.0 if floating else 0.0
    A[np.arange(N), np.arange(N)] += 0.0
    pattern = A != 0.0
    np.fill_diagonal(pattern, val=True)
    columns, rows = np.nonzero(pattern.T)
    starts = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
    return csc_array((A[rows, columns], rows, starts), shape=(N, N))


def compare(A: Any, rng: np.random.Generator, tolerance: float) -> None:
    solver = SuperLU()
    c, reference = solver.condense(A, BOUNDARY), SchurBySolves.of(A, BOUNDARY, solver.factors)
    assert isinstance(c, SchurByFactors)
    assert c.schur == pytest.approx(reference.schur, rel=tolerance, abs=tolerance)
    r, x = rng.normal(size=N), rng.normal(size=len(BOUNDARY))
    (g, reduced), (wanted, other) = c.reduce(r), reference.reduce(r)
    assert g == pytest.approx(wanted, rel=tolerance, abs=tolerance)
    extended = reference.extend(other, x)
    assert c.extend(reduced, x) == pytest.approx(extended, rel=tolerance, abs=tolerance)


def test_it_is_that_of_solves(rng: np.random.Generator) -> None:
    compare(body(rng), rng, 1e-11)


def test_a_body_that_floats_is_condensed_too(rng: np.random.Generator) -> None:
    A = body(rng, floating=True)
    assert np.linalg.matrix_rank(A.toarray()) == N - 1
    compare(A, rng, 1e-9)


def test_an_order_serves_all_matrices_of_a_pattern(rng: np.random.Generator) -> None:
    solver, first, second = SuperLU(), body(rng), body(rng)
    b = rng.normal(size=N)
    for A in (first, second, first):
        x = solver.factorise(A).solve(b)
        assert A @ x == pytest.approx(b, abs=1e-10)
        assert len(solver.orders.orders) == 1
        assert SuperLU().factorise(A).solve(b) == pytest.approx(x, rel=1e-9)
    for A in (first, second):
        solver.condense(A, BOUNDARY)
        assert len(solver.orders.orders) == 2
    for k in range(10):
        solver.condense(first, BOUNDARY[k % 4 :])
        assert len(solver.orders.orders) <= solver.orders.max_orders


def test_what_is_too_large_goes_by_solves(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(superlu, "MOST_COPIED", 10)
    assert isinstance(SuperLU().condense(body(rng), BOUNDARY), SchurBySolves)
