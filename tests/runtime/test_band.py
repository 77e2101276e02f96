"""Bands whose unknowns come in groups: as a dense solve, and left alone where they have none."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.runtime.cut import Cut, Parts
from softehl.runtime.solve.condensed import eliminated_own

SEGMENTS = 7


def chain(order: int, *, ends: bool, seed: int = 1) -> np.ndarray:
    """A matrix of elements along a chain, of so many unknowns each, with or without its ends."""
    rng, n = np.random.default_rng(seed), SEGMENTS * order + 1
    A = np.zeros((n, n))
    for first in range(0, n - 1, order):
        part = slice(first, first + order + 1)
        A[part, part] += rng.normal(size=(order + 1, order + 1)) + 4.0 * np.eye(order + 1)
    return A if ends else A[1:-1, 1:-1]


def groups_of(A: np.ndarray) -> object:
    K = csc_array(A)
    return Cut.of(K.indptr, K.indices, 0, K.shape[0]).groups


@pytest.mark.parametrize("ends", [True, False])
@pytest.mark.parametrize("order", [3, 4, 5, 8])
def test_groups_are_solved_like_the_whole(order: int, ends: bool) -> None:
    A = chain(order, ends=ends)
    b = np.random.default_rng(2).normal(size=(len(A), 11))
    assert groups_of(A) is not None
    found = eliminated_own(Parts.of(csc_array(A), 0), b.copy())
    assert found == pytest.approx(np.linalg.solve(A, b), rel=1e-9, abs=1e-11)


def test_a_singular_group_is_left_to_the_band() -> None:
    A = chain(3, ends=True)
    A[4:6, 4:6] = 0.0
    assert groups_of(A) is not None
    b = np.ones((len(A), 2))
    found = eliminated_own(Parts.of(csc_array(A), 0), b.copy())
    assert found == pytest.approx(np.linalg.solve(A, b), rel=1e-9)


@pytest.mark.parametrize("width", [0, 1, 2])
def test_a_plain_band_has_no_groups(width: int) -> None:
    n = 20
    A = sum(np.eye(n, k=k) for k in range(-width, width + 1)) + 3.0 * np.eye(n)
    assert groups_of(A) is None
    b = np.arange(2.0 * n).reshape(n, 2)
    found = eliminated_own(Parts.of(csc_array(A), 0), b.copy())
    assert found == pytest.approx(np.linalg.solve(A, b))
