"""Elements along a chain of nodes: which nodes and unknowns each has."""

import numpy as np

from softehl.runtime.fem.chain import chain_block
from softehl.runtime.fem.dofs import chain_dofs
from softehl.runtime.fem.rules import facet_rule, film_rule

NODES = np.array([[0.0, 5.0], [1.0, 6.0], [3.0, 8.0], [7.0, 9.0]])


def test_segments_and_facets_of_one_chain() -> None:
    pressures = chain_dofs(3, 2, NODES.size)
    film = chain_block("film", NODES, pressures, film_rule(2))
    assert film.name == film.kernel.name == "film"
    np.testing.assert_array_equal(film.coordinates[1], [1.0, 6.0, 3.0, 8.0])
    np.testing.assert_array_equal(film.dofs[1], [2, 3, 4, 5, 10, 11, 12])
    sides = np.hstack([pressures[:-1], pressures[1:]])
    facets = chain_block("film_facet", NODES, sides, facet_rule(2))
    assert facets.coordinates.shape == (2, 6)
    np.testing.assert_array_equal(facets.dofs[1][:6], [2, 3, 4, 5, 6, 7])
