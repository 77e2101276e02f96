"""The sample of seals: proportions of its parts, lines of a comparison."""

from __future__ import annotations

from collections import Counter
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from benchmarks.glands import sample
from benchmarks.glands.table import comparison, results
from benchmarks.marked import renew


def test_the_first_half_has_the_kinds_and_pressures_in_proportion() -> None:
    seals = list(islice(sample(), 30))
    assert len({seal.name for seal in seals}) == 30
    assert Counter(int(seal.ratio) for seal in seals) == dict.fromkeys(range(5), 6)
    sections = Counter(seal.section for seal in seals)
    assert (sections["round"], sections["x_ring"], sections["u_cup"]) == (20, 5, 3)


def line(verdict: str, h: float, **changes: Any) -> dict[str, Any]:
    """A run of one state."""
    state = {"verdict": verdict, "h_star_um": h, "rod_friction_N": 1.0}
    given = {"seal": "round 4", "section": "round", "p_s/mu": 0.9, "asked": 2, "cpu_s": 4.0}
    ok = int(verdict == "ok")
    return {**given, "ok": ok, "states": {"+100": state}, "keys": {}, **changes}


def test_a_comparison_counts_states_and_names_those_that_differ() -> None:
    old, equal = {"a": line("ok", 1.0)}, {"a": line("ok", 1.004, cpu_s=2.0)}
    same = comparison(old, equal)
    assert "| p_s / mu 0 to 1 | 1 | 2 | 1 | 1 | 4.0 | 2.0 |" in same
    assert same.endswith("none.")
    assert comparison(old, {"a": line("ok", 1.006)}).endswith("| ok | ok | 1 | 1.006 | +0.60 |")
    lost = comparison(old, {"a": line("ok", 1.0, ok=0, states={})})
    assert lost.endswith("| +100 | ok | not reached | 1 | nan | nan |")


def test_seals_of_another_draw_are_not_compared() -> None:
    with pytest.raises(SystemExit, match="other keys"):
        comparison({"a": line("ok", 1.0)}, {"a": line("ok", 1.0, keys={"density": 4})})


def test_the_table_of_a_program_counts_what_it_reached(tmp_path: Path) -> None:
    runs = {"a": line("ok", 1.0), "b": line("uncertain", 1.0, section="x_ring", cpu_s=9.6)}
    table = results(runs)
    assert "| round | 1 | 2 | 1 | 1 | 50.0 % |  | 4, 4 |" in table
    assert "| all | 2 | 4 | 2 | 1 | 25.0 % | 1 `uncertain` | 7, 10 |" in table
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- glands -->\nold\n<!-- end -->\nafter\n", encoding="utf-8")
    renew(page, "glands", table)
    assert page.read_text(encoding="utf-8").startswith("before\n<!-- glands -->\n| seals | number")
    assert page.read_text(encoding="utf-8").endswith(" |\n<!-- end -->\nafter\n")
    with pytest.raises(SystemExit, match="has no lines <!-- other -->"):
        renew(page, "other", table)
