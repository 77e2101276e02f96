"""Sensitivities and design."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.__main__ import main
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sections.section_keys import dimensions
from softehl.cases.seal.gland.sections.shapes import SECTIONS
from softehl.cases.seal.gland.sensitivity_keys import LENGTHS
from softehl.cases.seal.gland.tolerances import band, read_tolerances
from softehl.cases.seal.sensitivity import design
from softehl.cases.seal.sensitivity.design import (
    Change,
    DesignStep,
    DesignTarget,
    HeldFilm,
    Lever,
    NoDesignError,
    bounded,
    designed,
    joint_lever,
    settled,
)
from softehl.cases.seal.sensitivity.design import LinearisedFilm as DesignFilm
from softehl.cases.seal.sensitivity.frozen_mesh_map import FilmCase
from softehl.cases.seal.sensitivity.moving_mesh import edges, shift_rate, shifted, velocities
from softehl.cases.seal.sensitivity.pseudo_loads import Inputs, Tangent
from softehl.cases.seal.sensitivity.quantities import (
    QUANTITIES,
    along,
    by_unknowns,
    fields_along,
    quantities,
)
from softehl.cases.seal.sensitivity.sensitivity import (
    differentiation,
    frozen_slopes,
    rates_of,
    sensitivities,
)
from softehl.cases.seal.solve.driver import DryContact, run
from softehl.cases.seal.solve.film_solver import Film
from softehl.cases.seal.states.results import film_numbers, film_state
from softehl.cases.seal.states.sensitivity_table import SensitivityRow, resolved
from softehl.cases.seal.states.state import FilmRow, FilmState, Silent
from softehl.cases.seal.states.verdict import Verdict
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import interval_below
from softehl.runtime.io import read_csv
from softehl.runtime.solve.linear.linear_solver import Factorisation, SparseMatrix
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.newton import Newton
from tests.cases.oring_cases import film_values

# --- Sensitivities against central differences of what a run reports, and against dimensions ------


SLOPES = Mapping[str, Mapping[str, float]]


def film_of(speed: float, **given: Any) -> Seal:
    """A coarse case of one film."""
    values = {"density": 1, "speeds": (speed,), "error_estimate": False, "stroke": "out", **given}
    return Seal(**values)


CASES = {
    "out": film_of(400.0),
    "in": film_of(400.0, stroke="in"),
    "dg": film_of(800.0, reynolds="dg", solid="fbar"),
    "conserving": film_of(400.0, cavitation="mass-conserving"),
    "section rectangular": film_of(
        400.0, section="rectangular", corner_radius=0.4, groove_width=4.3, housing_diameter=56.4
    ),
    "section d_ring": film_of(
        400.0, section="d_ring", nose_radius=1.8, groove_width=4.3, housing_diameter=56.4
    ),
    "section x_ring": film_of(400.0, section="x_ring", groove_width=4.3, housing_diameter=56.4),
    "piston": film_of(400.0, bore=50.0),
    "gap": film_of(400.0, extrusion_gap=0.2, sealed_pressure=8.0),  # touches the edge
    "thick": film_of(1600.0, viscosity=1e-5),  # nowhere below 20 um
    "thinning": film_of(
        400.0, carreau_stress=0.01, carreau_exponent=0.6, carreau_plateau=0.3, stroke="in"
    ),
}
MEASURES = (*LENGTHS, *dict.fromkeys(key for name in SECTIONS for key in dimensions(name)))
QUICK = ("out", "dg", "conserving", "thinning")
ALL = [pytest.param(n, marks=[pytest.mark.slow] * (n not in QUICK)) for n in CASES]
STEP = 5e-7
"""A tenth of what makes a point of the film cavitate: there the friction has a kink."""


@cache
def state(name: str) -> tuple[FilmCase, Array]:
    """A film and its unknowns, solved to rounding."""
    p = CASES[name]
    stroke = p.stroke
    assert stroke != "both"
    contact = DryContact.of(p, Silent())
    film = contact.film(stroke, p.speeds[0])
    assert isinstance(film, Film)
    case = FilmCase(film.system, film.loads)
    return case, solved(case, film.x)


def solved(case: FilmCase, x: Array) -> Array:
    solution = Newton(tolerance=1e-11, stagnation=1e3).solve(case.problem, x)
    assert solution.converged, solution.message
    return solution.x


def reported(case: FilmCase, x: Array) -> dict[str, float]:
    """What `film_state` reports."""
    numbers = film_numbers(case.system, case.problem, case.film, x)
    state = film_state(case.system, case.problem, case.film, x, Verdict(1.0, last=numbers), 0)
    return {
        "h_star": numbers.h_star,
        "friction": numbers.friction,
        "leakage": case.system.around * numbers.flux,
        "p_max": numbers.p_max,
        "contact_width": state.contact_end_mm - state.contact_start_mm,
    }


@cache
def slopes(name: str) -> SLOPES:
    """On a mesh that moves with the section alone."""
    case, x = state(name)
    return frozen_slopes(case, x, SuperLU(), rates_of(case), quantities(case, x))


def differences(name: str, key: str) -> dict[str, float]:
    """Central differences of the logarithms of what is reported, the mesh frozen."""
    case, x = state(name)
    ahead, behind = (
        reported(moved, solved(moved, x))
        for moved in (case.scaled(key, STEP), case.scaled(key, -STEP))
    )
    span = math.log1p(STEP) - math.log1p(-STEP)
    return {q: math.log(ahead[q] / behind[q]) / span for q in QUANTITIES}


@pytest.mark.parametrize(
    "name", ["in", *(pytest.param(n, marks=pytest.mark.slow) for n in CASES if n != "in")]
)
def test_every_derivative_agrees_with_central_differences(name: str) -> None:
    """To 1e-5 of the largest derivative of a quantity, all of which are of this order."""
    case, _ = state(name)
    found = slopes(name)
    for key in case.parameters:
        expected = differences(name, key)
        for quantity in QUANTITIES:
            scale = max(1.0, abs(expected[quantity]))
            assert abs(found[quantity][key] - expected[quantity]) <= 1e-5 * scale, (key, quantity)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.slow] * (n not in ("thinning", "conserving")))
        for n in CASES
    ],
)
def test_direct_and_adjoint_agree(name: str) -> None:
    """How the film moves with each parameter is solved for, instead of the adjoints."""
    case, x = state(name)
    tangent, found = Tangent.at(case.problem, x), quantities(case, x)
    for key, rate in rates_of(case).items():
        dx = -SuperLU().factorise(tangent.reduced).solve(tangent.load(rate))
        moved = fields_along(case, x, rate, found.values())
        for quantity, q in found.items():
            value = by_unknowns(case, x, q) @ dx + along(case, q, key, rate, moved)
            assert slopes(name)[quantity][key] == pytest.approx(value, abs=1e-7, rel=1e-7)


def defects(found: SLOPES) -> dict[str, float]:
    """What is left of the identities that dimensions demand: pressure, time and length."""
    left = {}
    for quantity, pressures, lengths in (("h_star", 0, 1), ("friction", 1, 2), ("p_max", 1, 0)):
        s = found[quantity]
        stress = sum(s[k] for k in ("mu_1", "mu_2", "bulk_modulus", "sealed_pressure", "viscosity"))
        stress += s.get("carreau_stress", 0.0) - s["pressure_viscosity"] - s["cavitation_penalty"]
        left[f"{quantity} stress"] = stress - pressures
        left[f"{quantity} time"] = s["viscosity"] - s["U"] - s["cavitation_penalty"]
        length = sum(s.get(k, 0.0) for k in MEASURES) + s["U"] + s["cavitation_penalty"]
        left[f"{quantity} length"] = length - lengths
    return left


@pytest.mark.parametrize("name", ALL)
def test_dimensions_are_kept(name: str) -> None:
    assert max(map(abs, defects(slopes(name)).values())) < 1e-6


def test_dimensions_show_a_mesh_that_does_not_move() -> None:
    """The oracle itself: without the velocities of the nodes lengths do not add up."""
    case, x = state("out")
    rates = rates_of(case)
    still = {}
    for key, rate in rates.items():
        rows = {name: value.copy() for name, value in rate.blocks.items()}
        rows["solid"][:, :8] = 0.0
        still[key] = Inputs(rows, rate.values)
    found = frozen_slopes(case, x, SuperLU(), still, quantities(case, x))
    assert abs(defects(found)["h_star length"]) > 1e-3
    wrong = {q: {**s, "mu_2": 1.01 * s["mu_2"]} for q, s in slopes("out").items()}
    assert abs(defects(wrong)["h_star stress"]) > 1e-5


@pytest.mark.parametrize("name", ALL)
def test_dimensions_are_kept_on_a_mesh_that_follows_the_film(name: str) -> None:
    case, x = state(name)
    found = sensitivities(case, x, SuperLU(), rates_of(case))
    assert max(map(abs, defects(found).values())) < 1e-6


def test_derivatives_are_those_that_other_runs_have() -> None:
    """Two runs of density 4 with 0.1 mm more and less gave 17.91 and -52.89 of h* and friction.

    On a mesh that moves with the section alone, this film, which is `ok`, has 14.5 and -47.6.
    """
    p = film_of(100.0, density=2, ring="AS568-226", rod=50.0, sensitivity=True)
    (film,) = run(p, Silent(), differentiate=differentiation(p)).states
    assert film.verdict == "ok"
    assert film.sensitivity is not None
    found = {q: slopes["housing_diameter"] for q, slopes in film.sensitivity.items()}
    assert found["h_star"] == pytest.approx(17.91, rel=0.02)
    assert found["leakage"] == pytest.approx(17.91, rel=0.02)
    assert found["friction"] == pytest.approx(-52.89, rel=0.02)


def test_an_edge_moves_as_the_film_does() -> None:
    """At about the speed of the place where the film is 3 h* thick."""
    case, x = state("out")
    h_star = quantities(case, x)["h_star"].value
    sealed, air = edges(case, x, h_star)
    assert (sealed.opens, air.opens) == (False, True)

    def place(factor: float) -> tuple[float, float]:
        moved = case.scaled("housing_diameter", factor)
        y = solved(moved, x)
        h, level = moved.system.arc_film(y)[1], 3.0 * quantities(moved, y)["h_star"].value
        return interval_below(moved.system.section.positions, h, level)

    found = {"sealed": sealed.moved, "air": air.moved, **quantities(case, x)}
    slopes = frozen_slopes(case, x, SuperLU(), {"d": case.rate("housing_diameter")}, found)
    for k, edge in enumerate((sealed, air)):
        velocity = edge.velocities(slopes[("sealed", "air")[k]], slopes["h_star"])["d"]
        expected = (place(1e-6)[k] - place(-1e-6)[k]) / 2e-6
        assert velocity == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("name", ["out", pytest.param("section x_ring", marks=pytest.mark.slow)])
def test_derivatives_by_the_place_of_the_mesh_agree_with_central_differences(name: str) -> None:
    case, x = state(name)
    found, step = quantities(case, x), 1e-6
    for velocity in velocities(case, edges(case, x, found["h_star"].value)):
        rates = {"place": shift_rate(case, velocity)}
        slopes = frozen_slopes(case, x, SuperLU(), rates, found)
        ahead, behind = (
            reported(moved, solved(moved, x))
            for moved in (shifted(case, velocity, step), shifted(case, velocity, -step))
        )
        for quantity in QUANTITIES:
            expected = math.log(ahead[quantity] / behind[quantity]) / (2.0 * step)
            assert slopes[quantity]["place"] == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_edges_and_corners_hold_the_mesh() -> None:
    """Each edge moves alone; the ends of the arc and the corners of a section rest."""
    case, x = state("section rectangular")
    mesh, outline = case.system.mesh, case.system.section.layout.shape.outline
    found = edges(case, x, quantities(case, x)["h_star"].value)
    places = mesh.positions[: mesh.arc + 1]
    rest = [0, mesh.arc, *np.flatnonzero(np.isclose(places[:, None], outline.kinks).any(axis=1))]
    for k, velocity in enumerate(velocities(case, found)):
        speed = np.linalg.norm(velocity[mesh.arc_nodes], axis=1)
        assert speed[rest] == pytest.approx(0.0, abs=1e-12)
        at = [
            int(np.argmin(np.abs(case.system.section.positions - edge.position))) for edge in found
        ]
        assert speed[at] == pytest.approx([float(k == other) for other in range(len(found))])


def test_what_does_not_move_has_no_rate() -> None:
    """To the last bit: its kernels are not called."""
    case, _ = state("out")
    still = {
        key: {n for n, rows in case.rate(key).blocks.items() if not rows.any()}
        for key in ("rod_diameter", "viscosity", "section_diameter")
    }
    assert "solid" in still["rod_diameter"] & still["viscosity"]
    assert "film" not in still["rod_diameter"] | still["viscosity"]
    assert not {"solid", "film", "housing"} & still["section_diameter"]


def test_one_factorisation_serves_all_quantities_and_parameters() -> None:
    """And a kernel is called for a parameter only where this moves its elements."""
    case, x = state("in")
    counted, called = Counting(), Counter[str]()
    rates = rates_of(case)
    sensitivities(case, x, counted, rates)
    assert counted.made == 1
    for rate in rates.values():
        called.update(name for name, rows in rate.blocks.items() if rows.any())
    assert called["solid"] < called["film"] < len(rates)
    assert sum(called.values()) < 0.5 * len(rates) * len(rates["mu_1"].blocks)


class Counting(SuperLU):
    """Counts factorisations."""

    made = 0

    def factorise(self, K: SparseMatrix) -> Factorisation:
        """See `LinearSolver`."""
        self.made += 1
        return super().factorise(K)


def test_only_states_that_the_mesh_shows_are_differentiated() -> None:
    row = FilmRow(**film_values(verdict="ok", inlet_ratio=0.997))
    assert resolved(row)
    assert not resolved(replace(row, inlet_ratio=0.9))
    assert not resolved(replace(row, inlet_ratio=math.nan))
    assert not resolved(replace(row, verdict="under-resolved"))
    p = Seal(sensitivity=True)
    (words,) = CASE.complaints(p, [replace(row, inlet_ratio=0.9)], [], "")
    assert "the mesh does not show the film well enough" in words
    (words,) = CASE.complaints(p, [replace(row, verdict="uncertain")], [], "")
    assert "only states that are ok" in words
    assert CASE.complaints(p, [row], [], "") == []


# ------------------------------------------------------------------------------------- tolerances


def test_tolerances_of_a_catalogue_ring_and_given_ones() -> None:
    p = Seal(
        ring="AS568-226",
        rod=50.0,
        sensitivity=True,
        tolerances=("viscosity 20 %", "modulus 10 %", "inner_diameter 0.1 mm"),
    )
    shares = read_tolerances(p)
    assert shares["viscosity"] == {"viscosity": 0.2}
    assert shares["inner_diameter"] == {"inner_diameter": pytest.approx(0.1 / p.inner_diameter)}
    assert shares["modulus"] == {"mu_1": 0.1, "mu_2": 0.1}
    # AS568-226: section 0.139 +- 0.004 in
    section = pytest.approx(0.004 / 0.139, rel=1e-3)
    assert shares["section_diameter"] == {"section_diameter": section}
    assert set(shares) == {"section_diameter", "inner_diameter", "viscosity", "modulus"}


def test_a_band_adds_up() -> None:
    shares = {"a": {"a": 0.01}, "both": {"b": 0.02, "c": 0.02}}
    row = band((1.0, 400.0), "friction", {"a": -3.0, "b": 1.0, "c": 1.0, "d": 9.0}, shares)
    assert row.worst_percent == pytest.approx(3.0 + 4.0)
    assert row.likely_percent == pytest.approx(5.0)
    assert row.largest == "both"
    assert row.largest_percent == pytest.approx(4.0)


# ----------------------------------------------------------------------------------- command line


@pytest.mark.slow
def test_a_run_writes_its_sensitivities(tmp_path: Path) -> None:
    settings = ["stroke=out", "speeds=[800,400]", "error_estimate=false"]
    settings.append('tolerances=["viscosity 10 %"]')
    given = [a for s in settings for a in ("--set", s)]
    out = tmp_path / "run"
    assert main(["run", "oring", "--sensitivity", "--quiet", "--out", str(out), *given]) == 0
    rows = [SensitivityRow.parse(c) for c in read_csv(out / "sensitivity.csv", HEADER)]
    assert {r.quantity for r in rows} == set(QUANTITIES)
    assert {r.rod_speed_mm_s for r in rows} == {800.0, 400.0}
    (speed,) = (
        r.log_derivative
        for r in rows
        if (r.quantity, r.parameter, r.rod_speed_mm_s) == ("h_star", "U", 800.0)
    )
    assert speed == pytest.approx(0.6, abs=0.02)  # theory: h* grows with U^(3/5)
    assert (out / "tornado.png").stat().st_size > 10_000
    assert "viscosity" in (out / "tolerances.csv").read_text()
    assert np.isfinite([r.log_derivative for r in rows]).all()


HEADER = ("sealed_pressure_MPa", "rod_speed_mm_s", "quantity", "parameter", "log_derivative")


# --- One target by one key: steps, the nonlinear check, and what is out of reach ------------------


P = Seal()
POWER = -3.0
BY = Lever("rod_diameter", "rod_diameter")


def power_law(p: Seal, slope: float = POWER, **given: Any) -> FilmState:
    """A made-up film whose friction is a power of the rod diameter."""
    values = film_values(verdict="ok", inlet_ratio=1.0)
    values["rod_friction_N"] = -5.0 * (p.rod_diameter / 50.0) ** POWER
    nothing: Any = None
    state = FilmState(
        **values,
        advice="",
        profile=nothing,
        section=nothing,
        sensitivity={"friction": {"rod_diameter": slope}},
    )
    return replace(state, **given)


def held(p: Seal) -> Change:
    """How the same friction changes where the mesh is held: not quite as from mesh to mesh."""
    return lambda factor: factor ** (1.01 * POWER)


def steps(target: DesignTarget, solve: Callable[[Seal], FilmState | None]) -> list[DesignStep]:
    def with_mesh(p: Seal) -> DesignFilm | None:
        state = solve(p)
        return DesignFilm.of(state, target.quantity, held(p)) if state else None

    def all_of(p: Seal) -> list[DesignFilm] | None:
        film = with_mesh(p)
        return [film] if film else None

    if target.side:
        return bounded(P, [target], 0, BY, all_of)
    return designed(P, target, BY, with_mesh)


def test_a_power_law_is_met_in_one_step() -> None:
    found = steps(DesignTarget.of("friction -3%"), power_law)
    assert isinstance(found[0], DesignStep)
    assert (found[0].value, found[0].quantity) == (50.0, 5.0)
    assert len(found) == 2
    assert found[1].value == pytest.approx(50.0 * 0.97 ** (1.0 / POWER))
    assert found[1].quantity == pytest.approx(0.97 * 5.0)


def test_a_wrong_slope_needs_more_steps_and_a_wrong_sign_never_ends() -> None:
    target = DesignTarget.of("friction -6 %")
    found = steps(target, lambda p: power_law(p, 1.5 * POWER))
    assert len(found) > 2
    assert found[-1].quantity == pytest.approx(0.94 * 5.0, rel=1e-4)
    with pytest.raises((NoDesignError, ValueError)):
        steps(target, lambda p: power_law(p, -POWER))


def test_the_last_steps_settle_on_a_mesh_that_is_held() -> None:
    """A first step within one per cent is not the end; a film that is lost there is said."""
    near, wanted = DesignStep(50.0, 5.03), 5.0
    found = settled(near, wanted, POWER, lambda factor: factor ** (1.3 * POWER), "missed")
    assert len(found) >= 2
    assert found[-1].quantity == pytest.approx(wanted, rel=1e-4)
    assert 5.03 * (found[-1].value / 50.0) ** (1.3 * POWER) == pytest.approx(wanted, rel=1e-4)
    at_end: tuple[tuple[Change, str], ...] = (
        (lambda _: None, "missed: no film is found on the way"),
        (lambda _: 1.001, "missed: the film is at a kink"),
    )
    for change, words in at_end:
        with pytest.raises(NoDesignError, match=words):
            settled(near, wanted, POWER, change, "missed")


def test_what_is_out_of_reach_is_said() -> None:
    with pytest.raises(NoDesignError, match="too little for this target; choose another key"):
        steps(DesignTarget.of("friction -50%"), lambda p: power_law(p, slope=-0.01))
    with pytest.raises(NoDesignError, match="has the verdict under-resolved"):
        steps(DesignTarget.of("friction -5%"), lambda p: power_law(p, verdict="under-resolved"))
    for wrong in ("friction", "colour -3%", "friction -100%", "friction 3", "friction below 5 mm"):
        with pytest.raises(NoDesignError, match="is not understood"):
            DesignTarget.of(wrong)


TARGETS = {
    "friction -10%": DesignTarget("friction", 0.9),
    "friction below 5 N": DesignTarget("friction", None, 5.0, "below"),
    "friction <= 0.005 kN": DesignTarget("friction", None, 5.0, "below"),
    "h* above 500 nm": DesignTarget("h_star", None, 0.5, "above"),
    "h_star >= 0.5": DesignTarget("h_star", None, 0.5, "above"),
    "p_max = 20 bar": DesignTarget("p_max", None, 2.0, ""),
    "leakage below 12 mm3/s": DesignTarget("leakage", None, 12.0, "below"),
    "leakage below 1 mm3 a cycle": DesignTarget("cycle_leakage", None, 1.0, "below"),
    "leakage < 0.001 cm\u00b3/cycle": DesignTarget("cycle_leakage", None, 1.0, "below"),
    "cycle_leakage -20%": DesignTarget("cycle_leakage", 0.8),
}


def test_targets_are_changes_values_or_bounds() -> None:
    for text, wanted in TARGETS.items():
        found = DesignTarget.of(text)
        assert (found.quantity, found.factor, found.side) == (
            wanted.quantity,
            wanted.factor,
            wanted.side,
        ), text
        assert found.value == pytest.approx(wanted.value)


def test_a_bound_is_passed_and_not_met_twice() -> None:
    """Friction 5 N: below 6 N nothing changes; 4.8 N is passed by half a per cent in one step."""
    assert len(steps(DesignTarget.of("friction below 6 N"), power_law)) == 1
    found = steps(DesignTarget.of("friction below 4.8 N"), power_law)
    assert len(found) == 2
    assert found[-1].quantity == pytest.approx(0.995 * 4.8)
    assert steps(DesignTarget.of("friction = 4.8 N"), power_law)[-1].quantity == pytest.approx(4.8)


def test_several_bounds_are_met_by_the_least_change_or_contradict() -> None:
    """Friction 5 (d/50)^-3 N and h* 2 (d/50)^2 um."""

    def films(p: Seal) -> list[DesignFilm]:
        ratio, state = p.rod_diameter / 50.0, power_law(p)
        values = ((5.0 * ratio**POWER, POWER), (2.0 * ratio**2, 2.0))
        return [DesignFilm(state, value, {"rod_diameter": s}) for value, s in values]

    friction = DesignTarget.of("friction below 4.8 N")
    found = bounded(P, [friction, DesignTarget.of("h_star below 2.2 um")], 0, BY, films)
    assert len(found) == 2
    assert found[-1].values[0] == pytest.approx(0.995 * 4.8)
    assert found[-1].values[1] < 2.2
    found = bounded(P, [friction, DesignTarget.of("h_star above 2.1 um")], 1, BY, films)
    assert found[-1].quantity == pytest.approx(1.005 * 2.1)
    with pytest.raises(
        NoDesignError, match=r"no rod_diameter holds all bounds: .* above 50\.7"
    ) as no:
        bounded(P, [friction, DesignTarget.of("h_star below 2.04 um")], 0, BY, films)
    assert "h_star below 2.04 um needs it below 50.5 mm" in str(no.value)


def test_several_targets_are_bounds_of_both_strokes() -> None:
    text = "friction below 5 N and h* above 0.5 um, leakage < 1 mm3/cycle"
    found = [(t.quantity, t.stroke) for t in DesignTarget.several(text, both=True)]
    strokes = [(name, stroke) for name in ("friction", "h_star") for stroke in ("out", "in")]
    assert found == [*strokes, ("cycle_leakage", "")]
    assert len(DesignTarget.several(text, both=False)) == 3
    with pytest.raises(NoDesignError, match="several targets must be bounds"):
        DesignTarget.several("friction -10% leakage below 1 mm3 a cycle", both=True)


def test_several_keys_change_by_the_least_sum_of_squares() -> None:
    """Friction d^-3 eta^2: a rod counts by the gland, 3.15 mm deep."""
    film = DesignFilm(power_law(P), 5.0, {"rod_diameter": -3.0, "viscosity": 2.0})
    levers = [Lever(name, name) for name in ("rod_diameter", "viscosity")]
    gear = 0.5 * 50.0 / 3.15
    assert levers[0].gear(P) == pytest.approx(gear)
    depth = Lever("groove_depth", "housing_diameter")
    assert depth.gear(P) == pytest.approx(28.15 / 3.15, rel=1e-4)
    joint = joint_lever(P, levers, film)
    assert joint.name == "viscosity"
    share = (-3.0 / gear**2) / 2.0
    assert joint.exponents == {"viscosity": 1.0, "rod_diameter": pytest.approx(share)}
    keys = joint.keys_at(P, 1.02 * P.viscosity)
    assert keys["rod_diameter"] == pytest.approx(50.0 * 1.02**share)
    assert film.slope(joint) == pytest.approx(2.0 - 3.0 * share)


def test_leakage_of_a_cycle_is_a_difference() -> None:
    """3 mm3/s out and 2 back at 100 mm/s leave 1 mm3 of 100 mm; slopes 1 and 2 leave 3 - 4."""
    shared: dict[str, Any] = {"sensitivity": {"leakage": {"viscosity": 1.0}}}
    out = power_law(P, leak_rate_mm3_s=3.0, rod_speed_mm_s=100.0, **shared)
    back = power_law(P, leak_rate_mm3_s=-2.0, rod_speed_mm_s=-100.0, **shared)
    back = replace(back, sensitivity={"leakage": {"viscosity": 2.0}})
    film = DesignFilm.of_cycle(out, back, 100.0)
    assert film.value == pytest.approx(1.0)
    assert film.log_derivatives["viscosity"] == pytest.approx(3.0 * 1.0 - 2.0 * 2.0)


def test_a_key_that_is_no_number_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "oring", "friction -3%", "--by", "density"]) == 2
    assert "--by density: allowed: section_diameter" in capsys.readouterr().err
    for case in ("slider", "cycle"):
        assert main(["design", case, "friction -3%", "--by", "rod_diameter"]) == 2
        assert f"{case} has no sensitivities" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("measure", "key", "ends"),
    [
        ("groove_depth", "housing_diameter", (3.15, 3.2)),
        ("squeeze", "housing_diameter", (10.765, 9.348)),
        ("fill", "groove_width", (84.28, 78.80)),
    ],
)
def test_a_measure_of_the_gland_is_designed_by_the_key_that_it_decides(
    measure: str,
    key: str,
    ends: tuple[float, float],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def found(p: Seal, _target: DesignTarget, by: Lever, *_: object) -> list[DesignStep]:
        first, last = {"housing_diameter": (56.3, 56.4), "groove_width": (3.74, 4.0)}[by.key]
        return [DesignStep(first, 5.0), DesignStep(last, 4.5)]

    monkeypatch.setattr(design, "designed", found)
    assert main(["design", "oring", "friction -10%", "--by", measure]) == 0
    _, first, *_, summary, told = capsys.readouterr().out.splitlines()
    given = re.fullmatch(rf"  {measure} = (\S+) (mm|%): friction = 5 N", first)
    met = re.search(rf" by {measure} = (\S+) (mm|%) \(", summary)
    assert given
    assert met
    assert (float(given[1]), float(met[1])) == pytest.approx(ends, rel=1e-3)
    assert re.fullmatch(rf"{key} from (\S+) to (\S+) mm", told)


@pytest.mark.slow
def test_ten_per_cent_less_friction_by_the_rod(capsys: pytest.CaptureFixture[str]) -> None:
    """On one mesh to 1e-4; a run of its own, on its own mesh, agrees as well as two meshes do."""
    wanted = ["design", "oring", "friction -10%", "--by", "rod_diameter", "--set", "speeds=[400]"]
    assert main(wanted) == 0
    printed = capsys.readouterr().out
    assert re.search(r"friction -(10\.00|9\.99|10\.01) % \(wanted -10 %\)", printed)
    rod = float(printed.split("by rod_diameter = ")[-1].split()[0])
    given = [P.model_copy(update={**ONE, "rod_diameter": d}) for d in (50.0, rod)]
    before, after = (run(p, Silent()).states[0] for p in given)
    assert after.rod_friction_N / before.rod_friction_N == pytest.approx(0.9, rel=0.01)


ONE = {"speeds": (400.0,), "stroke": "out", "error_estimate": False}


@pytest.mark.slow
def test_the_held_mesh_gives_what_the_run_did() -> None:
    held_film = HeldFilm.of(P.model_copy(update={**ONE, "density": 1}), Silent())
    assert held_film is not None
    assert held_film.change("friction", {"rod_diameter": 1.0}, 1.0) == pytest.approx(1.0, abs=1e-7)
    changed = held_film.change("friction", {"rod_diameter": 1.0}, 0.9995)
    assert changed is not None
    assert 0.95 < changed < 0.99


@pytest.mark.slow
def test_a_held_film_follows_a_key_further_than_one_solve() -> None:
    """Newton's method with more iterations than a step has finds the same film at once."""
    held_film = HeldFilm.of(P.model_copy(update={**ONE, "density": 1}), Silent())
    assert held_film is not None
    moved = held_film.case.scaled("rod_diameter", -0.003)
    problem, quantity = moved.problem, "friction"
    at_once = Newton(max_iterations=50).solve(problem, held_film.x)
    assert at_once.converged
    assert at_once.iterations > held_film.newton.max_iterations
    before = quantities(held_film.case, held_film.x)[quantity].value
    after = quantities(moved, at_once.x)[quantity].value
    changed = held_film.change(quantity, {"rod_diameter": 1.0}, 0.997)
    assert changed == pytest.approx(after / before, rel=1e-7)


def test_a_design_is_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What to change, what a hundredth of a millimetre of it does, and all other results."""
    page = tmp_path / "design.html"
    given = ["ring=36x4", "rod=36", "material=NBR 70", "density=1", "speeds=400", "stroke=out"]
    told_to = [word for text in given for word in ("--set", text)]
    typed = ["design", "oring", "friction -5%", "--by", "groove_depth", *told_to]
    assert main([*typed, "--report", str(page)]) == 0
    printed = capsys.readouterr()
    assert "film at +400 mm/s" in printed.err  # it tells what it does meanwhile
    depth = re.search(r" by groove_depth = (\S+) mm", printed.out)
    assert depth
    text = page.read_text(encoding="utf-8")
    assert "of NBR 70, a rod seal: groove depth for friction -5\N{NO-BREAK SPACE}%</h1>" in text
    assert f"groove depth {float(depth[1]):.5g} mm instead of 3.5 mm" in text
    assert re.search(r"0\.01 mm more groove depth there: friction -[12]\.\d %", text)
    rows = re.findall(r"<td[^>]*>friction</td><td>(\S+)</td><td>(\S+)</td>", text)
    before, after = map(float, rows[-1])
    assert after / before == pytest.approx(0.95, abs=1e-3)
    outside = re.sub(r"<(script|details).*?</\1>", "", text, flags=re.DOTALL)
    assert not re.search(r"h_star|p_max|contact_width", outside)
