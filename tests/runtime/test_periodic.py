"""Cells of periodic materials against a laminate, whose effective stress has a closed form."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve

import softehl
from softehl.runtime.analyses.homogenisation import Cell
from softehl.runtime.arrays import Array
from softehl.runtime.definition.argument_checks import node_partners, partners
from softehl.runtime.definition.problem_definition import StudyError
from tests.runtime.field_pages import rubber

SOFT, STIFF = (0.4, 1.3), (2.0, 5.0)
SHARE = 0.25
F = np.array([[1.15, 0.2], [-0.05, 0.9]])


def laminate(cells: tuple[int, int] = (4, 2), turn: bool = False) -> Cell:
    """Layers across x, `SHARE` of them stiff; turn: across y."""
    across = 1 if turn else 0
    mesh = softehl.Mesh.rectangle(2, 2, cells=cells[::-1] if turn else cells)
    mesh = mesh.with_group("stiff", lambda x: x[:, across] < 2 * SHARE)
    mesh = mesh.with_group("soft", lambda x: x[:, across] > 2 * SHARE)
    study = softehl.Study(mesh)
    for name, (mu, K) in (("stiff", STIFF), ("soft", SOFT)):
        study.add(name, rubber, cells=name, mu=mu, K=K)
    return study.periodic(("left", "right"), ("bottom", "top"))


def stress(F: Array, law: tuple[float, float]) -> Array:
    """P of a layer in plane strain, written out."""
    mu, K = law
    J, inverse = np.linalg.det(F), np.linalg.inv(F).T
    return np.asarray(mu * (F - inverse) + K * (J - 1) * J * inverse)


def layers(F: Array) -> Array:
    """Mean P of the laminate: both layers have equal tractions across x."""

    def both(a: Array) -> tuple[Array, Array]:
        jump = np.outer(a, [1.0, 0.0])
        parts = F + (1 - SHARE) * jump, F - SHARE * jump
        return stress(parts[0], STIFF), stress(parts[1], SOFT)

    def apart(a: Array) -> Array:
        stiff, soft = both(a)
        return np.asarray((stiff - soft)[:, 0])

    stiff, soft = both(fsolve(apart, np.zeros(2), xtol=1e-12))
    return SHARE * stiff + (1 - SHARE) * soft


def slopes(f: Any, F: Array, h: float = 1e-3) -> Array:
    """dP/dF by differences of sixth order."""
    found = np.zeros((2, 2, 2, 2))
    for k, el in np.ndindex(2, 2):
        for step, weight in ((1, 45), (2, -9), (3, 1)):
            d = np.zeros((2, 2))
            d[k, el] = step * h
            found[:, :, k, el] += weight * (f(F + d) - f(F - d)) / (60 * h)
    return found


def test_a_laminate_has_the_stress_and_the_tangent_of_its_layers() -> None:
    found = laminate().solve(F)
    assert np.abs(found.P - layers(F)).max() < 1e-10
    assert np.abs(found.A - slopes(layers, F)).max() < 1e-8
    other = laminate(turn=True).solve(F)  # layers across the other direction are another material
    assert np.abs(other.P - layers(F)).max() > 1e-2


def test_components_of_the_stress_may_vanish_instead() -> None:
    found = laminate().solve([[1.2, 0.0], [0.0, None]], steps=2)
    assert abs(found.P[1, 1]) < 1e-10
    assert 0.5 < found.F[1, 1] < 1.0
    assert np.abs(found.P - layers(found.F)).max() < 1e-9


def test_a_hole_counts_in_the_volume_and_corners_are_one_node() -> None:
    mesh = softehl.Mesh.box((1, 1, 1), cells=(2, 2, 2))
    study = softehl.Study(mesh)
    study.add("body", rubber, mu=0.4, K=1.3)
    cell = study.periodic(("left", "right"), ("bottom", "top"), ("front", "back"))
    assert cell.volume == pytest.approx(1.0)
    assert cell.fluctuations.shape[1] == 3 * 7  # eight nodes of the torus, one of them held
    G = np.eye(3) + 0.1 * np.arange(9).reshape(3, 3) / 9
    J, inverse = np.linalg.det(G), np.linalg.inv(G).T
    assert (
        np.abs(cell.solve(G).P - (0.4 * (G - inverse) + 1.3 * (J - 1) * J * inverse)).max() < 1e-12
    )


def test_what_is_no_cell_is_refused() -> None:
    study = softehl.Study(softehl.Mesh.rectangle(1, 1, cells=(2, 3)))
    study.add("body", rubber, mu=0.4, K=1.3)
    with pytest.raises(StudyError, match="1 pairs of sides; a mesh in 2-D needs 2"):
        study.periodic(("left", "right"))
    with pytest.raises(StudyError, match=r"\('left', 'top'\): 4 and 3 nodes; the mesh of both"):
        study.periodic(("left", "top"), ("bottom", "top"))
    cell = study.periodic(("left", "right"), ("bottom", "top"))
    with pytest.raises(StudyError, match=r"F has shape \(3, 3\): \(2, 2\) is needed"):
        cell.solve(np.eye(3))
    with pytest.raises(StudyError, match="a determinant above 0"):
        cell.solve([[-1.0, 0.0], [0.0, 1.0]])
    study.fix("left", u_x=0)
    with pytest.raises(StudyError, match="the cell is moved by F alone"):
        study.periodic(("left", "right"), ("bottom", "top"))


def test_sides_that_do_not_fit_and_copies_of_a_node_are_refused() -> None:
    side = np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 2.0]])
    with pytest.raises(StudyError, match=r"do not fit, they are 0\.1 apart"):
        partners(side, side * [1.0, 1.1] + [1.0, 0.0], 1e-6)
    with pytest.raises(StudyError, match=r"two nodes at \(0, 0\) have the same partner"):
        partners(side[[0, 0, 2]], side[[0, 0, 2]] + [1.0, 0.0], 1e-6)


PLACES = {"low": (0, 0), "up": (0, 1), "far": (3, 0), "above it": (3, 1)}


def test_nodes_at_one_place_are_tied_body_by_body() -> None:
    """Of two blocks, one on the other, each has its own corner at the place of the other's."""
    low = softehl.Mesh.rectangle(1.0, 1.0, cells=(2, 2))
    blocks = {name: low.map(partial(np.add, by)) for name, by in PLACES.items()}
    mesh = softehl.Mesh.union(**blocks)
    left, right, third = (np.flatnonzero(mesh.points[:, 0] == x) for x in (0.0, 1.0, 3.0))
    order = [3, 0, 5, 2, 4, 1]
    np.testing.assert_array_equal(node_partners(mesh, left[order], right, 1e-6), right[order])
    with pytest.raises(StudyError, match=r"at \(0, 1\) .* body by body, .* a call of its own"):
        node_partners(mesh, left, third, 1e-6)  # which of both goes with which?
    with pytest.raises(StudyError, match=r"0\.25 apart at \(0, 1\) \(allowed: 5e-07\)"):
        node_partners(mesh, left[[2, 3]], left[[1, 2]], 1e-6)


def test_a_cell_with_a_net_force_is_refused() -> None:
    """Such a force would be carried by the one node that rests."""
    study = softehl.Study(softehl.Mesh.rectangle(1, 1, cells=(2, 2)))
    study.add("body", material="neo_hooke", mu=0.4, kappa=0.9)
    study.load("top", u_x=0.1)
    cell = study.periodic(("left", "right"), ("bottom", "top"))
    with pytest.raises(StudyError, match=r"net force of 0\.1 along x .* must balance"):
        cell.solve(np.eye(2))
    study.load("bottom", u_x=-0.1)
    balanced = study.periodic(("left", "right"), ("bottom", "top")).solve(np.eye(2))
    np.testing.assert_allclose(balanced.F, np.eye(2), atol=1e-12)
