"""Oils that thin under shear: closed forms, quadrature by SciPy, limits, momentum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from softehl.runtime.discretisation.quadrature import film_rule
from softehl.runtime.kernels.kernel import load_kernel
from tests.reference.calling import call
from tests.reference.states import State, film_states, thin_film_states, thinned

ETA = 6.6e-8  # MPa s
CARREAU = (0.45, 0.1)
STATES = [*film_states((4,)), *thin_film_states()]


def film(law: str, h: float, U: float, slope: float, *how: float) -> dict[str, float]:
    """Fields of a film of thickness h (mm) between parallel plates, with p' = slope (MPa/mm)."""
    kernel = load_kernel(f"film_{law}" if law else "film")
    given = {"rod_radius": 0.0, "rod_speed": U, "viscosity": ETA, "pressure_viscosity": 0.0}
    values = [*given.values(), 0.0, 0.0, 0.0, *how]
    X = np.array([[0.0, h, 1.0, h]])
    u = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, slope]])
    at = kernel.fields_at(X, u, parameters=np.array(values), rule=film_rule(1))[0, 0]
    return dict(zip(kernel.fields, at.tolist(), strict=True))


def by_quadrature(rate: Any, h: float, U: float, slope: float) -> tuple[float, float]:
    """Stress in the middle and flux of a film whose shear rate is rate(stress), by SciPy."""

    def across(middle: float, power: int) -> float:
        """Integral of y^power gamma, cut where the stress changes its sign."""
        zero = middle / slope
        value, _ = quad(
            lambda y: y**power * rate(middle - slope * y),
            *(-h / 2, h / 2),
            epsabs=1e-11 * abs(U) * h**power,
            epsrel=0.0,
            points=[zero] if abs(zero) < h / 2 else None,
        )
        return float(value)

    low, high = sorted((0.0, ETA * U / h))
    middle = float(brentq(lambda b: across(b, 0) - U, low, high, xtol=1e-300, rtol=1e-13))
    return middle, U * h / 2 + across(middle, 1)


def rate_of(tau_c: float, n: float, c: float) -> Any:
    """The shear rate of a Carreau oil under a stress, by its own law in rates."""

    def stress(x: float) -> float:
        return float(tau_c * x * (c + (1 - c) * (1 + x * x) ** ((n - 1) / 2)))

    def rate(tau: float) -> float:
        high = 2.0 * (abs(tau) / tau_c + (abs(tau) / tau_c) ** (1 / n)) + 1e-300
        x = brentq(lambda x: stress(x) - abs(tau), 0.0, high, xtol=1e-300, rtol=1e-14)
        return float(np.copysign(x, tau)) * tau_c / ETA

    return rate


@pytest.mark.parametrize("tau_0", [0.003, 0.05, 4.0])
@pytest.mark.parametrize("U", [400.0, -3.0])
def test_an_eyring_oil_under_shear_alone(U: float, tau_0: float) -> None:
    at = film("eyring", 1e-3, U, 0.0, tau_0)
    assert at["tau"] == pytest.approx(tau_0 * np.arcsinh(ETA * U / 1e-3 / tau_0), rel=1e-14)
    assert at["tau_rod"] == at["tau"]
    assert at["flux"] == pytest.approx(U * 1e-3 / 2, rel=1e-14)


@pytest.mark.parametrize("Sigma", [1e-9, 0.3, 0.9999, 1.0001, 6.0])
def test_an_eyring_oil_under_pressure_alone(Sigma: float) -> None:
    h, tau_0 = 2e-3, 0.05
    slope = 2 * tau_0 * Sigma / h
    at = film("eyring", h, 0.0, slope, tau_0)
    thinner = 3 * (Sigma * np.cosh(Sigma) - np.sinh(Sigma)) / Sigma**3 if Sigma > 1e-3 else 1.0
    assert at["flux"] == pytest.approx(-(h**3) / (12 * ETA) * slope * thinner, rel=1e-13)
    assert (at["tau_rod"], at["tau"]) == pytest.approx((h * slope / 2, -h * slope / 2), rel=1e-14)


BOTH = [(1e-3, 400.0, 30.0), (5e-4, -800.0, 200.0), (4e-3, 100.0, -60.0), (3e-4, 20.0, 15.0)]


@pytest.mark.parametrize(("h", "U", "slope"), BOTH)
def test_an_eyring_oil_under_both(h: float, U: float, slope: float) -> None:
    tau_0 = 0.04
    middle, flux = by_quadrature(lambda tau: tau_0 / ETA * np.sinh(tau / tau_0), h, U, slope)
    at = film("eyring", h, U, slope, tau_0)
    assert (at["tau"] + at["tau_rod"]) / 2 == pytest.approx(middle, rel=1e-10)
    assert at["flux"] == pytest.approx(flux, rel=1e-10)


@pytest.mark.parametrize(("h", "U", "slope"), BOTH)
@pytest.mark.parametrize("tau_c", [0.03, 0.3])
def test_a_carreau_oil_under_both(h: float, U: float, slope: float, tau_c: float) -> None:
    middle, flux = by_quadrature(rate_of(tau_c, *CARREAU), h, U, slope)
    at = film("carreau", h, U, slope, tau_c, *CARREAU)
    driven = h * abs(slope) / 2
    error = 1e-3 if driven > tau_c else 3e-5  # of Gauss' rule across the film
    size = abs(middle) + driven
    assert at["tau_rod"] == pytest.approx(middle + h * slope / 2, abs=error * size)
    assert at["flux"] - U * h / 2 == pytest.approx(flux - U * h / 2, rel=error)


def test_a_carreau_oil_becomes_a_power_law_and_ends_in_its_plateau() -> None:
    stresses = [film("carreau", 1e-3, U, 0.0, 1e-4, 0.4, 0.0)["tau"] for U in (1e3, 1e4)]
    assert np.log10(stresses[1] / stresses[0]) == pytest.approx(0.4, abs=1e-4)
    at = film("carreau", 1e-3, 1e9, 0.0, 1e-4, 0.4, 0.2)
    assert at["tau"] == pytest.approx(0.2 * ETA * 1e9 / 1e-3, rel=1e-3)
    slow, fast = (film("carreau", 1e-3, 0.0, s, 1e-4, 0.5, 0.0)["flux"] for s in (20.0, 40.0))
    assert fast / slow == pytest.approx(4.0, rel=2e-3)  # as p'^(1/n)


def test_an_oil_of_large_critical_stress_is_newtonian() -> None:
    """Residual and tangent to rounding; those without a law are the kernel of before."""
    for state in STATES:
        for law in ["eyring", "carreau"]:
            (thinning,) = (s for s in thinned(state, 2.0**60) if s.family == f"film_{law}")
            for found, before in zip(
                call("tangent", thinning), call("tangent", state), strict=True
            ):
                assert np.abs(found - before).max() <= 1e-14 * np.abs(before).max()


def test_a_carreau_oil_of_exponent_or_plateau_one_is_newtonian() -> None:
    for state in STATES:
        for n, c in ((1.0, 0.0), (0.4, 1.0)):
            given = (*state.parameters, 0.01, n, c)
            same = State("film_carreau", "", state.coordinates, state.dofs, given, kind=state.kind)
            same = State(**{**vars(same), "count": state.count})
            for found, before in zip(call("tangent", same), call("tangent", state), strict=True):
                assert np.abs(found - before).max() <= 1e-13 * np.abs(before).max()


@pytest.mark.parametrize("law", ["eyring", "carreau"])
def test_wall_stresses_balance_the_pressure(law: str) -> None:
    at = film(law, 7e-4, 300.0, 90.0, 0.02, *(CARREAU if law == "carreau" else ()))
    assert at["tau_rod"] - at["tau"] == pytest.approx(7e-4 * 90.0, rel=1e-12)


def test_a_wrong_law_is_found() -> None:
    """Eyring's oil is none of Carreau's, and the quadrature says so."""
    middle, flux = by_quadrature(rate_of(0.03, *CARREAU), *BOTH[0])
    at = film("eyring", *BOTH[0], 0.03)
    assert abs((at["tau"] + at["tau_rod"]) / 2 / middle - 1.0) > 0.01
    assert abs(at["flux"] / flux - 1.0) > 0.001


def test_a_film_without_motion_and_pressure_is_at_rest() -> None:
    for law, how in (("eyring", (0.05,)), ("carreau", (0.05, *CARREAU))):
        at = film(law, 1e-3, 0.0, 0.0, *how)
        assert (at["tau"], at["tau_rod"], at["flux"]) == (0.0, 0.0, 0.0)
