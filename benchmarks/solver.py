"""The fast route against the monolithic one: factorisations, iterations, seconds, memory, h*.

    OMP_NUM_THREADS=1 python -m benchmarks.solver [--densities 2 4] [--pressures 1 5]
        [--strokes out in] [--routes auto:auto monolithic:superlu] [--speeds 1600 400 100]
        [--json FILE]

A route is solver:linear. Each run has a process of its own, one after the other, so that its peak
memory is its own. CPU seconds are those of the process: on a shared machine they tell more than
wall seconds. The summary at the end is Markdown (`benchmarks.solver_summary`).
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks.solver_summary import FILM, difference, summary
from softehl.cases.paper.states import PAPER
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import COLLAPSED, Silent
from softehl.runtime.io import write_json


class Quiet(Silent):
    """Keeps the CPU time at the end of each stage."""

    def __init__(self) -> None:
        self.marks: list[float] = []

    def stage(self, name: str, **details: Any) -> None:
        self.marks.append(time.process_time())


def measure(parameters: Seal) -> dict[str, Any]:
    """One run: its stages, its films, its cost."""
    observer, wall, cpu = Quiet(), time.perf_counter(), time.process_time()
    outcome = run(parameters, observer)
    marks = [*observer.marks, time.process_time()]
    return {
        "converged": outcome.converged,
        "unknowns": outcome.unknowns["total"],
        "linear": outcome.solvers["linear"],
        "wall": time.perf_counter() - wall,
        "cpu": marks[-1] - cpu,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "films": {f"{s.rod_speed:g}": s.h_star_um for s in outcome.states},
        "collapsed": [f"{s.rod_speed:g}" for s in outcome.states if s.verdict == COLLAPSED],
        "residual": max(
            (
                s.residual_histories[-1][-1]
                for s in outcome.stages
                if s.name.startswith(FILM) and s.residual_histories[-1]
            ),
            default=math.nan,
        ),
        "stages": [
            {
                "name": s.name,
                "stroke": s.where["stroke"],
                "factorisations": s.factorisations,
                "iterations": s.iterations,
                "wall": s.seconds,
                "cpu": after - before,
                "method": s.method,
            }
            for s, before, after in zip(outcome.stages, marks, marks[1:], strict=False)
        ],
    }


def in_its_own_process(parameters: Seal) -> dict[str, Any]:
    """`measure` in a fresh interpreter."""
    command = [sys.executable, "-m", "benchmarks.solver", "--one", parameters.model_dump_json()]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def show(parameters: Seal, result: dict[str, Any]) -> None:
    """The table of one run."""
    p, row = (
        parameters,
        "  {:22} {:5} factorisations {:5} iterations {:8.2f} s CPU {:8.2f} s wall  {}",
    )
    print(
        f"\ndensity {p.density}, p_s = {p.sealed_pressure:g}, stroke {p.stroke}, "
        f"{result['unknowns']} unknowns, solver {p.solver}, linear {result['linear']}"
        f"{'' if result['converged'] else ', NOT CONVERGED'}"
    )
    for s in result["stages"]:
        numbers = (s[key] for key in ("factorisations", "iterations", "cpu", "wall"))
        print(row.format(s["name"], *numbers, s["method"][:50]))
    counts = [sum(s[k] for s in result["stages"]) for k in ("factorisations", "iterations")]
    print(row.format("all", *counts, result["cpu"], result["wall"], f"{result['memory']:.0f} MB"))


def compare(parameters: Seal, routes: list[str]) -> list[dict[str, Any]]:
    """All routes of one case, against the first of them."""
    first: dict[str, Any] | None = None
    results = []
    for route in routes:
        solver, linear = route.split(":")
        p = Seal(**{**parameters.model_dump(), "solver": solver, "linear": linear})
        result = in_its_own_process(p)
        show(p, result)
        case = p.model_dump(include={"density", "sealed_pressure", "stroke"})
        results.append({"route": route, **case, **result})
        first = first or result
        print(
            f"  h* differs from the first route's by {difference(result, first)};"
            f" CPU time {result['cpu'] / first['cpu']:.1f} times the first route's"
        )
    return results


def main() -> None:
    """Run every combination and sum up."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--densities", type=int, nargs="+", default=[2, 4])
    parser.add_argument("--pressures", type=float, nargs="+", default=[1.0])
    parser.add_argument("--strokes", nargs="+", default=["out"])
    parser.add_argument("--routes", nargs="+", default=["auto:auto", "monolithic:superlu"])
    speeds = [1600.0, 800.0, 400.0, 200.0, 100.0, 50.0, 25.0]
    parser.add_argument("--speeds", type=float, nargs="+", default=speeds)
    parser.add_argument("--json", type=Path, help="file for everything that was measured")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measure(Seal.model_validate_json(given.one))))
        return
    results: list[dict[str, Any]] = []
    for pressure, stroke in itertools.product(given.pressures, given.strokes):
        for density in given.densities:
            parameters = Seal(
                density=density,
                sealed_pressure=pressure,
                stroke=stroke,
                speeds=tuple(given.speeds),
                **PAPER,
            )
            results += compare(parameters, given.routes)
            if given.json:
                write_json(given.json, {"runs": results})
    print(f"\n{summary(results)}")


if __name__ == "__main__":
    main()
