"""Estimate against truth: what is drawn, and that a wrong `ok` is counted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.verdicts import QUANTITIES, SHAPES, drawn, reference, tables

ESTIMATES = {"h_star_error_percent": 0.1, "rod_friction_error_percent": float("nan")}


def test_settings_have_all_sections_at_all_densities() -> None:
    settings = [drawn(number) for number in range(24)]
    pairs = {(given.get("section", "round"), given["density"]) for given in settings}
    assert pairs == {(section, density) for section in SHAPES for density in (1, 2, 4)}
    assert {given["reynolds"] for given in settings} == {"fe", "dg"}
    assert {given["stroke"] for given in settings} == {"out", "in"}
    fine = reference({**settings[0], "pressure_order": 2, "reynolds": "dg"}, 4)
    assert (fine["density"], fine["pressure_order"], fine["reynolds"]) == (8, 4, "fe")


def write(path: Path, *values: float, verdict: str = "ok") -> None:
    """A file of states, at 100 mm/s and on; each has one value for all quantities."""
    rows: list[dict[str, Any]] = [
        {"U": 100.0 * k, "verdict": verdict, **dict.fromkeys(QUANTITIES, value), **ESTIMATES}
        for k, value in enumerate(values, 1)
    ]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_a_state_that_is_ok_and_wrong_is_counted(tmp_path: Path) -> None:
    write(tmp_path / "run_0.json", 1.0, 1.0, 1.0)
    write(tmp_path / "twice_0.json", 1.01, 1.01)
    assert "| 1 | 3 | 3 | 2 | 2 | 0 | 0.99 | 0.99 | 0.99 |" in tables(tmp_path, 20)
    write(tmp_path / "four_0.json", 1.03)  # the finest mesh counts
    text = tables(tmp_path, 20)
    assert "| 1 | 3 | 3 | 2 | 2 | 1 | 2.91 | 2.91 | 2.91 |" in text
    assert "| +100 | -2.91 | -2.91 | -2.91 | +0.10, - | ok |" in text


def test_a_doubtful_reference_does_not_count(tmp_path: Path) -> None:
    write(tmp_path / "run_0.json", 1.0)
    write(tmp_path / "twice_0.json", 1.5, verdict="under-resolved")
    assert "| 1 | 3 | 1 | 0 | 0 | 0 | nan | nan | nan |" in tables(tmp_path, 20)
