"""The pictures of a run, looked at: what they say, show and mark."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import regime
from softehl.cases.seal.report import style
from softehl.cases.seal.report.gland_drawing import gland_figure
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
