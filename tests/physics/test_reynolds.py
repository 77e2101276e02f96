"""Film segments with rigid geometry: the linear wedge slider, Barus oil and cavitation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from softehl.runtime.discretisation import quadrature
from softehl.runtime.kernels.kernel import Rule
from tests.reference.calling import Part, assemble, fitted_order, solve
from tests.reference.slider import ROD, Slider

MESHES = {1: (16, 32, 64), 2: (16, 32, 64), 3: (8, 16, 32), 4: (8, 16, 32), 5: (8, 12, 20)}


@dataclass(frozen=True)
class Film:
    """Discrete solution: the part, all unknowns and the numbers of the pressures."""

    part: Part
    x: np.ndarray
    pressures: np.ndarray
    order: int

    def fields(self) -> dict[str, np.ndarray]:
        return self.part.fields(self.x)

    def element_flux(self) -> np.ndarray:
        """Mean flux of each element."""
        values = self.fields()
        return np.asarray((values["flux"] * values["dx"]).sum(axis=1) / values["dx"].sum(axis=1))

    def error(self, slider: Slider) -> float:
        """L2 norm of the pressure error by a fine Gauss rule."""
        fine = quadrature.film_rule(self.order, "gauss", self.order + 6)
        part = replace_rule(self.part, fine)
        values = part.fields(self.x)
        wrong = values["p"] - slider.pressure(values["x"])
        return float(np.sqrt(np.sum(wrong**2 * values["dx"])))


def replace_rule(part: Part, rule: Rule) -> Part:
    return Part("film", part.coordinates, part.maps, part.parameters, rule=rule)


def discretise(
    slider: Slider,
    count: int,
    order: int,
    kind: quadrature.Kind = "gauss",
    points: int | None = None,
) -> Film:
    """Segments along the wedge; all displacements are zero and fixed."""
    z = np.linspace(0.0, slider.length, count + 1)
    nodes = np.stack([z, ROD + slider.gap(z)], axis=1)
    ends = np.stack([np.arange(count), np.arange(count) + 1], axis=1)
    moved = (2 * ends[:, :, None] + np.arange(2)).reshape(count, 4)
    first = 2 * (count + 1)
    maps = np.hstack([moved, first + order * np.arange(count)[:, None] + np.arange(order + 1)])
    parameters = (ROD, slider.speed, slider.viscosity, slider.alpha, slider.penalty, 1.0, 1.0)
    rule = quadrature.film_rule(order, kind, points)
    part = Part("film", nodes[ends].reshape(count, 4), maps, parameters, rule=rule)
    size = first + order * count + 1
    return Film(part, np.zeros(size), np.arange(first, size), order)


def solved(
    slider: Slider,
    count: int,
    order: int,
    kind: quadrature.Kind = "gauss",
    points: int | None = None,
) -> Film:
    film = discretise(slider, count, order, kind, points)
    x = solve([film.part], film.x, film.pressures[1:-1], tolerance=1e-11)
    return replace(film, x=x)


def orders(
    slider: Slider, m_p: int, kind: quadrature.Kind, exact: Slider, points: int | None = None
) -> float:
    counts = MESHES[m_p]
    errors = [solved(slider, n, m_p, kind, points).error(exact) for n in counts]
    return -fitted_order(counts, errors)


@pytest.mark.parametrize("kind", ["gauss", "lobatto"])
@pytest.mark.parametrize("m_p", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("alpha", [0.0, 0.8], ids=["constant", "barus"])
def test_pressure_converges_with_order_m_p_plus_one(
    alpha: float, m_p: int, kind: quadrature.Kind
) -> None:
    slider = Slider(alpha=alpha)
    assert m_p + 0.85 < orders(slider, m_p, kind, slider) < m_p + 1.15


@pytest.mark.parametrize("m_p", [2, 3, 4])
def test_collocated_lobatto_rule_keeps_the_order(m_p: int) -> None:
    """m_p + 1 Lobatto points under-integrate: other numbers than the full rule, same order."""
    slider = Slider()
    assert m_p + 0.8 < orders(slider, m_p, "lobatto", slider, m_p + 1) < m_p + 1.2
    under, full = (solved(slider, 6, m_p, "lobatto", points) for points in (m_p + 1, None))
    assert np.abs(under.x - full.x).max() > 1e-9


@pytest.mark.parametrize("m_p", [1, 2, 3])
def test_load_and_flux_converge_with_twice_the_order(m_p: int) -> None:
    """Both are linear functionals of p with a smooth dual solution: order 2 m_p."""
    slider, counts = Slider(), {1: (16, 32, 64), 2: (8, 16, 32), 3: (6, 10, 16)}[m_p]
    load, flux = [], []
    for count in counts:
        film = solved(slider, count, m_p)
        values = film.fields()
        load.append(abs((values["p"] * values["dx"]).sum() / slider.load() - 1))
        flux.append(abs(film.element_flux().mean() / slider.flux - 1))
    assert 2 * m_p - 0.3 < -fitted_order(counts, load) < 2 * m_p + 0.4
    assert 2 * m_p - 0.3 < -fitted_order(counts, flux) < 2 * m_p + 0.4


@pytest.mark.parametrize("kind", ["gauss", "lobatto"])
@pytest.mark.parametrize("m_p", [1, 2, 3, 4, 5, 7])
def test_element_mean_flux_is_constant_along_the_film(m_p: int, kind: quadrature.Kind) -> None:
    """The hat functions are among the test functions: the element means are equal to rounding."""
    film = solved(Slider(alpha=0.02), 6, m_p, kind)
    flux = film.element_flux()
    assert np.ptp(flux) < 1e-10 * abs(flux.mean())
    values = film.fields()
    assert values["dx"].sum() == pytest.approx(1.5, rel=1e-13)
    film.x[film.pressures[3]] *= 1.001  # any other pressure breaks it
    assert np.ptp(film.element_flux()) > 1e-6 * abs(flux.mean())


def test_instroke_is_the_mirror_image_of_outstroke() -> None:
    out = Slider()
    back = Slider(h1=out.h2, h2=out.h1, speed=-out.speed)
    one, other = solved(out, 6, 3), solved(back, 6, 3)
    scale = np.abs(one.x[one.pressures]).max()
    assert np.abs(one.x[one.pressures] - other.x[other.pressures][::-1]).max() < 1e-11 * scale
    assert back.flux == pytest.approx(-out.flux)
    assert other.element_flux().mean() == pytest.approx(back.flux, rel=1e-5)


def test_penalty_is_silent_where_the_pressure_is_positive() -> None:
    without, with_penalty = (solved(Slider(penalty=e), 8, 4) for e in (0.0, 1e4))
    assert without.fields()["p"].min() > 0
    np.testing.assert_array_equal(without.x, with_penalty.x)


def test_a_wrong_oil_wedge_or_law_loses_the_order() -> None:
    """The oracle must notice one per cent of viscosity, a missing Barus term, a shifted gap."""
    for exact in (Slider(viscosity=6.59e-8 * 1.01), Slider(alpha=0.02), Slider(h2=0.00501)):
        assert not 2.85 < orders(Slider(), 2, "gauss", exact) < 3.15


@pytest.mark.parametrize("kind", ["gauss", "lobatto"])
def test_cavitated_diverging_wedge_sits_at_the_penalty_pressure(kind: quadrature.Kind) -> None:
    """-dq/dx = eps p for p < 0: with constant h' the plateau is p = -ubar h' / eps exactly.

    The ends decay over sqrt(h^3 / (12 eta eps)), a small part of the length.
    """
    slider = Slider(h1=0.005, h2=0.012, speed=400.0, penalty=1e4)
    plateau = -slider.speed / 2 * (slider.h2 - slider.h1) / slider.length / slider.penalty
    film = solved(slider, 60, 3, kind)
    values = film.fields()
    inner = (values["x"] > 0.4) & (values["x"] < 1.1)
    np.testing.assert_allclose(values["p"][inner], plateau, rtol=1e-8)
    flux = slider.speed / 2 * slider.gap(values["x"][inner])  # pure drag
    np.testing.assert_allclose(values["flux"][inner], flux, rtol=1e-8)
    assert np.ptp(film.element_flux()) > 0.1 * film.element_flux().mean()  # not conserved here
    twice = solved(replace(slider, penalty=2e4), 60, 3, kind).fields()
    np.testing.assert_allclose(twice["p"][inner], plateau / 2, rtol=1e-8)
    free = solved(replace(slider, penalty=0.0), 60, 3, kind).fields()
    assert np.abs(free["p"][inner] / plateau - 1).min() > 1


def test_tractions_of_the_slider_balance_and_match_their_integrals() -> None:
    """Forces on the seal from the fields: radial 2 pi r p dx, axial 2 pi r (p dr - tau ds)."""
    slider = Slider()
    film = solved(slider, 24, 4)
    total, _ = assemble([film.part], film.x)
    values = film.fields()
    count = 2 * (24 + 1)
    ring = 2 * np.pi * (ROD + values["h"]) * values["dx"]
    slope = (slider.h2 - slider.h1) / slider.length
    assert total[1:count:2].sum() == pytest.approx(-(ring * values["p"]).sum(), rel=1e-12)
    axial = (ring * (values["p"] * slope - values["tau"] * np.hypot(1, slope))).sum()
    assert total[0:count:2].sum() == pytest.approx(axial, rel=1e-12)
    # the wedge is thin: sum of the pressure forces is 2 pi R_rod times the load, up to h / R
    assert -total[1:count:2].sum() == pytest.approx(2 * np.pi * ROD * slider.load(), rel=1e-3)


def test_shear_on_seal_and_rod_matches_the_closed_form() -> None:
    """(17) on both walls: tau_rod - tau = h dp/dx, tau_rod + tau = 2 eta U / h."""
    slider = Slider()
    values = solved(slider, 24, 5).fields()
    h = slider.gap(values["x"])
    slope = 12 * slider.viscosity * (slider.speed / 2 / h**2 - slider.flux / h**3)
    couette = slider.viscosity * slider.speed / h
    scale = couette.max()
    np.testing.assert_allclose(values["tau"], couette - h / 2 * slope, atol=1e-6 * scale)
    np.testing.assert_allclose(values["tau_rod"], couette + h / 2 * slope, atol=1e-6 * scale)
    assert np.abs(values["tau"] - values["tau_rod"]).max() > 1e-2 * scale
    length = slider.length / (slider.h1 - slider.h2)
    friction = slider.viscosity * slider.speed * length * np.log(slider.h1 / slider.h2)
    mean = ((values["tau"] + values["tau_rod"]) / 2 * values["dx"]).sum()
    assert mean == pytest.approx(friction, rel=1e-10)


def test_weights_scale_the_tractions_and_leave_the_reynolds_rows() -> None:
    film = solved(Slider(alpha=0.02), 5, 2)
    full, _ = assemble([film.part], film.x + 1e-3)
    count = 2 * (5 + 1)
    results = {}
    for force, shear in ((0.3, 1.0), (1.0, 0.0)):
        parameters = [*film.part.parameters[:5], force, shear]
        part = Part("film", film.part.coordinates, film.part.maps, parameters, rule=film.part.rule)
        results[force, shear], _ = assemble([part], film.x + 1e-3)
        np.testing.assert_array_equal(results[force, shear][count:], full[count:])
    np.testing.assert_allclose(results[0.3, 1.0][:count], 0.3 * full[:count], rtol=1e-13)
    np.testing.assert_allclose(results[1.0, 0.0][1:count:2], full[1:count:2], rtol=1e-13)
    assert np.abs(results[1.0, 0.0][0:count:2] - full[0:count:2]).max() > 1e-6


def resisting(degrees: float, length: float = 1e-3) -> float:
    """Flux between the ends of a segment at a slope for a unit difference of pressures, U = 0."""
    middle, half = 0.02, 0.5 * length * np.array([np.cos(a := np.radians(degrees)), np.sin(a)])
    nodes = np.array([[-half[0], ROD + middle - half[1], half[0], ROD + middle + half[1]]])
    parameters = (ROD, 0.0, 1e-8, 0.0, 0.0, 0.0, 0.0)
    part = Part("film", nodes, np.arange(6)[None], parameters, rule=quadrature.film_rule(1))
    rows, _ = part.elements(np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0]))
    return -float(rows[0, 4])


def test_a_gentle_segment_is_as_long_as_the_rod_says() -> None:
    """Along the rod its length is the cosine's, but for the tenth power of its slope."""
    for degrees in (1.0, 5.0, 10.0):
        angle = np.radians(degrees)
        wedge = 1.0 + (0.5e-3 * np.sin(angle) / 0.02) ** 2  # mean of h^3 over that of a level one
        ratio = resisting(degrees) * np.cos(angle) / (wedge * resisting(0.0))
        assert ratio == pytest.approx(1.0, abs=1e-6)


def test_a_segment_on_a_wall_resists_like_any_other() -> None:
    """Upright, and a little beyond, where its length along the rod is zero and negative."""
    beyond = [resisting(a) for a in (80.0, 89.9, 90.0, 90.1, 100.0)]
    assert min(beyond) > 0.0
    assert max(beyond) < 1.2 * min(beyond)
    assert beyond[2] == pytest.approx(resisting(0.0), rel=1e-3)
