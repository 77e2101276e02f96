"""Results of `benchmarks.solver` as Markdown tables for benchmarks/README.md."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Run = Mapping[str, Any]
"""A run as `benchmarks.solver.measure` describes it, with route, density, p_s and stroke."""

PARTS = ("contact", "films")

FILM = "film at"
"""Names of the stages of films begin so."""

_HEADER = (
    *("p_s", "stroke", "density", "unknowns", "route", "part"),
    *("factorisations", "iterations", "CPU s", "peak MB", "h* differs by"),
)


def part_of(stage: str) -> str:
    """The part of :data:`PARTS` that a stage belongs to, by its name."""
    return "films" if stage.startswith(FILM) else "contact"


def summary(runs: Sequence[Run]) -> str:
    """A table of all runs, part by part, and how the time of each route grows."""
    lines = _rows([_HEADER, ["---"] * len(_HEADER)])
    for run in runs:
        lines += _rows(_run_rows(run, _first_of(run, runs)))
    return "\n".join([*lines, "", *_growth(runs)])


def _rows(cells: Iterable[Iterable[object]]) -> list[str]:
    return [f"| {' | '.join(map(str, row))} |" for row in cells]


def _first_of(run: Run, runs: Sequence[Run]) -> Run:
    """The first route of the same case."""
    return next(other for other in runs if _case(other) == _case(run))


def _case(run: Run) -> tuple[object, ...]:
    return tuple(run[key] for key in ("sealed_pressure", "stroke", "density"))


def _run_rows(run: Run, first: Run) -> list[list[object]]:
    case = [f"{run['sealed_pressure']:g}", run["stroke"], run["density"], run["unknowns"]]
    route = f"{run['route'].split(':')[0]}, {run['linear']}"
    rows: list[list[object]] = []
    for part in PARTS:
        stages = [stage for stage in run["stages"] if part_of(stage["name"]) == part]
        if stages:
            rows.append([*case, route, part, *_cost(stages), "", ""])
    memory = f"{run['memory']:.0f}"
    whole = [*_counts(run["stages"]), f"{run['cpu']:.2f}", memory, difference(run, first)]
    rows.append([*case, route, "all", *whole])
    if not run["converged"]:
        rows.append([*case, route, f"NOT CONVERGED: {_reached(run)}", "", "", "", "", ""])
    return rows


def _cost(stages: Sequence[Run]) -> list[object]:
    return [*_counts(stages), f"{sum(stage['cpu'] for stage in stages):.2f}"]


def _counts(stages: Sequence[Run]) -> list[object]:
    return [sum(stage[key] for stage in stages) for key in ("factorisations", "iterations")]


def _reached(run: Run) -> str:
    speeds = [abs(float(speed)) for speed in run["films"]]
    return f"{len(speeds)} speeds, down to {min(speeds):g} mm/s" if speeds else "no film"


def difference(run: Run, first: Run) -> str:
    """Largest relative difference of h* from the first route's, at the speeds that both reached.

    A collapsed film is none; on a mesh so coarse there are several.
    """
    if run is first:
        return "-"
    spurious = {*run["collapsed"], *first["collapsed"]}
    both = [u for u in run["films"] if u in first["films"] and u not in spurious]
    ratios = [run["films"][u] / first["films"][u] for u in both]
    left_out = f" ({len(spurious)} collapsed)" if spurious else ""
    shown = f"{max(abs(ratio - 1.0) for ratio in ratios):.1e}" if ratios else "no film in common"
    return f"{shown}{left_out}"


def _growth(runs: Sequence[Run]) -> list[str]:
    """A line for each route and kind of curve that has several densities, all converged."""
    lines = []
    for route in dict.fromkeys(run["route"] for run in runs):
        for pressure, stroke in dict.fromkeys(_case(run)[:2] for run in runs):
            some = [r for r in runs if r["route"] == route and _case(r)[:2] == (pressure, stroke)]
            where = f"{route}, p_s = {pressure:g}, stroke {stroke}"
            lost = [str(run["density"]) for run in some if not run["converged"]]
            if lost:
                lines.append(f"{where}: not converged at density {', '.join(lost)}: no exponent")
            elif (exponent := growth([(r["unknowns"], r["cpu"]) for r in some])) is not None:
                lines.append(
                    f"{where}: CPU time grows with the unknowns to the power {exponent:.2f}"
                )
    return lines


def growth(points: Sequence[tuple[int, float]]) -> float | None:
    """Exponent between the smallest and the largest problem, (unknowns, seconds); None for one."""
    small, large = min(points), max(points)
    if small[0] == large[0]:
        return None
    return math.log(large[1] / small[1]) / math.log(large[0] / small[0])
