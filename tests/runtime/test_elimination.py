"""Chains that are eliminated piece by piece: as a dense solve, and left whole where that fails."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.cases.seal.correctors.chord_newton import solved
from softehl.cases.seal.correctors.layer_split import Cut, Parts
from softehl.cases.seal.correctors.nested_dissection import Elimination
from softehl.runtime.solve.linear.linear_solver import SingularMatrix

SEGMENTS, SHARED = 23, 26


def chain(order: int, fields: int, *, ends: bool, seed: int = 1) -> np.ndarray:
    """A matrix of elements along a chain, of so many nodes each, with or without its ends.

    Each element knows two of the first unknowns, which it shares with others.
    """
    rng, n = np.random.default_rng(seed), (SEGMENTS * order + 1) * fields
    A = np.zeros((SHARED + n, SHARED + n))
    for element in range(SEGMENTS):
        first = SHARED + element * order * fields
        part = np.append([element, element + 3], first + np.arange((order + 1) * fields))
        A[np.ix_(part, part)] += rng.normal(size=(len(part),) * 2) + 4.0 * np.eye(len(part))
    if ends:
        return A
    inside = np.r_[:SHARED, SHARED + fields : SHARED + n - fields]
    return np.asarray(A[np.ix_(inside, inside)])


def band(width: int, n: int = 80) -> np.ndarray:
    return sum(np.eye(n, k=k) for k in range(-width, width + 1)) + 3.0 * np.eye(n)


def elimination(A: np.ndarray, m: int) -> Elimination:
    K = csc_array(A)
    return Cut.of(K.indptr, K.indices, m, len(A)).elimination


def check(A: np.ndarray, m: int) -> None:
    rng = np.random.default_rng(2)
    S, r = rng.normal(size=(m, m)), rng.normal(size=len(A))
    whole = A.copy()
    whole[:m, :m] += S
    found = solved(S, Parts.of(csc_array(A), m), r)
    assert found == pytest.approx(np.linalg.solve(whole, r), rel=1e-9, abs=1e-11)


@pytest.mark.parametrize("ends", [True, False])
@pytest.mark.parametrize(("order", "fields"), [(2, 2), (2, 1), (4, 1), (4, 2), (8, 1)])
def test_pieces_are_solved_like_the_whole(order: int, fields: int, ends: bool) -> None:
    A = chain(order, fields, ends=ends)
    check(A, SHARED)
    assert len(elimination(A, SHARED).remaining) < 0.5 * (len(A) - SHARED) + SHARED


@pytest.mark.parametrize("width", [0, 1, 2, 5, 79])
def test_a_band_of_any_width_is_solved(width: int) -> None:
    check(band(width), 0)


def test_pieces_end_where_few_unknowns_are_between_them() -> None:
    first, *_ = elimination(chain(4, 2, ends=False), SHARED).levels
    assert first.inner.shape == (SEGMENTS, 6)
    assert first.boundary.shape == (SEGMENTS, 2 + 4)


def test_a_singular_piece_is_left_to_the_whole() -> None:
    A = chain(4, 1, ends=True)
    piece = elimination(A, SHARED).levels[0].inner[1]
    piece = piece[piece < len(A)]
    A[np.ix_(piece, piece)] = 1.0  # no entry is left out, and each of its pivots is exact
    check(A, SHARED)


@pytest.mark.parametrize("row", [3, SHARED + 12])
def test_a_singular_whole_is_refused(row: int) -> None:
    A = chain(4, 1, ends=True)
    A[row] = 0.0
    with pytest.raises(SingularMatrix):
        solved(np.zeros((SHARED, SHARED)), Parts.of(csc_array(A), SHARED), np.ones(len(A)))
