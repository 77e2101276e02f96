"""Summary of a run: leakage and friction in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from softehl.cases.harness.case import Alarm
from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.surfaces import MIXED
from softehl.cases.seal.gland.trade.service_names import service_cycles
from softehl.cases.seal.states.leakage import LeakageRow, net_leakage, per_100_m
from softehl.cases.seal.states.run_plan import USUAL
from softehl.cases.seal.states.state import ESTIMATED, FilmRow
from softehl.cases.seal.states.verdict import LARGEST_ERROR

RETURNS = "returns what it takes out"


@dataclass(frozen=True)
class _Speed:
    """A sealed pressure and a speed |U|: its strokes, and their cycle where it has both."""

    sealed_pressure: float
    speed: float
    strokes: Mapping[str, FilmRow]
    net: LeakageRow | None

    @property
    def kind(self) -> str:
        """Leakage in words: "leaks", "returns", or "even" where both are the same within errors."""
        if self.net is None:
            return ""
        if abs(self.net.net_film_um) <= 0.01 * LARGEST_ERROR * self.strokes["out"].h_star_um:
            return "even"
        return "leaks" if self.net.net_mm3_per_mm > 0.0 else "returns"


def run_summary(
    rows: Sequence[FilmRow], travel: float, stroke: str = "both", service: str | None = None
) -> list[str]:
    """Answer if the seal leaks, and a line for each sealed pressure and speed |U|, fast ones first.

    travel: way of the rod from end to end, mm. stroke: what was asked for. service: such as "2000
    h", which the leakage is also given for. A line with a film that
    is thinner than the roughness is an Alarm.
    """
    if not rows:
        return []
    nets = {(net.sealed_pressure_MPa, net.speed_mm_s): net for net in net_leakage(rows)}
    strokes = dict[tuple[float, float], dict[str, FilmRow]]()
    for row in sorted(rows, key=lambda row: row.order):
        at = row.sealed_pressure_MPa, abs(row.rod_speed_mm_s)
        strokes.setdefault(at, {})[row.stroke] = row
    points = sorted(strokes, key=lambda at: (at[0], -at[1]))
    speeds = [_Speed(p_s, u, strokes[p_s, u], nets.get((p_s, u))) for p_s, u in points]
    first = _whether(speeds, travel)
    if stroke != "both" and not nets:
        first = f'{stroke}stroke alone, as asked for; leakage needs stroke = "both"'
    return [first, *(_line(speed, travel, stroke, service) for speed in speeds)]


def leaks(volume: float) -> str:
    """Words for a leaking or a returning seal; volume: net, mm3 in a cycle, + = to the air side."""
    return f"leaks {volume:.3g} mm3" if volume > 0.0 else RETURNS


def far(volume: float, travel: float, service: str | None = None, period: float = 0.0) -> str:
    """The net volume of a cycle (mm3) as that of 100 m, and of a service, in words.

    period: of a cycle, s.
    """
    in_100_m = f"{1e-3 * per_100_m(volume, travel):.3g} cm3 in 100 m of travel"
    if service is None:
        return in_100_m
    total = 1e-3 * volume * service_cycles(service, travel, period)
    text = f"{total:.3g} cm3" if total < 1e3 else f"{1e-3 * total:.3g} l"
    return f"{in_100_m}, {text} in {service}"


def _whether(speeds: Sequence[_Speed], travel: float) -> str:
    """One line: leaks, how much and where most, or returns what it takes out."""
    kinds = [speed.kind for speed in speeds if speed.kind]
    if not kinds:
        return "leakage is not known: no speed has a film of both strokes"
    cycle = f"in a cycle of {travel:g} mm out and back"
    leaking = [(s.net.net_mm3_per_mm, s) for s in speeds if s.net and s.kind == "leaks"]
    if not leaking:
        even = set(kinds) == {"even"}
        return f"{'takes back as much as it takes out' if even else RETURNS} {cycle}"
    rate, worst = max(leaking, key=lambda item: item[0])
    volume = f"{travel * rate:.3g} mm3 {cycle}"
    if len(kinds) == 1:
        return f"leaks {volume}"
    several = len({speed.sealed_pressure for speed in speeds}) > 1
    at = f"{worst.sealed_pressure:g} MPa and " * several + f"{worst.speed:g} mm/s"
    tight = len(kinds) - len(leaking)
    return f"leaks, most at {at}: {volume}" + (f"; not at {tight} of {len(kinds)}" if tight else "")


def _line(speed: _Speed, travel: float, stroke: str, service: str | None) -> str:
    """A speed: leakage, friction, least lambda."""
    strokes = speed.strokes
    parts = [f"friction {_forces(strokes)}", *_ratio(strokes), *_warmth(strokes)]
    if speed.net is not None or stroke == "both":
        parts.insert(0, _leakage(speed, travel, service))
    verdicts = {f"{stroke}stroke": row.verdict for stroke, row in strokes.items()}
    doubted = [f"{name} {word}" for name, word in verdicts.items() if word != OK]
    if len(doubted) == 2 and len(set(verdicts.values())) == 1:
        doubted = [f"both strokes {next(iter(verdicts.values()))}"]
    doubt = f" ({', '.join(doubted)})" if doubted else ""
    line, thin = f"  {speed.speed:g} mm/s: {'; '.join(parts)}{doubt}", _thin(strokes)
    return Alarm(f"{line}; {thin}") if thin else line


def _forces(strokes: Mapping[str, FilmRow]) -> str:
    """The friction of each stroke in words."""
    if not any(isfinite(row.rod_friction_N) for row in strokes.values()):
        return "not known"
    return ", ".join(f"{_force(row)} {stroke}" for stroke, row in strokes.items())


def _force(row: FilmRow) -> str:
    """The friction of a row in words."""
    return f"{abs(row.rod_friction_N):.3g} N" if isfinite(row.rod_friction_N) else "not known"


def _leakage(speed: _Speed, travel: float, service: str | None) -> str:
    net, kind = speed.net, speed.kind
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
    period = 2.0 * travel / net.speed_mm_s
    text = f"{leaks(volume)} ({both}), {far(volume, travel, service, period)}"
    if net.verdict == ESTIMATED:
        text += f", within {net.net_error_percent:.2g} %"
    return text


def _ratio(strokes: Mapping[str, FilmRow]) -> Iterator[str]:
    """The least lambda ratio, of rough surfaces."""
    rough = {s: row for s, row in strokes.items() if row.regime}
    if rough:
        stroke, row = min(rough.items(), key=lambda item: item[1].lambda_ratio)
        yield f"least lambda {row.lambda_ratio:.3g} ({row.regime}, {stroke}stroke)"


def _warmth(strokes: Mapping[str, FilmRow]) -> Iterator[str]:
    """How warm friction makes the film, and the heat into the rod, of the warmest stroke."""
    warm = [row for row in strokes.values() if row.film_heating_K > 0.0]
    if warm:
        row = max(warm, key=lambda row: row.film_heating_K)
        rise, power = row.film_heating_K, row.heat_to_rod_W
        yield f"warms the film by {rise:.2g} K and the rod with {power:.3g} W"


def _thin(strokes: Mapping[str, FilmRow]) -> str:
    """Which films are thinner than the roughness of the surfaces, in words."""
    rough = [s for s, row in strokes.items() if row.regime and row.lambda_ratio < MIXED]
    smooth = [s for s, row in strokes.items() if not row.regime and row.thickness_um < USUAL]
    if rough:
        return f"film below the roughness of the surfaces: {_named(rough)}"
    if smooth:
        return f"film below the usual roughness, {USUAL:g} um: {_named(smooth)}"
    return ""


def _named(strokes: Sequence[str]) -> str:
    return ", ".join(f"{stroke}stroke" for stroke in strokes)
