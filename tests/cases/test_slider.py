"""The slider against closed forms, and from the command line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import fixed_quad, quad
from scipy.optimize import brentq

import softehl
from softehl.cases.harness.observer import State
from softehl.cases.slider.case import CASE, Slider, SliderRow
from softehl.runtime.arrays import Array
from tests.reference import slider as reference
from tests.reference.calling import fitted_order

Gap = Callable[[Array], Array]

INLET, END = -40.0, 4.0
RUPTURE, FLUX = 0.47512992, 1.22574844
"""Flooded parabola with p = 0 far away: X = x / sqrt(2 R h0) and 2 q / (U h0)."""


def row(p: Slider, speed: float = 400.0) -> SliderRow:
    """The row of one speed."""
    problem, solution = CASE.solution(p, speed)
    assert solution.converged
    state: State = CASE.state(p, speed, problem, solution)
    assert isinstance(state.row, SliderRow)
    return state.row


@dataclass(frozen=True)
class Exact:
    """Flux (mm^2/s), load and friction (N/mm) of a film without cavitation."""

    flux: float
    load: float
    friction: float

    def error(self, found: SliderRow) -> float:
        """The largest relative difference."""
        pairs = (
            (found.flux_mm2_s, self.flux),
            (found.load_N_per_mm, self.load),
            (found.friction_N_per_mm, self.friction),
        )
        return max(abs(a / b - 1.0) for a, b in pairs)


def by_quadrature(p: Slider, gap: Gap, speed: float) -> Exact:
    """dp/dx = 12 eta (U/2 / h^2 - q / h^3) between the end pressures, by a Gauss rule of scipy."""

    def integral(f: Gap) -> float:
        return float(fixed_quad(f, p.start, p.end, n=120)[0])

    eta, u = p.viscosity, 0.5 * speed
    rise = (p.end_pressure - p.start_pressure) / (12.0 * eta)
    q = (u * integral(lambda x: gap(x) ** -2) - rise) / integral(lambda x: gap(x) ** -3)

    def slope(x: Array) -> Array:
        return 12.0 * eta * (u / gap(x) ** 2 - q / gap(x) ** 3)

    length = p.end - p.start
    load = p.end_pressure * length - integral(lambda x: (x - p.start) * slope(x))
    drag = integral(lambda x: eta * speed / gap(x) + 0.5 * gap(x) * slope(x))
    return Exact(q, load, drag)


# --- closed forms ---------------------------------------------------------------------------------


def wedge(p: Slider, speed: float) -> Exact:
    """Reynolds' plane slider, between pressures of zero."""
    h1, h2, length = p.ratio * p.h0, p.h0, p.end - p.start
    known = reference.Slider(h1, h2, length, speed, p.viscosity)
    shear = p.viscosity * speed * length / (h1 - h2) * math.log(h1 / h2)
    return Exact(known.flux, known.load(), shear + 0.5 * (h1 - h2) / length * known.load())


def exponential(p: Slider, speed: float) -> Exact:
    """h = h1 exp(-a (x - start)): integrals of h^-n are (h2^-n - h1^-n) / (n a)."""
    h1, h2, length, eta, u = p.ratio * p.h0, p.h0, p.end - p.start, p.viscosity, 0.5 * speed
    a = math.log(p.ratio) / length
    one, two, three = ((h2**-n - h1**-n) / (n * a) for n in (1, 2, 3))
    q = u * two / three
    load = u / 2 * (two - length / h1**2) - q / 3 * (three - length / h1**3)
    return Exact(q, 12.0 * eta / a * load, 4.0 * eta * speed * one - 6.0 * eta * q * two)


WEDGE = Slider(profile="wedge", h0=0.005, ratio=2.4, start=0.2, end=1.7, segments=16)
EXPONENTIAL = WEDGE.model_copy(update={"profile": "exponential"})
COSINE = Slider(profile="cosine", h0=0.005, start_pressure=3.0, end_pressure=3.0)
OFTEN = (20, 40, 80)


def test_the_plane_wedge_is_exact_to_rounding() -> None:
    """h is linear, so that only the order of the pressure counts: 2 m_p for these functionals."""
    exact = wedge(WEDGE, 400.0)
    assert exact.error(row(WEDGE.model_copy(update={"pressure_order": 8}))) < 1e-10
    errors = [
        exact.error(row(WEDGE.model_copy(update={"pressure_order": 2, "segments": n})))
        for n in OFTEN
    ]
    assert 3.7 < -fitted_order(OFTEN, errors) < 4.4
    wrong = wedge(WEDGE.model_copy(update={"viscosity": 6.6e-8}), 400.0)
    assert wrong.error(row(WEDGE)) > 1e-3


@pytest.mark.parametrize("reynolds", ["fe", "dg"])
def test_the_exponential_slider(reynolds: str) -> None:
    """h is linear on a segment: order 2."""
    p = EXPONENTIAL.model_copy(update={"reynolds": reynolds})
    exact = exponential(p, 400.0)
    found = [row(p.model_copy(update={"segments": n})) for n in OFTEN]
    errors = [exact.error(one) for one in found]
    assert errors[-1] < 1e-4
    assert 1.9 < -fitted_order(OFTEN, errors) < 2.1
    wrong = exponential(p.model_copy(update={"ratio": 2.45}), 400.0)
    assert not 1.9 < -fitted_order(OFTEN, [wrong.error(one) for one in found]) < 2.1


@pytest.mark.parametrize("speed", [400.0, -300.0])
def test_the_cosine_by_quadrature_and_by_sommerfeld(speed: float) -> None:
    """Between pressures that keep the film whole; the load is that of the pressures alone."""

    def gap(x: Array) -> Array:
        return COSINE.h0 * (1.0 + 0.5 * np.asarray(np.cos(2.0 * np.pi * (x + 1.5) / 2.25)))

    exact = by_quadrature(COSINE, gap, speed)
    sommerfeld = speed * COSINE.h0 * (1.0 - 0.25) / (2.0 + 0.25)
    assert exact.flux == pytest.approx(sommerfeld, rel=1e-10)
    assert exact.load == pytest.approx(3.0 * 2.25, rel=1e-10)
    found = [row(COSINE.model_copy(update={"segments": n}), speed) for n in OFTEN]
    assert all(math.isnan(one.rupture_mm) for one in found)
    errors = [abs(one.friction_N_per_mm / exact.friction - 1.0) for one in found]
    assert 1.9 < -fitted_order(OFTEN, errors) < 2.1
    errors = [abs(one.flux_mm2_s / exact.flux - 1.0) for one in found]
    assert 1.9 < -fitted_order(OFTEN, errors) < 2.1
    assert exact.load == pytest.approx(found[-1].load_N_per_mm, rel=1e-3)
    shifted = by_quadrature(COSINE, lambda x: gap(x + 0.2), speed)
    assert shifted.load != pytest.approx(found[-1].load_N_per_mm, rel=1e-2)
    thicker = by_quadrature(COSINE, lambda x: 1.01 * gap(x), speed)
    assert thicker.error(found[-1]) > 5e-3


def test_barus_law() -> None:
    """The reduced pressure is that of a constant viscosity."""
    alpha = 0.4
    p = WEDGE.model_copy(update={"pressure_viscosity": alpha, "segments": 64})
    known = reference.Slider(0.012, 0.005, 1.5, 400.0, p.viscosity, alpha)
    assert row(p).load_N_per_mm == pytest.approx(known.load(), rel=1e-7)
    assert row(p).load_N_per_mm != pytest.approx(wedge(p, 400.0).load, rel=1e-3)
    pressed = p.model_copy(update={"start_pressure": 2.0, "end_pressure": 1.0})
    problem, solution = CASE.solution(pressed, 400.0)
    ends = solution.x[problem.layout.part("pressure")][[0, -1]]
    assert solution.converged
    np.testing.assert_allclose(ends, [2.0, 1.0], rtol=1e-14)


# --- cavitation -----------------------------------------------------------------------------------


def parabola(segments: int, penalty: float, inlet: float = INLET) -> SliderRow:
    p = Slider(segments=segments, cavitation_penalty=penalty)
    unit = math.sqrt(2.0 * p.radius * p.h0)
    return row(p.model_copy(update={"start": inlet * unit, "end": END * unit}))


def scaled(found: SliderRow) -> tuple[float, float]:
    """Rupture X and 2 q / (U h0)."""
    p = Slider()
    unit = math.sqrt(2.0 * p.radius * p.h0)
    return found.rupture_mm / unit, 2.0 * found.flux_mm2_s / (found.rod_speed_mm_s * p.h0)


def rupture_of(inlet: float) -> float:
    """X where p and its slope, proportional to (H - H_c) / H^3 with H = 1 + X^2, vanish."""

    def pressure(x_c: float) -> float:
        value = quad(lambda x: (x**2 - x_c**2) / (1 + x**2) ** 3, inlet, x_c, epsabs=1e-14)
        return float(value[0])

    return float(brentq(pressure, 0.1, 1.0, xtol=1e-12))


def test_the_flooded_parabola_ruptures_where_it_must() -> None:
    assert rupture_of(-2000.0) == pytest.approx(RUPTURE, abs=2e-8)
    assert pytest.approx(FLUX, abs=1e-8) == 1.0 + RUPTURE**2
    found = scaled(parabola(4000, 1e6))
    assert found[0] == pytest.approx(RUPTURE, rel=2e-3)
    assert found[1] == pytest.approx(FLUX, rel=2e-5)
    # half Sommerfeld's condition, rupture at the least gap, is another one
    assert found[0] > 0.4


@pytest.mark.slow
def test_the_penalty_converges() -> None:
    """The layer in which p < 0 builds up is as long as epsilon^(-1/2)."""
    penalties, inlet = (1e2, 1e3, 1e4), -6.0
    exact = rupture_of(inlet)
    errors = [abs(scaled(parabola(4000, e, inlet))[0] - exact) for e in penalties]
    assert 0.4 < -fitted_order(penalties, errors) < 0.6
    flux = scaled(parabola(4000, 1e6, inlet))[1]
    assert flux == pytest.approx(1.0 + exact**2, rel=2e-5)
    assert flux != pytest.approx(FLUX, rel=2e-4)  # a nearer inlet starves the film


def test_a_film_without_pressure_has_no_load_and_is_torn_where_its_gap_widens() -> None:
    plain = row(Slider(profile="wedge", ratio=1.0, segments=64))
    assert plain.load_N_per_mm == plain.p_max_MPa == 0.0
    assert math.isnan(plain.rupture_mm)
    assert plain.error_percent < 1e-9
    widening = row(Slider(profile="wedge", ratio=0.5, segments=64))
    assert widening.rupture_mm == pytest.approx(-1.5, abs=0.01)


@pytest.mark.parametrize("p", [WEDGE, EXPONENTIAL, Slider(), Slider(profile="cosine")])
def test_ok_is_within_two_per_cent(p: Slider) -> None:
    fine = row(p.model_copy(update={"segments": 3000}))
    for segments in (6, 12, 25, 50, 100):
        found = row(p.model_copy(update={"segments": segments}))
        wrong = max(
            abs(found.flux_mm2_s / fine.flux_mm2_s - 1.0),
            abs(found.load_N_per_mm / fine.load_N_per_mm - 1.0),
        )
        assert found.verdict == "coarse" or 100.0 * wrong < 2.0, (segments, wrong, found)


# --- the command line -----------------------------------------------------------------------------


def run(folder: Path, *arguments: str) -> int:
    return softehl.main(["run", "slider", "--out", str(folder), "--quiet", *arguments])


def curve(folder: Path) -> list[list[str]]:
    header, *lines = (folder / "curve.csv").read_text().splitlines()
    assert header.split(",")[:5] == [
        *("rod_speed_mm_s", "flux_mm2_s", "load_N_per_mm"),
        *("p_max_MPa", "friction_N_per_mm"),
    ]
    return [line.split(",") for line in lines]


def test_a_run_and_what_it_writes(tmp_path: Path) -> None:
    assert run(tmp_path / "a", "--set", "speeds=[100, -200]") == 0
    names = {path.name for path in (tmp_path / "a").iterdir()}
    assert names == {"curve.csv", "run.json", "rows.png", "profile_100.csv", "profile_-200.csv"}
    assert [line[0] for line in curve(tmp_path / "a")] == ["100", "-200"]
    header, first, *_ = (tmp_path / "a" / "profile_100.csv").read_text().splitlines()
    assert header == "x_mm,h_um,p_MPa"
    assert float(first.split(",")[0]) == pytest.approx(-1.5, abs=1e-2)
    content = json.loads((tmp_path / "a" / "run.json").read_text())
    assert (content["case"], content["status"]) == ("slider", "converged")
    assert content["unknowns"] == {"total": 2403, "displacement": 802, "pressure": 1601}
    assert [stage["name"] for stage in content["stages"]] == ["U = +100 mm/s", "U = -200 mm/s"]
    assert all(stage["steps"] for stage in content["stages"])


def test_a_film_that_no_pressure_carries(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("--set", "pressure_viscosity=1", "--set", "speeds=[400, 20]")
    assert run(tmp_path / "a", *arguments) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert "U = +400 mm/s: no pressure carries this film" in line
    assert "reached and saved" in line
    assert [row[0] for row in curve(tmp_path / "a")] == ["20"]
