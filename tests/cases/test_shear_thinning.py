"""Oils that thin under shear: their keys, what is refused, and what they do to a slider."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import fixed_quad
from scipy.optimize import brentq

from softehl.cases.cycle import Cycle
from softehl.cases.seal.equations.definition import FILM, blocks_of
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.slider.parameters import Slider
from tests.cases.test_slider import row

POLYMER: dict[str, Any] = {
    "carreau_rate": "1e5 1/s",
    "carreau_exponent": 0.6,
    "carreau_plateau": 0.6,
}
WEDGE: dict[str, Any] = {"profile": "wedge", "start": 0.0, "end": 1.0, "segments": 200}


def kernel(p: Seal) -> str:
    (name,) = (block.kernel_of(p) for block in blocks_of(p) if block.name == FILM)
    return name


def test_keys_choose_the_kernel_of_the_film() -> None:
    assert kernel(Seal()) == "film"
    assert kernel(Seal(eyring_stress=5)) == "film_eyring"
    assert kernel(Seal(**POLYMER)) == "film_carreau"
    assert kernel(Seal(**POLYMER, section="x_ring", groove_width=4.3)) == "film_conserving_carreau"
    assert kernel(Seal(eyring_stress=5, cavitation_pressure=-0.05)) == "film_conserving_eyring"
    assert kernel(Cycle(**POLYMER)) == "film_conserving_carreau"


def test_a_rate_is_a_stress_of_the_oil_at_its_temperature() -> None:
    p = Seal(**POLYMER, oil="ISO VG 46", temperature=40)
    values = p.thinning_values(p.viscosity)
    assert values["critical_stress"] == pytest.approx(1e5 * p.viscosity)
    assert (values["thinning_exponent"], values["thinning_plateau"]) == (0.6, 0.6)
    assert Seal().thinning_values(6.59e-8) == {}
    bar: Any = "50 bar"
    assert Seal(eyring_stress=bar).thinning_values(1.0)["critical_stress"] == 5.0


def eyring_wedge(p: Slider, speed: float) -> tuple[float, float]:
    """Flux and load by p'(h, q), of the closed form, integrated with a Gauss rule of SciPy."""
    eta, tau_0 = p.viscosity, p.eyring_stress
    assert tau_0 is not None

    def flux(slope: float, h: float) -> float:
        S = h * slope / (2 * tau_0)
        if abs(S) < 1e-4:
            mean, moment = 1 + S * S / 6, 1 + S * S / 10
        else:
            mean, moment = np.sinh(S) / S, 3 * (S * np.cosh(S) - np.sinh(S)) / S**3
        sheared = eta * speed / (h * tau_0) / mean
        return float(speed * h / 2 - h**3 / 12 / eta * slope * moment * np.hypot(1, sheared))

    def slope(x: float, q: float) -> float:
        h = float(p.gap(np.array(x)))
        return float(brentq(lambda s: flux(s, h) - q, -100, 100, xtol=1e-13, rtol=1e-13))

    def integral(q: float, power: int) -> float:
        def values(x: Any) -> Any:
            return np.array([slope(v, q) * (p.end - v) ** power for v in x])

        return float(fixed_quad(values, p.start, p.end, n=40)[0])

    h, long = 1e3 * p.h0, 0.5 * abs(speed)
    q = float(brentq(lambda q: integral(q, 0), 1e-3 * h * long, 2e-3 * h * long, rtol=1e-13))
    return q, integral(q, 1)  # by parts: the load of p = integral of p'


@pytest.mark.parametrize("cavitation", ["penalty", "mass-conserving"])
def test_an_eyring_wedge_by_quadrature(cavitation: Any) -> None:
    p = Slider(**WEDGE, eyring_stress=0.02, cavitation=cavitation)
    found, (flux, load) = row(p), eyring_wedge(p, 400.0)
    assert found.flux_mm2_s == pytest.approx(flux, rel=2e-5)
    assert found.load_N_per_mm == pytest.approx(load, rel=2e-5)
    newtonian = row(Slider(**WEDGE, cavitation=cavitation))
    assert found.load_N_per_mm < 0.9 * newtonian.load_N_per_mm, "the oil must thin for this test"


@pytest.mark.parametrize("given", [{"eyring_stress": 1e6}, {**POLYMER, "carreau_rate": 1e14}])
def test_a_slider_of_a_newtonian_limit(given: dict[str, Any]) -> None:
    thin, before = row(Slider(**given)), row(Slider())
    assert thin.flux_mm2_s == pytest.approx(before.flux_mm2_s, rel=1e-12)
    assert thin.friction_N_per_mm == pytest.approx(before.friction_N_per_mm, rel=1e-12)


def test_a_plateau_of_the_viscosity_is_a_thinner_oil() -> None:
    """Far above its critical rate a Carreau oil is Newtonian again."""
    thin = row(Slider(**{**POLYMER, "carreau_rate": 1.0}, **WEDGE))
    other = row(Slider(viscosity=0.6 * 6.59e-8, **WEDGE))
    assert thin.load_N_per_mm == pytest.approx(other.load_N_per_mm, rel=0.01)
    assert thin.friction_N_per_mm == pytest.approx(other.friction_N_per_mm, rel=0.01)
