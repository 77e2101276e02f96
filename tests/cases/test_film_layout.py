"""Segments that a film asks for, from films that are given node by node, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.section.layout import RATE
from softehl.cases.seal.solve.arc_meshing import (
    COARSEST_OF_FILM,
    RISE,
    THINNING,
    film_layout,
    misfit,
    sizes,
)
from softehl.cases.seal.states.mesh_indicators import INLET
from softehl.runtime.arrays import Array
from tests.cases.oring_cases import oring

THICKNESS = 1e-3


@pytest.fixture(scope="module")
def system() -> SealSystem:
    return build_system(oring(density=2))


def film(system: SealSystem, h: Array, p: Array) -> Array:
    """A state with thicknesses h and pressures p at the nodes of the arc."""
    x, nodes = system.at_rest(), system.mesh.arc_nodes
    system.displacements(x)[nodes, 1] = h + system.rod_radius - system.mesh.points[nodes, 1]
    rows = system.pressure_dofs()
    share = np.linspace(0.0, 1.0, rows.shape[1])
    x[rows] = p[:-1, None] + share * np.diff(p)[:, None]
    return x


def test_a_film_that_does_not_change_has_the_longest_segments(system: SealSystem) -> None:
    s = system.section.positions
    still = np.full(len(s), THICKNESS)
    _, size = sizes(system, film(system, still, np.ones(len(s))), THICKNESS)
    assert size == pytest.approx(np.full(len(size), s[-1] / COARSEST_OF_FILM))


def test_thickness_and_pressure_ask_for_so_much_of_their_change(system: SealSystem) -> None:
    """ln h of a constant slope; p of a constant slope; the steeper one of them decides."""
    s = system.section.positions
    k, rise = 12.0 / s[-1], 4.0 / s[-1]
    thin = THICKNESS * np.exp(k * s - 6.0)  # from 1/400 of it to 400 times
    x = film(system, thin, np.ones(len(s)))
    at, size = sizes(system, x, THICKNESS)
    inside = (k * at - 6.0 < np.log(INLET[0]) - 0.5) & (k * at - 6.0 > np.log(1e-3) + 0.5)
    assert size[inside] == pytest.approx(np.full(inside.sum(), THINNING / k))
    assert size[-1] == pytest.approx(s[-1] / COARSEST_OF_FILM)  # too thick to matter
    peak = np.minimum(rise * s, 1.0)
    _, size = sizes(system, film(system, np.full(len(s), THICKNESS), peak), THICKNESS)
    assert size[at < 0.2 * s[-1]] == pytest.approx(np.full((at < 0.2 * s[-1]).sum(), RISE / rise))
    both = film(system, THICKNESS * np.exp(2.0 * k * np.minimum(s, 0.1 * s[-1])), peak)
    _, size = sizes(system, both, THICKNESS)
    assert size[0] == pytest.approx(0.5 * THINNING / k)


def test_segments_grow_away_from_a_step(system: SealSystem) -> None:
    s, node = system.section.positions, 30
    h = np.where(np.arange(len(s)) < node, THICKNESS, 3.0 * THICKNESS)
    at, size = sizes(system, film(system, h, np.ones(len(s))), THICKNESS)
    least = THINNING / np.log(3.0) * (s[node] - s[node - 1])
    away = np.maximum(np.maximum(s[node - 1] - at, at - s[node]), 0.0)
    expected = np.minimum(least + RATE * away, s[-1] / COARSEST_OF_FILM)
    assert size == pytest.approx(expected, rel=0.02)


def test_the_misfit_is_the_number_of_segments_in_the_place_of_one(system: SealSystem) -> None:
    s, node = system.section.positions, 30
    h = np.where(np.arange(len(s)) < node, THICKNESS, 9.0 * THICKNESS)
    x = film(system, h, np.ones(len(s)))
    asked = np.log(9.0) / THINNING
    assert misfit(system, x, THICKNESS) == pytest.approx(asked, rel=0.02)
    fine = film(system, np.full(len(s), THICKNESS), np.ones(len(s)))
    assert misfit(system, fine, THICKNESS) < 1.0


def test_a_mesh_that_is_made_for_a_film_fits_it(system: SealSystem) -> None:
    s, node = system.section.positions, 30
    h = np.where(np.arange(len(s)) < node, THICKNESS, 9.0 * THICKNESS)
    layout = film_layout(system, film(system, h, np.ones(len(s))), THICKNESS)
    places = layout.mesh(2).arc_places
    finest = np.diff(places).argmin()
    assert s[node - 1] <= places[finest] <= s[node]
    assert np.diff(places).min() == pytest.approx(
        THINNING / np.log(9.0) * (s[node] - s[node - 1]), rel=0.1
    )
