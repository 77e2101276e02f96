"""The slider with void fractions and roughness against closed forms, found here by quadrature."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from softehl.cases.harness.observer import State
from softehl.cases.slider.case import CASE, Slider, SliderRow
from tests.reference import mixed
from tests.reference.calling import fitted_order
from tests.reference.differentiate import mpf

SPEED = 400.0
OFTEN = (32, 64, 128, 256)


def row(p: Slider, speed: float = SPEED) -> SliderRow:
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
    found = [row(p.model_copy(update={"segments": n})) for n in OFTEN]
    errors = [abs(r.flux_mm2_s / flux - 1.0) for r in found]
    assert errors[-1] < 1e-4
    assert 1.8 < -fitted_order(OFTEN, errors) < 2.2
    assert found[-1].rupture_mm == pytest.approx(rupture, abs=2e-4)
    assert found[-1].reformation_mm == pytest.approx(formed, abs=2e-4)
    # the penalty destroys oil where the film forms again, and lets more out than comes in
    penalty = row(p.model_copy(update={"cavitation": "penalty", "segments": 256}))
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
    found = [row(p.model_copy(update={"segments": n})) for n in OFTEN]
    assert found[-1].flux_mm2_s == pytest.approx(0.5 * SPEED * unit_flux, rel=1e-12)
    assert found[-1].rupture_mm == pytest.approx(ruptured, abs=2e-4)
    assert found[-1].reformation_mm == pytest.approx(filled, abs=2e-4)
    errors = [abs(r.reformation_mm - filled) + abs(r.rupture_mm - ruptured) for r in found]
    assert errors[-1] < errors[0] / 10
    # more than the inlet takes is a flooded film
    flooded = row(PARABOLA.model_copy(update={"segments": 64}))
    plenty = row(PARABOLA.model_copy(update={"segments": 64, "supply": 0.1}))
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
    found = [row(p.model_copy(update={"segments": n})) for n in OFTEN]
    errors = [abs(r.flux_mm2_s / (0.5 * SPEED * flux) - 1.0) for r in found]
    assert errors[-1] < 1e-4
    assert 1.8 < -fitted_order(OFTEN, errors) < 2.3
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
    found = row(p)
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
    found, H = row(p, speed), p.ratio
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


@pytest.mark.parametrize("roughness", [(0.0, 0.4), (0.5, 0.0), (0.3, 0.2)])
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
    found = row(p)
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
    smooth = row(p)
    errors = []
    for sigma in (0.02, 0.01):
        rough = row(p.model_copy(update={"roughness": (0.0, sigma)}))
        errors.append(abs(rough.friction_N_per_mm / smooth.friction_N_per_mm - 1.0))
        assert rough.flux_mm2_s == pytest.approx(smooth.flux_mm2_s, rel=1e-6)
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


# --- as a stranger would --------------------------------------------------------------------------
