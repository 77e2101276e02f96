"""Prolongation to twice the density and back: polynomials, the mesh itself, chains, cells."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from softehl.runtime.mesh.prolongation import (
    node_blocks,
    prolong_chain,
    prolong_elements,
    prolong_nodes,
    resampled_elements,
    resampled_nodes,
    restrict_chain,
    restrict_elements,
    restrict_nodes,
)
from softehl.runtime.mesh.sections import Disc, disc_mesh

DISC = Disc(0.0, 26.0, 1.7, -34.0, 43.0)


@pytest.mark.parametrize("density", [1, 2, 3])
def test_blocks_hold_all_nodes_in_the_order_of_the_mesh(density: int) -> None:
    mesh = disc_mesh(DISC, density)
    blocks = node_blocks(density)
    assert np.array_equal(
        np.unique(np.concatenate([b.ravel() for b in blocks])), range(len(mesh.points))
    )
    # every cell of a block is a quadrilateral of the mesh
    quads = {frozenset(quad) for quad in mesh.quads.tolist()}
    cells = {
        frozenset((int(b[i, j]), int(b[i + 1, j]), int(b[i, j + 1]), int(b[i + 1, j + 1])))
        for b in blocks
        for i in range(b.shape[0] - 1)
        for j in range(b.shape[1] - 1)
    }
    assert cells == quads


def test_the_finer_mesh_is_nearly_the_prolonged_one() -> None:
    errors = []
    for density in (1, 2, 4):
        coarse, fine = disc_mesh(DISC, density), disc_mesh(DISC, 2 * density)
        prolonged = prolong_nodes(coarse.points, density)
        assert prolonged.shape == fine.points.shape
        errors.append(np.abs(prolonged - fine.points).max())
    assert errors[0] < 1e-2
    # fourth order in the mesh width, as cubic splines are
    assert errors[1] < errors[0] / 8.0
    assert errors[2] < errors[1] / 8.0


def test_common_nodes_keep_their_values(rng: np.random.Generator) -> None:
    values = rng.normal(size=(len(disc_mesh(DISC, 1).points), 2))
    prolonged = prolong_nodes(values, 1)
    for old, new in zip(node_blocks(1), node_blocks(2), strict=True):
        assert prolonged[new[::2, ::2]] == pytest.approx(values[old], abs=1e-12)


def test_cells_of_a_plane_field_stay_on_the_plane() -> None:
    def centres(density: int) -> tuple[np.ndarray, ...]:
        long, short = 27 * density, 6 * density
        j, i = (np.arange(k) + 0.5 for k in (long, short))
        return i[:, None] / density, j[None, :] / density

    values = np.zeros(360)
    i, j = centres(1)
    values[198:] = (2.0 + 3.0 * i - 0.5 * j).ravel()
    i, j = centres(2)
    expected = 2.0 + 3.0 * i - 0.5 * j
    fine = prolong_elements(values, 1)[198 * 4 :].reshape(expected.shape)
    assert fine[1:-1, 1:-1] == pytest.approx(expected[1:-1, 1:-1], abs=1e-12)
    assert fine[0, 0] == pytest.approx(values[198])  # constant beyond the outermost centre


def test_cells_keep_a_constant_and_their_mean(rng: np.random.Generator) -> None:
    assert prolong_elements(np.full(360, 7.0), 1) == pytest.approx(np.full(1440, 7.0))
    ring = np.zeros(360)
    ring[:66] = rng.normal(size=66)  # the outermost layer, which closes upon itself
    fine = prolong_elements(ring, 1)[: 2 * 132].reshape(2, 132)
    assert fine[0].mean() == pytest.approx(ring[:66].mean())


def test_chain() -> None:
    assert prolong_chain(np.array([1.0, 3.0, 2.0])).tolist() == [1.0, 2.0, 3.0, 2.5, 2.0]


@pytest.mark.parametrize("density", [2, 4])
def test_nodes_restricted_are_those_of_the_coarser_mesh(density: int) -> None:
    coarse, fine = disc_mesh(DISC, density // 2), disc_mesh(DISC, density)
    assert restrict_nodes(fine.points, density) == pytest.approx(coarse.points, abs=1e-13)


def test_elements_restricted_keep_their_sum_and_place() -> None:
    fine = disc_mesh(DISC, 2)
    centres = fine.points[fine.quads].mean(axis=1)
    coarse = disc_mesh(DISC, 1)
    expected = coarse.points[coarse.quads].mean(axis=1)
    for k in (0, 1):
        found = restrict_elements(centres[:, k].copy(), 2)
        assert 4.0 * found.sum() == pytest.approx(centres[:, k].sum())
        assert found == pytest.approx(expected[:, k], abs=0.02)


def test_restriction_undoes_prolongation(rng: np.random.Generator) -> None:
    values = rng.normal(size=(len(disc_mesh(DISC, 1).points), 2))
    assert restrict_nodes(prolong_nodes(values, 1), 2) == pytest.approx(values)
    chain = rng.normal(size=7)
    assert restrict_chain(prolong_chain(chain)).tolist() == chain.tolist()


@pytest.mark.parametrize("parts", [(27, 6, 3), (33, 6, 6)])
def test_a_mesh_of_any_density_is_nearly_the_resampled_one(parts: tuple[int, int, int]) -> None:
    disc = Disc(0.0, 26.0, 1.7, -34.0, 43.0, long=parts[0], layers=parts[2])
    finer, coarser = disc_mesh(disc, 2), disc_mesh(disc, Fraction(5, 3))
    found = resampled_nodes(finer.points, 2, Fraction(5, 3), parts)
    assert found == pytest.approx(coarser.points, abs=1e-4)
    before, after = (mesh.points[mesh.quads].mean(axis=1)[:, 0] for mesh in (finer, coarser))
    found = resampled_elements(before.copy(), 2, Fraction(5, 3), parts)
    assert found == pytest.approx(after, abs=0.02)
    assert resampled_elements(before[::-1].copy(), 2, Fraction(5, 3), parts) != pytest.approx(
        after, abs=0.02
    )
