"""The pictures of a run, looked at: what they say, show and mark."""

from collections.abc import Iterator
from dataclasses import replace
from math import nan
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import regime
from softehl.cases.seal.report import style
from softehl.cases.seal.report.curve import curve_figure, fitted_exponent
from softehl.cases.seal.report.drawing import gland_figure
from softehl.cases.seal.report.profiles import profiles_figure
from softehl.cases.seal.report.section import (
    View,
    boundary_edges,
    draw_gland,
    nodal_von_mises,
    section_figure,
)
from softehl.cases.seal.report.stribeck import crossing, hersey_um, stribeck_figure
from softehl.cases.seal.report.tables import SHOWN
from softehl.cases.seal.report.tornado import tornado_figure
from softehl.cases.seal.states.state import COLLAPSED, OSCILLATING, FilmRow, Profile, Section
from tests.cases.oring_cases import film_values

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


def figures() -> dict[str, Figure]:
    rows = power_law(0.6)
    views = [View(r, profile(r.h_star_um), square()) for r in (rows[2], rows[5])]
    results = [(r, profile(r.h_star_um)) for r in rows]
    return {
        "curve": curve_figure(HEAD, rows),
        "profiles": profiles_figure(HEAD, results),
        "section": section_figure(SEAL, views),
    }


@pytest.mark.parametrize("name", ["curve", "profiles", "section"])
def test_a_picture_names_the_ring_the_oil_and_its_units(name: str) -> None:
    written = texts(figures()[name])
    assert "50.39 \N{MULTIPLICATION SIGN} 3.53 mm" in written
    assert "3.66 MPa" in written
    assert "65.9 mPa s" in written
    assert "pₛ = 1 MPa" in written
    assert "µm" in written
    assert "um" not in written.split()
    assert "[um]" not in written


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


def test_one_speed_has_no_slope() -> None:
    rows = [row(100.0, 0.5), row(-100.0, 0.4)]
    assert fitted_exponent(rows) is None
    assert "slope" not in texts(curve_figure(HEAD, rows))


def test_one_speed_is_a_bar_for_each_stroke() -> None:
    rows = [row(400.0, 1.5, error=2.0), row(-400.0, 1.0, error=nan, verdict=OSCILLATING)]
    figure = curve_figure(HEAD, rows)
    (axes,) = figure.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "linear")
    assert [patch.get_height() for patch in axes.patches] == [1.5, 1.0]  # type: ignore[attr-defined]
    said = texts(figure)
    for words in ("|U| = 400 mm/s", "1.5 µm", "± 2 %", "1 µm\noscillating", "instroke"):
        assert words in said
    lost = texts(curve_figure(HEAD, [], [replace(row(400.0, 0.1), verdict=COLLAPSED)]))
    assert "no result" in lost
    assert "0.1 µm" not in lost


def test_a_slope_is_not_fitted_to_doubtful_states() -> None:
    rows = [*power_law(0.6)[:3], row(25.0, 9.9, verdict=OSCILLATING)]
    assert fitted_exponent(rows) == pytest.approx(0.6, abs=1e-12)


def test_error_bars_have_the_estimated_length() -> None:
    rows = [row(100.0, 0.5, error=-2.0), row(400.0, 1.0, error=1.0), row(1600.0, 2.0, error=nan)]
    axes = curve_figure(HEAD, rows).axes[0]
    assert "outstroke (error bars: at most 2 %)" in legend(axes)
    bars = next(artist for artist in axes.collections if isinstance(artist, LineCollection))
    ends = np.array([np.asarray(segment)[:, 1] for segment in bars.get_segments()])
    np.testing.assert_allclose(ends, [[0.49, 0.51], [0.99, 1.01]], rtol=1e-12)


def test_without_an_estimate_there_are_no_bars() -> None:
    rows = [row(speed, 0.5, error=nan) for speed in (100.0, 200.0)]
    axes = curve_figure(HEAD, rows).axes[0]
    assert legend(axes)[0] == "outstroke"
    assert list(axes.containers) == []


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


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (90.0, 1800.0, [100, 200, 500, 1000]),
        (0.41, 4.0, [0.5, 1, 2]),
        (0.001, 1000.0, [0.001, 0.01, 0.1, 1, 10, 100, 1000]),
        (1.1, 4.5, [1.5, 2, 2.5, 3, 3.5, 4, 4.5]),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, expected: list[float]) -> None:
    assert style.plain_ticks(low, high).tolist() == pytest.approx(expected)


@pytest.mark.parametrize(("low", "high"), [(99.0, 101.0), (1e-9, 1e9), (0.7, 0.72)])
def test_ticks_of_short_and_long_axes(low: float, high: float) -> None:
    ticks = style.plain_ticks(low, high)
    assert 2 <= len(ticks) <= 10
    assert all(low <= tick <= high for tick in ticks)


def test_ticks_are_written_out() -> None:
    figure = curve_figure(HEAD, power_law(0.6))
    assert "e-" not in texts(figure)
    assert [t.get_text() for t in figure.axes[0].get_xticklabels()] == ["100", "200", "500", "1000"]


# --- profiles ----------------------------------------------------------------------------------


def test_profiles_have_a_panel_a_stroke_and_a_line_a_speed() -> None:
    rows = [*power_law(0.6), row(25.0, 0.3, verdict=OSCILLATING)]
    figure = profiles_figure(HEAD, [(r, profile(r.h_star_um)) for r in rows])
    pressure_out, pressure_in, film_out, film_in = figure.axes
    assert [len(axes.lines) for axes in figure.axes] == [4, 3, 4, 3]
    assert (pressure_out.get_title(), pressure_in.get_title()) == ("outstroke", "instroke")
    assert pressure_out.get_ylabel() == "pressure p [MPa]"
    assert film_out.get_ylabel() == "film thickness h [µm]"
    assert film_in.get_xlabel().startswith("x [mm]")
    assert legend(film_out) == ["100", "400", "1600", "25 (oscillating)"]
    assert [line.get_linestyle() for line in film_out.lines] == ["-", "-", "-", ":"]


# --- the section -------------------------------------------------------------------------------


def test_von_mises_of_plain_stress_states() -> None:
    def of(**stress: float) -> float:
        data = {f"sigma_{at}": np.array([stress.get(at, 0.0)]) for at in ("zz", "rr", "tt", "zr")}
        return float(nodal_von_mises(Section(np.zeros((1, 2)), np.zeros((0, 4), int), data))[0])

    assert of(zz=-5.0, rr=-5.0, tt=-5.0) == pytest.approx(0.0, abs=1e-12)
    assert of(rr=3.0) == pytest.approx(3.0)
    assert of(zr=2.0) == pytest.approx(2.0 * 3.0**0.5)


def test_boundary_edges_go_round_the_cells() -> None:
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    edges = {tuple(edge) for edge in boundary_edges(cells).tolist()}
    assert edges == {(0, 1), (1, 2), (2, 5), (5, 4), (4, 3), (3, 0)}


def test_the_section_shows_both_strokes_with_one_scale() -> None:
    rows = power_law(0.6)
    views = [View(r, profile(r.h_star_um), square()) for r in (rows[2], rows[5])]
    figure = section_figure(SEAL, views)
    out, back = figure.axes
    (bar,) = back.child_axes
    assert out.get_title().startswith("outstroke, U = +1600 mm/s")
    assert back.get_title().startswith("instroke, U = \N{MINUS SIGN}1600 mm/s")
    assert bar.get_ylabel() == "von Mises stress [MPa]"
    written = texts(figure)
    assert "film pressure, max 3.7 MPa" in written
    assert "contact pressure, max 3 MPa" in written
    assert out.get_aspect() == 1.0
    assert (out.get_xlabel(), out.get_ylabel()) == ("z [mm]", "r [mm]")


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


def test_the_legend_of_a_tornado_is_beside_its_bars() -> None:
    slopes = {f"key_{k}": 10.0 - k for k in range(10)}
    figure = tornado_figure(HEAD, {(u, name): slopes for u in (400.0, -400.0) for name in SHOWN})
    figure.draw_without_rendering()
    (found,) = figure.legends
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box is not None
        assert not found.get_window_extent().overlaps(box)
        assert axes.get_legend() is None


def test_pressure_bands_are_to_scale() -> None:
    r = power_law(0.6)[2]
    out = section_figure(SEAL, [View(r, profile(r.h_star_um), square(1.85))]).axes[0]
    paths = [path for artist in out.collections for path in artist.get_paths()]
    r_of = np.concatenate([np.asarray(path.vertices)[:, 1] for path in paths])
    film, contact = 25.0 - float(r_of.min()), float(r_of.max()) - 28.15
    top = float(profile(1.0).p_MPa.max())
    assert film == pytest.approx(0.25 * SEAL.section_diameter)
    # the corners of the square have normals at 45 degrees
    assert contact == pytest.approx(film * 1.85 / top * 0.5**0.5, rel=0.05)


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


def test_smooth_surfaces_have_no_stribeck_picture() -> None:
    assert stribeck_figure(SEAL, power_law(0.6)) is None


def test_one_speed_has_no_stribeck_picture() -> None:
    p = Seal.model_validate({"roughness": 0.3})
    assert stribeck_figure(p, [r for r in rough_rows() if abs(r.rod_speed_mm_s) == 4.0]) is None


def test_films_that_flow_against_the_rod_are_left_out_of_the_curve() -> None:
    """Pressure drives oil through asperities faster than a slow rod: h* < 0."""
    rows = [*rough_rows(), replace(row(-0.01, 1.0), h_star_um=-0.2)]
    (axes,) = curve_figure(HEAD, rows).axes
    drawn = np.concatenate([np.asarray(line.get_ydata()) for line in axes.get_lines()])
    assert np.min(drawn) > 0.0


def test_the_sealed_fluid_reaches_to_where_the_seal_touches() -> None:
    """Into the mouth of a U-cup, which is deeper than the middle of the groove."""
    for middle, end in ((None, 0.0), (0.9, 0.9)):
        axes = Figure().subplots()
        draw_gland(axes, Seal(sealed_pressure=1.0), middle)
        fluid = axes.patches[0].get_path()
        assert fluid.get_extents().x1 == pytest.approx(end)
