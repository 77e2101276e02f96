"""What a run says in the end: leaks or returns, friction, and the volume that is lost."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import fields, replace
from math import nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from softehl.cases import cycle, oring
from softehl.cases.harness.case import Alarm, Run
from softehl.cases.harness.progress import Display
from softehl.cases.harness.report.page import parts_of, render, write_xlsx
from softehl.cases.harness.report.part import FinishedRun, Part, ReportTable
from softehl.cases.harness.row import OK
from softehl.cases.harness.run_record import RunRecord
from softehl.cases.harness.runner import RecordingObserver
from softehl.cases.oring import CASE
from softehl.cases.seal.cycle.transient import March, Reading
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.trade.service_names import service_cycles
from softehl.cases.seal.report.parts import tolerances
from softehl.cases.seal.states.leakage import LeakageRow, net_leakage
from softehl.cases.seal.states.state import OSCILLATING, UNCERTAIN, UNDER_RESOLVED, FilmRow
from softehl.cases.seal.states.state_files import report_film
from softehl.cases.seal.states.summary import RETURNS, run_summary
from softehl.runtime.io import read_csv, read_json
from tests.cases.test_cli import film_state

RADIUS = 25.0


def row(speed: float, film: float, verdict: str = OK, sealed_pressure: float = 1.0) -> FilmRow:
    """A row with the leak rate that goes with h* in micrometres, (16)."""
    state = film_state(Seal(sealed_pressure=sealed_pressure), speed, verdict)
    leak = math.pi * RADIUS * speed * film * 1e-3
    return replace(FilmRow.part_of(state), h_star_um=film, leak_rate_mm3_s=leak)


# --- The answer of a run in words, reports of cycles, titles, and text in sheets ------------------


def test_a_warm_film_is_in_the_line_of_its_speed() -> None:
    warm = replace(row(400.0, 1.4), film_heating_K=0.621, heat_to_rod_W=7.28)
    lines = run_summary([warm, row(-400.0, 1.1)], travel=100.0)
    assert lines[1].endswith("; warms the film by 0.62 K and the rod with 7.28 W")
    assert "warms" not in run_summary([row(400.0, 1.4), row(-400.0, 1.1)], travel=100.0)[1]


@pytest.mark.parametrize(
    ("rows", "head", "said"),
    [
        (
            [row(400.0, 1.4), row(-400.0, 1.1)],
            "leaks 2.36 mm3",
            "leaks 2.36 mm3 (takes out 11 mm3, could take back 8.64), 1.18 cm3 in 100 m of travel; "
            "friction 3 N out, 3 N in",
        ),
        ([row(400.0, 1.1), row(-400.0, 1.4)], RETURNS, f"{RETURNS} (takes out 8.64 mm3, could"),
        (
            [row(400.0, 1.1), row(-400.0, 1.11)],
            "takes back as much as it takes out",
            "out and back the same within 2 %: no net leakage (",
        ),
        (
            [row(400.0, 1.1)],
            "leakage is not known: no speed has a film of both strokes",
            "friction 3 N out",
        ),
        (
            [row(-400.0, 1.1, UNCERTAIN)],
            "leakage is not known: no speed has a film of both strokes",
            "leakage needs both strokes; friction 3 N in (instroke uncertain)",
        ),
    ],
)
def test_whether_a_seal_leaks_and_what_friction_it_has(
    rows: Sequence[FilmRow], head: str, said: str
) -> None:
    first, line = run_summary(rows, 100.0)
    assert first == head + (" in a cycle of 100 mm out and back" if len(rows) > 1 else "")
    assert line.startswith("  400 mm/s: ")
    assert said in line
    assert not isinstance(line, Alarm)


def test_leakage_of_a_service() -> None:
    """A cycle of 100 mm at 400 mm/s lasts 0.5 s: 2000 h are 1.44e7 cycles, 500 km 2.5e6."""
    rows = [row(400.0, 1.4), row(-400.0, 1.1)]
    cycle_mm3 = float(re.findall(r"leaks (\S+) mm3", run_summary(rows, 100.0)[0])[0])
    for service, cycles_of_it in {"1e6 cycles": 1e6, "2000 h": 1.44e7, "500 km": 2.5e6}.items():
        line = run_summary(rows, 100.0, service=service)[1]
        (litres,) = re.findall(rf"travel, (\S+) l in {service};", line)
        assert float(litres) == pytest.approx(1e-6 * cycle_mm3 * cycles_of_it, rel=0.01)
    with pytest.raises(ValueError, match='write "1e6 cycles", "2000 h" or "500 km"'):
        Seal(service="2000")
    assert service_cycles("3 km", 100.0, 0.5) == 15_000.0


def test_films_thinner_than_roughness_are_an_alarm() -> None:
    back = replace(row(-400.0, 1.1), lambda_ratio=0.7, regime="boundary")
    out = replace(row(400.0, 1.4), lambda_ratio=3.5, regime="full")
    line = run_summary([out, back], 100.0)[1]
    assert isinstance(line, Alarm)
    assert line.endswith(
        "least lambda 0.7 (boundary, instroke); film below the roughness of the surfaces: instroke"
    )
    smooth = replace(row(400.0, 1.4), h_min_um=0.1)
    assert isinstance(run_summary([smooth], 100.0)[1], Alarm)
    assert "usual roughness, 0.2 um: outstroke" in run_summary([smooth], 100.0)[1]
    page = render([cycles()], [Part("x", lines=[line, "calm"])])
    assert f'<li class="not">{line}</li><li>calm</li>' in page


def cycles() -> FinishedRun:
    last = cycle.CycleRow(
        cycle=3.0,
        leak_mm3=0.51,
        leak_sealed_mm3=0.5,
        friction_out_N=12.0,
        friction_in_N=-10.0,
        energy_mJ=425.0,
        h_min_um=0.3,
        p_max_MPa=4.0,
        asperity_load_percent=1.0,
        change_percent=0.2,
        mass_error=0.0,
        steps=100,
        newton_iterations=300,
        verdict=OK,
    )
    return FinishedRun(Path("results/cycle"), cycle.CASE, cycle.Cycle(), [last], content={})


def test_a_report_of_cycles_has_their_numbers() -> None:
    run = cycles()
    said = (
        "cycle 3: leaks 0.51 mm3, 1.28 cm3 in 100 m of travel; friction 12 N out, 10 N in at most; "
        "its work 425 mJ"
    )
    assert run.case.summary(run.parameters, run.rows) == [said]
    assert parts_of([run])[0].title == "Answer"
    page = render([run], parts_of([run]))
    assert said in page
    assert ">energy [mJ]</th>" in page
    assert "every speed is a steady state" not in page


def test_a_table_of_speeds_has_the_leakage_of_its_service() -> None:
    """A trapezoid by its keys, and as a table, whose speed turns between two of its times."""
    run = cycles()
    by_keys = cycle.Cycle(shape="trapezoidal", travel=30.0, frequency=1.5, service="2000 h")
    table = by_keys.path.speed
    motion = tuple(zip(table.times, table.values, strict=True))
    by_table = cycle.Cycle(motion=motion, service="2000 h")
    assert by_table.path.distance == pytest.approx(60.0)
    (line,) = run.case.summary(by_keys, run.rows)
    assert "5.51 l in 2000 h" in line  # 0.51 mm3 in 1.08e7 cycles
    assert run.case.summary(by_table, run.rows) == [line]


def test_a_rod_that_does_not_come_back_returns_nothing() -> None:
    run = cycles()
    back = replace(run.rows[0], leak_mm3=-0.51)
    assert "returns what it takes out" in run.case.summary(run.parameters, [back])[0]
    motion = ((0.0, 100.0), (0.2, 100.0), (0.25, -100.0))
    (line,) = run.case.summary(cycle.Cycle(motion=motion), [back])
    assert line.startswith("cycle 3: -0.51 mm3 past the air end, by a rod that does not come back")


def test_rough_cycles_say_how_they_break_away() -> None:
    run = cycles()
    known = replace(run.rows[0], breakaway_N=15.0, lambda_ratio=3.5)
    (calm,) = run.case.summary(run.parameters, [known])
    assert "10 N in at most; 15 N to break away; its work 425 mJ; least lambda 3.5" in calm
    assert not isinstance(calm, Alarm)
    (one_way,) = run.case.summary(run.parameters, [replace(known, friction_in_N=9.0)])
    assert "friction 12 N out at most; 15 N to break away" in one_way
    (line,) = run.case.summary(run.parameters, [replace(known, lambda_ratio=0.7)])
    assert isinstance(line, Alarm)
    assert line.endswith("least lambda 0.7; film below the roughness of the surfaces")


def test_breaking_away_is_friction_of_a_slow_rod() -> None:
    """Of a rod that is slow for a while: not the friction at full speed."""
    ones: dict[str, Any] = dict.fromkeys((f.name for f in fields(Reading)), 1)
    made = Reading(**{**ones, "lambda_ratio": 2.0})
    speeds, forces = (0.0, 5.0, 100.0, -5.0), (3.0, 8.0, 20.0, -9.0)
    readings = [
        replace(made, t_s=float(k), rod_speed_mm_s=u, friction_N=f)
        for k, (u, f) in enumerate(zip(speeds, forces, strict=True))
    ]
    films = SimpleNamespace(readings=readings[1:])
    found = cycle.cycle_row(1, 25.0, films, readings[0], None)
    assert found.breakaway_N == 9.0
    assert found.lambda_ratio == 2.0


def test_tolerances_of_a_cup_are_those_of_its_rod() -> None:
    """The name of a U-cup is that of its groove: the ring itself has none that are known."""
    cup = Seal.model_validate({"ring": "U-cup 25x35x8", "rod": "25 f7"})
    seals = (cup, Seal(ring="36x4", rod=36))
    runs = [FinishedRun(Path("a"), oring.CASE, seal, [], content={}) for seal in seals]
    of_cup, of_ring = ([row[1] for row in tolerances([r]).tables[0].rows] for r in runs)
    assert of_cup == ["rod = 25 mm"]
    assert of_ring == ["section diameter = 4 mm", "inner diameter = 36 mm"]


def test_no_text_of_a_sheet_is_a_formula(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    texts = ("=1+1", "+1+1", "-1+1", "@A1")
    table = ReportTable("=1+1", texts, [texts, (1.0, 2, nan, "ok")])
    write_xlsx([Part("x", tables=[table])], tmp_path / "a.xlsx")
    book = openpyxl.load_workbook(tmp_path / "a.xlsx")
    cells = [cell for line in book.worksheets[0].iter_rows() for cell in line]
    given = [cell for cell in cells if str(cell.value)[0] in "=+-@"]
    assert len(given) == 9
    assert {(cell.data_type, cell.quotePrefix) for cell in given} == {("s", True)}
    assert [cell.value for cell in book.worksheets[0][4]] == [1, 2, None, "ok"]


# --- Net leakage of a cycle from the rows of a curve ----------------------------------------------


def test_an_outstroke_leaves_the_film_that_its_flux_has() -> None:
    """The flux is U h* / 2, and h* stays on the rod; an instroke leaves nothing."""
    of = cast("March", SimpleNamespace(_fastest=100.0))
    for speed, left in ((80.0, pytest.approx(3e-3)), (-80.0, None)):
        flux = 0.5 * speed * 3e-3
        at = cast("Reading", SimpleNamespace(rod_speed_mm_s=speed, flux_air_mm2_s=flux))
        assert March.left(of, at) == left


ERRORS = ((100.0, 0.6, 1.0), (-100.0, 0.5, -0.6))
"""U in mm/s, h* in um, estimated error in per cent."""


def test_net_leakage_is_the_difference_of_the_two_films() -> None:
    rows = [
        row(100.0, 0.6),
        row(400.0, 1.4, OSCILLATING),
        row(-400.0, 1.1),
        row(-100.0, 0.5),
    ]
    fast, slow = net_leakage(rows)
    assert (fast.speed_mm_s, slow.speed_mm_s) == (400.0, 100.0)
    assert fast.net_film_um == pytest.approx(0.3)
    assert fast.net_mm3_per_mm == pytest.approx(math.pi * RADIUS * 0.3e-3)
    assert fast.net_mm3_per_100_m == pytest.approx(50e3 * math.pi * RADIUS * 0.3e-3)
    assert slow.net_mm3_per_mm == pytest.approx(math.pi * RADIUS * 0.1e-3)
    assert fast.leak_out_mm3_s > 0.0 > fast.leak_in_mm3_s
    assert (fast.verdict, slow.verdict) == (OSCILLATING, OK)


def test_the_error_of_the_net_volume_is_that_of_a_difference() -> None:
    out, back = (replace(row(u, h), h_star_error_percent=e) for u, h, e in ERRORS)
    assert net_leakage([out, back])[0].net_error_percent == pytest.approx(0.9 / 0.1)
    unknown = replace(back, h_star_error_percent=math.nan)
    assert math.isnan(net_leakage([out, unknown])[0].net_error_percent)


def test_only_speeds_with_both_strokes_at_one_pressure_count() -> None:
    rows = [
        row(100.0, 0.6),
        row(-200.0, 0.8),
        row(-100.0, 0.5, sealed_pressure=2.0),
    ]
    assert net_leakage(rows) == []


def test_the_worse_verdict_of_the_two_is_kept() -> None:
    rows = [row(100.0, 0.6, OSCILLATING), row(-100.0, 0.5, UNDER_RESOLVED)]
    assert net_leakage(rows)[0].verdict == UNDER_RESOLVED


def test_a_run_of_both_strokes_writes_the_table(tmp_path: Path) -> None:
    run = Run(CASE, Seal(speeds=(400.0, 100.0)))
    record = RunRecord(tmp_path / "both", run, "refuse")
    observer = RecordingObserver(Display(), CASE, "both", record=record)
    for speed in (400.0, -400.0, 100.0):
        report_film(observer, film_state(run.parameters, speed))
        assert (record.folder / "leakage.csv").exists() == (speed != 400.0)
    (only,) = read_csv(record.folder / "leakage.csv", LeakageRow.header())
    assert only[1] == "400"
    (entry,) = read_json(record.folder / "run.json")["leakage"]
    assert entry["net_film_um"] == 0.0
