"""The benchmark of both forms of a page of fields."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import forms
from benchmarks.field_pages import SYSTEMS


def test_both_forms_are_built_measured_and_compared(capsys: pytest.CaptureFixture[str]) -> None:
    assert forms.main(["tri3", "--material", "plastic"]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[:3] for row in rows[2:]] == [["plastic", "tri3", f] for f in ("whole", "point")]


def test_forms_that_differ_are_an_error() -> None:
    one = [np.ones(3)]
    with pytest.raises(SystemExit, match="tri3: the forms differ by 1"):
        forms._require_equal([one, [np.array([1.0, 1.0, 2.0])]], "tri3")
    with pytest.raises(SystemExit, match="nan"):
        forms._require_equal([one, [np.full(3, np.nan)]], "tri3")


def test_a_cubic_crystal_has_twelve_systems() -> None:
    assert len(SYSTEMS) == 12
