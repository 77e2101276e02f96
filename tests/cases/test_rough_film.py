"""Films of the O-ring that conserve mass and touch: limits, Stribeck curve, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from softehl.cases.harness.row import OK
from softehl.cases.oring import CASE
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import SurfacePair, regime
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.inlet import inlet_length
from softehl.cases.seal.states.state import FilmRow, FilmState, Silent
from softehl.runtime.discretisation.step_bounds import ChangesLittle

VALIDATION = Path(__file__).parents[2] / "docs" / "validation"
SPEEDS = (2000.0, 500.0, 200.0, 50.0, 10.0, 1.0, 0.1, 0.01)


@pytest.mark.parametrize("rms", [2e-7, -0.1, 21.0])
def test_a_roughness_has_bounds(rms: float) -> None:
    """Metres for micrometres would be no roughness that a film can be solved with."""
    with pytest.raises(ValidationError, match="roughness"):
        Seal(roughness=(0.0, rms))


def solved(**given: Any) -> dict[float, FilmState]:
    """States by their signed speed."""
    p = Seal.model_validate({"density": 1, "error_estimate": False, **given})
    outcome = run(p, Silent())
    assert outcome.converged, outcome.message
    return {s.rod_speed_mm_s: s for s in outcome.states}


def test_the_mass_conserving_film_is_that_of_the_penalty_where_nothing_forms_again() -> None:
    given = {"speeds": (400.0,), "density": 1}
    penalty, conserving = solved(**given), solved(cavitation="mass-conserving", **given)
    for speed, state in penalty.items():
        assert conserving[speed].h_star_um == pytest.approx(state.h_star_um, rel=1e-5)
        assert conserving[speed].flux_variation < 1e-6  # also where the film is ruptured
        assert conserving[speed].regime == ""
        assert np.isnan(conserving[speed].lambda_ratio)
    # what drags on the rod is less by what the void takes
    assert conserving[400.0].rod_friction_N < penalty[400.0].rod_friction_N


def test_what_the_penalty_differs_by_is_its_suction() -> None:
    """At a high outstroke, without shear: it goes with one over epsilon."""
    given: dict[str, Any] = {"speeds": (1600.0,), "stroke": "out", "shear_traction": False}
    conserving = solved(cavitation="mass-conserving", **given)[1600.0].h_star_um
    films = [solved(cavitation_penalty=e, **given)[1600.0].h_star_um for e in (1e4, 1e5, 1e6)]
    errors = [abs(h / conserving - 1.0) for h in films]
    assert 1e-5 < errors[0] < 1e-4
    assert errors[2] < errors[1] < errors[0] / 3.0
    assert errors[2] < 1e-5


@pytest.mark.slow
def test_a_stribeck_curve_from_dry_sliding_unattended() -> None:
    states = solved(roughness=0.3, speeds=SPEEDS)
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
    smooth = solved(cavitation="mass-conserving", **given)[1000.0]
    errors = []
    for sigma in (0.08, 0.04):
        rough = solved(roughness=sigma, **given)[1000.0]
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
    coarse, fine = (solved(**given, density=d) for d in (2, 4))
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
    held, rubbing = (solved(housing_friction=f, density=2, **given) for f in (0.0, 0.2))
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
    usual, varied = solved(**given), solved(**{**given, **keys})
    for number, speed in enumerate(speeds):
        for name, column in zip(("mean_gap_um", "rod_friction_N"), said, strict=True):
            found = getattr(varied[speed], name) / getattr(usual[speed], name)
            assert 100.0 * (found - 1.0) == pytest.approx(column[number], abs=0.5)
