"""Graded lines: the size function is obeyed, meshes are nested, bad requests are refused."""

import numpy as np
import pytest

from softehl.cases.seal.meshing.spacing import Spot, graded

LENGTH, SPOTS, COUNT = 2.4, (0.4, 1.8), 54
TWO = tuple(Spot(place) for place in SPOTS)


def _sizes(count: int = COUNT, **changes: float) -> tuple[np.ndarray, np.ndarray]:
    given = {"coarsest": 0.1, "rate": 0.25, **changes}
    spacing = graded(LENGTH, TWO, COUNT, **given)
    nodes = LENGTH * spacing(np.arange(count + 1) / count)
    return np.diff(nodes), 0.5 * (nodes[1:] + nodes[:-1])


def test_a_segment_is_as_long_as_the_size_function_says() -> None:
    sizes, middle = _sizes(8 * COUNT)
    finest = 8 * sizes.min()
    distance = np.abs(middle[:, None] - SPOTS).min(axis=1)
    assert 8 * sizes == pytest.approx(np.minimum(0.1, finest + 0.25 * distance), rel=0.02)
    assert sizes.sum() == pytest.approx(LENGTH, rel=1e-12)


def test_the_finest_segments_lie_at_the_spots() -> None:
    sizes, middle = _sizes()
    for spot in SPOTS:
        assert sizes[np.abs(middle - spot).argmin()] == pytest.approx(sizes.min(), rel=0.15)
    assert sizes.max() <= 0.1 * (1 + 1e-6)
    assert sizes.min() < 0.1 * LENGTH / COUNT * 2.0


def test_twice_the_density_has_the_same_nodes() -> None:
    spacing = graded(LENGTH, TWO, COUNT, coarsest=0.1, rate=0.25)
    coarse, fine = (spacing(np.arange(n + 1) / n) for n in (COUNT, 2 * COUNT))
    assert fine[::2].tolist() == coarse.tolist()


def test_a_larger_rate_makes_the_finest_segment_finer() -> None:
    assert _sizes(rate=0.35)[0].min() < _sizes(rate=0.25)[0].min() < _sizes(rate=0.2)[0].min()


def test_a_spot_may_be_given_finer_segments() -> None:
    spots = (Spot(0.4, 3.0), Spot(1.8))
    nodes = LENGTH * graded(LENGTH, spots, COUNT, coarsest=0.1, rate=0.25)(np.arange(865) / 864)
    at = [np.diff(nodes)[np.abs(nodes[1:] - spot.position).argmin()] for spot in spots]
    assert at[0] / at[1] == pytest.approx(3.0, rel=0.1)


def test_segments_that_cannot_fill_the_line_are_refused() -> None:
    with pytest.raises(ValueError, match=r"must be larger than 0\.0444"):
        graded(LENGTH, TWO, COUNT, coarsest=0.04, rate=0.25)
    with pytest.raises(ValueError, match="at least one"):
        graded(LENGTH, (), COUNT, coarsest=0.1, rate=0.25)
