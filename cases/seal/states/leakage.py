"""Net leakage of a cycle: what the outstroke carries out minus what the instroke takes back."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from softehl.cases.harness.row import Record, column
from softehl.cases.seal.states.state import VERDICTS, FilmRow


@dataclass(frozen=True)
class LeakageRow(Record):
    """One row of `leakage.csv`: both strokes at one sealed pressure and one speed |U|."""

    sealed_pressure_MPa: float = column("MPa", "sealed pressure p_s")
    speed_mm_s: float = column("mm/s", "rod speed |U|")
    leak_out_mm3_s: float = column(
        "mm3/s", "leak rate 2 pi R q of the outstroke, + = to the air side"
    )
    leak_in_mm3_s: float = column("mm3/s", "the same of the instroke")
    net_mm3_per_mm: float = column(
        "mm3/mm",
        "net volume that leaves in a cycle for each mm of stroke, pi R (h*_out - h*_in); "
        "negative where the instroke could take back more than there is: dry on balance",
    )
    net_film_um: float = column("um", "h*_out - h*_in")
    net_mm3_per_100_m: float = column(
        "mm3", "net volume that leaves in 100 m of travel, out and back together"
    )
    net_error_percent: float = column(
        "%",
        "largest error of the net volume by the estimated errors of both h*; as a difference, it "
        "is less certain than either film; nan where not known",
    )
    verdict: str = column("", "the worse one of the two states")


def net_leakage(rows: Sequence[FilmRow]) -> list[LeakageRow]:
    """A row for each sealed pressure and speed that has both strokes, fast ones first."""
    rows_by_point = {(row.sealed_pressure_MPa, row.rod_speed_mm_s): row for row in rows}
    pairs = [
        (row, rows_by_point[p, -speed])
        for (p, speed), row in rows_by_point.items()
        if speed > 0.0 and (p, -speed) in rows_by_point
    ]
    pairs.sort(key=lambda pair: pair[0].order)
    return [_cycle(out, back) for out, back in pairs]


def per_100_m(volume: float, travel: float) -> float:
    """The net volume of a cycle of this travel (mm) as that of 100 m, out and back together."""
    return volume * 1e5 / (2.0 * travel)


def _cycle(out: FilmRow, back: FilmRow) -> LeakageRow:
    net = out.leak_rate_mm3_s / out.rod_speed_mm_s - back.leak_rate_mm3_s / back.rod_speed_mm_s
    film = out.h_star_um - back.h_star_um
    errors = sum(abs(row.h_star_error_percent) * row.h_star_um for row in (out, back))
    return LeakageRow(
        sealed_pressure_MPa=out.sealed_pressure_MPa,
        speed_mm_s=out.rod_speed_mm_s,
        leak_out_mm3_s=out.leak_rate_mm3_s,
        leak_in_mm3_s=back.leak_rate_mm3_s,
        net_mm3_per_mm=net,
        net_film_um=film,
        net_mm3_per_100_m=per_100_m(net, 1.0),
        net_error_percent=errors / abs(film) if film else inf,
        verdict=min(out.verdict, back.verdict, key=VERDICTS.index),
    )
