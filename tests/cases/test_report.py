"""Pictures, pages and files of finished runs."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from math import nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import matplotlib
import meshio
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from softehl.__main__ import main
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.file_content import write_content
from softehl.cases.harness.report.page import read_finished
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.harness.row import OK
from softehl.cases.oring import CASE
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import regime
from softehl.cases.seal.report import style
from softehl.cases.seal.report.gland_drawing import gland_figure
from softehl.cases.seal.report.paraview import PARTS, gland_outlines, write_paraview
from softehl.cases.seal.report.pictures import (
    crossing,
    curve_figure,
    fitted_exponent,
    hersey_um,
    stribeck_figure,
)
from softehl.cases.seal.report.section import (
    View,
    nodal_von_mises,
    section_figure,
)
from softehl.cases.seal.report.system_export import (
    BLOCKS,
    FILES,
    FrictionLaw,
    SealMap,
    modelica,
    write_hand_over,
)
from softehl.cases.seal.solve.driver import run as solve
from softehl.cases.seal.states.section_view import principal_stretches, section_view
from softehl.cases.seal.states.state import (
    COLLAPSED,
    OSCILLATING,
    FilmRow,
    Profile,
    Section,
    Silent,
)
from softehl.cases.seal.states.state_files import read_profile
from softehl.cases.shipped import SHIPPED
from softehl.runtime.analyses.callbacks import read_series
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.io import read_csv
from tests.cases.oring_cases import film_values, oring

# --- The pictures of a run, looked at: what they say, show and mark -------------------------------


SEAL = Seal()
HEAD = style.subject(SEAL)
SPEEDS = (100.0, 400.0, 1600.0)


def row(speed: float, h_star: float, error: float = 0.5, verdict: str = OK) -> FilmRow:
    values = film_values(
        sealed_pressure_MPa=1.0,
        rod_speed_mm_s=speed,
        h_star_um=h_star,
        h_star_error_percent=error,
        h_min_um=0.8 * h_star,
        p_max_MPa=3.7,
        rod_friction_N=9.0,
        leak_rate_mm3_s=400.0,
        contact_start_mm=-0.6,
        contact_end_mm=1.1,
        newton_iterations=9,
        contact_p_max_MPa=3.7,
        density=2,
        verdict=verdict,
    )
    return FilmRow(**values)


def power_law(exponent: float) -> list[FilmRow]:
    """Both strokes with one exponent and other factors."""
    factors = ((1.0, 0.05), (-1.0, 0.04))
    return [row(sign * u, a * u**exponent) for sign, a in factors for u in SPEEDS]


def profile(h_star: float) -> Profile:
    x = np.linspace(-0.9, 1.3, 23)
    p = np.maximum(3.7 - 4.0 * (x - 0.2) ** 2, 0.0)
    return Profile(x, h_star + 40.0 * (x - 0.2) ** 4, p, 0.01 * x, h_star + 0.0 * x, 0.01 * x)


def square(pressure: float = 3.0) -> Section:
    """One cell between rod and housing, pressed at the top."""
    points = np.array([[-1.5, 25.0], [1.5, 25.0], [1.5, 28.15], [-1.5, 28.15]])
    stress = {"zz": [-1.0, -1.0, 0.0, 0.0], "rr": [-3.0] * 4, "tt": [-2.0] * 4, "zr": [0.5] * 4}
    data = {f"sigma_{name}": np.array(values) for name, values in stress.items()}
    data["contact_pressure"] = np.array([0.0, 0.0, pressure, pressure])
    return Section(points, np.array([[0, 1, 2, 3]]), data)


@pytest.fixture(autouse=True)
def styled() -> Iterator[None]:
    with matplotlib.rc_context(style.STYLE):
        yield


def texts(figure: Figure) -> str:
    """Everything that is written on a picture."""
    figure.canvas.draw()
    found = [text.get_text() for text in figure.findobj(Text) if isinstance(text, Text)]
    return "\n".join(found)


def drawn(line: Line2D) -> NDArray[np.float64]:
    """The data of a line, (2, n)."""
    return np.asarray(line.get_data(), dtype=np.float64)


def legend(axes: Axes) -> list[str]:
    found = axes.get_legend()
    assert found is not None
    return [text.get_text() for text in found.get_texts()]


# --- every picture -----------------------------------------------------------------------------


# --- film thickness over speed -----------------------------------------------------------------


@pytest.mark.parametrize("exponent", [0.5, 0.605])
def test_the_slope_is_the_measured_one(exponent: float) -> None:
    rows = power_law(exponent)
    assert fitted_exponent(rows) == pytest.approx(exponent, abs=1e-12)
    axes = curve_figure(HEAD, rows).axes[0]
    assert f"slope {exponent:.3f} (fitted)" in legend(axes)
    (dashed,) = (line for line in axes.lines if line.get_linestyle() == "--")
    (x0, x1), (y0, y1) = np.log(drawn(dashed))
    assert (y1 - y0) / (x1 - x0) == pytest.approx(exponent, abs=1e-12)
    assert (drawn(dashed)[1] > [r.h_star_um for r in (rows[0], rows[2])]).all()


def test_a_slope_is_not_fitted_to_doubtful_states() -> None:
    rows = [*power_law(0.6)[:3], row(25.0, 9.9, verdict=OSCILLATING)]
    assert fitted_exponent(rows) == pytest.approx(0.6, abs=1e-12)


def test_verdicts_are_marked() -> None:
    rows = [*power_law(0.6)[:3], row(25.0, 0.3, verdict=OSCILLATING)]
    lost = replace(row(10.0, 0.1), verdict=COLLAPSED)
    figure = curve_figure(HEAD, rows, [lost])
    axes = figure.axes[0]
    assert "outstroke, film collapsed: no result" in legend(axes)
    assert "oscillating" in texts(figure)
    hollow = [line for line in axes.lines if line.get_markerfacecolor() == "white"]
    assert [drawn(line)[0].tolist() for line in hollow] == [[25.0]]
    (cross,) = (line for line in axes.lines if line.get_marker() == "x")
    x, y = drawn(cross)
    assert x.tolist() == [10.0]
    assert y[0] < 0.05  # on the axis, not at its thickness


# --- profiles ----------------------------------------------------------------------------------


# --- the section -------------------------------------------------------------------------------


def test_von_mises_of_plain_stress_states() -> None:
    def of(**stress: float) -> float:
        data = {f"sigma_{at}": np.array([stress.get(at, 0.0)]) for at in ("zz", "rr", "tt", "zr")}
        return float(nodal_von_mises(Section(np.zeros((1, 2)), np.zeros((0, 4), int), data))[0])

    assert of(zz=-5.0, rr=-5.0, tt=-5.0) == pytest.approx(0.0, abs=1e-12)
    assert of(rr=3.0) == pytest.approx(3.0)
    assert of(zr=2.0) == pytest.approx(2.0 * 3.0**0.5)


GLANDS: tuple[dict[str, Any], ...] = (
    {},
    {"bore": 40.0, "ring": "32x4"},
    {"section": "u_cup", "groove_width": 6.0, "housing_diameter": 56.4},
)


@pytest.mark.parametrize("given", GLANDS)
def test_nothing_of_a_picture_is_cut_off(given: dict[str, Any]) -> None:
    p, r, section = Seal(**given), power_law(0.6)[2], square()
    data = {name: 400.0 * values for name, values in section.point_data.items()}
    view = View(r, profile(r.h_star_um), replace(section, point_data=data))
    for figure in (gland_figure(p), section_figure(p, [view]), section_figure(p, [view, view])):
        figure.draw_without_rendering()
        drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert -0.02 < drawn.x0 < drawn.x1 < width + 0.02
        assert -0.02 < drawn.y0 < drawn.y1 < height + 0.02


def rough_rows() -> list[FilmRow]:
    """A stroke each way whose lambda ratio is the square root of |U|."""
    return [
        replace(
            row(sign * u, 0.05 * u**0.5),
            rod_friction_N=sign * (50.0 / (1.0 + u) + 0.1 * u),
            lambda_ratio=u**0.5,
            regime=regime(u**0.5),
            asperity_load_percent=100.0 / (1.0 + u),
            boundary_friction_percent=100.0 / (1.0 + 0.1 * u),
        )
        for sign in (1.0, -1.0)
        for u in (0.1, 4.0, 100.0)
    ]


def test_the_stribeck_picture_marks_regimes_and_shares() -> None:
    p = Seal.model_validate({"roughness": 0.3})
    rows = rough_rows()
    outstroke = rows[:3]
    # straight in logarithms: lambda is one at 1 mm/s and three at 9 mm/s
    for ratio, speed in ((1.0, 1.0), (3.0, 9.0)):
        place = crossing(p, outstroke, ratio)
        assert place == pytest.approx(1e3 * p.viscosity * speed / 3.7)
    assert crossing(p, outstroke, 20.0) is None
    assert hersey_um(p, rows[-1]) == pytest.approx(1e3 * p.viscosity * 100.0 / 3.7)
    figure = stribeck_figure(p, rows)
    assert figure is not None
    said = texts(figure)
    assert said.count("boundary | mixed") == said.count("mixed | full") == 2
    assert "seal 0.3" in said
    friction, shares = figure.axes
    drawn = [np.asarray(line.get_ydata()) for line in friction.get_lines()]
    np.testing.assert_allclose(drawn[0], [abs(r.rod_friction_N) for r in outstroke])
    assert [line.get_linestyle() for line in shares.get_lines()].count("--") == 2


def test_films_that_flow_against_the_rod_are_left_out_of_the_curve() -> None:
    """Pressure drives oil through asperities faster than a slow rod: h* < 0."""
    rows = [*rough_rows(), replace(row(-0.01, 1.0), h_star_um=-0.2)]
    (axes,) = curve_figure(HEAD, rows).axes
    drawn = np.concatenate([np.asarray(line.get_ydata()) for line in axes.get_lines()])
    assert np.min(drawn) > 0.0


# --- Reports of runs: what they say, that nothing of them is elsewhere, how a browser shows -------


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

    return float(read_table(folder / f"profile_1MPa_out_{speed}mm_s.csv")["h_um"].min())


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


# --- What ParaView is given: stresses, stretches and pressures against closed forms, the gland ----


DOCS = Path(__file__).parents[2] / "docs"
X_RING: dict[str, Any] = {
    **{"section": "x_ring", "lobe_radius": 0.9, "fillet_radius": 0.6},
    **{"housing_diameter": 56.4, "groove_width": 4.3},
}


def cells_of(path: Path) -> tuple[Array, Integers, dict[str, Array], dict[str, Array]]:
    """Points (n, 2), cells, point data and cell data of a section, by meshio."""
    mesh = meshio.read(path)
    data = {name: values[0] for name, values in mesh.cell_data.items()}
    return mesh.points[:, :2], mesh.cells_dict["quad"], dict(mesh.point_data), data


def pulled(axial: float, radial: float) -> tuple[SealSystem, Array]:
    """A section whose every place is stretched alike."""
    system = build_system(oring(density=1, solid="fbar"))
    x = system.at_rest()
    system.displacements(x)[:] = system.mesh.points * [axial - 1.0, radial - 1.0]
    return system, x


@pytest.mark.parametrize(("axial", "radial"), [(1.2, 0.93), (0.8, 1.1)])
def test_a_section_that_is_stretched_alike_everywhere(
    axial: float, radial: float, tmp_path: Path
) -> None:
    """Von Mises stress of a Mooney-Rivlin rubber in closed form; stretches as they were given."""
    system, x = pulled(axial, radial)
    mu_1, mu_2 = (system.parameters.rubber_values[name] for name in ("mu_1", "mu_2"))
    view = section_view(system, x, np.zeros(system.mesh.arc + 1))
    write_content(tmp_path / "s.vtu", view)
    *_, data = cells_of(tmp_path / "s.vtu")
    volume = axial * radial**2
    a, b = axial / volume ** (1 / 3), radial / volume ** (1 / 3)
    stress = abs(mu_1 * (a**2 - b**2) + mu_2 * (b**-2 - a**-2)) / volume
    np.testing.assert_allclose(data["von_mises"], stress, rtol=1e-9)
    np.testing.assert_allclose(data["stretch_1"], max(axial, radial), rtol=1e-12)
    np.testing.assert_allclose(data["stretch_2"], min(axial, radial), rtol=1e-12)
    np.testing.assert_allclose(data["stretch_hoop"], radial, rtol=1e-12)


def stretches_of_one(before: Array, after: Array) -> Array:
    """Principal stretches (3,) in the middle of a cell of these corners (4, 2), from scratch."""
    slopes = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
    gradient = np.eye(3)
    gradient[:2, :2] = np.linalg.solve(slopes @ before, slopes @ after).T
    gradient[2, 2] = after[:, 1].sum() / before[:, 1].sum()
    return np.asarray(np.sqrt(np.linalg.eigvalsh(gradient.T @ gradient)))


def volumes(points: Array, cells: Integers) -> Array:
    """Volumes of revolution of cells, per radian, by two triangles each."""
    total = np.zeros(len(cells))
    for corners in ([0, 1, 2], [0, 2, 3]):
        a, b, c = (points[cells[:, k]] for k in corners)
        (z_1, r_1), (z_2, r_2) = (b - a).T, (c - a).T
        total += (z_1 * r_2 - r_1 * z_2) * (a + b + c)[:, 1] / 6.0
    return total


def beside(x: Array, p: Array, at: Array) -> list[Array]:
    """p (n,) known at x (n,), at places (m,): between two points and on the line of either side.

    Behind the exit of a lobe pressure has a pit at a node, which no line across the node shows.
    """
    i = np.clip(np.searchsorted(x, at), 2, len(x) - 2)
    sides = [p[j] + (at - x[j]) * (p[j + 1] - p[j]) / (x[j + 1] - x[j]) for j in (i - 2, i)]
    return [np.interp(at, x, p), *sides]


@pytest.mark.parametrize(
    "changes",
    [
        {"density": 1},
        pytest.param({"density": 2, **X_RING}, marks=pytest.mark.slow),
    ],
    ids=["round", "x_ring"],
)
def test_what_a_run_writes_of_its_sections(changes: dict[str, Any], tmp_path: Path) -> None:
    p = Seal(speeds=(400.0,), stroke="out", error_estimate=False, **changes)
    (state,) = solve(p, Silent()).states
    file = state.file_names()[1]
    write_content(tmp_path / file, state.section)
    write_paraview(p, tmp_path, [state])
    assert read_series(tmp_path / "section_out.pvd") == [(400.0, file)]
    assert not (tmp_path / "section_in.pvd").exists()
    points, cells, nodal, data = cells_of(tmp_path / file)
    page = (DOCS / "keys.md").read_text(encoding="utf-8")
    assert {name for name in (*nodal, *data) if f"`{name}`" not in page} == set()
    at_rest = points - nodal["displacement"]
    found = np.stack([data[f"stretch_{name}"] for name in ("1", "2", "hoop")], axis=1)
    k = int(np.argmax(found[:, 0]))
    expected = stretches_of_one(at_rest[cells[k]], points[cells[k]])
    assert found[k, 0] > 1.1
    np.testing.assert_allclose(np.sort(found[k]), expected, rtol=1e-10)
    ratio = volumes(points, cells) / volumes(at_rest, cells)
    np.testing.assert_allclose(found.prod(axis=1), ratio, rtol=0.02)
    nodes = np.flatnonzero(nodal["rod_pressure"])
    x, film = state.profile.x_mm, state.profile.p_MPa
    away = [nodal["rod_pressure"][nodes] - near for near in beside(x, film, points[nodes, 0])]
    assert np.abs(away).min(axis=0).max() < 0.02 * film.max()
    np.testing.assert_array_less(points[nodes, 1], 0.5 * p.rod_diameter + 0.5)  # beside the rod


def test_stretches_of_the_way_back_are_others() -> None:
    """What compares stretches with one cell computed from scratch sees F^-1 in place of F."""
    system, x = pulled(1.2, 0.93)
    before, after, cells = system.mesh.points, system.deformed(x), system.mesh.quads
    wrong = principal_stretches(after, before, cells)
    found = np.sort([wrong[name][0] for name in wrong])
    expected = stretches_of_one(before[cells[0]], after[cells[0]])
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_the_gland_is_that_of_the_model(gap: float, tmp_path: Path) -> None:
    p = Seal(extrusion_gap=gap, corner_fillet=0.2)
    write_content(tmp_path / "gland.vtu", gland_outlines(p))
    mesh = meshio.read(tmp_path / "gland.vtu")
    lines, part = mesh.cells_dict["line"], mesh.cell_data["part"][0]
    rod, groove, housing = (
        mesh.points[np.unique(lines[part == k])][:, :2] for k in range(len(PARTS))
    )
    wall = p.groove_centre + 0.5 * p.groove_width
    assert set(rod[:, 1]) == {0.5 * p.rod_diameter}
    assert groove[:, 1].max() == 0.5 * p.housing_diameter
    assert groove[0, 0] == wall - p.groove_width
    assert groove[:4, 0].max() == pytest.approx(wall)
    assert groove[-1] == pytest.approx(housing[-1])
    if not gap:
        assert groove[-1] == pytest.approx([wall, 0.5 * p.rod_diameter])
        return
    assert groove[-1] == pytest.approx([wall + 0.2, 0.5 * p.rod_diameter + gap])
    centre = [wall + 0.2, 0.5 * p.rod_diameter + gap + 0.2]
    assert np.hypot(*(groove[3:] - centre).T) == pytest.approx(np.full(17, 0.2))


# --- Friction and leakage handed over to simulations of systems -----------------------------------


FILM_SPEEDS = (-300.0, -100.0, -30.0, -10.0, 10.0, 30.0, 100.0, 300.0)
LAWS = {
    block: FrictionLaw(block, 8.0, 1.5, 3.0, rate, 0.01, 0.0)
    for block, rate in zip(BLOCKS, (0.04, 0.02), strict=True)
}


def finished(
    pressure: float, law: FrictionLaw, speeds: tuple[float, ...] = FILM_SPEEDS
) -> FinishedRun:
    """A run whose films have the friction of a law, and leak 0.1 mm^3 for a mm/s and a MPa."""
    rows = [
        FilmRow(
            **film_values(
                sealed_pressure_MPa=pressure,
                rod_speed_mm_s=u,
                rod_friction_N=float(law.friction(np.array(u), np.array(pressure))),
                leak_rate_mm3_s=0.1 * u * pressure,
                verdict="ok",
            )
        )
        for u in speeds
    ]
    case = SimpleNamespace(titled=lambda _: "a seal", selection=CASE.selection)
    return FinishedRun(Path("run"), case, Seal(sealed_pressure=pressure), rows)


@pytest.mark.parametrize("block", BLOCKS)
def test_a_law_is_found_again(block: str) -> None:
    law = LAWS[block]
    found = FrictionLaw.fitted(SealMap.of([finished(p, law) for p in (1.0, 5.0)]), block)
    assert found is not None
    assert found.misfit < 1e-4
    for name in ("preload", "coulomb", "breakaway", "rate", "viscous"):
        assert getattr(found, name) == pytest.approx(getattr(law, name), rel=1e-2)


def test_a_misfit_is_told() -> None:
    """Films that are no law of that kind: one differs by half."""
    runs = [finished(p, LAWS["Cylinder Friction"]) for p in (1.0, 5.0)]
    rows = cast("list[Any]", runs[0].rows)
    rows[3] = replace(rows[3], rod_friction_N=1.5 * rows[3].rod_friction_N)
    found = FrictionLaw.fitted(SealMap.of(runs), "Cylinder Friction")
    assert found is not None
    assert found.misfit > 0.05


def test_modelica_reads_friction_between_films() -> None:
    """The table read by the rule of CombiTable2Ds, in SI units."""
    seal = SealMap.of([finished(p, LAWS["Cylinder Friction"]) for p in (1.0, 5.0)])
    lines = modelica(seal).splitlines()
    assert lines[0] == "#1"
    assert lines[1].startswith("double friction(9,3) ")
    table = np.array([[float(v) for v in line.split()] for line in lines[2:11]])
    look_up = RegularGridInterpolator((table[1:, 0], table[0, 1:]), table[1:, 1:])
    assert float(look_up((0.1, 1e6))) == pytest.approx(seal.friction[6, 0])
    assert float(look_up((0.2, 3e6))) == pytest.approx(float(seal.friction[6:, :].mean()))
    assert lines[11].startswith("double leakage(9,3) ")
    last = [float(v) for v in lines[20].split()]
    assert last == pytest.approx([0.3, 30e-9, 150e-9])


def test_files_of_a_hand_over(tmp_path: Path) -> None:
    law = LAWS["Cylinder Friction"]
    one = write_hand_over(tmp_path / "seal", [finished(1.0, law)])
    written = f"8 speeds at 1 pressure written to {tmp_path / 'seal'}"
    assert one[0] == f"{written}: {', '.join(FILES)}"
    said = write_hand_over(
        tmp_path / "seal",
        [finished(1.0, law), finished(5.0, law, FILM_SPEEDS[1:])],
    )
    assert sorted(path.name for path in (tmp_path / "seal").iterdir()) == sorted(FILES)
    header = ("sealed_pressure_MPa", "rod_speed_mm_s", "friction_N", "leakage_mm3_s")
    assert len(read_csv(tmp_path / "seal" / FILES[0], header)) == 14
    assert "left out, as not every pressure has their friction: -300 mm/s" in said
    text = (tmp_path / "seal" / FILES[2]).read_text()
    assert "Preload force = 8 N" in text
    assert "Coulomb friction coefficient = 1.5e-06 N/Pa" in text
    assert "Transition coefficient = 40 s/m" in text


def test_friction_that_is_not_known_is_not_handed_over(tmp_path: Path) -> None:
    """An estimated state has none, and a table with nan stops a simulation."""
    low, high = (finished(p, LAWS["Cylinder Friction"]) for p in (1.0, 5.0))
    rows = cast("list[Any]", high.rows)
    rows[0] = replace(rows[0], rod_friction_N=nan, verdict="estimated")
    seal = SealMap.of([low, high])
    assert np.isfinite(seal.friction).all()
    assert seal.left_out == "-300 mm/s"
    unknown = [replace(row, rod_friction_N=nan) for row in rows]
    with pytest.raises(BadInput, match="without states that are estimated"):
        write_hand_over(tmp_path / "seal", [replace(high, rows=unknown)])


def test_what_is_not_one_seal_is_refused() -> None:
    one, other = (
        finished(1.0, LAWS["Cylinder Friction"]),
        finished(5.0, LAWS["Cylinder Friction"]),
    )
    harder = Seal(sealed_pressure=5.0, mu_1=4.0)
    with pytest.raises(BadInput, match="differ in mu_1"):
        SealMap.of([one, replace(other, parameters=harder)])
    with pytest.raises(BadInput, match="no speed has a film with its friction at every"):
        SealMap.of(
            [
                one,
                replace(other, rows=finished(5.0, LAWS["Cylinder Friction"], (50.0,)).rows),
            ]
        )
