"""Sensitivities against central differences of what a run reports, and against dimensions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
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
from softehl.cases.seal.states.state import FilmRow, Silent
from softehl.cases.seal.states.verdict import Verdict
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import interval_below
from softehl.runtime.io import read_csv
from softehl.runtime.solve.linear.linear_solver import Factorisation, SparseMatrix
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.newton import Newton
from tests.cases.oring_cases import film_values

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
    "section x_ring": film_of(400.0, section="x_ring", groove_width=4.3, housing_diameter=56.4),
    "piston": film_of(400.0, bore=50.0),
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


@pytest.mark.parametrize("name", ALL)
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
