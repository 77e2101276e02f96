"""From mesh to mesh: quadratic fields are carried over exactly, chains keep their bounds."""

from dataclasses import replace

import numpy as np
import pytest

from softehl.runtime.mesh.sections import Disc, corner_jacobians, disc_mesh
from softehl.runtime.mesh.spacing import Spot, graded
from softehl.runtime.mesh.transfer import transfer_chain, transfer_elements, transfer_nodes

OLD = disc_mesh(Disc(0.0, 26.0, 1.7, -34.0, 43.0), 2)
NEW = disc_mesh(
    Disc(
        *(0.0, 26.0, 1.7, -34.0, 43.0),
        top=95.0,
        layer_growth=15.0,
        spacing=graded(2.28, (Spot(0.5), Spot(1.6)), 54, coarsest=0.1, rate=0.25),
    ),
    2,
)


def test_quadratic_fields_are_carried_over_exactly() -> None:
    def field(points: np.ndarray) -> np.ndarray:
        z, r = points[:, 0], points[:, 1] - 26.0
        return np.stack([1.0 + z - r**2, z * r + 0.5 * z**2], axis=1)

    assert transfer_nodes(OLD, NEW, field(OLD.points)) == pytest.approx(field(NEW.points), abs=1e-9)


def test_a_cubic_field_is_not() -> None:
    values = OLD.points[:, :1] ** 3
    error = np.abs(transfer_nodes(OLD, NEW, values) - NEW.points[:, :1] ** 3).max()
    assert 1e-9 < error < 1e-2


def test_constant_element_values_stay_constant() -> None:
    constant = np.full(len(OLD.quads), 7.0)
    assert transfer_elements(OLD, NEW, constant) == pytest.approx(np.full(len(NEW.quads), 7.0))


def test_a_mesh_is_carried_over_to_itself() -> None:
    values = np.sin(3.0 * OLD.points)
    assert transfer_nodes(OLD, OLD, values) == pytest.approx(values, abs=1e-12)


@pytest.mark.parametrize("part", ["arc_nodes", "outer_nodes"])
def test_a_chain_keeps_to_the_values_of_its_neighbours(part: str) -> None:
    nodes, new_nodes = getattr(OLD, part), getattr(NEW, part)
    values = np.zeros(len(nodes))
    values[5:9] = -3.0
    moved = transfer_chain(OLD, NEW, nodes, new_nodes, values)
    assert moved.shape == (len(new_nodes),)
    assert -3.0 <= moved.min() < -2.5
    assert moved.max() <= 0.0
    assert moved[[0, -1]].tolist() == [0.0, 0.0]


def test_a_field_on_long_elements_is_bilinear() -> None:
    z, r = np.meshgrid(1e-3 * np.arange(40.0), np.arange(10.0))
    first = 40 * np.arange(9)[:, None] + np.arange(39)
    quads = np.stack([first, first + 1, first + 41, first + 40], axis=-1).reshape(-1, 4)
    rows = replace(OLD, points=np.stack([z.ravel(), r.ravel()], axis=1), quads=quads)
    inside = replace(NEW, points=np.array([[0.0101, 3.3], [0.0256, 8.9]]))
    assert transfer_nodes(rows, inside, rows.points) == pytest.approx(inside.points, abs=1e-9)


def test_thin_elements_are_not_turned_over() -> None:
    thin = Disc(0.0, 26.0, 1.7, -34.0, 43.0, layers=6, layer_growth=2.0**12)
    old, new = disc_mesh(thin, 2), disc_mesh(replace(thin, arc_end=40.0), 2)
    moved = transfer_nodes(old, new, 0.3 * np.sin(2.0 * old.points))
    assert np.abs(moved - 0.3 * np.sin(2.0 * new.points)).max() < 0.006
    assert corner_jacobians(replace(new, points=new.points + moved)).min() > 0.1
