"""Errors of states that a run calls `ok`, in settings drawn at random, against finer meshes.

    python -m benchmarks.verdicts FOLDER [--count 24] [--limit 150] [--only N ...]

Each setting is run as a user would, then on a mesh of at least twice its density (and at least 4)
with pressures of at least order 4. FOLDER keeps the results, one JSON file a run. References
are never run twice; delete the `run_*` files to try another program. A run that ends in an error,
or takes more than the limit (in seconds of CPU), is left out and named.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing as mp
import resource
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.gland.sections import SECTIONS
from softehl.cases.seal.solve.method import run
from softehl.cases.seal.states.state import Silent

SEED = 32
QUANTITIES = ("h_star_um", "rod_friction_N", "leak_rate_mm3_s")
MODULUS = 3.66  # MPa, of the default rubber

SHAPES: dict[str, dict[str, Any]] = {
    "round": {},
    "rectangular": {"groove_width": 4.6},
    "x_ring": {"lobe_radius": 0.9, "fillet_radius": 0.6, "housing_diameter": 56.4},
    "d_ring": {"groove_width": 4.6},
    "trapezoid": {"groove_width": 5.2},
    "u_cup": {"groove_width": 6.0},
}
"""What a section needs besides its name on the default rod, with its default height."""


def drawn(number: int) -> dict[str, Any]:
    """The keys of a number; settings that contradict each other are drawn again."""
    rng = np.random.default_rng([SEED, number])
    while True:
        section = list(SECTIONS)[number % len(SECTIONS)]
        speeds = np.exp(rng.uniform(np.log(25.0), np.log(1600.0), 2))
        given: dict[str, Any] = {
            **({} if section == "round" else {"section": section}),
            **({"groove_width": 4.3} | SHAPES[section] if section != "round" else {}),
            "density": int(rng.choice([1, 2, 4])),
            "reynolds": str(rng.choice(["fe", "dg"])),
            "pressure_order": int(rng.integers(1, 7)),
            "sealed_pressure": round(float(rng.uniform(0.0, 3.0)) * MODULUS, 2),
            "stroke": str(rng.choice(["out", "in"])),
            "speeds": tuple(sorted((float(f"{u:.2g}") for u in speeds), reverse=True)),
        }
        try:
            ORing(**given)
        except ValueError:
            continue
        return given


def reference(given: dict[str, Any]) -> dict[str, Any]:
    """The setting on a finer mesh, with the continuous film of at least order 4."""
    order, density = max(given["pressure_order"], 4), max(2 * given["density"], 4)
    same = {"reynolds": "fe", "error_estimate": False}
    return {**given, **same, "pressure_order": order, "density": density}


def _solved(given: dict[str, Any], path: str, limit: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    begun = time.process_time()
    states = run(ORing(**given), Silent()).states
    names = (*QUANTITIES, "h_star_error_percent", "rod_friction_error_percent")
    rows = [
        {"U": s.rod_speed_mm_s, "verdict": s.verdict, **{n: getattr(s, n) for n in names}}
        for s in states
    ]
    found = {"given": given, "rows": rows, "cpu_s": time.process_time() - begun}
    Path(path).write_text(json.dumps(found), encoding="utf-8")


def solved(given: dict[str, Any], path: Path, limit: float) -> list[dict[str, Any]] | None:
    """The states of a run, kept in a file; None where it takes too long or ends in an error."""
    if not path.exists():
        arguments = given, str(path), int(limit)
        process = mp.get_context("spawn").Process(target=_solved, args=arguments)
        process.start()
        process.join()
        if not path.exists():
            path.write_text(json.dumps({"given": given, "rows": None}), encoding="utf-8")
    rows: list[dict[str, Any]] | None = json.loads(path.read_text(encoding="utf-8"))["rows"]
    return rows


def errors(row: dict[str, Any], right: dict[str, Any]) -> list[float]:
    """Of h*, friction and leakage, %."""
    return [100.0 * (row[name] / right[name] - 1.0) for name in QUANTITIES]


def compared(
    rows: Sequence[dict[str, Any]], references: Sequence[dict[str, Any]]
) -> Iterator[tuple[dict[str, Any], list[float]]]:
    """The states that both runs have, each with its errors; the reference must not be doubtful."""
    right = {row["U"]: row for row in references if row["verdict"] == "ok"}
    for row in rows:
        if row["U"] in right:
            yield row, errors(row, right[row["U"]])


def told(number: int, given: dict[str, Any]) -> str:
    """A setting in a few words."""
    words = (given.get("section", "round"), f"d={given['density']}", given["reynolds"])
    order, p_s = given["pressure_order"], given["sealed_pressure"]
    return f"{number:3d} {' '.join(words)} m={order} p_s={p_s:g}"


def main() -> None:
    """Print a line for each state, and the largest errors of those that are `ok`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--limit", type=float, default=150.0)
    parser.add_argument("--only", type=int, nargs="*")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    worst, ok, others = [0.0, 0.0, 0.0], 0, 0
    for number in options.only or range(options.count):
        given = drawn(number)
        paths = (options.folder / f"{kind}_{number}.json" for kind in ("reference", "run"))
        right, rows = (
            solved(keys, path, options.limit)
            for keys, path in zip((reference(given), given), paths, strict=True)
        )
        if right is None or rows is None:
            print(
                f"{told(number, given)}: no state of the run or of its reference within the limit",
                flush=True,
            )
            continue
        for row, off in compared(rows, right):
            shown = " ".join(f"{value:+6.2f}" for value in off)
            estimates = row["h_star_error_percent"], row["rod_friction_error_percent"]
            said = " ".join(f"{value:+6.2f}" for value in estimates)
            print(
                f"{told(number, given)} U={row['U']:+g}: {shown} % (estimates {said}) "
                f"{row['verdict']}",
                flush=True,
            )
            if row["verdict"] == "ok":
                ok += 1
                worst = [max(a, abs(b)) for a, b in zip(worst, off, strict=True)]
            else:
                others += 1
    figures = ", ".join(f"{n} {v:.2f} %" for n, v in zip(QUANTITIES, worst, strict=True))
    print(f"{ok} states ok, {others} others; largest errors of those that are ok: {figures}")


if __name__ == "__main__":
    main()
