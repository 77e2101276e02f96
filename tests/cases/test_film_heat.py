"""Heat of a film: conduction and convection against closed forms, its balance, warm states."""

from math import isnan, pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import k0

from softehl.cases.cycle import Cycle
from softehl.cases.seal.equations.film_heat import (
    OIL,
    ROD,
    RUBBER,
    changed_film,
    inlet_mean,
    inlet_weights,
    moving_half_space,
    warm_film,
)
from softehl.cases.seal.equations.inlet_theory import (
    SPEED_POWER,
    ThinningOil,
    local_inlet,
    newtonian_inlet,
)
from softehl.cases.seal.gland.oils import density, read_oil
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.arrays import Array

WARM: dict[str, Any] = {"oil": "ISO VG 100", "temperature": 40.0, "error_estimate": False}


def parts(n: int, length: float) -> tuple[Array, Array]:
    """Places and widths of equal parts."""
    return (np.arange(n) + 0.5) * length / n, np.full(n, length / n)


@pytest.mark.parametrize("speed", [0.1, 10.0, 1000.0])
def test_a_moving_half_space_is_jaegers(speed: float) -> None:
    x, width = parts(200, 2.0)
    k, capacity = ROD
    v, at = 0.5 * speed * capacity / k, 120
    rise = moving_half_space(x, width, speed).sum(axis=1)

    def source(s: float) -> float:
        return float(np.exp(v * s) * k0(v * abs(s)))

    ahead = quad(source, float(x[at]) - 2.0, 0.0, limit=400)[0]
    behind = quad(source, 0.0, float(x[at]), limit=400)[0]
    assert rise[at] == pytest.approx((ahead + behind) / (pi * k), rel=1e-6)
    still = moving_half_space(x, width, 0.5 * speed).sum(axis=1)
    assert still[at] > 1.05 * rise[at]


def test_a_fast_band_has_the_flash_temperatures_of_jaeger() -> None:
    # of the half width b and P = U b / kappa: 1.06 and 1.60 q b / k / sqrt(P), mean and largest
    (k, capacity), speed, b = ROD, 1000.0, 1.0
    x, width = parts(400, 2.0 * b)
    rise = moving_half_space(x, width, speed).sum(axis=1)
    unit = b / k / (speed * b * capacity / k) ** 0.5
    assert rise.mean() / unit == pytest.approx(1.064, rel=0.01)
    assert rise.max() / unit == pytest.approx(1.596, rel=0.01)


def test_plates_with_cold_walls_and_with_one_that_lets_no_heat_through() -> None:
    n, h, eta, speed, k = 50, 2e-3, 1e-7, 1000.0, OIL[0]
    _, width = parts(n, 1.0)
    heat = np.full(n, eta * speed**2 / h)
    cold = warm_film(np.zeros((n, n)), width, h=h + 0.0 * width, heat=heat, flux=0.0, height=1e-12)
    assert cold.peak == pytest.approx(np.full(n, eta * speed**2 / (8.0 * k)), rel=1e-6)
    assert cold.oil == pytest.approx(np.full(n, eta * speed**2 / (12.0 * k)), rel=1e-6)
    assert cold.to_rod == pytest.approx(cold.to_seal, rel=1e-6)
    one = warm_film(np.zeros((n, n)), width, h=h + 0.0 * width, heat=heat, flux=0.0, height=1e9)
    assert one.seal == pytest.approx(np.full(n, eta * speed**2 / (2.0 * k)), rel=1e-6)
    assert one.oil == pytest.approx(np.full(n, eta * speed**2 / (3.0 * k)), rel=1e-6)


def test_a_plug_of_oil_between_walls_that_let_no_heat_through() -> None:
    n, flux, heat = 50, 2.0, np.full(50, 30.0)
    x, width = parts(n, 1.0)
    rod = 1e12 * np.eye(n)  # takes no heat
    warm = warm_film(rod, width, h=1e-3 + 0.0 * x, heat=heat, flux=flux, height=1e12 * RUBBER)
    assert warm.oil == pytest.approx(np.cumsum(heat * width) / (OIL[1] * flux), rel=1e-6)
    assert warm.carried == pytest.approx(30.0, rel=1e-6)


def test_the_heat_of_a_film_goes_somewhere() -> None:
    x, width = parts(60, 1.5)
    h, heat = 1e-3 + 0.01 * (x - 1.0) ** 2, 20.0 + x
    rod = moving_half_space(x, width, 500.0)
    warm = warm_film(rod, width, h=h, heat=heat, flux=0.5, height=3.0)
    out = (warm.to_rod + warm.to_seal) @ width + warm.carried
    assert out == pytest.approx(heat @ width, rel=1e-12)
    assert warm.peak.max() >= max(warm.rod.max(), warm.seal.max(), warm.oil.max())


def test_the_weights_of_an_inlet_are_those_of_its_h() -> None:
    # by its units h* is as (eta U)^0.6: a viscosity that changes everywhere must give that too
    assert newtonian_inlet().by_viscosity.sum() == pytest.approx(SPEED_POWER, abs=2e-4)
    at, share = inlet_weights()
    assert share[-1] == pytest.approx(1.0)
    assert 0.3 < np.interp(np.log(1.5), at, share) < 0.5
    h = np.geomspace(40.0, 1.0, 200)
    assert inlet_mean(h, 1.0, np.full(200, 7.0)) == pytest.approx(7.0)
    assert inlet_mean(h, 1.0, np.where(h > 30.0, 1.0, 0.0)) < 0.01
    assert changed_film(0.9, 1.0) == pytest.approx(1.0 - 0.9**0.6)


class Warmer(ThinningOil):
    """Oil with a viscosity of its own at every thickness of the film."""

    def resistance(self, H: Array, slope: Array, viscosity: Array) -> Array:
        return np.asarray(viscosity * np.exp(profile(H)))


def profile(H: Array) -> Array:
    """Logarithm of the viscosity: the oil becomes warm where the film is thin."""
    return np.asarray(-0.15 / (1.0 + H**2))


def test_the_mean_of_an_inlet_gives_the_h_of_an_uneven_viscosity() -> None:
    found = local_inlet(oil=Warmer(1.0))
    H = 0.5 * (found.H[1:] + found.H[:-1])[::-1]
    mean = inlet_mean(H, found.H_star, profile(H))
    ratio = found.H_star / newtonian_inlet().H_star
    assert ratio == pytest.approx(np.exp(SPEED_POWER * mean), abs=1.5e-3)
    assert abs(ratio - np.exp(SPEED_POWER * profile(H).min())) > 5e-3


def test_viscosity_of_a_warm_oil_is_that_of_its_line() -> None:
    p, kinematic = Seal(heating=True, oil="ISO VG 46", temperature=40.0), read_oil("ISO VG 46")
    line = [kinematic(40.0 + t) * density(40.0 + t) for t in (0.0, 10.0, 30.0)]
    ratios = p.warm_viscosity(np.array([0.0, 10.0, 30.0]))
    assert ratios[:2] == pytest.approx(np.array(line[:2]) / line[0], rel=3e-3)
    assert ratios[2] == pytest.approx(line[2] / line[0], rel=0.02)
    settled = Seal(**p.settled())  # as a study of random numbers has it
    assert settled.oil is None
    assert settled.warm_viscosity(np.array([10.0]))[0] == pytest.approx(ratios[1], rel=1e-12)


def solved(**keys: Any) -> FilmState:
    (state,) = run(Seal(**{**WARM, "stroke": "in", "density": 1, **keys}), Silent()).states
    return state


@pytest.mark.slow
def test_a_warm_film_is_thinner_and_its_heat_is_its_friction() -> None:
    cold, warm = solved(speeds=(3000.0,)), solved(speeds=(3000.0,), heating=True)
    assert isnan(cold.film_heating_K)
    assert 0.94 * cold.h_star_um < warm.h_star_um < 0.97 * cold.h_star_um
    ratios = [s.h_star_theory_um / s.h_star_um for s in (cold, warm)]
    assert ratios[1] == pytest.approx(ratios[0], rel=0.015)
    assert abs(warm.rod_friction_N) < abs(cold.rod_friction_N)
    # the power of the friction, less what presses the oil to the sealed side, by two routes
    power = abs(warm.rod_friction_N) * 3.0
    pressed = abs(warm.leak_rate_mm3_s) * 1e-3 * warm.sealed_pressure_MPa
    heat = warm.heat_to_rod_W + warm.heat_to_seal_W + warm.heat_in_oil_W
    assert heat == pytest.approx(power - pressed, rel=2e-3)
    assert heat != pytest.approx(power, rel=0.01)
    assert warm.heat_to_seal_W < 0.01 * heat
    assert 0.0 < warm.inlet_heating_K < warm.film_heating_K < 10.0


@pytest.mark.slow
def test_a_slow_film_and_an_oil_without_slope_keep_their_cold_digits() -> None:
    cold, warm = solved(speeds=(1.0,)), solved(speeds=(1.0,), heating=True)
    assert warm.h_star_um == cold.h_star_um
    assert warm.rod_friction_N == pytest.approx(cold.rod_friction_N, rel=1e-4)
    assert warm.film_heating_K < 1e-3
    fast = {"speeds": (3000.0,), "oil": None, "temperature": None}
    cold, warm = solved(**fast), solved(**fast, heating=True, viscosity_slope=0.0)
    numbers = ((s.h_star_um, s.rod_friction_N, s.h_star_theory_um, s.density) for s in (cold, warm))
    assert next(numbers) == next(numbers)
    assert warm.film_heating_K > 1.0


def test_heating_needs_its_oil_and_a_steady_state() -> None:
    with pytest.raises(ValueError, match="heating = true needs the viscosity of the oil"):
        Seal(heating=True)
    with pytest.raises(ValueError, match="sensitivities are those of a film"):
        Seal(heating=True, sensitivity=True, oil="ISO VG 46", temperature=40.0)
    with pytest.raises(ValueError, match="in steady state only"):
        Cycle(heating=True, oil="ISO VG 46", temperature=40.0)
