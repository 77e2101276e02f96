"""Net leakage of a cycle from the rows of a curve."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from softehl.cases.harness.case import Run
from softehl.cases.harness.progress import Display
from softehl.cases.harness.row import OK
from softehl.cases.harness.run_record import RunRecord
from softehl.cases.harness.runner import RecordingObserver
from softehl.cases.oring import CASE
from softehl.cases.seal.cycle.transient import March, Reading
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.leakage import LeakageRow, net_leakage
from softehl.cases.seal.states.state import OSCILLATING, UNDER_RESOLVED, FilmRow
from softehl.cases.seal.states.state_files import report_film
from softehl.runtime.io import read_csv, read_json
from tests.cases.test_cli import film_state

RADIUS = 25.0


def row(speed: float, film: float, verdict: str = OK, sealed_pressure: float = 1.0) -> FilmRow:
    """A row with the leak rate that goes with h* in micrometres, (16)."""
    state = film_state(Seal(sealed_pressure=sealed_pressure), speed, verdict)
    leak = math.pi * RADIUS * speed * film * 1e-3
    return replace(FilmRow.part_of(state), h_star_um=film, leak_rate_mm3_s=leak)


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
    rows = [row(100.0, 0.6), row(400.0, 1.4, OSCILLATING), row(-400.0, 1.1), row(-100.0, 0.5)]
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
    rows = [row(100.0, 0.6), row(-200.0, 0.8), row(-100.0, 0.5, sealed_pressure=2.0)]
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
