"""Numbering of unknowns."""

import numpy as np
import pytest

from softehl.runtime.fem.dofs import (
    DofLayout,
    chain_dofs,
    displacement_dofs,
    gather_rows,
    separate_dofs,
)


def test_fields_follow_each_other_without_gaps() -> None:
    layout = DofLayout.of(displacement=6, pressure=4, moment=1)
    assert layout.total == 11
    assert np.concatenate([layout.dofs(n) for n in layout.names]).tolist() == list(range(11))
    assert layout.part("pressure") == slice(6, 10)
    assert layout.count("moment") == 1


def test_unknown_field_is_named() -> None:
    with pytest.raises(KeyError, match="no field 'p'; there are u"):
        DofLayout.of(u=3).part("p")


def test_displacements_go_node_by_node() -> None:
    assert displacement_dofs(np.array([[3, 0]])).tolist() == [[6, 7, 0, 1]]


@pytest.mark.parametrize(("segments", "order"), [(27, 4), (5, 1), (1, 3)])
def test_neighbours_in_a_chain_share_one_unknown(segments: int, order: int) -> None:
    dofs = chain_dofs(segments, order, 100)
    assert dofs.shape == (segments, order + 1)
    assert np.array_equal(dofs[1:, 0], dofs[:-1, -1])
    assert np.unique(dofs).tolist() == list(range(100, 100 + order * segments + 1))


def test_neighbours_may_share_no_unknown() -> None:
    assert separate_dofs(2, 3, 10).tolist() == [[10, 11, 12, 13], [14, 15, 16, 17]]


def test_columns_are_joined() -> None:
    joined = gather_rows(np.array([[1, 2], [3, 4]]), np.array([9, 8]))
    assert joined.tolist() == [[1, 2, 9], [3, 4, 8]]
