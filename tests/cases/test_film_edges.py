"""Where a film ends and where it holds oil, from films that are given node by node."""

import numpy as np
import pytest

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.states.contacts import Edge
from softehl.cases.seal.states.film_edges import between, film_edges
from softehl.cases.seal.states.state import COLLAPSED, OSCILLATING, FilmRow, doubt
from softehl.runtime.arrays import Array
from tests.cases.oring_cases import film_values

H_STAR = 1e-3


@pytest.fixture(scope="module")
def system() -> SealSystem:
    gland = {"housing_diameter": 56.4, "groove_width": 4.3}
    return build_system(ORing.model_validate({"section": "rectangular", "density": 2, **gland}))


def film(system: SealSystem, h: Array, p: Array) -> Array:
    """A state with thicknesses h and pressures p at the nodes of the arc."""
    x, nodes = system.at_rest(), system.mesh.arc_nodes
    system.displacements(x)[nodes, 1] = h + system.rod_radius - system.mesh.points[nodes, 1]
    rows = system.pressure_dofs()
    share = np.linspace(0.0, 1.0, rows.shape[1])
    x[rows] = p[:-1, None] + share * np.diff(p)[:, None]
    return x


def test_a_film_with_a_pocket_has_four_edges(system: SealSystem) -> None:
    s = system.section.places
    h, p = np.full(len(s), 20.0 * H_STAR), np.zeros(len(s))
    h[10:40], p[10:40] = H_STAR, np.sqrt(np.minimum(s[10:40] - s[10], s[39] - s[10:40]))
    assert [edge.sealed for edge in film_edges(system, film(system, h, p), H_STAR)] == [True, False]
    h[20:25] = 9.0 * H_STAR
    h[42] = H_STAR  # a node alone is a zigzag, not an edge
    edges = film_edges(system, film(system, h, p), H_STAR)
    assert [edge.sealed for edge in edges] == [True, False, True, False]
    for edge, (a, b) in zip(edges, [(9, 10), (19, 20), (24, 25), (39, 40)], strict=True):
        assert s[a] < edge.place < s[b]
    # p^2 is the distance from where it begins, a little inside of where the film is thick
    assert 0.8 < edges[0].rise < 1.0
    assert 0.8 < edges[-1].rise < 1.0


def test_a_film_that_reaches_an_end_of_the_arc_has_no_edge_there(system: SealSystem) -> None:
    h = np.full(len(system.section.places), H_STAR)
    assert film_edges(system, film(system, h, h), H_STAR) == []


def test_on_the_way_from_film_to_contact_there_are_edges_outside_of_the_contact() -> None:
    dry = [Edge(2.0, 5.0), Edge(6.0, 5.0, sealed=False)]
    found = between([Edge(1.0, 3.0), Edge(5.0, 4.0, sealed=False)], dry)
    assert [edge.place for edge in found] == [1.25, 1.5, 1.75]
    assert {(edge.rise, edge.sealed) for edge in found} == {(3.0, True)}
    assert [e.place for e in between([Edge(7.0, 1.0, sealed=False)], dry)] == [6.75, 6.5, 6.25]
    assert between([], dry) == []


def test_of_states_on_several_meshes_the_least_doubtful_is_reported() -> None:
    kinds = [(COLLAPSED, 0.0), (OSCILLATING, 1.6), (OSCILLATING, 0.3)]
    states = [
        FilmRow(**film_values(verdict=word, oscillation_index=index)) for word, index in kinds
    ]
    assert min(states, key=doubt) is states[2]
