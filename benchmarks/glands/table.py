"""Tables of a run of the sample of seals, and of two runs side by side, in Markdown."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

Run = dict[str, Any]
Runs = dict[str, Run]
Row = TypeVar("Row", bound=tuple[Run, ...])
"""A run, or the same seal with two programs."""

MISSING = {"verdict": "not reached", "h_star_um": math.nan}
LARGEST = 0.5  # % between two h* that count as equal
GROUPS = "| seals | number | states | `ok` old | `ok` new | CPU old, s | CPU new, s |"
RESULTS = "| seals | number | states | reached | `ok` | share | the others | CPU, s: median, most |"
THEORY = "| seal | p_s / mu | stroke | h\\*, um | verdicts | theory, % | inlet over pocket |"
STATES = "| seal | p_s / mu | U, mm/s | old | new | h\\* old, um | new | % |"


def read(file: Path) -> Runs:
    """The lines of a file by the names of their seals."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return {run["seal"]: run for run in map(json.loads, lines)}


def comparison(old: Runs, new: Runs) -> str:
    """Groups by pressure and by section, then the states that differ, of seals that both have."""
    pairs = [(old[name], new[name]) for name in old if name in new]
    if not pairs:
        raise SystemExit("the files have no seal in common; run the same seals with both programs")
    for a, b in pairs:
        if a["keys"] != b["keys"]:
            raise SystemExit(f"{a['seal']}: the files have other keys; run it again with one draw")
    differing = [line for a, b in pairs for line in states(a, b)]
    told = f"States that are `ok` in one run only, or whose h\\* differs by more than {LARGEST} %:"
    tables = [*head(GROUPS), *groups(pairs), "", told if differing else f"{told} none."]
    return "\n".join([*tables, "", *head(STATES), *differing] if differing else tables)


def head(columns: str) -> list[str]:
    """The head of a table."""
    return [columns, "|---" * (columns.count("|") - 1) + "|"]


def results(runs: Runs) -> str:
    """The states that one program reached: by p_s / mu, by section, and all."""
    lines = [
        result(name, [run for (run,) in some])
        for name, some in grouped([(run,) for run in runs.values()])
    ]
    return "\n".join([*head(RESULTS), *lines])


def result(name: str, runs: Sequence[Run]) -> str:
    """A line of that table: the seals of a group."""
    asked, ok = (sum(run[key] for run in runs) for key in ("asked", "ok"))
    verdicts = Counter(state["verdict"] for run in runs for state in run["states"].values())
    others = ", ".join(
        f"{n} `{verdict}`" for verdict, n in sorted(verdicts.items()) if verdict != "ok"
    )
    times = [run["cpu_s"] for run in runs]
    share = f"{asked} | {verdicts.total()} | {ok} | {100.0 * ok / asked:.1f} %"
    return f"| {name} | {len(runs)} | {share} | {others} | {median(times):.0f}, {max(times):.0f} |"


def theories(runs: Runs) -> str:
    """The theory of the inlet beside the films of a run: a line for each seal and stroke."""
    lines = [line for run in runs.values() for line in theory(run)]
    return "\n".join([*head(THEORY), *lines])


def theory(run: Run) -> Iterator[str]:
    """Lines of that table: the strokes of a seal."""
    for sign, stroke in (("+", "out"), ("-", "in")):
        states = [state for speed, state in run["states"].items() if speed.startswith(sign)]
        films = ", ".join(f"{state['h_star_um']:.4g}" for state in states)
        verdicts = ", ".join(f"`{state['verdict']}`" for state in states)
        off = ", ".join(difference(state) for state in states)
        pockets = ", ".join(f"{state['inlet_over_pocket']:.2g}" for state in states)
        where = f"| {run['seal']} | {run['p_s/mu']:.2g} | {stroke}"
        yield f"{where} | {films} | {verdicts} | {off} | {pockets} |"


def difference(state: dict[str, Any]) -> str:
    """The theory of a state over its film, minus one, in words."""
    by_theory = state["h_star_theory_um"]
    if math.isnan(by_theory):
        return "none"
    return f"{100.0 * (by_theory / state['h_star_um'] - 1.0):+.1f}"


def groups(pairs: list[tuple[Run, Run]]) -> Iterator[str]:
    """Lines of the first table of a comparison."""
    for name, some in grouped(pairs):
        asked = sum(a["asked"] for a, _ in some)
        ok = " | ".join(str(sum(pair[k]["ok"] for pair in some)) for k in (0, 1))
        cpu = " | ".join(f"{median(pair[k]['cpu_s'] for pair in some):.1f}" for k in (0, 1))
        yield f"| {name} | {len(some)} | {asked} | {ok} | {cpu} |"


def grouped(rows: list[Row]) -> Iterator[tuple[str, list[Row]]]:
    """Runs, or pairs of them, by p_s / mu, by section, and all."""
    for group in (pressure, itemgetter("section"), lambda _: "all"):
        found: dict[str, list[Row]] = {}
        for row in rows:
            found.setdefault(group(row[0]), []).append(row)
        yield from sorted(found.items())


def pressure(run: Run) -> str:
    """The stratum of a seal."""
    low = int(run["p_s/mu"])
    return f"p_s / mu {low} to {low + 1}"


def states(old: Run, new: Run) -> Iterator[str]:
    """Lines of the second table: the states of a seal that differ."""
    for speed in dict.fromkeys([*old["states"], *new["states"]]):
        a, b = (run["states"].get(speed, MISSING) for run in (old, new))
        off = 100.0 * (b["h_star_um"] / a["h_star_um"] - 1.0)  # nan where one is missing
        if (a["verdict"] == "ok") != (b["verdict"] == "ok") or abs(off) > LARGEST:
            where = f"| {old['seal']} | {old['p_s/mu']:g} | {speed} "
            h = f"{a['h_star_um']:.4g} | {b['h_star_um']:.4g} | {off:+.2f}".replace("+nan", "nan")
            yield f"{where}| {a['verdict']} | {b['verdict']} | {h} |"
