"""The answer to what is asked of a seal first: does it leak, and how much friction has it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from softehl.cases.harness.case import Alarm
from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.surfaces import MIXED
from softehl.cases.seal.states.leakage import LeakageRow, net_leakage, per_100_m
from softehl.cases.seal.states.plan import USUAL
from softehl.cases.seal.states.state import FilmRow
from softehl.cases.seal.states.verdict import LARGEST_ERROR

RETURNS = "returns what it takes out"

_Place = tuple[float, float]
_Strokes = Mapping[str, FilmRow]


def answer(rows: Sequence[FilmRow], travel: float) -> list[str]:
    """Answer if the seal leaks, and a line for each sealed pressure and speed |U|, fast ones first.

    travel: way of the rod from end to end, mm. A line with a film that is thinner than the
    roughness is an Alarm.
    """
    if not rows:
        return []
    found = {(row.sealed_pressure_MPa, row.rod_speed_mm_s): row for row in rows}
    nets = {(net.sealed_pressure_MPa, net.speed_mm_s): net for net in net_leakage(rows)}
    places = sorted({(p, abs(u)) for p, u in found}, key=lambda at: (at[0], -at[1]))
    strokes: dict[_Place, _Strokes] = {
        (p, speed): {
            stroke: found[p, u] for stroke, u in (("out", speed), ("in", -speed)) if (p, u) in found
        }
        for p, speed in places
    }
    kinds = {at: _kind(net, strokes[at]["out"]) for at, net in nets.items()}
    head = _whether(kinds, nets, travel, several_pressures=len({p for p, _ in places}) > 1)
    lines = [_line(at, strokes[at], nets.get(at), kinds.get(at, ""), travel) for at in places]
    return [head, *lines]


def leaks(volume: float) -> str:
    """Words for a leaking or a returning seal; volume: net, mm3 in a cycle, + = to the air side."""
    return f"leaks {volume:.3g} mm3" if volume > 0.0 else RETURNS


def far(volume: float, travel: float) -> str:
    """The net volume of a cycle (mm3) as that of 100 m, in words."""
    return f"{1e-3 * per_100_m(volume, travel):.3g} cm3 in 100 m of travel"


def _kind(net: LeakageRow, out: FilmRow) -> str:
    """Leakage of a cycle in words; "even" where both strokes carry the same within the error."""
    if abs(net.net_film_um) <= 0.01 * LARGEST_ERROR * out.h_star_um:
        return "even"
    return "leaks" if net.net_mm3_per_mm > 0.0 else "returns"


def _whether(
    kinds: Mapping[_Place, str],
    nets: Mapping[_Place, LeakageRow],
    travel: float,
    *,
    several_pressures: bool,
) -> str:
    """One line: leaks, how much and where most, or returns what it takes out."""
    if not kinds:
        return "leakage is not known: no speed has a film of both strokes"
    cycle = f"in a cycle of {travel:g} mm out and back"
    leaking = [at for at, kind in kinds.items() if kind == "leaks"]
    if not leaking:
        even = all(kind == "even" for kind in kinds.values())
        return f"{'takes back as much as it takes out' if even else RETURNS} {cycle}"
    most = max(leaking, key=lambda at: nets[at].net_mm3_per_mm)
    volume = f"{travel * nets[most].net_mm3_per_mm:.3g} mm3 {cycle}"
    if len(kinds) == 1:
        return f"leaks {volume}"
    at = f"{most[0]:g} MPa and {most[1]:g} mm/s" if several_pressures else f"{most[1]:g} mm/s"
    tight = len(kinds) - len(leaking)
    return f"leaks, most at {at}: {volume}" + (f"; not at {tight} of {len(kinds)}" if tight else "")


def _line(at: _Place, strokes: _Strokes, net: LeakageRow | None, kind: str, travel: float) -> str:
    """A speed: leakage, friction, least lambda."""
    parts = [_leakage(net, kind, travel), _friction(strokes)]
    doubts = [f"{stroke} {row.verdict}" for stroke, row in strokes.items() if row.verdict != OK]
    parts += list(_ratio(strokes))
    doubt = f" ({', '.join(doubts)})" if doubts else ""
    line, thin = f"  {at[1]:g} mm/s: {'; '.join(parts)}{doubt}", _thin(strokes)
    return Alarm(f"{line}; {thin}") if thin else line


def _leakage(net: LeakageRow | None, kind: str, travel: float) -> str:
    if net is None:
        return "leakage needs both strokes"
    out, back = (
        travel * abs(rate) / net.speed_mm_s for rate in (net.leak_out_mm3_s, net.leak_in_mm3_s)
    )
    both = f"takes out {out:.3g} mm3, could take back {back:.3g}"
    if kind == "even":
        return f"out and back the same within {LARGEST_ERROR:g} %: no net leakage ({both})"
    if kind == "returns":
        return f"{RETURNS} ({both})"
    volume = travel * net.net_mm3_per_mm
    return f"{leaks(volume)} ({both}), {far(volume, travel)}"


def _friction(strokes: _Strokes) -> str:
    forces = [f"{abs(row.rod_friction_N):.3g} N {stroke}" for stroke, row in strokes.items()]
    return f"friction {', '.join(forces)}"


def _ratio(strokes: _Strokes) -> Iterator[str]:
    """The least lambda ratio, of rough surfaces."""
    rough = {s: row for s, row in strokes.items() if row.regime}
    if rough:
        stroke, row = min(rough.items(), key=lambda item: item[1].lambda_ratio)
        yield f"least lambda {row.lambda_ratio:.3g} ({row.regime}, {stroke}stroke)"


def _thin(strokes: _Strokes) -> str:
    """Which films are thinner than the roughness of the surfaces, in words."""
    rough = [s for s, row in strokes.items() if row.regime and row.lambda_ratio < MIXED]
    smooth = [s for s, row in strokes.items() if not row.regime and row.h_min_um < USUAL]
    if rough:
        return f"film below the roughness of the surfaces: {_named(rough)}"
    if smooth:
        return f"film below the usual roughness, {USUAL:g} um: {_named(smooth)}"
    return ""


def _named(strokes: Sequence[str]) -> str:
    return ", ".join(f"{stroke}stroke" for stroke in strokes)
