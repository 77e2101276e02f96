"""The fast route against the monolithic one, its cost, and what it says when it gives up."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome
from softehl.cases.seal.correctors.layer_split import Layered
from softehl.cases.seal.correctors.schur_corrector import SchurCorrector
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve import correctors
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.squeeze_film import film_layer, film_loads
from softehl.cases.seal.states.state import FilmState
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Solution, Status
from tests.cases.oring_cases import oring
from tests.cases.test_method import Recorder

SPEEDS = (1600.0, 400.0)


@cache
def solved(
    solver: str, sealed_pressure: float, linear: str = "auto", density: int = 2
) -> Outcome[FilmState]:
    return run(
        oring(
            density=density,
            sealed_pressure=sealed_pressure,
            solver=solver,
            speeds=SPEEDS,
            linear=linear,
        ),
        Recorder(),
    )


@pytest.mark.parametrize(
    ("sealed_pressure", "density"),
    [(1.0, 1), *(pytest.param(p, 2, marks=pytest.mark.slow) for p in (1.0, 5.0))],
)
def test_both_routes_give_the_same_films(sealed_pressure: float, density: int) -> None:
    fast, reference = (solved(s, sealed_pressure, density=density) for s in ("auto", "monolithic"))
    assert fast.converged, fast.message
    assert len(fast.states) == len(reference.states) == 4
    for a, b in zip(fast.states, reference.states, strict=True):
        assert (a.rod_speed, a.verdict) == (b.rod_speed, b.verdict)
        assert a.h_star_um == pytest.approx(b.h_star_um, rel=1e-8)
        assert a.p_max_MPa == pytest.approx(b.p_max_MPa, rel=1e-7)
        assert a.rod_friction_N == pytest.approx(b.rod_friction_N, rel=1e-7)
        assert a.contact_p_max_MPa == pytest.approx(b.contact_p_max_MPa, rel=1e-8)


def test_the_cost_of_the_fast_route() -> None:
    """Factorisations of a stroke, once contact is known; of Newton's method a multiple."""
    fast, reference = (solved(s, 1.0, density=1).stages for s in ("auto", "monolithic"))
    for stroke in ("out", "in"):
        few, many = (
            sum(s.factorisations or 0 for s in stages if s.where["stroke"] == stroke)
            for stages in (fast, reference)
        )
        assert few <= 5
        assert many > 4 * few


def test_the_discontinuous_film_is_condensed_too() -> None:
    parameters = {"density": 1, "reynolds": "dg", "stroke": "out", "speeds": SPEEDS}
    routes = ("auto", "monolithic")
    fast, reference = (run(oring(solver=s, **parameters), Recorder()) for s in routes)
    assert fast.converged, fast.message
    for a, b in zip(fast.states, reference.states, strict=True):
        assert a.h_star_um == pytest.approx(b.h_star_um, rel=1e-8)
        assert a.pressure_jump_max_MPa == pytest.approx(b.pressure_jump_max_MPa, rel=1e-7)


class Tired(SchurCorrector):
    """Gives up at films slower than 1000 mm/s, or at all."""

    slowest = 1000.0

    def solve(self, problem: Any, x0: Array) -> Solution:
        film = problem.problem.assembler.block("film").kernel.parameters
        speed = problem.problem.parameters["film"][film.index("rod_speed")]
        solution = super().solve(problem, x0)
        failed = replace(solution, status=Status.DIVERGED, message="tired")
        return solution if abs(speed) > self.slowest else failed


class VeryTired(Tired):
    slowest = math.inf


@pytest.mark.parametrize("corrector", [Tired, VeryTired])
def test_where_it_gives_up_newton_goes_on(
    monkeypatch: pytest.MonkeyPatch, corrector: type[Tired]
) -> None:
    monkeypatch.setattr(correctors, "SchurCorrector", corrector)
    parameters = oring(density=1, sealed_pressure=1.0, stroke="out", speeds=SPEEDS)
    outcome = run(parameters, Recorder())
    assert outcome.converged, outcome.message
    assert [s.rod_speed for s in outcome.states] == list(SPEEDS)  # each of them once
    fast, films = (
        [s for s in stages if s.where["stroke"] == "out"]
        for stages in (solved("auto", 1.0, density=1).stages, outcome.stages)
    )
    # Newton's method factorises in every iteration
    assert sum(s.factorisations or 0 for s in films) > 4 * sum(s.factorisations or 0 for s in fast)
    reference = solved("monolithic", 1.0, density=1)
    for a, b in zip(outcome.states, reference.states, strict=False):
        assert a.h_star_um == pytest.approx(b.h_star_um, rel=1e-8)


def test_a_film_that_ends_at_a_wall_leaves_no_multiplier_undetermined() -> None:
    """Above three shear moduli the arc reaches the wall; the rest of the section is condensed."""
    system = build_system(Seal(density=1))
    x, air_end = system.at_rest(), system.mesh.arc_nodes[-3:]
    at_wall = system.obstacles["air_wall"].c
    system.displacements(x)[air_end, 0] = -at_wall - system.mesh.points[air_end, 0]
    boundary = system.section.chains["wall_nodes"][0]
    x[system.layout.part("air_wall")][np.isin(boundary, air_end)] = -1.0
    film = film_loads(system, "out", 6400.0, x)

    def empty_rows(near: Array) -> int:
        layered = Layered(system.film_problem(film), film_layer(system, near))
        inside = np.setdiff1d(np.arange(len(x)), layered.shared)
        rows: Array = abs(layered.body(x).tocsr()[inside][:, inside]).sum(axis=1)
        return int((np.asarray(rows).ravel() == 0.0).sum())

    assert empty_rows(x) == 0
    assert empty_rows(system.at_rest()) == len(air_end)
