"""Pressurised thick-walled Mooney-Rivlin cylinder with an axial stretch against its closed form.

Incompressible: r^2 = a^2 + (R^2 - A^2) / l with the axial stretch l, hoop stretch r/R, radial
stretch R / (r l).  Radial equilibrium gives the pressure as the integral over r of
(sigma_tt - sigma_rr) / r = [mu_1 (s_t^2 - s_r^2) - mu_2 (s_t^-2 - s_r^-2)] / r.
With l = 1 the integral is (mu_1 + mu_2) [ln(B/A) - ln(b/a) + (a^2 - A^2)/2 (1/a^2 - 1/b^2)].
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from tests.reference.calling import Part, assemble, fitted_order, solve

INNER, OUTER, HEIGHT = 1.0, 2.0, 0.3
MU = (1.0, 0.6)
KAPPA = 1e7  # compressibility changes the pressure by about MU / KAPPA
BORE = 1.4  # deformed inner radius of the closed form


def radius(R: float, stretch: float, bore: float = BORE) -> float:
    return float(np.sqrt(bore**2 + (R**2 - INNER**2) / stretch))


def exact_pressure(stretch: float, bore: float = BORE, mu: tuple[float, float] = MU) -> float:
    """The closed-form integral (MPa)."""

    def integrand(r: float) -> float:
        R = np.sqrt(INNER**2 + stretch * (r**2 - bore**2))
        hoop, radial = r / R, R / (r * stretch)
        first, second = hoop**2 - radial**2, hoop**-2 - radial**-2
        return float((mu[0] * first - mu[1] * second) / r)

    return float(quad(integrand, bore, radius(OUTER, stretch, bore), epsabs=1e-14)[0])


def cylinder(family: str, count: int, pressure: float, kappa: float = KAPPA) -> list[Part]:
    """One row of elements through the wall, numbered (bottom, top) from the bore outwards."""
    R = np.linspace(INNER, OUTER, count + 1)
    nodes = np.array([(z, r) for r in R for z in (0.0, HEIGHT)])
    column = 2 * np.arange(count)[:, None]
    cells = column + np.array([[0, 1, 3, 2]])
    maps = (2 * cells[:, :, None] + np.arange(2)).reshape(count, 8)
    # the bore runs along +z: the solid is on its left
    return [
        Part(family, nodes[cells].reshape(count, 8), maps, (*MU, kappa)),
        Part("follower_pressure", nodes[:2].reshape(1, 4), np.array([[0, 1, 2, 3]]), (pressure,)),
    ]


def bore_of(
    family: str,
    count: int,
    pressure: float,
    stretch: float = 1.0,
    *,
    kappa: float = KAPPA,
    guess: float = BORE,
) -> float:
    """Deformed inner radius under the pressure, axial displacements prescribed."""
    parts = cylinder(family, count, pressure, kappa)
    R = np.linspace(INNER, OUTER, count + 1)
    x = np.zeros(4 * (count + 1))
    x[2::4] = (stretch - 1) * HEIGHT
    x[1::4] = x[3::4] = [radius(r, stretch, guess) - r for r in R]
    u = solve(parts, x, np.arange(1, x.size, 2), tolerance=1e-9)  # kappa / mu takes six digits
    assert u[1] == pytest.approx(u[3], abs=1e-9)
    return INNER + float(u[1])


@pytest.mark.parametrize("stretch", [1.0, 0.8])
@pytest.mark.parametrize("family", ["solid_fbar", "solid_taylor", "solid_taylor_mean"])
def test_bore_converges_with_second_order_to_the_closed_form(family: str, stretch: float) -> None:
    counts = (8, 16, 32, 64)
    pressure = exact_pressure(stretch)
    errors = [abs(bore_of(family, n, pressure, stretch) - BORE) for n in counts]
    assert errors[-1] < 2e-5 * (BORE - INNER)
    assert 1.95 < -fitted_order(counts, errors) < 2.1


@pytest.mark.parametrize("family", ["solid_fbar", "solid_taylor", "solid_taylor_mean"])
def test_a_wrong_pressure_or_material_is_noticed(family: str) -> None:
    """A material with mu_2 counted as mu_1 agrees in plane strain only, as it should."""
    swapped = (MU[0] + MU[1], 0.0)
    assert exact_pressure(1.0, mu=swapped) == pytest.approx(exact_pressure(1.0), rel=1e-12)
    counts = (4, 8, 16)
    wrong = [abs(bore_of(family, n, exact_pressure(0.8, mu=swapped), 0.8) - BORE) for n in counts]
    assert not 1.85 < -fitted_order(counts, wrong) < 2.1


def test_plain_element_locks_and_so_fails_the_same_test() -> None:
    counts, bore = (4, 8, 16), 1.05
    pressure = exact_pressure(1.0, bore)
    errors = [abs(bore_of("solid_q4", n, pressure, guess=INNER) - bore) for n in counts]
    assert errors[0] > 0.1 * (bore - INNER)
    assert not 1.85 < -fitted_order(counts, errors) < 2.1


def test_reactions_balance_the_pressure_on_a_shell_between_two_radii() -> None:
    """At the solution the free rows vanish; the axial reactions carry the axial stress alone."""
    pressure = exact_pressure(1.0)
    parts = cylinder("solid_fbar", 8, pressure)
    x = np.zeros(36)
    R = np.linspace(INNER, OUTER, 9)
    x[1::4] = x[3::4] = [radius(r, 1.0) - r for r in R]
    x = solve(parts, x, np.arange(1, 36, 2), tolerance=1e-9)
    total, _ = assemble(parts, x)
    assert np.abs(total[1::2]).max() < 1e-7 * np.abs(total).max()
    assert total[0::4].sum() == pytest.approx(-total[2::4].sum(), rel=1e-9)
