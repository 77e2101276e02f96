"""Whole problems beside other tools: ours agrees with itself, what is missing is said."""

from __future__ import annotations

import sys

import pytest

from benchmarks import problems


@pytest.mark.slow
@pytest.mark.parametrize(("problem", "expected"), [("cook", 11.53022336), ("block", 0.03265384257)])
def test_our_side_finds_what_felupe_finds(problem: str, expected: float) -> None:
    """FElupe 11.3 by `benchmarks/rivals.py` on the same mesh; scikit-fem agrees with it."""
    found = problems.ours(problem, 4)
    assert found.iterations >= problems.STEPS[problem]
    assert found.assembly < found.total
    assert found.value == pytest.approx(expected, rel=1e-8)


def test_a_tool_that_is_missing_is_named() -> None:
    found = problems.theirs(sys.executable, "felupe", "cook", 2)
    assert isinstance(found, str)
    assert "No module named 'felupe'" in found


def test_an_answer_that_differs_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one = problems.Timing(1.0, 0.1, 8, 2.0)
    monkeypatch.setattr(problems, "ours", lambda problem, n: one)
    for value, code in ((2.0, 0), (2.0 + 1e-5, 1)):
        other = problems.Timing(2.0, 0.4, 8, value)
        monkeypatch.setattr(problems, "theirs", lambda *_, other=other: other)
        assert problems.main("python", {"cook": 4}) == code
        assert "| cook | felupe | 400.0 | 4.0 | 2.00 | 2.0 | 8 |" in capsys.readouterr().out
