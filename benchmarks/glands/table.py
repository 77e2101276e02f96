"""The comparison of two runs of the sample of seals, in Markdown."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

Run = dict[str, Any]
Runs = dict[str, Run]

LARGEST = 0.5  # % between two h* that count as equal
GROUPS = "| seals | number | states | `ok` old | `ok` new | CPU old, s | CPU new, s |"
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
    groups = [line for name, some in grouped(pairs) if (line := group(name, some))]
    differing = [line for a, b in pairs for line in states(a, b)]
    told = f"States that are `ok` in one run only, or whose h\\* differs by more than {LARGEST} %:"
    if not differing:
        return "\n".join([*head(GROUPS), *groups, "", told.replace(":", ": none.")])
    return "\n".join([*head(GROUPS), *groups, "", told, "", *head(STATES), *differing])


def head(columns: str) -> list[str]:
    """The head of a table."""
    return [columns, "|---" * (columns.count("|") - 1) + "|"]


def grouped(pairs: list[tuple[Run, Run]]) -> Iterator[tuple[str, list[tuple[Run, Run]]]]:
    """The seals by p_s / mu, by section, and all."""
    for low in range(5):
        yield f"p_s / mu {low} to {low + 1}", [x for x in pairs if int(x[0]["p_s/mu"]) == low]
    for section in dict.fromkeys(a["section"] for a, _ in pairs):
        yield section, [x for x in pairs if x[0]["section"] == section]
    yield "all", pairs


def group(name: str, pairs: list[tuple[Run, Run]]) -> str:
    """A line of the first table: sums of states, medians of CPU time; empty without seals."""
    if not pairs:
        return ""
    asked = sum(a["asked"] for a, _ in pairs)
    ok = [sum(pair[k]["ok"] for pair in pairs) for k in (0, 1)]
    cpu = [f"{median(pair[k]['cpu_s'] for pair in pairs):.1f}" for k in (0, 1)]
    return f"| {name} | {len(pairs)} | {asked} | {ok[0]} | {ok[1]} | {cpu[0]} | {cpu[1]} |"


def states(old: Run, new: Run) -> Iterator[str]:
    """Lines of the second table: the states of a seal that differ."""
    for speed in dict.fromkeys([*old["states"], *new["states"]]):
        both = [run["states"].get(speed) for run in (old, new)]
        verdicts = [state["verdict"] if state else "not reached" for state in both]
        h = [f"{state['h_star_um']:.4g}" if state else "" for state in both]
        off = 0.0
        if both[0] and both[1]:
            off = 100.0 * (both[1]["h_star_um"] / both[0]["h_star_um"] - 1.0)
        if verdicts.count("ok") == 1 or abs(off) > LARGEST:
            told = f"{off:+.2f}" if all(both) else ""
            where = f"| {old['seal']} | {old['p_s/mu']:g} | {speed} "
            yield f"{where}| {verdicts[0]} | {verdicts[1]} | {h[0]} | {h[1]} | {told} |"
