"""Errors of states that a run calls `ok`, in settings drawn at random, against finer meshes.

    python -m benchmarks.verdicts FOLDER [--count 20] [--limit 150] [--only N ...] [--page FILE]

Each setting is run as a user would, then on meshes of twice and, up to density 2, of four times its
density, with continuous pressures of at least order 4. A state counts against the finest mesh that
has it without a doubt. FOLDER keeps the states, one file of JSON lines a run; a run that FOLDER has
is not repeated. Delete the `run_*` files to try another program with the same references. A run is
stopped at the limit (seconds of CPU); what it had found by then counts. `--page` writes the tables
between the marks of a page of the documentation.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing as mp
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.marked import renew
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import FilmState, Silent

SEED = 33
QUANTITIES = {"h_star_um": "h\\*", "rod_friction_N": "friction", "leak_rate_mm3_s": "leakage"}
ALLOWED = 2.0  # %, what `ok` promises
MODULUS = 3.66  # MPa, of the default rubber
DENSITIES = (2, 1, 2, 4)
FINER = {"twice": 2, "four": 4}
FINEST = 8  # density of the most expensive reference

SHAPES: dict[str, dict[str, Any]] = {
    "round": {},
    "rectangular": {"groove_width": 4.6},
    "x_ring": {"lobe_radius": 0.9, "fillet_radius": 0.6, "housing_diameter": 56.4},
    "d_ring": {"groove_width": 4.6},
    "trapezoid": {"groove_width": 5.2},
    "u_cup": {"groove_width": 6.0},
}
"""Keys of a section besides its name, on the default rod with its default height."""

Keys = dict[str, Any]
States = dict[float, dict[str, Any]]
Line = tuple[int, Keys, dict[str, Any], list[float]]
"""A state beside its reference: number and keys of its setting, its row, its errors in per cent."""


def drawn(number: int) -> Keys:
    """The keys of a number; settings that contradict each other are drawn again.

    Sections and densities take turns, so that 24 settings have each pair.
    """
    rng = np.random.default_rng([SEED, number])
    while True:
        section = list(SHAPES)[number % len(SHAPES)]
        speeds = np.exp(rng.uniform(np.log(25.0), np.log(1600.0), 3))
        given: Keys = {
            **({} if section == "round" else {"section": section}),
            **({"groove_width": 4.3} | SHAPES[section] if section != "round" else {}),
            "density": DENSITIES[(number + number // len(SHAPES)) % len(DENSITIES)],
            "reynolds": str(rng.choice(["fe", "dg"])),
            "pressure_order": int(rng.integers(1, 7)),
            "sealed_pressure": round(float(rng.uniform(0.0, 4.0)) * MODULUS, 2),
            "stroke": str(rng.choice(["out", "in"])),
            "speeds": tuple(sorted((float(f"{u:.2g}") for u in speeds), reverse=True)),
        }
        try:
            Seal(**given)
        except ValueError:
            continue
        return given


def reference(given: Keys, times: int) -> Keys:
    """The setting on a finer mesh, with the continuous film of at least order 4."""
    order, density = max(given["pressure_order"], 4), times * given["density"]
    same = {"reynolds": "fe", "error_estimate": False}
    return {**given, **same, "pressure_order": order, "density": density}


class Keeper(Silent):
    """Writes each state to a file as soon as it is found."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def film_state(self, state: FilmState) -> None:
        """See :class:`Observer`."""
        names = (*QUANTITIES, "verdict", "h_star_error_percent", "rod_friction_error_percent")
        row = {"U": state.rod_speed_mm_s, **{name: getattr(state, name) for name in names}}
        with self.path.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(row) + "\n")


def _solve(given: Keys, path: Path, limit: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    run(Seal(**given), Keeper(path))


def solved(given: Keys, path: Path, limit: float) -> None:
    """Write the states of a run to a file, unless it is there."""
    if path.exists():
        return
    path.touch()
    process = mp.get_context("spawn").Process(target=_solve, args=(given, path, int(limit)))
    process.start()
    process.join()


def states(path: Path) -> States:
    """The states in a file by speed; none without the file."""
    if not path.exists():
        return {}
    rows = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    return {row["U"]: row for row in rows}


def references(folder: Path, number: int) -> States:
    """The states of the finest mesh that has each without a doubt."""
    found: States = {}
    for kind in FINER:
        fine = states(folder / f"{kind}_{number}.json")
        found |= {u: row for u, row in fine.items() if row["verdict"] == "ok"}
    return found


def errors(row: dict[str, Any], right: dict[str, Any]) -> list[float]:
    """Errors of h*, friction and leakage, %."""
    return [100.0 * (row[name] / right[name] - 1.0) for name in QUANTITIES]


def compared(folder: Path, number: int) -> Iterator[Line]:
    """The states of a setting that have a reference."""
    right = references(folder, number)
    for u, row in states(folder / f"run_{number}.json").items():
        if u in right:
            yield number, drawn(number), row, errors(row, right[u])


def told(line: Line) -> str:
    """A line of the second table."""
    number, given, row, off = line
    u, order = row["U"], given["pressure_order"]
    numerics = f"{given['density']}, {given['reynolds']} {order}"
    shown = " | ".join(f"{value:+.2f}" for value in off)
    estimates = row["h_star_error_percent"], row["rod_friction_error_percent"]
    said = ", ".join("-" if np.isnan(value) else f"{value:+.2f}" for value in estimates)
    p_s = Seal(**given).load_ratio(given["sealed_pressure"])
    where = f"{number} | {given.get('section', 'round')} | {numerics} | {p_s:.1f} | {u:+g}"
    return f"| {where} | {shown} | {said} | {row['verdict']} |"


def tables(folder: Path, count: int) -> str:
    """Table of `ok` states and their largest errors, then one of all states with a reference."""
    tried = [n for n in range(count) if (folder / f"run_{n}.json").exists()]
    lines = [line for number in tried for line in compared(folder, number)]
    asked = sum(len(drawn(number)["speeds"]) for number in tried)
    reached = sum(len(states(folder / f"run_{number}.json")) for number in tried)
    ok = [line for line in lines if line[2]["verdict"] == "ok"]
    wrong = [line for line in ok if max(map(abs, line[3])) > ALLOWED]
    worst = np.abs([line[3] for line in ok]).max(axis=0) if ok else np.full(3, np.nan)
    counts = len(tried), asked, reached, len(lines), len(ok), len(wrong)
    most = " | ".join(f"{value:.2f}" for value in worst)
    names = ", % | ".join(QUANTITIES.values())
    return "\n".join([
        f"| settings | states | reached | with a reference | `ok` of these | `ok` and off by more "
        f"than {ALLOWED:g} % | largest errors of `ok` states: {names}, % |",
        "|---" * 9 + "|",
        f"| {' | '.join(map(str, counts))} | {most} |",
        "",
        f"| | section | density, scheme, order | p_s / mu | U, mm/s | {names}, % | "
        "estimates of h\\*, friction, % | verdict |",
        "|---" * 10 + "|",
        *map(told, lines),
    ])  # fmt: skip


def main() -> None:
    """Run what is missing, print or write the tables."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--limit", type=float, default=150.0, help="seconds of CPU of a run")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of settings to run")
    parser.add_argument("--page", type=Path, help="page of the documentation to renew")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for number in options.only or range(options.count):
        given, path = drawn(number), options.folder / f"run_{number}.json"
        solved(given, path, options.limit)
        for kind, times in FINER.items() if states(path) else ():
            if times == 2 or times * given["density"] <= FINEST:
                path = options.folder / f"{kind}_{number}.json"
                solved(reference(given, times), path, options.limit)
    text = tables(options.folder, options.count)
    if options.page:
        renew(options.page, "verdicts", text)
    else:
        print(text)


if __name__ == "__main__":
    main()
