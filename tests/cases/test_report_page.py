"""Reports of runs: what they say, that nothing of them is elsewhere, how a browser shows them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.__main__ import main
from softehl.cases.harness.report.page import read_finished
from softehl.cases.seal.states.observer_adapter import read_profile
from softehl.cases.shipped import SHIPPED

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
GIVEN = {
    **{"density": "1", "speeds": "[800, 200]", "error_estimate": "false"},
    "oil": '"ISO VG 46"',
    "temperature": '"50 degC"',
}


def run(folder: Path, *more: str, **given: str) -> Path:
    pairs = [f"--set={key}={value}" for key, value in {**GIVEN, **given}.items()]
    assert main(["run", "oring", "--quiet", "--out", str(folder), *pairs, *more]) == 0
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    base = tmp_path_factory.mktemp("reports")
    soft = run(base / "soft", "--report", shore_A="75", ring="-226", rod="51.2")
    return soft, run(base / "hard", shore_A="80", ring="-226", rod="51.2")


@pytest.fixture(scope="module")
def page(runs: tuple[Path, Path]) -> str:
    return (runs[0] / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "words",
    [
        *("What was asked", "Gland and ring", "Deformed section", "Film and pressure"),
        *("Film thickness", "Friction", "Leakage per cycle", "Tolerances", "Versions"),
        *("What the model leaves out", "shore_A", "ISO VG 46", "+- 5: modulus", "stretch"),
    ],
)
def test_a_report_says(page: str, words: str) -> None:
    assert words in page


def test_the_stress_on_the_rod_is_its_friction(runs: tuple[Path, Path]) -> None:
    """By the trapezoidal rule; that on the seal lacks h p', far from its edges on both sides."""
    run = read_finished(runs[0], SHIPPED)
    for row in run.rows:
        profile = read_profile(run.folder, row)
        around = np.pi * run.parameters.rod_diameter
        friction = around * np.trapezoid(profile.tau_rod_MPa, profile.x_mm)
        assert friction == pytest.approx(row.rod_friction_N, rel=0.01)
        pushed = np.gradient(profile.p_MPa, profile.x_mm) * profile.h_um * 1e-3
        difference = np.abs(profile.tau_rod_MPa - profile.tau_MPa - pushed)
        assert np.median(difference) < 1e-2 * np.abs(profile.tau_rod_MPa).max()


def test_numbers_are_those_of_the_curve(runs: tuple[Path, Path], page: str) -> None:
    states = json.loads((runs[0] / "run.json").read_text(encoding="utf-8"))["states"]
    assert len(states) == 4
    for state in states:
        assert f"<td>{state['h_star_um']:.4g}</td>" in page


@pytest.fixture(scope="module")
def both(runs: tuple[Path, Path]) -> Path:
    """The page of both runs, with its tables beside it."""
    out = runs[0].with_name("both.html")
    assert main(["report", *map(str, runs), "--out", str(out), "--xlsx"]) == 0
    return out


def test_a_sweep_that_is_damaged_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.json").write_text('{"points": [], "case": "oring"}', encoding="utf-8")
    assert main(["report", str(tmp_path)]) == 2
    assert "holds no sweep that can be read" in capsys.readouterr().err


@pytest.mark.parametrize("content", [None, "{}", "nonsense"])
def test_what_is_no_run_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None
) -> None:
    if content is not None:
        (tmp_path / "run.json").write_text(content, encoding="utf-8")
    assert main(["report", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "holds no run" in error
    assert not (tmp_path / "report.html").exists()


# --- in a browser -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    selenium = pytest.importorskip("selenium.webdriver")
    if CHROMIUM is None or shutil.which("chromedriver") is None:
        pytest.skip("no Chromium with its driver")
    options = selenium.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1100,5000"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = selenium.ChromeService(shutil.which("chromedriver"))
    driver = selenium.Chrome(options=options, service=service)
    yield driver
    driver.quit()


LINE = 'Bokeh.documents[0].get_model_by_name("film out").data.h'
MOVE = 'Bokeh.documents[0].get_model_by_name("speed").value = 1'


def test_the_slider_moves_the_film_in_a_browser(
    browser: Any, runs: tuple[Path, Path], tmp_path: Path
) -> None:
    browser.set_network_conditions(offline=True, latency=0, throughput=1)
    browser.get((runs[0] / "report.html").as_uri())
    before = browser.execute_script(f"return {LINE}")
    shown = browser.get_screenshot_as_png()
    browser.execute_script(MOVE)
    browser.execute_async_script("setTimeout(arguments[0], 500)")
    after = browser.execute_script(f"return {LINE}")
    assert min(before) == pytest.approx(_thinnest(runs[0], 800), rel=1e-3)
    assert min(after) == pytest.approx(_thinnest(runs[0], 200), rel=1e-3)
    assert browser.get_screenshot_as_png() != shown
    assert "200 mm/s" in browser.execute_script(
        'return Bokeh.documents[0].get_model_by_name("speed").title'
    )
    errors = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []


def test_an_error_of_a_page_is_seen(browser: Any, tmp_path: Path) -> None:
    broken = tmp_path / "broken.html"
    broken.write_text("<script>nobody.knows();</script>", encoding="utf-8")
    browser.get(broken.as_uri())
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"]


def _thinnest(folder: Path, speed: int) -> float:
    from softehl.runtime.io import read_table

    return float(read_table(folder / f"profile_1_{speed}.csv")["h_um"].min())
