"""The benchmark beside FFCx: same nodes, same values, a missing FFCx is named."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import solids


def test_nodes_are_matched_by_their_places() -> None:
    ours = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    theirs = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    assert solids.matched(ours, theirs).tolist() == [0, 1, 3, 2]
    with pytest.raises(SystemExit, match="nodes of the cells are not the same"):
        solids.matched(ours, theirs + 0.01)


def test_values_that_differ_are_an_error() -> None:
    other: Any = SimpleNamespace(order=np.array([0, 1, 3, 2]))
    at = (other.order[:, None] * 2 + np.arange(2)).ravel()
    R, K = np.arange(8.0)[None], np.arange(64.0).reshape(1, 8, 8)
    found = [R[:, at], K[:, at][:, :, at]]
    solids._require_equal("quad4", other, R, K, found)
    found[1][0, 2, 3] += 1
    with pytest.raises(SystemExit, match=r"quad4: the values differ by 1\.6e-02"):
        solids._require_equal("quad4", other, R, K, found)


def test_a_python_without_ffcx_is_named(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"has no FFCx that works: .*No module named"):
        solids.theirs(sys.executable, "quad4", tmp_path)
