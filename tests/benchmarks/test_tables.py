"""Tables of benchmarks: samples of seals, verdicts, costs of solvers, sizes of files."""

from __future__ import annotations

import json
from collections import Counter
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from benchmarks import sizes
from benchmarks.glands import sample
from benchmarks.glands.table import comparison, results
from benchmarks.marked import renew
from benchmarks.solver_summary import growth, part_of, summary
from benchmarks.verdicts import QUANTITIES, SHAPES, drawn, reference, tables

# --- The sample of seals: proportions of its parts, lines of a comparison -------------------------


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


# --- Estimate against truth: what is drawn, and that a wrong `ok` is counted ----------------------


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


# --- The table of `benchmarks.solver`: sums, differences, exponents, and what has not converged ---


def stage(name: str, factorisations: int, cpu: float) -> dict[str, Any]:
    return {"name": name, "factorisations": factorisations, "iterations": 10, "cpu": cpu}


def run(route: str, density: int, **changes: Any) -> dict[str, Any]:
    """A made-up run: its time is the square of its unknowns."""
    given = {
        "route": route,
        "density": density,
        "sealed_pressure": 1.0,
        "stroke": "out",
        "unknowns": 1000 * density,
        "linear": route.split(":")[1],
        "converged": True,
        "cpu": float(density**2),
        "memory": 123.4,
        "films": {"1600": 3.0, "100": 0.5},
        "collapsed": [],
        "stages": [
            stage("squeeze", 30, 0.1),
            stage("contact at density 4", 4, 0.2),
            stage("film at +1600 mm/s", 3, 0.5),
            stage("film at +100 mm/s", 5, 0.6),
        ],
    }
    return {**given, **changes}


def test_the_parts_and_their_sums() -> None:
    lines = summary([run("auto:superlu", 4)]).splitlines()
    case = "| 1 | out | 4 | 4000 | auto, superlu |"
    assert lines[2:5] == [
        f"{case} contact | 34 | 20 | 0.30 |  |  |",
        f"{case} films | 8 | 20 | 1.10 |  |  |",
        f"{case} all | 42 | 40 | 16.00 | 123 | - |",
    ]
    assert len({line.count("|") for line in lines if line}) == 1
    assert part_of("sealed pressure") == "contact"


def test_the_difference_and_the_exponent() -> None:
    films = {"1600": 3.0, "100": 0.5 * (1 - 2e-7), "25": 9.0}
    runs = [run(route, density) for density in (4, 8) for route in ("auto:a", "monolithic:b")]
    runs[1] = run("monolithic:b", 4, films=films)
    runs[3] = run("monolithic:b", 8, films=films | {"1600": 7.0}, collapsed=["1600"], cpu=100.0)
    lines = summary(runs).splitlines()
    shown = [line.split("|")[-2].strip() for line in lines if "| all |" in line]
    assert shown == ["-", "2.0e-07", "-", "2.0e-07 (1 collapsed)"]
    assert lines[-2].endswith("to the power 2.00")
    assert lines[-1].startswith("monolithic:b, p_s = 1, stroke out: ")
    assert growth([(10, 5.0), (10, 6.0)]) is None
    assert growth([(400, 8.0), (100, 1.0)]) == pytest.approx(1.5)


# --- Sizes of files and functions are counted as the script says ----------------------------------


SOURCE = '''"""A file of ten lines that are not blank."""


def short(a, b, *, c):
    """Three lines, three parameters."""
    return a


class Thing:
    def method(self, a, b, c, d, e, f, g):

        def inner(x):
            return x

        return inner
'''


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "runtime").mkdir()
    (tmp_path / "runtime" / "a.py").write_text(SOURCE)
    return tmp_path


def test_lines_are_counted(root: Path) -> None:
    counted = {f.place.split()[-1]: f.lines for f in sizes.functions_of(root)}
    assert counted == {"short": 3, "method": 4, "inner": 2}
    header, line = sizes.table(root)
    shown = dict(zip(header, line, strict=True))
    assert shown["room"] == "runtime"
    assert (shown["files"], shown["lines"], shown["functions"]) == ("1", "9", "3")
    assert (shown["median"], shown["longest"]) == ("3", "4")
