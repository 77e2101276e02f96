"""What is asked of a seal first, in words: does it leak, and how much friction has it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from softehl.cases.harness.row import OK
from softehl.cases.seal.states.leakage import net_leakage
from softehl.cases.seal.states.state import FilmRow
from softehl.cases.seal.states.verdict import LARGEST_ERROR

STROKE = 100.0
"""Length of the stroke that steady films are answered for, mm."""


def answer(rows: Sequence[FilmRow]) -> list[str]:
    """A line for each sealed pressure and speed |U|, fast ones first."""
    if not rows:
        return []
    return [f"in a cycle of {STROKE:g} mm out and {STROKE:g} mm back:", *_speeds(rows)]


def leaks(volume: float) -> str:
    """Whether a seal leaks; volume: net, mm3 in a cycle, + = to the air side."""
    return f"leaks {volume:.3g} mm3" if volume > 0.0 else "returns what it takes out"


def _speeds(rows: Sequence[FilmRow]) -> Iterator[str]:
    found = {(row.sealed_pressure_MPa, row.rod_speed_mm_s): row for row in rows}
    nets = {(net.sealed_pressure_MPa, net.speed_mm_s): net for net in net_leakage(rows)}
    for p, speed in sorted({(p, abs(u)) for p, u in found}, key=lambda at: (at[0], -at[1])):
        strokes = {"out": found.get((p, speed)), "in": found.get((p, -speed))}
        known = {stroke: row for stroke, row in strokes.items() if row}
        net = nets.get((p, speed))
        if net is None:
            leak = "leakage needs both strokes"
        elif abs(net.net_film_um) <= 0.01 * LARGEST_ERROR * known["out"].h_star_um:
            leak = f"out and back the same within {LARGEST_ERROR:g} %: no net leakage"
        else:
            leak = leaks(STROKE * net.net_mm3_per_mm)
        forces = [f"{abs(row.rod_friction_N):.3g} N {stroke}" for stroke, row in known.items()]
        doubts = [f"{stroke} {row.verdict}" for stroke, row in known.items() if row.verdict != OK]
        doubt = f" ({', '.join(doubts)})" if doubts else ""
        yield f"  {speed:g} mm/s: {leak}; friction {', '.join(forces)}{doubt}"
