"""Unknowns and equations of a seal, with upwinding, roughness and oils that thin."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import fixed_quad
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

from softehl.cases.cycle import Cycle
from softehl.cases.harness.observer import Outcome
from softehl.cases.harness.row import OK
from softehl.cases.oring import CASE
from softehl.cases.seal.equations.definition import FILM, PRESSURE, ROD, SealBlock, blocks_of
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.scales import film_flux
from softehl.cases.seal.equations.system import SealSystem, build_system, seal_study
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import SurfacePair, regime
from softehl.cases.seal.section.section import seal_section
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.inlet import inlet_length
from softehl.cases.seal.states.state import FilmRow, FilmState, Silent
from softehl.cases.slider.parameters import Slider
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.step_bounds import ChangesLittle
from tests.cases.oring_cases import oring
from tests.cases.test_driver import Recorder
from tests.cases.test_slider import row

# --- The coupled system: declared once, counts of Table 2, loads, tangent of the whole ------------


TABLE_2 = {1: (1076, 109), 2: (3587, 217), 4: (12929, 433), 8: (48893, 865), 16: (189941, 1729)}


@pytest.mark.parametrize("d", TABLE_2)
def test_unknowns_of_table_2(d: int) -> None:
    p = oring(density=1, mesh="uniform", arc_start=-34.0, arc_end=43.0)
    layout = SealSystem.of(p, seal_section(p, density=Fraction(d))).layout
    total, pressures = TABLE_2[d]
    assert layout.count(PRESSURE) == pressures == 108 * d + 1
    assert layout.total == pytest.approx(total, rel=0.03)


@pytest.mark.parametrize("m_p", range(1, 6))
def test_discontinuous_pressures_have_all_their_unknowns(m_p: int) -> None:
    system = build_system(oring(density=1, pressure_order=m_p, reynolds="dg"))
    assert system.pressure_count == 27 * (m_p + 1)
    first = system.layout.part("pressure").start
    assert system.film_ends.tolist() == [first, first + 27 * (m_p + 1) - 1]
    film, facet = (system.problem.assembler.block(name) for name in ("film", "facet"))
    assert np.unique(film.dofs[:, 4:]).size == 27 * (m_p + 1)
    assert facet.dofs.shape == (26, 6 + 2 * (m_p + 1))
    # a facet sees the displacements and pressures of the segments on its two sides
    assert np.array_equal(facet.dofs[:, :4], film.dofs[:-1, :4])
    assert np.array_equal(facet.dofs[:, 2:6], film.dofs[1:, :4])
    assert np.array_equal(facet.dofs[:, 6:], np.hstack([film.dofs[:-1, 4:], film.dofs[1:, 4:]]))


def test_sealed_pressure_acts_from_the_sealed_end_of_the_arc_to_the_crown() -> None:
    system = build_system(oring(density=4))
    block = system.problem.assembler.block("sealed_side")
    z = block.coordinates[:, [0, 2]].mean(axis=1)
    assert z.max() < 0.0
    r = block.coordinates[:, [1, 3]]
    assert r.max() == pytest.approx(28.725, abs=2e-3)  # the crown
    sealed_end = system.mesh.points[system.mesh.arc_nodes[0]]
    assert block.coordinates[-1, 2:] == pytest.approx(sealed_end)
    arc = system.problem.assembler.block("sealed_arc")
    assert arc.coordinates[0, :2] == pytest.approx(sealed_end)
    assert arc.coordinates[-1, 3] == system.mesh.points[system.mesh.arc_nodes, 1].min()


def test_axial_force_of_the_sealed_pressure_is_pressure_times_projected_area() -> None:
    system = build_system(oring(density=2))
    x = system.at_rest()
    force = 0.0
    for name in ("sealed_side", "sealed_arc"):
        block = system.problem.assembler.block(name)
        force -= block.residual(x, np.array([2.0]))[:, [0, 2]].sum()
    top, bottom = system.mesh.points[:, 1].max(), system.mesh.points[:, 1].min()
    assert force == pytest.approx(2.0 * np.pi * (top**2 - bottom**2), rel=2e-3)


def test_what_holds_the_rotation_is_a_pure_couple() -> None:
    """About the centroid of the mesh, which is not that of the circle where its nodes are not even.

    About the circle's own centre it would push the section along the rod.
    """
    system = build_system(oring(density=2))
    area, centroid, polar_moment = system.section.moments
    p = system.parameters
    radius = 0.5 * p.section_diameter
    assert area == pytest.approx(np.pi * radius**2, rel=3e-3)
    assert polar_moment == pytest.approx(0.5 * np.pi * radius**4, rel=6e-3)
    x = system.at_rest()
    x[system.layout.part("rotation")] = 1.0
    block = system.problem.assembler.block("rotation")

    def push(centre: np.ndarray) -> float:
        moments = block.residual(x, np.array([*centre, polar_moment, 0.0]))
        return abs(float(moments[:, [0, 2, 4, 6]].sum()))

    assert push(centroid) < 1e-12
    assert push(np.array([0.0, 0.5 * p.inner_diameter + radius])) > 1e-6


def test_obstacles_touch_the_free_section_where_they_should() -> None:
    system = build_system(oring(density=2))
    points = system.mesh.points
    gaps = {name: obstacle.gap(points).min() for name, obstacle in system.obstacles.items()}
    assert gaps["rod"] == pytest.approx(0.195, abs=1e-3)
    assert gaps["housing"] == pytest.approx(28.15 - 28.725, abs=1e-3)
    assert gaps["sealed_wall"] == pytest.approx(1.87 - 1.765, abs=5e-3)
    assert gaps["air_wall"] == pytest.approx(1.87 - 1.765, abs=5e-3)


@pytest.mark.parametrize("solid", ["taylor", "fbar", "q4"])
@pytest.mark.parametrize("stroke", ["out", "in"])
def test_tangent_of_the_whole_problem(solid: str, stroke: str, rng: np.random.Generator) -> None:
    system = build_system(oring(density=1, solid=solid))
    layout = system.layout
    film = FilmLoads(1.0, stroke, 400.0, np.zeros(28))  # type: ignore[arg-type]
    problem = system.film_problem(film)
    x = 1e-3 * rng.normal(size=layout.total)
    system.pressures(x)[:] = rng.uniform(0.5, 3.0, system.pressure_count)
    x[problem.fixed] = problem.values
    direction = rng.normal(size=layout.total)
    direction[problem.fixed] = 0.0
    direction[layout.part("displacement")] *= 1e-3
    step = 1e-4
    difference = problem.residual(x + step * direction) - problem.residual(x - step * direction)
    r, K = problem.linearise(x)
    exact = np.asarray(K @ direction)
    for name in ("displacement", "pressure", "rotation", "housing"):
        part = layout.part(name)
        error = difference[part] / (2 * step) - exact[part]
        assert np.linalg.norm(error) < 1e-5 * np.linalg.norm(exact[part]) + 1e-12
    assert r == pytest.approx(problem.residual(x), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("moment", [None, 0.0, 2.5])
def test_the_film_acts_on_a_held_section_or_on_one_with_a_given_moment(
    moment: float | None,
) -> None:
    system = build_system(oring(density=1))
    film = FilmLoads(1.0, "out", 400.0, np.zeros(28), moment=moment)
    problem = system.film_problem(film)
    prescribed = dict(zip(problem.fixed.tolist(), problem.values.tolist(), strict=True))
    assert prescribed.get(int(system.layout.dofs("rotation")[0])) == moment


def test_fluxes_are_measured_by_what_rounding_leaves_of_them() -> None:
    system = build_system(oring(density=1))
    gap = np.full(28, 1e-3)
    thin = system.flux_scales(25.0, gap)
    assert thin == pytest.approx(np.full(109, film_flux(25.0)), rel=1e-3)
    gap[0] = 0.1  # the film of the first segment, four of whose pressures are its own
    scales = system.flux_scales(25.0, gap)
    assert scales[5:] == pytest.approx(thin[5:])
    dx = np.linalg.norm(np.diff(system.mesh.points[system.mesh.arc_nodes[:2]], axis=0))
    flux = 1e-4 * 4**2 * 0.1**3 / (12.0 * system.parameters.viscosity * dx)
    assert scales[:5] == pytest.approx(np.full(5, film_flux(25.0) + flux))


def test_a_pressure_is_rounded_to_far_less_than_the_tolerance() -> None:
    """A last digit of 5 MPa drives through a film of 0.1 mm less than 1e-9 of its scale."""
    system = build_system(oring(density=8))
    scale = system.flux_scales(25.0, np.full(217, 0.1)).max()
    dx = 2.37 / 216 / 4  # of the four intervals of a segment, mm
    rounding = 0.1**3 / (12.0 * system.parameters.viscosity) * np.spacing(5.0) / dx
    assert rounding < 1e-9 * scale
    assert rounding > 1e-9 * film_flux(25.0)


# --- declared once --------------------------------------------------------------------------------


def test_a_kernel_that_asks_for_what_nobody_gives_is_named() -> None:
    stranger = SealBlock("stranger", "contact", "arc_nodes", (ROD,), "film")
    p = oring(density=1)
    with pytest.raises(
        KeyError, match=r"'stranger' asks for offset; cases/seal/equations/definition.py gives"
    ):
        seal_study(p, seal_section(p), (*blocks_of(p), stranger))


# --- The O-ring with the bubble-load upwinding: none at c = 0, both routes and treatments with ----


TREATMENTS = ("fe", "dg")


def reversed_sign(parameters: Seal, strength: float) -> Seal:
    """What no case may ask for: the load moved upstream."""
    return parameters.model_copy(update={"upwinding": strength})


@cache
def solved(strength: float, **changes: Any) -> Outcome[FilmState]:
    parameters = oring(**{"density": 1, "stroke": "out", "speeds": (1600.0, 400.0), **changes})
    outcome = run(reversed_sign(parameters, strength), Recorder())
    assert outcome.converged, outcome.message
    return outcome


def films(**changes: Any) -> tuple[Problem, np.ndarray]:
    """The film problem of a coarse section, and a state in which nothing is zero."""
    system, rng = build_system(oring(density=1, **changes)), np.random.default_rng(8)
    film = FilmLoads(1.0, "out", 400.0, np.zeros(28))
    problem = system.film_problem(film)
    x = 1e-3 * rng.normal(size=system.layout.total)
    radii = system.mesh.points[system.mesh.arc_nodes, 1] - system.rod_radius
    system.displacements(x)[system.mesh.arc_nodes, 1] = rng.uniform(5e-4, 2e-3, 28) - radii
    system.pressures(x)[:] = rng.uniform(0.5, 3.0, system.pressure_count)
    return problem, x


@pytest.mark.parametrize("reynolds", TREATMENTS)
def test_at_strength_zero_the_scheme_is_the_papers_to_the_last_bit(reynolds: str) -> None:
    """No block more than without the term; and where it is there, c = 0 changes no bit either."""
    plain, x = films(reynolds=reynolds, upwinding=0.0)
    assert "upwind" not in [block.name for block in plain.assembler.blocks]
    with_term, _ = films(reynolds=reynolds, upwinding=1.0)
    silent = with_term.with_parameters(upwind={"upwinding": 0.0})
    np.testing.assert_array_equal(silent.residual(x), plain.residual(x))
    without, zero = (problem.linearise(x)[1].toarray() for problem in (plain, silent))
    np.testing.assert_array_equal(zero, without)
    assert (with_term.residual(x) != plain.residual(x)).any()


@pytest.mark.parametrize("reynolds", TREATMENTS)
def test_the_tangent_of_the_whole_problem_has_it(reynolds: str, rng: np.random.Generator) -> None:
    problem, x = films(reynolds=reynolds, upwinding=1.0)
    direction = np.where(problem.layout.dofs("pressure").min() <= np.arange(len(x)), 1.0, 1e-4)
    direction *= rng.normal(size=len(x))
    direction[problem.fixed] = 0.0
    x[problem.fixed] = problem.values
    step = 1e-4
    plus, minus = (problem.residual(x + s * step * direction) for s in (1, -1))
    exact = np.asarray(problem.linearise(x)[1] @ direction)
    part = problem.assembler.block("film").dofs[:, [1, 3]].ravel()
    error = (plus - minus)[part] / (2 * step) - exact[part]
    assert np.linalg.norm(error) < 1e-5 * np.linalg.norm(exact[part])


def test_newton_converges_quadratically_with_it() -> None:
    outcome = solved(1.0, solver="monolithic")
    checked = 0
    for stage in outcome.stages:
        for norms in stage.residual_histories if stage.where["stroke"] == "out" else ():
            above = [k for k, norm in enumerate(norms) if norm > 1e-6]
            if above and norms[-1] <= 1e-6 and len(norms) > 1:  # steps in time end before
                assert norms[above[-1] + 1] <= max(1e-8, norms[above[-1]] ** 1.5), norms
                checked += 1
    assert checked > 3


@pytest.mark.parametrize("reynolds", ["fe", pytest.param("dg", marks=pytest.mark.slow)])
def test_it_damps_the_oscillation_and_amplifies_it_with_its_sign_reversed(reynolds: str) -> None:
    """At 400 mm/s; measured 0.017, 0.057, 0.75 for "fe" and 0.014, 0.094, 0.61 for "dg"."""
    damped, plain, amplified = (
        solved(c, reynolds=reynolds).states[-1].oscillation_index for c in (1.0, 0.0, -0.25)
    )
    assert damped < 0.4 * plain
    assert amplified > 4 * plain


@pytest.mark.parametrize("solid", ["taylor", "fbar"])
def test_the_section_is_as_stiff_against_a_zigzag_as_the_theory_takes_it_to_be(solid: str) -> None:
    """k / (2 pi G) is 28 zeta(3) / pi^4 = 0.346 of a half-space whose trace is linear."""
    system = build_system(oring(density=1, solid=solid))
    nodes, layout = system.mesh.arc_nodes, system.layout
    multipliers = [layout.dofs(name) for name in ("pressure", "rod", "rotation")]
    problem = system.problem.with_fixed(multipliers, [0.0, 0.0, 0.0])
    load = np.zeros(layout.total)
    load[2 * nodes + 1] = 2.0 * np.pi * system.mesh.points[nodes, 1] * (-1.0) ** np.arange(28)
    moved = spsolve(problem.linearise(system.at_rest())[1], load)[2 * nodes + 1]
    amplitude = np.abs(np.diff(moved, 2))[10:16] / 4
    assert np.ptp(amplitude) < 0.1 * amplitude.mean()
    k = 1.0 / amplitude.mean()
    assert 0.31 < k / (2.0 * np.pi * system.parameters.shear_modulus) < 0.36


@pytest.mark.parametrize("stroke", ["out", "in"])
def test_both_strokes_move_the_load_downstream(stroke: str) -> None:
    system = build_system(oring(density=1, upwinding=0.5))
    film = FilmLoads(1.0, stroke, 400.0, np.zeros(28))  # type: ignore[arg-type]
    problem = system.film_problem(film)
    names = problem.assembler.block("upwind").kernel.parameters
    given = dict(zip(names, problem.parameters["upwind"].tolist(), strict=True))
    assert given["upwinding"] == (0.5 if stroke == "out" else -0.5)
    assert given["shear_modulus"] == pytest.approx(3.66)
    assert (given["force_weight"], given["rod_speed"]) == (1.0, film.rod_speed)


# --- Films of the O-ring that conserve mass and touch: limits, Stribeck curve, what is refused ----


VALIDATION = Path(__file__).parents[2] / "docs" / "validation"
SPEEDS = (2000.0, 500.0, 200.0, 50.0, 10.0, 1.0, 0.1, 0.01)


@pytest.mark.parametrize("rms", [2e-7, -0.1, 21.0])
def test_a_roughness_has_bounds(rms: float) -> None:
    """Metres for micrometres would be no roughness that a film can be rough with."""
    with pytest.raises(ValidationError, match="roughness"):
        Seal(roughness=(0.0, rms))


def rough_states(**given: Any) -> dict[float, FilmState]:
    """States by their signed speed."""
    p = Seal.model_validate({"density": 1, "error_estimate": False, **given})
    outcome = run(p, Silent())
    assert outcome.converged, outcome.message
    return {s.rod_speed_mm_s: s for s in outcome.states}


def test_the_mass_conserving_film_is_that_of_the_penalty_where_nothing_forms_again() -> None:
    given = {"speeds": (400.0,), "density": 1}
    penalty, conserving = (
        rough_states(**given),
        rough_states(cavitation="mass-conserving", **given),
    )
    for speed, state in penalty.items():
        assert conserving[speed].h_star_um == pytest.approx(state.h_star_um, rel=1e-5)
        assert conserving[speed].flux_variation < 1e-6  # also where the film is ruptured
        assert conserving[speed].regime == ""
        assert np.isnan(conserving[speed].lambda_ratio)
    # what drags on the rod is less by what the void takes
    assert conserving[400.0].rod_friction_N < penalty[400.0].rod_friction_N


@pytest.mark.slow
def test_what_the_penalty_differs_by_is_its_suction() -> None:
    """At a high outstroke, without shear: it goes with one over epsilon."""
    given: dict[str, Any] = {"speeds": (1600.0,), "stroke": "out", "shear_traction": False}
    conserving = rough_states(cavitation="mass-conserving", **given)[1600.0].h_star_um
    films = [rough_states(cavitation_penalty=e, **given)[1600.0].h_star_um for e in (1e4, 1e5, 1e6)]
    errors = [abs(h / conserving - 1.0) for h in films]
    assert 1e-5 < errors[0] < 1e-4
    assert errors[2] < errors[1] < errors[0] / 3.0
    assert errors[2] < 1e-5


@pytest.mark.slow
def test_a_stribeck_curve_from_dry_sliding_unattended() -> None:
    states = rough_states(roughness=0.3, speeds=SPEEDS)
    assert sorted(states) == sorted([*SPEEDS, *(-u for u in SPEEDS)])
    for sign in (1.0, -1.0):
        stroke = [states[sign * u] for u in sorted(SPEEDS)]
        friction = np.array([sign * s.rod_friction_N for s in stroke])
        ratios = [s.lambda_ratio for s in stroke]
        shares = [s.asperity_load_percent for s in stroke]
        assert np.diff(ratios).min() > -0.01  # the film hardly knows the slowest speeds
        assert np.diff(shares).max() < 1.0
        assert [s.regime for s in stroke] == [regime(r) for r in ratios]
        assert stroke[0].regime == "boundary"
        assert stroke[-1].regime == "full"
        least = int(np.argmin(friction))
        assert 0 < least < len(stroke) - 1
        assert friction[0] > 5.0 * friction[least]
        assert friction[-1] > friction[least]
        assert stroke[0].boundary_friction_percent > 98.0
        assert all(s.verdict == "ok" for s in stroke)
    # dry friction: the coefficient of asperities times what they carry
    dry = states[0.01]
    assert 40.0 < dry.rod_friction_N < 70.0


@pytest.mark.slow
def test_little_roughness_is_the_smooth_film() -> None:
    given: dict[str, Any] = {"speeds": (1000.0,), "stroke": "out"}
    smooth = rough_states(cavitation="mass-conserving", **given)[1000.0]
    errors = []
    for sigma in (0.08, 0.04):
        rough = rough_states(roughness=sigma, **given)[1000.0]
        errors.append(abs(rough.rod_friction_N / smooth.rod_friction_N - 1.0))
        assert rough.h_star_um == pytest.approx(smooth.h_star_um, rel=1e-4)
    assert errors[1] < errors[0] < 2e-2
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


def test_a_pressure_of_cavitation_asks_for_the_film_that_has_one() -> None:
    assert not Seal().conserving
    assert Seal(cavitation_pressure=-0.05).conserving


def test_without_roughness_the_pages_are_the_smooth_ones() -> None:
    default = build_system(Seal(density=1))
    zero = build_system(Seal.model_validate({"density": 1, "roughness": 0}))
    names = [[b.kernel.name for b in s.problem.assembler.blocks] for s in (default, zero)]
    assert names[0] == names[1]
    assert not any("rough" in name or "void" in name for name in names[0])
    assert zero.layout == default.layout


def test_a_smooth_run_says_where_usual_surfaces_would_touch() -> None:
    values: dict[str, Any] = {
        "sealed_pressure_MPa": 1.0,
        "rod_speed_mm_s": 25.0,
        "h_star_um": 0.3,
        "h_min_um": 0.2,
        "p_max_MPa": 3.6,
        "pressure_jump_max_MPa": 0.0,
        "rod_friction_N": 2.0,
        "leak_rate_mm3_s": 0.1,
        "contact_start_mm": -1.0,
        "contact_end_mm": 1.0,
        "newton_iterations": 5,
        "flux_variation": 0.0,
        "moment_N_mm": 0.0,
        "contact_p_max_MPa": 3.6,
        "oscillation_index": 0.0,
        "inlet_segments": 9.0,
        "density": 2,
        "verdict": "ok",
    }
    row = FilmRow(**values)
    (note,) = CASE.notes([row])
    assert "roughness" in note
    assert "+25" in note


def test_the_guard_of_rough_films_lets_them_interpenetrate() -> None:
    guard = ChangesLittle(np.array([1, 2]), np.array([0.0, 1.0]), 0.7, 1e-3)
    x = np.array([5.0, 2e-4, -0.5])
    assert guard.limit(x, np.array([9.0, -1e-3, 0.0])) == 1.0
    assert guard.limit(x, np.array([0.0, -4e-3, 0.0])) == 0.25
    assert guard.limit(x, np.array([0.0, 0.0, 0.7])) == pytest.approx(0.5)


def test_stiffness_of_asperities_is_that_of_the_rubber() -> None:
    assert Seal().surfaces == SurfacePair(0.0, 0.0, 14.64, 0.1)
    assert Seal(asperity_stiffness=3.0).surfaces.stiffness == 3.0


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.4])
def test_densities_agree_on_a_rough_film(sigma: float) -> None:
    """Mean gap and friction within 1 % between densities 2 and 4, from dry to 2000 mm/s.

    Friction of 0.1 um at 10 mm/s, where it falls by half within a doubling of the speed: 1.3 %.
    """
    speeds = (2000.0, 200.0, 10.0, 1.0, 0.01)
    given: dict[str, Any] = {"roughness": sigma, "speeds": speeds}
    coarse, fine = (rough_states(**given, density=d) for d in (2, 4))
    assert len(fine) == 2 * len(speeds)
    for speed, state in fine.items():
        friction = 1.4e-2 if (sigma, abs(speed)) == (0.1, 10.0) else 1e-2
        assert coarse[speed].mean_gap_um == pytest.approx(state.mean_gap_um, rel=1e-2)
        assert coarse[speed].rod_friction_N == pytest.approx(state.rod_friction_N, rel=friction)


def test_the_mesh_of_a_rough_seal_is_no_finer_than_its_asperities_ask() -> None:
    """Smooth, the inlet shrinks with the slowest speed; rough, h rises by sigma over it."""
    smooth, rough = (Seal.model_validate({"roughness": r}) for r in (0, 0.1))
    rise, slowest = 25.0, 0.01
    length = inlet_length(rough, rise, slowest)
    assert length > 10.0 * inlet_length(smooth, rise, slowest)
    gap = rise**0.5 * length**1.5 / (3.0 * rough.shear_modulus)
    assert gap == pytest.approx(rough.surfaces.sigma)


@pytest.mark.slow
def test_a_rough_film_on_a_section_that_rubs_on_its_housing() -> None:
    """The film begins with the section free to roll, as friction holds it in the contact."""
    given: dict[str, Any] = {"roughness": 0.3, "speeds": (10.0, 500.0), "stroke": "out"}
    held, rubbing = (rough_states(housing_friction=f, density=2, **given) for f in (0.0, 0.2))
    assert all(state.verdict == OK for state in rubbing.values())
    for speed, state in held.items():
        assert rubbing[speed].rod_friction_N == pytest.approx(state.rod_friction_N, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "keys"),
    [
        ("K halved", {"asperity_stiffness": 7.32}),
        ("both surfaces equally rough", {"roughness": [0.3 / 2**0.5, 0.3 / 2**0.5]}),
    ],
)
def test_how_much_uncertain_coefficients_matter(what: str, keys: dict[str, Any]) -> None:
    """Rows of the table in docs/validation/films.md."""
    page = (VALIDATION / "films.md").read_text(encoding="utf-8")
    (line,) = [line for line in page.splitlines() if line.startswith(f"| {what}")]
    said = [[float(v) for v in cell.split(",")] for cell in line.split("|")[2:4]]
    speeds = (1.0, 20.0, 200.0)
    given: dict[str, Any] = {
        "roughness": 0.3,
        "speeds": speeds,
        "stroke": "out",
        "density": 2,
    }
    usual, varied = rough_states(**given), rough_states(**{**given, **keys})
    for number, speed in enumerate(speeds):
        for name, column in zip(("mean_gap_um", "rod_friction_N"), said, strict=True):
            found = getattr(varied[speed], name) / getattr(usual[speed], name)
            assert 100.0 * (found - 1.0) == pytest.approx(column[number], abs=0.5)


# --- Oils that thin under shear: their keys, what is refused, and what they do to a slider --------


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
