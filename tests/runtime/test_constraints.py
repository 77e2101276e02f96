"""The map u = T z + g of constraints against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.constraints import (
    Constraints,
    dependent_tie,
    tied_groups,
)
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import Tie

N = 12
TIES = np.array([[7, 2, 10], [2, 5, 11], [4, 8, 9]])
"""7, 2 and 5 move as one; 4 and 8 do not move, for 8 is prescribed; 9 to 11 are the forces."""
FIXED, VALUES = np.array([8, 1]), np.array([0.5, -2.0])


def constraints() -> Constraints:
    block = ElementBlock("tie", Tie(0.0), np.zeros((3, 1)), TIES)
    return Constraints.of(Assembler.build(N, [block]), FIXED, VALUES)


def equations(ties: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Rows of all equations that a change of the unknowns satisfies, forces left out."""
    rows = np.eye(N)[ties[:, 0]] - np.eye(N)[ties[:, 1]]
    return np.concatenate([rows, np.eye(N)[fixed], np.eye(N)[ties[:, 2]]])


def test_the_map_spans_what_supports_and_ties_admit(rng: np.random.Generator) -> None:
    c, B = constraints(), equations(TIES, FIXED)
    T = c.T.toarray()
    assert T.shape == (N, null_space(B).shape[1])
    assert np.linalg.matrix_rank(T) == T.shape[1]
    np.testing.assert_array_equal(B @ T, 0.0)
    z, f = rng.normal(size=T.shape[1]), rng.normal(size=N)
    np.testing.assert_array_equal(c.expand(z), T @ z)
    np.testing.assert_allclose(c.gather(f), T.T @ f, rtol=1e-15)
    assert np.abs(equations(TIES, FIXED + 1) @ T).max() == 1.0  # other supports are seen


def test_the_map_of_a_level_has_the_first_unknown_of_a_group_as_master() -> None:
    numbers = np.array([5, 0, 8, 7, 4])
    level = constraints().restricted(numbers)
    assert level.masters[3] == 0  # 7 follows 5
    assert level.moving.tolist() == [True, True, False, False, False]
    assert level.g.tolist() == [0.0, 0.0, 0.5, 0.0, 0.0]
    x = np.array([1.0, 2.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(level.square @ x, [1.0, 2.0, 0.0, 1.0, 0.0])
    level.copy_to_slaves(x)
    assert x.tolist() == [1.0, 2.0, 0.0, 1.0, 0.0]
    level.collect(x)
    assert x[0] == 2.0


def test_prescribed_values_are_eliminated_exactly(rng: np.random.Generator) -> None:
    """The Newton step of the eliminated equations satisfies the others, from any state."""
    c, K = constraints(), rng.normal(size=(N, N)) + N * np.eye(N)
    x, b = rng.normal(size=N), rng.normal(size=N)
    r = c.residual(K @ x - b, c.deviation(x), K.__matmul__)
    eliminated = np.where(c.prescribed[:, None] | c.prescribed[None], np.eye(N), K)
    y = x - np.linalg.solve(eliminated, r)
    np.testing.assert_allclose(y[FIXED], VALUES, rtol=1e-14)
    np.testing.assert_allclose((K @ y - b)[~c.prescribed], 0.0, atol=1e-12)
    np.testing.assert_array_equal(c.admissible(x)[FIXED], VALUES)


@pytest.mark.parametrize("n_ties", [0, 3, 12, 40])
def test_groups_are_the_connected_unknowns(n_ties: int, rng: np.random.Generator) -> None:
    a, b = rng.integers(0, 30, (2, n_ties))
    groups = tied_groups(a, b, 30)
    labels = connected_components(csr_array((np.ones(n_ties), (a, b)), (30, 30)), directed=False)[1]
    first = [int(np.flatnonzero(labels == label)[0]) for label in labels]
    assert groups.tolist() == first


@pytest.mark.parametrize(
    ("extra", "fixed", "number"),
    [
        *(([5, 7, 9], [], 3), ([0, 0, 9], [], 3), ([5, 4, 9], [8, 7], 3)),
        *(([5, 4, 9], [8], None), ([6, 0, 9], [8, 4], 2)),
    ],
)
def test_the_tie_that_closes_a_circle(
    extra: list[int], fixed: list[int], number: int | None
) -> None:
    """As the rank of the equations without prescribed unknowns falls."""
    prescribed = np.zeros(N, dtype=bool)
    prescribed[fixed] = True
    ties = np.vstack([TIES, extra])
    assert dependent_tie(ties, prescribed) == number
    B = (np.eye(N)[ties[:, 0]] - np.eye(N)[ties[:, 1]])[:, ~prescribed]
    ranks = [int(np.linalg.matrix_rank(B[:k])) for k in range(1, len(B) + 1)]
    assert next((k for k, rank in enumerate(ranks) if rank == k), None) == number
