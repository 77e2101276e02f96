"""The table of `benchmarks.films`: ratios to the smooth curve."""

from __future__ import annotations

from benchmarks.films import Cost, table


def test_ratios_are_to_the_first_run() -> None:
    costs = {"smooth curve": Cost(2.0, 30, 100), "cycle": Cost(5.0, 101, 700)}
    lines = table(costs).splitlines()
    assert lines[2] == "| smooth curve | 2.00 | 1.00 | 30 | 100 |"
    assert lines[3] == "| cycle | 5.00 | 2.50 | 101 | 700 |"
