"""The slider: closed forms, rupture, mass-conserving and rough films."""

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
from tests.reference import mixed
from tests.reference import slider as reference
from tests.reference.calling import fitted_order
from tests.reference.differentiate import mpf

# --- The slider against closed forms, and from the command line -----------------------------------


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


@pytest.mark.parametrize(
    "p",
    [
        *(WEDGE, EXPONENTIAL, Slider()),
        pytest.param(Slider(profile="cosine"), marks=pytest.mark.slow),
    ],
)
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
    assert names == {
        "curve.csv",
        "run.json",
        "profiles.png",
        "profile_100mm_s.csv",
        "profile_-200mm_s.csv",
    }
    assert [line[0] for line in curve(tmp_path / "a")] == ["100", "-200"]
    header, first, *_ = (tmp_path / "a" / "profile_100mm_s.csv").read_text().splitlines()
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


# --- The slider with void fractions and roughness against closed forms, found here by -------------


SPEED = 400.0
FULL = (32, 64, 128, 256)


def conserving_row(p: Slider, speed: float = SPEED) -> SliderRow:
    """The row of one speed."""
    problem, solution = CASE.solution(p, speed)
    assert solution.converged
    state: State = CASE.state(p, speed, problem, solution)
    assert isinstance(state.row, SliderRow)
    return state.row


def slope(gap: Callable[[float], float], flux: float) -> Callable[[float], float]:
    """p' of a full film, pressures in 12 eta U / 2."""
    return lambda x: 1.0 / gap(x) ** 2 - flux / gap(x) ** 3


def rise(gap: Callable[[float], float], flux: float, a: float, b: float) -> float:
    """Pressure from a to b of a full film, in the same unit; flux in U / 2.

    A Gauss rule on panels: an adaptive one gives up where the integral is nearly zero.
    """
    points, weights = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(a, b, 201)
    half = 0.5 * (b - a) / 200.0
    x = 0.5 * (edges[:-1] + edges[1:])[:, None] + half * points
    values = np.vectorize(slope(gap, flux))(x)
    return float(half * (values @ weights).sum())


# --- parabola -------------------------------------------------------------------------------------

PARABOLA = Slider(profile="parabola", cavitation="mass-conserving", start=-0.4, end=0.4)


def parabola_exact(p: Slider) -> tuple[float, float, float]:
    """Flux (mm^2/s), rupture and reformation (mm): p' = 0 where it ruptures."""
    unit = 12.0 * p.viscosity * 0.5 * SPEED

    def gap(x: float) -> float:
        return p.h0 + x**2 / (2.0 * p.radius)

    def left(x: float) -> float:
        return p.start_pressure / unit + rise(gap, gap(x), p.start, x)

    rupture = brentq(left, 1e-3, 0.2, xtol=1e-14)
    flux = gap(rupture)
    formed = brentq(
        lambda x: rise(gap, flux, x, p.end) - p.end_pressure / unit, rupture + 0.01, p.end
    )
    return 0.5 * SPEED * flux, float(rupture), float(formed)


@pytest.mark.parametrize("pressure", [0.0, 0.5])
def test_the_parabola_ruptures_and_forms_again(pressure: float) -> None:
    p = PARABOLA.model_copy(update={"start_pressure": pressure, "end_pressure": 0.3})
    flux, rupture, formed = parabola_exact(p)
    found = [conserving_row(p.model_copy(update={"segments": n})) for n in FULL]
    errors = [abs(r.flux_mm2_s / flux - 1.0) for r in found]
    assert errors[-1] < 1e-4
    assert 1.8 < -fitted_order(FULL, errors) < 2.2
    assert found[-1].rupture_mm == pytest.approx(rupture, abs=2e-4)
    assert found[-1].reformation_mm == pytest.approx(formed, abs=2e-4)
    # the penalty destroys oil where the film forms again, and lets more out than comes in
    penalty = conserving_row(p.model_copy(update={"cavitation": "penalty", "segments": 256}))
    assert math.isnan(penalty.reformation_mm)
    wrong = parabola_exact(p.model_copy(update={"viscosity": 1.05 * p.viscosity}))
    assert abs(found[-1].reformation_mm - wrong[2]) > 1e-3


def test_a_starved_parabola_fills_where_its_supply_does() -> None:
    """The flux is that of the supply; full between places that it determines."""
    p = PARABOLA.model_copy(update={"supply": 0.0011, "segments": 256})
    unit_flux = 0.0011

    def gap(x: float) -> float:
        return p.h0 + x**2 / (2.0 * p.radius)

    ruptured = math.sqrt(2.0 * p.radius * (unit_flux - p.h0))
    filled = brentq(lambda x: rise(gap, unit_flux, x, ruptured), -0.39, -ruptured - 1e-3)
    found = [conserving_row(p.model_copy(update={"segments": n})) for n in FULL]
    assert found[-1].flux_mm2_s == pytest.approx(0.5 * SPEED * unit_flux, rel=1e-12)
    assert found[-1].rupture_mm == pytest.approx(ruptured, abs=2e-4)
    assert found[-1].reformation_mm == pytest.approx(filled, abs=2e-4)
    errors = [abs(r.reformation_mm - filled) + abs(r.rupture_mm - ruptured) for r in found]
    assert errors[-1] < errors[0] / 10
    # more than the inlet takes is a flooded film
    flooded = conserving_row(PARABOLA.model_copy(update={"segments": 64}))
    plenty = conserving_row(PARABOLA.model_copy(update={"segments": 64, "supply": 0.1}))
    assert plenty.flux_mm2_s == flooded.flux_mm2_s


# --- cosine and pocket ----------------------------------------------------------------------------


def test_the_cosine() -> None:
    """A bearing unrolled: h = h0 (1 + e cos 2 pi x), full at both ends."""
    p = Slider.model_validate(
        {
            "profile": "cosine",
            "cavitation": "mass-conserving",
            "h0": 0.005,
            "amplitude": 0.5,
            "start": 0.0,
            "end": 1.0,
            "start_pressure": 0.3,
            "end_pressure": 0.3,
        }
    )
    unit = 12.0 * p.viscosity * 0.5 * SPEED

    def gap(x: float) -> float:
        return p.h0 * (1.0 + p.amplitude * math.cos(2.0 * math.pi * x))

    rupture = brentq(
        lambda x: p.start_pressure / unit + rise(gap, gap(x), 0.0, x), 0.501, 0.8, xtol=1e-14
    )
    flux = gap(rupture)
    formed = brentq(lambda x: rise(gap, flux, x, 1.0) - p.end_pressure / unit, rupture + 0.01, 1.0)
    found = [conserving_row(p.model_copy(update={"segments": n})) for n in FULL]
    errors = [abs(r.flux_mm2_s / (0.5 * SPEED * flux) - 1.0) for r in found]
    assert errors[-1] < 1e-4
    assert 1.8 < -fitted_order(FULL, errors) < 2.3
    assert found[-1].rupture_mm == pytest.approx(rupture, abs=1e-4)
    assert found[-1].reformation_mm == pytest.approx(formed, abs=1e-4)


@pytest.mark.parametrize("segments", [6, 7, 50])
def test_the_pocket_is_exact_on_any_mesh_with_nodes_at_its_steps(segments: int) -> None:
    """Lands of a and c about a pocket of length b and height H2, pressure P0 at both ends."""
    a, b, c, H2, P0 = 0.6, 1.5, 0.9, 2.5, 0.03
    h0, eta = 0.002, 6.59e-8
    unit = 6.0 * eta * SPEED / h0**2  # MPa per mm
    p = Slider.model_validate(
        {
            "profile": "pocket",
            "h0": h0,
            "ratio": H2,
            "viscosity": eta,
            "segments": segments,
            "start": 0.0,
            "end": a + b + c,
            "pocket_start": a,
            "pocket_end": a + b,
            "start_pressure": P0 * unit,
            "end_pressure": P0 * unit,
            "pressure_order": 2,
        }
    )
    Hr = 1.0 + P0 / a
    Pp = P0 + c * (Hr - 1.0)
    void = b - Pp * H2**3 / (H2 - Hr)
    assert 0.0 < void < b
    found = conserving_row(p)
    assert found.flux_mm2_s == pytest.approx(0.5 * SPEED * h0 * Hr, rel=1e-12)
    assert found.p_max_MPa <= Pp * unit
    assert found.rupture_mm == a
    assert found.reformation_mm == pytest.approx(a + void, rel=1e-12)
    load = P0 * a / 2 + Pp * (b - void) / 2 + (Pp + P0) * c / 2
    assert found.load_N_per_mm == pytest.approx(load * unit, rel=1e-12)


@pytest.mark.parametrize(("speed", "behind"), [(SPEED, 0.0), (-SPEED, 0.0), (SPEED, 1.0)])
def test_a_pocket_without_inlet_pressure_is_torn_at_its_step(speed: float, behind: float) -> None:
    """The first land brings U h0 / 2, which fills the second: p is that behind it, all along it."""
    p = Slider(profile="pocket", segments=50, end_pressure=behind)
    found, H = conserving_row(p, speed), p.ratio
    filling = behind * p.h0**2 / (6.0 * p.viscosity * SPEED * (H - 1.0) / H**3)  # mm of the pocket
    torn, formed = (-0.75, -filling) if speed > 0.0 else (0.0, -0.75)
    assert found.rupture_mm == torn
    assert found.reformation_mm == pytest.approx(formed, abs=1e-12)
    assert found.load_N_per_mm == pytest.approx(behind * (0.75 + filling / 2.0), rel=1e-12)
    assert found.p_max_MPa == pytest.approx(behind, rel=1e-12)
    assert found.flux_mm2_s == pytest.approx(0.5 * speed * p.h0, rel=1e-12)
    assert found.error_percent < 1e-6


# --- roughness ------------------------------------------------------------------------------------


def rough_exact(p: Slider) -> tuple[float, float]:
    """Flux and load of a full rough film between pressures of zero, by quadrature."""
    rod, seal = p.roughness
    sigma = 1e-3 * math.hypot(rod, seal)
    c = (rod**2 - seal**2) / (rod**2 + seal**2)

    def factors(x: float) -> tuple[float, float, float]:
        H = mpf(float(p.gap(np.array([x]))[0]) / sigma)
        E = mixed.effective(H)
        carried = sigma * (mixed.mean_gap(H) + c * mixed.phi_s(E))
        mobility = mixed.phi_p(E) * (sigma * E) ** 3 / (12 * p.viscosity)
        return float(carried), float(mobility), float(mixed.asperities(H))

    points, weights = np.polynomial.legendre.leggauss(24)
    # the flow factors have a kink where H is 5: one rule on either side
    at = brentq(lambda x: float(p.gap(np.array([x]))[0]) - 5.0 * sigma, p.start, p.end)
    parts = [(p.start, at), (at, p.end)]
    x = np.concatenate([0.5 * (a + b) + 0.5 * (b - a) * points for a, b in parts])
    w = np.concatenate([0.5 * (b - a) * weights for a, b in parts])
    carried, mobility, asperities = np.array([factors(v) for v in x]).T
    q = 0.5 * SPEED * (w @ (carried / mobility)) / (w @ (1.0 / mobility))
    gradient = (0.5 * SPEED * carried - q) / mobility
    load = -(w @ ((x - p.start) * gradient)) + p.asperity_stiffness * (w @ asperities)
    return float(q), float(load)


@pytest.mark.parametrize(
    "roughness",
    [(0.3, 0.2), *(pytest.param(r, marks=pytest.mark.slow) for r in ((0.0, 0.4), (0.5, 0.0)))],
)
def test_the_rough_wedge_by_quadrature(roughness: tuple[float, float]) -> None:
    sigma = 1e-3 * math.hypot(*roughness)
    p = Slider.model_validate(
        {
            "profile": "wedge",
            "start": 0.0,
            "end": 1.0,
            "h0": 1.5 * sigma,
            "ratio": 4.0,
            "roughness": roughness,
            "segments": 1024,
            "asperity_stiffness": 3.0,
        }
    )
    flux, load = rough_exact(p)
    found = conserving_row(p)
    assert found.flux_mm2_s == pytest.approx(flux, rel=1e-6)
    assert found.load_N_per_mm == pytest.approx(load, rel=1e-6)
    other = rough_exact(p.model_copy(update={"roughness": roughness[::-1]}))
    if roughness[0] != roughness[1]:
        assert abs(found.flux_mm2_s / other[0] - 1.0) > 1e-3


def test_greenwoods_integral_has_its_published_values() -> None:
    table = {0: 0.61663422, 1: 0.080562336, 2: 0.0054237052, 3: 1.70873e-4}
    for H, value in table.items():
        assert float(mixed.asperities(mpf(H), 2.5)) == pytest.approx(value, rel=2e-6)


def test_little_roughness_is_the_smooth_film() -> None:
    p = Slider(profile="wedge", cavitation="mass-conserving", segments=64)
    smooth = conserving_row(p)
    errors = []
    for sigma in (0.02, 0.01):
        rough = conserving_row(p.model_copy(update={"roughness": (0.0, sigma)}))
        errors.append(abs(rough.friction_N_per_mm / smooth.friction_N_per_mm - 1.0))
        assert rough.flux_mm2_s == pytest.approx(smooth.flux_mm2_s, rel=1e-6)
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


# --- as a stranger would --------------------------------------------------------------------------
