"""Theory of the inlet: its constant, the stretched rubber, and states that are estimated by it."""

from dataclasses import replace
from math import exp, isnan
from typing import Any

import numpy as np
import pytest

from softehl.cases.seal.equations.inlet_theory import (
    BY_CURVATURE,
    BY_VISCOSITY,
    CONSTANT,
    FACTOR,
    Edge,
    ThinningOil,
    incremental_modulus,
    local_inlet,
    thinned,
)
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.rubbers.materials import (
    MATERIALS,
    incremental_stiffness,
    shear_modulus,
)
from softehl.cases.seal.gland.validation import require_films
from softehl.cases.seal.report.pictures import stribeck_figure
from softehl.cases.seal.report.profiles import thicknesses
from softehl.cases.seal.solve.contact_meshes import misplacement
from softehl.cases.seal.solve.driver import COMPARED, DryContact, _reservation, run
from softehl.cases.seal.states.contacts import contact_edges
from softehl.cases.seal.states.estimated import (
    ERRORS,
    FILMS,
    GROOVE,
    contact_of,
    estimated_state,
    theory_by_contact,
)
from softehl.cases.seal.states.inlet_edges import (
    SETTLED,
    Prediction,
    Predictions,
    _Surface,
    predicted,
)
from softehl.cases.seal.states.leakage import net_leakage
from softehl.cases.seal.states.state import ESTIMATED, UNCERTAIN, Silent
from softehl.cases.seal.states.summary import run_summary
from softehl.cases.seal.states.verdict import MOST_OFF_THEORY, Verdict
from tests.cases.test_results import NUMBERS


def test_the_constants_are_those_of_the_local_problem() -> None:
    coarse, fine = local_inlet().H_star, local_inlet(inside=1e3, spacing=(0.01, 0.03)).H_star
    assert coarse == pytest.approx(CONSTANT, rel=3e-4)
    assert fine == pytest.approx(CONSTANT, rel=3e-5)
    assert pytest.approx(1.5006, rel=1e-5) == FACTOR
    assert (local_inlet(A=0.02).H_star / coarse - 1.0) / 0.02 == pytest.approx(
        BY_VISCOSITY, abs=0.01
    )
    by_B = [(local_inlet(B=B).H_star / coarse - 1.0) / B for B in (-1e-4, 1e-4)]
    assert np.mean(by_B) == pytest.approx(BY_CURVATURE, abs=0.02)


def test_a_local_problem_without_a_solution_is_an_error() -> None:
    with pytest.raises(ArithmeticError, match="B = -1"):
        local_inlet(B=-1.0)


def test_the_local_solution_fulfils_reynolds_equation() -> None:
    found = local_inlet()
    mid, slope = 0.5 * (found.H[1:] + found.H[:-1]), np.diff(found.P) / np.diff(found.X)
    assert slope == pytest.approx(-(mid - found.H_star) / mid**3, abs=1e-9)
    assert found.P[0] == pytest.approx(300.0**0.5)
    # far outside the gap is that of the dry edge
    assert found.H[-1] == pytest.approx(4.0 / 3.0 * found.X[-1] ** 1.5, rel=0.01)


def test_resistance_of_an_eyring_film_is_conrys() -> None:
    oil, H, slope, viscosity = ThinningOil(0.3), np.array([0.8]), np.array([0.4]), np.array([1.2])
    S = 3.0 * slope * H / oil.critical  # h p' / (2 tau_0)
    sheared = viscosity / (H * oil.critical) * S / np.sinh(S)
    driven = 3.0 * (S * np.cosh(S) - np.sinh(S)) / S**3 * np.sqrt(1.0 + sheared**2)
    assert oil.resistance(H, slope, viscosity) == pytest.approx(viscosity / driven, rel=1e-9)
    assert oil.resistance(H, 2.0 * slope, viscosity) < 0.99 * viscosity / driven


def test_a_thinned_film_between_its_limits() -> None:
    assert thinned(ThinningOil(1e4)) == pytest.approx(1.0, abs=1e-7)
    assert thinned(ThinningOil(1e4, 0.5)) == pytest.approx(1.0, abs=1e-7)
    # of c times the viscosity where all of the oil has thinned: h* is as its power 0.6
    assert thinned(ThinningOil(1e-6, 0.4, 0.6)) == pytest.approx(0.6**0.6, rel=2e-3)
    # tau = m gamma^n: with K / sqrt(l) as m U^n / h^(n + 1) and h = K l^1.5 / E, h is as
    # m^(3 / (3n + 2)), m as the critical stress to the power 1 - n
    n = 0.5
    ratio = thinned(ThinningOil(1e-2, n)) / thinned(ThinningOil(1e-3, n))
    assert ratio == pytest.approx(10.0 ** (3.0 * (1.0 - n) / (3.0 * n + 2.0)), rel=5e-3)


def test_theory_of_an_oil_that_thins_too_much_is_none() -> None:
    with pytest.raises(ArithmeticError):
        Edge(7.0, 0.0, 4.0, 1.0).h_star(6.6e-6, oil=ThinningOil(1e-6))


@pytest.mark.parametrize(("along", "hoop"), [(1.0, 1.0), (1.1, 1.02), (0.9, 1.05), (0.8, 0.97)])
def test_modulus_of_a_stretched_neo_hookean_half_space(along: float, hoop: float) -> None:
    mu = 2.0

    def stiffness(a: float, h: float) -> tuple[float, float]:
        first, third = exp(2.0 * a), exp(-2.0 * (a + h))
        return mu * (first - third), 2.0 * mu * (first + third)

    across = 1.0 / (along * hoop)
    x = along / across
    closed = 2.0 * mu * across**2 * (x**3 + x**2 + 3.0 * x - 1.0) / (1.0 + x)
    assert incremental_modulus(stiffness, along, hoop) == pytest.approx(closed, rel=1e-12)
    kernel = incremental_stiffness(MATERIALS["neo-hooke"], {"mu_1": mu, "mu_2": 0.0}, 0.2, 0.1)
    assert kernel == pytest.approx(stiffness(0.2, 0.1), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("mooney-rivlin", {"mu_1": 1.0, "mu_2": 0.3}),
        ("yeoh", {"c_10": 0.5, "c_20": -0.02, "c_30": 0.01}),
        ("ogden", {"ogden_mu": (0.6, 0.2), "ogden_alpha": (1.5, 4.0)}),
        ("arruda-boyce", {"mu": 1.2, "lambda_m": 3.0}),
        ("gent", {"mu": 1.5, "J_m": 20.0}),
    ],
)
def test_modulus_of_every_law_is_four_mu_at_rest(name: str, keys: dict[str, Any]) -> None:
    material = MATERIALS[name]
    values = material.kernel_values(keys)

    def at(along: float) -> float:
        return incremental_modulus(
            lambda a, h: incremental_stiffness(material, values, a, h), along, 1.0
        )

    rest = 4.0 * shear_modulus(material, keys)
    assert at(1.0) == pytest.approx(rest, rel=1e-9)
    assert at(1.0 + 1e-5) == pytest.approx(rest, rel=1e-3)
    assert at(1.1) > rest > at(0.9)


def test_film_of_a_hertz_contact() -> None:
    # p^2 = (2 p_0^2 / a) s near the edge; Herrebrugh's least film of a line contact is 3.10 in the
    # form h/R = c U^0.6 W^-0.2, and the dip is 0.796 of h*
    E, R, load, flow = 4.0, 10.0, 1.0, 1e-9
    half = (4.0 * load * R / (np.pi * E)) ** 0.5
    peak = 2.0 * load / (np.pi * half)
    speed, force = 0.5 * flow / (2.0 * E * R), load / (2.0 * E * R)
    h = Edge(2.0 * peak**2 / half, 0.0, E, 1.0).h_star(flow)
    assert 0.796 * h / R / speed**0.6 * force**0.2 == pytest.approx(3.10, rel=0.05)
    assert 0.796 * Edge(peak**2 / half, 0.0, E, 1.0).h_star(flow) > 1.2 * 0.796 * h  # another K


def test_theory_and_film_agree() -> None:
    (state,) = run(Seal(stroke="out", speeds=(100.0,)), Silent()).states
    assert state.h_star_theory_um == pytest.approx(state.h_star_um, rel=0.03)
    assert 0.0 < state.inlet_over_pocket < 0.1


def test_theory_and_film_of_an_oil_that_thins_agree() -> None:
    p = Seal(stroke="out", speeds=(800.0,), error_estimate=False, eyring_stress=0.01)
    (state,) = run(p, Silent()).states
    assert state.h_star_theory_um == pytest.approx(state.h_star_um, rel=0.04)
    assert state.h_star_um == pytest.approx(1.285, rel=5e-3)  # Newtonian: 2.088


def test_a_film_far_from_the_theory_is_uncertain() -> None:
    assert Verdict(1.0, NUMBERS, theory=0.99 * MOST_OFF_THEORY).word != UNCERTAIN
    verdict = Verdict(1.0, NUMBERS, theory=-1.01 * MOST_OFF_THEORY)
    assert verdict.word == UNCERTAIN
    assert "theory of the inlet differs by -6.1 %" in verdict.advice


def test_two_meshes_alone_are_not_enough_above_five_shear_moduli() -> None:
    high = Seal(sealed_pressure=1.02 * COMPARED * Seal().shear_modulus)
    assert "5.1 is above 5" in _reservation(high, None, applies=False)
    assert not _reservation(high, None, applies=True)
    assert not _reservation(Seal(), None, applies=False)


def test_estimated_states() -> None:
    p = Seal(sealed_pressure=1.0, density=1)
    contact = DryContact.of(p, Silent())
    high = p.model_copy(update={"sealed_pressure": 9.0 * p.shear_modulus})
    rows = [
        state
        for stroke in ("out", "in")
        if (state := estimated_state(high, contact.system, contact.x, stroke, 100.0))
    ]
    out, back = rows
    assert {row.verdict for row in rows} == {ESTIMATED}
    assert all(isnan(row.rod_friction_N) for row in rows)
    assert (out.h_star_error_percent, back.h_star_error_percent) == (3.0, 100.0)
    # the viscosity before the inlet is that at the sealed pressure
    here = predicted(contact.system, contact.x, "out", 100.0)
    assert here is not None
    more = exp(0.6 * p.pressure_viscosity * (high.sealed_pressure - 1.0))
    assert out.h_star_um == pytest.approx(1e3 * here.h_star * more * 1.08, rel=0.01)
    assert "order of magnitude" in back.advice
    (net,) = net_leakage(rows)
    assert net.verdict == ESTIMATED
    errors = 0.03 * out.h_star_um + back.h_star_um
    assert net.net_error_percent == pytest.approx(100.0 * errors / net.net_film_um)
    _, line = run_summary(rows, 100.0)
    assert "friction not known (both strokes estimated)" in line
    (error,) = [column for column in out.columns() if column.name == "h_star_error_percent"]
    assert out.shown(error) == "\u00b13"
    rough = high.model_copy(update={"roughness": (0.0, 0.3)})
    state = estimated_state(rough, contact.system, contact.x, "in", 100.0)
    assert state is not None
    assert "asperities add at most" in state.advice
    # no picture of a friction that is not known; others have their range
    assert stribeck_figure(rough, [state, replace(state, rod_speed_mm_s=-50.0)]) is None
    assert np.isfinite(thicknesses(rows)).all()
    assert state.regime


def surface(p: Any) -> _Surface:
    """A flat surface of 1 mm in contact with these pressures (n,)."""
    s = np.linspace(0.0, 1.0, len(p))
    points = np.stack([s, np.full(len(p), 25.0)], axis=1)
    return _Surface(s, points, np.array(p), np.ones(len(p) - 1), np.ones(len(p)), (-1.0, 2.0))


def test_the_edge_of_a_contact_of_any_section() -> None:
    p, nodes = Seal(section="rectangular", groove_width=4.6), np.arange(101)
    s = np.linspace(0.0, 1.0, 101)
    smooth = surface(np.sqrt(9.0 * s)).drawn_in(p, nodes, 1.0, 1e-9, None)
    assert smooth is not None
    assert smooth.edge.rise == pytest.approx(9.0, rel=1e-6)
    assert smooth.unsettled < 1e-6
    assert smooth.edge.pocket == pytest.approx(1.0, rel=1e-6)  # to the end of the section
    inner = surface(np.sqrt(9.0 * np.maximum(s - 0.2, 0.0))).drawn_in(
        p, nodes[20:], 1.0, 1e-9, nodes[:11]
    )
    assert inner is not None
    assert inner.edge.pocket == pytest.approx(0.1, rel=1e-6)  # to the contact before
    peak = surface(1.0 + 2.0 * np.sqrt(s) / (1.0 + 30.0 * s)).drawn_in(p, nodes, 1.0, 1e-9, None)
    assert peak is None or peak.unsettled > SETTLED


def test_the_first_contact_of_several_decides() -> None:
    edge = Edge(9.0, 0.5, 4.0, 1.0)
    thick, thin = (Prediction(h, 0.05, edge, 0.05) for h in (1e-3, 8e-4))
    filled, starved = Predictions((thick, thin), "out"), Predictions((thin, thick), "in")
    assert (filled.h_star, starved.h_star) == (1e-3, 8e-4)
    assert (filled.passing, starved.passing) == (0.8, 1.0)
    assert (filled.applies, starved.applies) == (False, True)
    assert theory_by_contact(filled) == theory_by_contact(starved)
    assert theory_by_contact(filled)["h_star_theory_sealed_um"] == pytest.approx(1.0)
    assert theory_by_contact(Predictions((thick,), "out")) == {}
    assert not replace(thick, edge=replace(edge, curvature=3.0)).applies


@pytest.mark.slow
def test_estimated_state_of_an_x_ring() -> None:
    lobes: dict[str, Any] = {"lobe_radius": 0.9, "fillet_radius": 0.6}
    p = Seal(section="x_ring", groove_width=4.3, housing_diameter=56.4, **lobes)
    contact = DryContact.of(p, Silent())
    # films of docs/validation/sections.md at 200 mm/s
    films: dict[Stroke, float] = {"out": 0.683, "in": 0.547}
    for stroke, film in films.items():
        state = estimated_state(p, contact.system, contact.x, stroke, 200.0)
        assert state is not None
        assert state.h_star_um == pytest.approx(film, rel=0.01 * state.h_star_error_percent)
        assert state.h_star_error_percent >= ERRORS[stroke] + GROOVE
        assert state.contact_start_mm < state.groove_start_mm < state.groove_end_mm


def test_misplaced_segments_are_seen() -> None:
    graded = DryContact.of(Seal(density=1), Silent())
    uniform = DryContact.of(Seal(density=1, mesh="uniform"), Silent())
    equal = misplacement(uniform.system, uniform.x)
    steep, flat = sorted((e.rise for e in contact_edges(uniform.system, uniform.x)), reverse=True)
    assert misplacement(graded.system, graded.x) >= 1.0
    assert 1.0 <= equal < 1.1  # no segment is longer than the finest one
    assert steep > flat


def test_a_contact_above_all_films_is_that_under_less_pressure() -> None:
    p = Seal()
    low, high = (
        p.model_copy(update={"sealed_pressure": r * p.shear_modulus}) for r in (FILMS["out"], 20)
    )
    assert contact_of(low) is low
    assert high.load_ratio(contact_of(high).sealed_pressure) == pytest.approx(4.0, rel=5e-3)
    with pytest.raises(ValueError, match="films are found up to 6 times"):
        Seal(sealed_pressure=30.0, mesh="uniform")
    with pytest.raises(ValueError, match=r"8\.2 times the shear modulus"):
        require_films(p, 30.0)
