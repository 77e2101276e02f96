"""From mesh to mesh: linear fields exactly, nothing across a mouth, chains keep their bounds."""

from fractions import Fraction

import numpy as np
import pytest

from softehl.cases.seal.meshing.mesh_transfer import (
    places_of,
    transfer_boundary,
    transfer_chain,
    transfer_elements,
    transfer_nodes,
)
from softehl.cases.seal.meshing.outline import Outline, Shape, rounded
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.meshing.section_mesher import Sizes, section_mesh
from softehl.cases.seal.meshing.spacing import Spot, graded
from tests.runtime.test_outline_mesh import SHAPES

FORK = [(0, 0), (4, 0), (4, 1.0), (0.5, 1.0), (0.5, 1.3), (4, 1.3), (4, 2.3), (0, 2.3)]


def meshes(name: str) -> tuple[SectionMesh, SectionMesh]:
    """One of equal segments, and one of other segments on another part of the outline."""
    shape = SHAPES[name]
    film = shape.film[0] + 0.1, shape.film[1] - 0.2
    length = film[1] - film[0]
    fine = graded(length, (Spot(0.5), Spot(1.5)), 84, coarsest=0.1 * length, rate=0.3)
    old = section_mesh(shape, shape.film, Sizes(33), 2)
    return old, section_mesh(shape, film, Sizes(42, fine, 0.01), 2)


@pytest.mark.parametrize("name", SHAPES)
def test_linear_fields_are_exact_and_quadratic_ones_nearly(name: str) -> None:
    old, new = meshes(name)
    sag = 0.006  # of the old boundary: what is outside gets what is nearest
    assert transfer_nodes(old, new, old.points) == pytest.approx(new.points, abs=sag)
    inside = np.setdiff1d(np.arange(len(new.points)), np.unique(new.quads[: len(new.boundary)]))
    moved = transfer_nodes(old, new, old.points)[inside]
    away = np.abs(moved - new.points[inside]).max(axis=1)
    assert np.quantile(away, 0.9) < 1e-12
    z = old.points[:, :1]
    error = np.abs(transfer_nodes(old, new, z**2) - new.points[:, :1] ** 2).max()
    assert 1e-6 < error < 0.05
    same = transfer_nodes(old, old, np.sin(old.points))
    assert same == pytest.approx(np.sin(old.points), abs=1e-12)


@pytest.mark.parametrize("name", SHAPES)
def test_values_of_elements_are_those_at_their_middles(name: str) -> None:
    old, new = meshes(name)
    values = old.points[old.quads].mean(axis=1)[:, 0]
    moved = transfer_elements(old, new, values)
    sides = np.ptp(old.points[old.quads], axis=1).max()
    assert np.abs(moved - new.points[new.quads].mean(axis=1)[:, 0]).max() < sides
    assert (transfer_elements(old, old, values) == values).all()


def test_nothing_is_carried_across_a_mouth() -> None:
    """Two arms 0.3 mm apart, one of which has moved."""
    shape = Shape(Outline(rounded(FORK, 0.1)), (0.0, 4.0), (12.0, 0.0), "fork")
    old, new = (section_mesh(shape, shape.film, Sizes(33), d) for d in (1, Fraction(4, 3)))

    def moved(mesh: SectionMesh) -> np.ndarray:
        z, r = mesh.points.T
        return np.where(r > 1.15, np.maximum(z - 0.5, 0.0) ** 2, 0.0)[:, None]

    assert transfer_nodes(old, new, moved(old)) == pytest.approx(moved(new), abs=0.05)


@pytest.mark.parametrize("name", SHAPES)
def test_places_carry_the_boundary(name: str) -> None:
    old, new = meshes(name)

    def wave(mesh: SectionMesh) -> np.ndarray:
        return np.asarray(np.cos(2.0 * np.pi * mesh.positions / mesh.length))

    assert transfer_boundary(old, new, wave(old)) == pytest.approx(wave(new), abs=0.01)
    for part in ("arc_nodes", "outer_nodes"):
        nodes, new_nodes = getattr(old, part), getattr(new, part)
        values = np.zeros(len(nodes))
        values[5:9] = -3.0
        chain = transfer_chain(old, new, nodes, new_nodes, values)
        assert -3.0 <= chain.min() < -2.5
        assert chain.max() <= 0.0
    ends = places_of(old, old.outer_nodes)
    outer = transfer_chain(old, new, old.outer_nodes, new.outer_nodes, ends)
    expected = np.clip(places_of(new, new.outer_nodes), *ends[[0, -1]])
    assert outer == pytest.approx(expected, abs=1e-12)
