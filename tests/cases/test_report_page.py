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
from softehl.cases.seal.states.state_files import read_profile
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


LARGEST = 5_000_000


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of two keys of the seal, two values each."""
    place = tmp_path_factory.mktemp("sweep")
    study = place / "study.toml"
    study.write_text(
        'case = "oring"\nmaterial = "neo-hooke"\ndensity = 1\nspeeds = 400\nstroke = "out"\n'
        "error_estimate = false\n"
        "[grid]\nsealed_pressure = [0.5, 1]\nmu = [0.5, 0.9]\n",
        encoding="utf-8",
    )
    assert main(["sweep", str(study), "--out", str(place / "runs"), "--quiet"]) == 0
    return place / "runs"


def test_two_folders_side_by_side(runs: tuple[Path, Path], both: Path) -> None:
    from openpyxl import load_workbook

    text = both.read_text(encoding="utf-8")
    assert len(text.encode()) < LARGEST
    soft, hard = (json.loads((r / "run.json").read_text(encoding="utf-8"))["states"] for r in runs)
    change = 100.0 * (hard[0]["h_star_um"] / soft[0]["h_star_um"] - 1.0)
    assert "hard, difference in %" in text
    assert f"<td>{change:.4g}</td>" in text
    book = load_workbook(both.with_suffix(".xlsx"))
    first = next(s for s in book.worksheets if s.title.startswith("Side by side"))
    header = [cell.value for cell in first[2]]
    assert header == ["U [mm/s]", "soft", "hard", "hard, difference in %"]
    assert [cell.value for cell in first[3]] == pytest.approx(
        [800.0, soft[0]["h_star_um"], hard[0]["h_star_um"], change]
    )


def test_a_sweep_has_a_pivot_table_and_its_best_and_worst_run(swept: Path) -> None:
    from openpyxl import load_workbook

    assert main(["report", str(swept), "--xlsx"]) == 0
    text = (swept / "report.html").read_text(encoding="utf-8")
    assert "over sealed pressure and mu</h1>" in text
    book = load_workbook(swept / "report.xlsx")
    pivot = [[c.value for c in row] for row in book["Largest friction N"].iter_rows()]
    assert pivot[1] == [None, "mu = 0.5 MPa", "mu = 0.9 MPa"]
    assert [row[0] for row in pivot[2:]] == ["sealed pressure = 0.5 MPa", "sealed pressure = 1 MPa"]
    friction = {}
    for number in range(1, 5):
        content = json.loads((swept / f"runs/{number:05d}/run.json").read_text(encoding="utf-8"))
        friction[number] = max(abs(state["rod_friction_N"]) for state in content["states"])
    assert [v for row in pivot[2:] for v in row[1:]] == pytest.approx(list(friction.values()))
    rows = {row[0].value: [c.value for c in row] for row in book["Best and worst"].iter_rows()}
    best, worst = (choose(friction, key=friction.__getitem__) for choose in (min, max))
    _, least, at, most, where = rows["largest friction [N]"]
    assert (least, most) == pytest.approx((friction[best], friction[worst]))
    assert f"(run {best})" in str(at)
    assert f"(run {worst})" in str(where)
    asked = [row[0].value for row in book["What was asked"].iter_rows()]
    assert "speeds" in asked  # the same in all runs
    assert not {"sealed_pressure", "mu"} & set(asked)
    thin = rows["thinnest film [um]"]
    assert float(str(thin[1])) > float(str(thin[3]))  # the thicker one is better
