"""The table of `benchmarks.solver`: sums, differences, exponents, and what has not converged."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.solver_summary import growth, part_of, summary


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
