"""Means, runs, crossings, nodal averages."""

import math

import numpy as np
import pytest

from softehl.runtime.discretisation.postprocessing import (
    element_means,
    interval_below,
    local_exponent,
    nodal_average,
    run_around,
)


def test_element_means_use_the_weights() -> None:
    means = element_means(np.array([[1.0, 3.0], [2.0, 2.0]]), np.array([[3.0, 1.0], [1.0, 5.0]]))
    assert means.tolist() == [1.5, 2.0]


def test_element_means_without_weights_are_those_of_the_points() -> None:
    means = element_means(np.array([[1.0, 3.0], [2.0, 4.0]]), np.array([[0.0, 0.0], [1.0, 3.0]]))
    assert means.tolist() == [2.0, 3.5]


@pytest.mark.parametrize(
    ("flags", "index", "expected"),
    [
        ("1110111", 1, slice(0, 3)),
        ("1110111", 5, slice(4, 7)),
        ("1110111", 3, slice(3, 4)),
        ("0110", 2, slice(1, 3)),
        ("1111", 0, slice(0, 4)),
    ],
)
def test_run_around(flags: str, index: int, expected: slice) -> None:
    assert run_around(np.array([f == "1" for f in flags]), index) == expected


def test_interval_below_interpolates_both_ends() -> None:
    x = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    h = np.array([4.0, 2.0, 0.0, 1.0, 5.0])
    assert interval_below(x, h, 1.5) == pytest.approx((1.25, 3.125))
    assert interval_below(x, h, 9.0) == (0.0, 4.0)
    assert all(math.isnan(end) for end in interval_below(x, h, -1.0))


def test_nodal_average_counts_every_cell_once() -> None:
    cells = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    values = {"s": np.array([[1.0, 3.0], [6.0, 6.0]])}
    nodal = nodal_average(cells, values, 7)["s"]
    assert nodal[:6].tolist() == [2.0, 4.0, 4.0, 2.0, 6.0, 6.0]
    assert math.isnan(nodal[6])


def test_local_exponent_of_a_power_law() -> None:
    assert local_exponent(400.0, 3 * 400**0.6, 100.0, 3 * 100**0.6) == pytest.approx(0.6)
