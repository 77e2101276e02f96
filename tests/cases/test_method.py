"""The O-ring solved: convergence, flux, both strokes, p_s = 0, labelled collapse, named failure."""

import math
from typing import Unpack

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome, StepReport
from softehl.cases.harness.row import OK
from softehl.cases.seal.report.section import boundary_edges
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import (
    COLLAPSED,
    OSCILLATING,
    UNCERTAIN,
    UNDER_RESOLVED,
    ContactState,
    FilmState,
    Silent,
)
from softehl.runtime.contact.rigid_obstacles import tributary_areas
from tests.cases.oring_cases import oring


class Recorder(Silent):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.contacts: list[ContactState] = []
        self.films: list[FilmState] = []
        self.fractions: list[float] = []

    def step(self, **step: Unpack[StepReport]) -> None:
        if step["fraction"] is not None:  # how far a film is from steady is not known
            self.fractions.append(step["fraction"])

    def contact_state(self, state: ContactState) -> None:
        self.contacts.append(state)

    def film_state(self, state: FilmState) -> None:
        self.films.append(state)


@pytest.fixture(scope="module")
def default() -> tuple[Outcome[FilmState], Recorder]:
    """Density 2, m_p = 4, p_s = 1, both strokes: the run of the README."""
    recorder = Recorder()
    speeds = (1600.0, 800.0, 400.0, 200.0, 100.0)
    return run(oring(density=2, speeds=speeds), recorder), recorder


def test_every_requested_state_converges_and_is_told(
    default: tuple[Outcome[FilmState], Recorder],
) -> None:
    outcome, recorder = default
    assert outcome.converged, outcome.message
    speeds = [s.rod_speed for s in outcome.states]
    assert speeds == [1600, 800, 400, 200, 100, -1600, -800, -400, -200, -100]
    assert recorder.films == list(outcome.states)
    assert len(recorder.contacts) == 1  # shared by both strokes
    assert min(recorder.fractions) == 0.0
    assert max(recorder.fractions) == 1.0


def test_the_air_wall_carries_the_sealed_pressure(
    default: tuple[Outcome[FilmState], Recorder],
) -> None:
    """Axial balance without friction: p_s on the annulus inside of the housing."""
    section = default[1].contacts[0].section
    pressure = section.point_data["contact_pressure"]
    edges = boundary_edges(section.cells)
    nodes = np.unique(edges[np.abs(section.points[edges, 0] - 0.5 * 3.74).max(axis=1) < 1e-6])
    force = float(pressure[nodes] @ tributary_areas(section.points, edges, nodes))
    inner = float(section.points[:, 1].min())
    assert force == pytest.approx(math.pi * (28.15**2 - inner**2), rel=1e-6)


def test_newton_ends_quadratically() -> None:
    outcome = run(oring(density=1, speeds=(1600.0, 400.0), solver="monolithic"), Recorder())
    checked = 0
    for stage in outcome.stages:
        for norms in stage.residual_histories:
            above = [k for k, norm in enumerate(norms) if norm > 1e-6]
            if not above or len(norms) == 1 or norms[-1] > 1e-6:  # steps in time end before
                continue
            last = above[-1]
            # the exponent of the last step before rounding; 2 in theory
            floor = 1e-8
            assert norms[last + 1] <= max(floor, norms[last] ** 1.5), (stage.name, norms)
            checked += 1
    assert checked > 30


def test_flux_is_constant_outside_cavitation(default: tuple[Outcome[FilmState], Recorder]) -> None:
    outcome, _ = default
    assert max(s.flux_variation for s in outcome.states) < 1e-6


def test_film_thickness_against_a_fine_mesh(default: tuple[Outcome[FilmState], Recorder]) -> None:
    outcome, _ = default
    fine = {1600: 3.1836, 400: 1.3748, 100: 0.5945, -1600: 2.6314, -400: 1.1363, -100: 0.4913}
    for state in outcome.states:
        if state.rod_speed in fine:
            assert state.h_star_um == pytest.approx(fine[int(state.rod_speed)], rel=0.03)
        assert 0.0 < state.h_min_um < state.h_star_um


@pytest.mark.parametrize("first", [0, 5])
def test_film_thickness_is_a_power_of_the_speed(
    default: tuple[Outcome[FilmState], Recorder], first: int
) -> None:
    states = default[0].states[first : first + 5]
    h = [s.h_star_um for s in states]
    exponents = np.log2(np.array(h[:-1]) / np.array(h[1:]))
    assert exponents.min() > 0.5
    assert exponents.max() < 0.7
    friction = [abs(s.rod_friction_N) for s in states]
    assert friction == sorted(friction, reverse=True)


def test_leakage_pressure_and_contact_of_each_state(
    default: tuple[Outcome[FilmState], Recorder],
) -> None:
    outcome, recorder = default
    dry = recorder.contacts[0]
    for state in outcome.states:
        flux = 0.5 * state.rod_speed * state.h_star_um * 1e-3
        assert state.leak_rate_mm3_s == pytest.approx(2 * math.pi * 25.0 * flux, rel=1e-12)
        assert state.p_max_MPa == pytest.approx(dry.p_MPa.max(), rel=0.06)
        assert state.contact_start_mm < dry.x_mm[dry.p_MPa > 1.0][0] < 0.0
        assert 1.0 < state.contact_end_mm < 1.15
        # boundary conditions (15), seen at the quadrature points next to the ends
        assert state.profile.p_MPa[[0, -1]] == pytest.approx([1.0, 0.0], abs=2e-3)


@pytest.mark.parametrize("p_s", [0.0, 0.5])
def test_low_sealed_pressure_works_in_both_strokes(p_s: float) -> None:
    speeds = (1600.0, 800.0)
    outcome = run(oring(density=1, sealed_pressure=p_s, speeds=speeds), Recorder())
    assert outcome.converged, outcome.message
    assert [s.rod_speed for s in outcome.states] == [1600, 800, -1600, -800]
    if p_s == 0.0:  # nearly symmetric about the middle of the groove
        h = [s.h_star_um for s in outcome.states]
        assert h[0] == pytest.approx(h[2], rel=0.02)


def test_a_film_that_a_coarse_mesh_does_not_bear_is_labelled() -> None:
    """Density 1 at 1 MPa: the exit dip of the instroke is narrower than a segment at 100 mm/s."""
    outcome = run(oring(density=1, stroke="in", speeds=(400.0, 100.0)), Recorder())
    found = [(s.rod_speed_mm_s, s.verdict) for s in outcome.states]
    assert found == [(-400.0, UNDER_RESOLVED), (-100.0, COLLAPSED)]


def test_a_free_section_rolls_until_no_moment_holds_it() -> None:
    # without shear stress hardly anything turns it, so that the path is not cut short
    parameters = {"density": 1, "sealed_pressure": 0.6, "stroke": "out", "speeds": (6400.0,)}
    free, fixed = (
        run(oring(rotation=rotation, shear_traction=False, **parameters), Recorder())
        for rotation in ("free", "fixed")
    )
    assert free.converged, free.message
    assert abs(free.states[0].moment_N_mm) < 1e-9
    assert abs(fixed.states[0].moment_N_mm) > 1e-3
    assert free.states[0].h_star_um == pytest.approx(fixed.states[0].h_star_um, rel=0.05)


def test_shear_stress_can_be_switched_off() -> None:
    states = [
        run(oring(density=1, stroke="out", speeds=(1600.0,), shear_traction=on), Recorder()).states
        for on in (True, False)
    ]
    with_shear, without = states[0][0], states[1][0]
    assert with_shear.h_star_um == pytest.approx(without.h_star_um, rel=0.02)
    assert with_shear.h_star_um != pytest.approx(without.h_star_um, rel=1e-5)
    assert with_shear.moment_N_mm > without.moment_N_mm + 5.0  # the film turns the section


@pytest.fixture(scope="module")
def discontinuous() -> Outcome[FilmState]:
    """The same with discontinuous pressures, outstroke."""
    speeds = (1600.0, 400.0, 100.0)
    return run(oring(density=2, reynolds="dg", stroke="out", speeds=speeds), Recorder())


def test_discontinuous_pressures_give_the_film_of_continuous_ones(
    default: tuple[Outcome[FilmState], Recorder], discontinuous: Outcome[FilmState]
) -> None:
    assert discontinuous.converged, discontinuous.message
    assert discontinuous.unknowns["pressure"] == 5 * 54
    continuous = {s.rod_speed: s for s in default[0].states}
    for state, limit in zip(discontinuous.states, (0.0005, 0.0015, 0.006), strict=True):
        other = continuous[state.rod_speed]
        assert state.h_star_um == pytest.approx(other.h_star_um, rel=limit)
        assert state.flux_variation < 1e-6
        assert 1e-3 < state.pressure_jump_max_MPa < 0.15
        assert other.pressure_jump_max_MPa == 0.0


def test_a_profile_shows_both_sides_of_a_facet(discontinuous: Outcome[FilmState]) -> None:
    for state in discontinuous.states:
        profile = state.profile
        x, p, h = (values.reshape(54, 7) for values in (profile.x_mm, profile.p_MPa, profile.h_um))
        assert x[1:, 0] == pytest.approx(x[:-1, -1], abs=1e-12)
        assert h[1:, 0] == pytest.approx(h[:-1, -1], rel=1e-9)
        jumps = np.abs(p[1:, 0] - p[:-1, -1])
        assert jumps.max() == pytest.approx(state.pressure_jump_max_MPa, rel=1e-9)
        assert p[0, 0] == pytest.approx(1.0)
        assert p[-1, -1] == pytest.approx(0.0, abs=1e-12)
        assert np.all(np.diff(profile.x_mm) >= -1e-12)


def test_jumps_fall_with_the_order(discontinuous: Outcome[FilmState]) -> None:
    parameters = {"density": 2, "reynolds": "dg", "stroke": "out", "speeds": (1600.0,)}
    low = run(oring(pressure_order=2, **parameters), Recorder()).states[0]
    assert low.pressure_jump_max_MPa > 3.0 * discontinuous.states[0].pressure_jump_max_MPa


@pytest.mark.slow
def test_a_low_order_is_reached_from_a_higher_one() -> None:
    """Its own path ends at 249 mm/s; the solutions beyond are those of an order of its own."""
    parameters = {"density": 2, "reynolds": "dg", "stroke": "in", "speeds": (1600.0, 200.0)}
    recorder = Recorder()
    outcome = run(oring(pressure_order=3, **parameters), recorder)
    assert outcome.converged, outcome.message
    assert outcome.states[-1].h_star_um == pytest.approx(0.726024, rel=1e-4)


def test_states_of_a_coarse_mesh_are_labelled(default: tuple[Outcome[FilmState], Recorder]) -> None:
    """Density 2: outstroke is sound, instroke oscillates, its slow end has too short an inlet."""
    out, back = default[0].states[:5], default[0].states[5:]
    assert [s.verdict for s in out] == [UNCERTAIN] * 5  # sound, but nothing says how accurate
    assert [s.verdict for s in back[-3:]] == [OSCILLATING, OSCILLATING, UNDER_RESOLVED]
    assert max(s.oscillation_index for s in out) < 0.2 < back[2].oscillation_index
    for states in (out, back):  # the inlet shortens as the film thins
        segments = [s.inlet_segments for s in states]
        assert segments == sorted(segments, reverse=True)
    assert all(bool(s.advice) == (s.verdict != OK) for s in default[0].states)
