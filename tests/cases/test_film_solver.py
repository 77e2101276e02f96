"""Films: meshes that are made for them, neighbours, squeeze films, routes of the solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from softehl.cases.harness.observer import Outcome
from softehl.cases.seal.correctors.layer_split import Layered
from softehl.cases.seal.correctors.proximal_term import Anchored, Relaxed
from softehl.cases.seal.correctors.schur_corrector import SchurCorrector
from softehl.cases.seal.equations.definition import DISPLACEMENT
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.layout import RATE
from softehl.cases.seal.solve import correctors
from softehl.cases.seal.solve.adaptation import FITS, Adaptation, Adapted
from softehl.cases.seal.solve.arc_meshing import (
    COARSEST_OF_FILM,
    RISE,
    THINNING,
    film_layout,
    misfit,
    sizes,
)
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.contact_stages import OFFSET
from softehl.cases.seal.solve.correctors import FilmCorrectors
from softehl.cases.seal.solve.driver import DryContact, run
from softehl.cases.seal.solve.film_solver import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.inlet import InletScales
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.solve.squeeze_film import (
    SqueezeFilm,
    film_layer,
    film_loads,
    gap_masses,
    pressed_film,
)
from softehl.cases.seal.solve.transfer import FilmTransfer
from softehl.cases.seal.states.estimate import Estimate
from softehl.cases.seal.states.mesh_indicators import INLET
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Solution, Status
from tests.cases.oring_cases import oring
from tests.cases.test_driver import Recorder

# --- The fast route against the monolithic one, its cost, and what it says when it gives up -------


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


# --- A film is the same whatever it is found from: contact, another speed, another mesh -----------


RING: dict[str, Any] = {"ring": "AS568-210", "rod": 19.0, "error_estimate": False}
P = Seal(**RING, density=1, sealed_pressure=3.0, mu_1=1.5)
THIN = Seal(
    inner_diameter=9.525,
    section_diameter=1.78,
    rod_diameter=9.525,
    housing_diameter=12.6222,
    speeds=(2.0,),
    stroke="out",
    error_estimate=False,
)
"""A film of 0.0403 um at density 4, much thinner than what holds the rod off in contact."""


def contact_of(p: Seal) -> DryContact:
    return DryContact.of(p, Silent())


@pytest.fixture(scope="module")
def dry() -> DryContact:
    """AS568-210 under 3 MPa on a coarse mesh."""
    return contact_of(P)


@pytest.fixture(scope="module")
def films(dry: DryContact) -> dict[float, Film]:
    """Films from the contact, by speed."""
    return {speed: a_film(dry.film("out", speed)) for speed in (800.0, 400.0, 100.0)}


def a_film(found: Film | NoFilm) -> Film:
    assert isinstance(found, Film), found.message
    return found


def solver(dry: DryContact, system: Any = None) -> FilmSolver:
    return dry.films.on(system or dry.system)


def adaptation(p: Seal, dry: DryContact) -> Adaptation:
    return Adaptation(p, dry.solver, dry.films)


def gap(film: Film) -> Array:
    return film.system.arc_film(film.x)[1]


# ---------------------------------------------------------------------------------- on one mesh


@pytest.mark.parametrize("last", [(800.0,), (800.0, 400.0), (100.0,)], ids=str)
def test_a_film_from_a_neighbour_is_that_from_the_contact(
    dry: DryContact, films: dict[float, Film], last: Sequence[float]
) -> None:
    speed = 400.0 if last == (100.0,) else 100.0  # also towards faster films
    found = a_film(solver(dry).from_neighbour([films[u] for u in last], speed))
    assert found.loads.speed == speed
    assert gap(found) == pytest.approx(gap(films[speed]), rel=1e-6)
    assert found.numbers.friction == pytest.approx(films[speed].numbers.friction, rel=1e-6)
    assert gap(found) != pytest.approx(gap(films[last[-1]]), rel=1e-2)


# ------------------------------------------------------------------------------- on another mesh


def test_a_film_that_is_carried_is_that_from_the_contact_of_its_mesh(
    dry: DryContact, films: dict[float, Film]
) -> None:
    film = films[400.0]
    new = build_system(P, film_layout(film.system, film.x, film.squeeze_film.scales.thickness))
    carried = adaptation(P, dry)._carried(film, new)
    assert isinstance(carried, Film)
    contact = ContactSolver(PathDriver(Silent())).from_mesh(dry.system, dry.x, new)
    own = a_film(solver(dry, new).from_contact("out", 400.0, contact[1]))
    assert gap(carried) == pytest.approx(gap(own), rel=1e-6)
    assert carried.numbers.h_star != pytest.approx(film.numbers.h_star, rel=1e-5)


def test_a_film_that_is_carried_to_its_own_mesh_stays(
    dry: DryContact, films: dict[float, Film]
) -> None:
    film = films[400.0]
    transfer = FilmTransfer(film.system, film.system, (dry.x, dry.x))
    x = transfer.state(film.x)
    assert film.system.arc_film(x)[1] == pytest.approx(gap(film), rel=1e-6)
    assert film.system.pressures(x) == pytest.approx(film.system.pressures(film.x), abs=1e-9)


def test_a_mesh_that_does_not_fit_is_made_anew_and_h_star_moves_to_its_limit() -> None:
    contact = contact_of(THIN)
    film = a_film(contact.film("out", 2.0))
    found = adaptation(THIN, contact).adapted(film)
    assert isinstance(found, Adapted)
    assert found.fits
    for one, fits in ((film, False), (found.film, True)):
        asked = misfit(one.system, one.x, one.squeeze_film.scales.thickness)
        assert (asked <= FITS) is fits
    assert 1e3 * found.film.numbers.h_star == pytest.approx(0.0403, rel=5e-3)
    assert 1e3 * film.numbers.h_star != pytest.approx(0.0403, rel=5e-3)


@pytest.mark.parametrize(
    ("bound", "density"), [(1.0, 2), pytest.param(3.0, 5, marks=pytest.mark.slow)]
)
def test_a_film_with_a_large_error_is_solved_on_finer_meshes(
    monkeypatch: pytest.MonkeyPatch, bound: float, density: int
) -> None:
    """The estimate compares the two finest, and the next film goes on from there."""
    monkeypatch.setattr(Estimate, "friction_bound", bound)
    p = P.model_copy(update={"error_estimate": True, "density": 2})
    contact = contact_of(p)
    film = a_film(contact.film("out", 400.0))
    found = adaptation(p, contact).adapted(film)
    assert isinstance(found, Adapted)
    assert found.film.system.section.density == density
    assert found.coarser is not None
    assert found.estimate is not None
    assert found.estimate.ratio == (3 / 5 if density == 5 else 5 / 6)
    assert found.film.numbers.h_star == pytest.approx(film.numbers.h_star, rel=5e-3)
    assert found.sure is (bound < 2.0)
    monkeypatch.setattr(Adapted, "off_theory", -6.5)  # of the contact on this mesh
    assert not found.sure


def test_a_mesh_that_is_given_is_not_made_anew(dry: DryContact, films: dict[float, Film]) -> None:
    """Neither for a film that is not found, nor for one that asks for more."""
    film = films[400.0]
    uniform = P.model_copy(update={"mesh": "uniform"})
    system = dry.system.moved(uniform, dry.system.section)
    squeeze_film, now = film.start_state
    begun = squeeze_film.carried(system, film.x, dry.x), now
    no = NoFilm("out", 400.0, Status.DIVERGED, "no film", begun)
    assert adaptation(uniform, dry).adapted(no) is no
    found = adaptation(uniform, dry).adapted(replace(film, squeeze_film=begun[0]))
    assert isinstance(found, Adapted)
    assert found.fits
    assert found.film.system is system


# --------------------------------------------------------------------------------- of whole runs


@pytest.mark.slow
def test_a_film_that_is_not_found_ends_soon_and_with_a_reason() -> None:
    """No more meshes are made once one has led no further."""
    given: dict[str, Any] = {"section": "rectangular", "groove_width": 4.6, "density": 1}
    p = Seal(**given, sealed_pressure=2.0, stroke="out", speeds=(1.0,), error_estimate=False)
    outcome = run(p, Silent())
    assert not outcome.states
    assert outcome.message.startswith("outstroke: no film was found at 1 mm/s; ")
    assert sum(stage.name.startswith("film at") for stage in outcome.stages) <= 3


# --- Segments that a film asks for, from films that are given node by node, against closed forms


THICKNESS = 1e-3


@pytest.fixture(scope="module")
def system() -> SealSystem:
    return build_system(oring(density=2))


def film(system: SealSystem, h: Array, p: Array) -> Array:
    """A state with thicknesses h and pressures p at the nodes of the arc."""
    x, nodes = system.at_rest(), system.mesh.arc_nodes
    system.displacements(x)[nodes, 1] = h + system.rod_radius - system.mesh.points[nodes, 1]
    rows = system.pressure_dofs()
    share = np.linspace(0.0, 1.0, rows.shape[1])
    x[rows] = p[:-1, None] + share * np.diff(p)[:, None]
    return x


def test_a_film_that_does_not_change_has_the_longest_segments(system: SealSystem) -> None:
    s = system.section.positions
    still = np.full(len(s), THICKNESS)
    _, size = sizes(system, film(system, still, np.ones(len(s))), THICKNESS)
    assert size == pytest.approx(np.full(len(size), s[-1] / COARSEST_OF_FILM))


def test_thickness_and_pressure_ask_for_so_much_of_their_change(system: SealSystem) -> None:
    """ln h of a constant slope; p of a constant slope; the steeper one of them decides."""
    s = system.section.positions
    k, rise = 12.0 / s[-1], 4.0 / s[-1]
    thin = THICKNESS * np.exp(k * s - 6.0)  # from 1/400 of it to 400 times
    x = film(system, thin, np.ones(len(s)))
    at, size = sizes(system, x, THICKNESS)
    inside = (k * at - 6.0 < np.log(INLET[0]) - 0.5) & (k * at - 6.0 > np.log(1e-3) + 0.5)
    assert size[inside] == pytest.approx(np.full(inside.sum(), THINNING / k))
    assert size[-1] == pytest.approx(s[-1] / COARSEST_OF_FILM)  # too thick to matter
    peak = np.minimum(rise * s, 1.0)
    _, size = sizes(system, film(system, np.full(len(s), THICKNESS), peak), THICKNESS)
    assert size[at < 0.2 * s[-1]] == pytest.approx(np.full((at < 0.2 * s[-1]).sum(), RISE / rise))
    both = film(system, THICKNESS * np.exp(2.0 * k * np.minimum(s, 0.1 * s[-1])), peak)
    _, size = sizes(system, both, THICKNESS)
    assert size[0] == pytest.approx(0.5 * THINNING / k)


def test_segments_grow_away_from_a_step(system: SealSystem) -> None:
    s, node = system.section.positions, 30
    h = np.where(np.arange(len(s)) < node, THICKNESS, 3.0 * THICKNESS)
    at, size = sizes(system, film(system, h, np.ones(len(s))), THICKNESS)
    least = THINNING / np.log(3.0) * (s[node] - s[node - 1])
    away = np.maximum(np.maximum(s[node - 1] - at, at - s[node]), 0.0)
    expected = np.minimum(least + RATE * away, s[-1] / COARSEST_OF_FILM)
    assert size == pytest.approx(expected, rel=0.02)


def test_the_misfit_is_the_number_of_segments_in_the_place_of_one(system: SealSystem) -> None:
    s, node = system.section.positions, 30
    h = np.where(np.arange(len(s)) < node, THICKNESS, 9.0 * THICKNESS)
    x = film(system, h, np.ones(len(s)))
    asked = np.log(9.0) / THINNING
    assert misfit(system, x, THICKNESS) == pytest.approx(asked, rel=0.02)
    fine = film(system, np.full(len(s), THICKNESS), np.ones(len(s)))
    assert misfit(system, fine, THICKNESS) < 1.0


def test_a_mesh_that_is_made_for_a_film_fits_it(system: SealSystem) -> None:
    s, node = system.section.positions, 30
    h = np.where(np.arange(len(s)) < node, THICKNESS, 9.0 * THICKNESS)
    layout = film_layout(system, film(system, h, np.ones(len(s))), THICKNESS)
    places = layout.mesh(2).arc_places
    finest = np.diff(places).argmin()
    assert s[node - 1] <= places[finest] <= s[node]
    assert np.diff(places).min() == pytest.approx(
        THINNING / np.log(9.0) * (s[node] - s[node - 1]), rel=0.1
    )


# --- The contact squeezed out to a film: its start, its masses, its steps in time -----------------


SQUEEZED = Seal(
    ring="AS568-210", rod=19.0, sealed_pressure=3.0, density=1, speeds=(400.0,), mu_1=1.5
)


@pytest.fixture(scope="module")
def dry_contact() -> DryContact:
    """AS568-210 under 3 MPa on a coarse mesh."""
    return DryContact.of(SQUEEZED, Silent())


@pytest.fixture(scope="module")
def squeeze_film(dry_contact: DryContact) -> SqueezeFilm:
    found = dry_contact.film("out", 400.0)
    assert not isinstance(found, NoFilm), found.message
    return found.squeeze_film


@pytest.fixture
def begun(dry_contact: DryContact, squeeze_film: SqueezeFilm) -> tuple[Relaxed, Array]:
    """A step of a thousandth of T from the start, and that start."""
    start = pressed_film(dry_contact.system, dry_contact.x, 3.0)
    problem = squeeze_film.step(start, 1e-3, 0.5)
    return problem, problem.admissible(start)


# ------------------------------------------------------------------------------------- the start


def around(dry_contact: DryContact, p: Array) -> float:
    """Radial force of a pressure p (arc nodes,) that is linear between the nodes, N."""
    z, r = dry_contact.system.deformed(dry_contact.x)[dry_contact.system.mesh.arc_nodes].T
    middle = 4.0 * 0.25 * (p[1:] + p[:-1]) * (r[1:] + r[:-1])
    simpson = (p[1:] * r[1:] + p[:-1] * r[:-1] + middle) / 6.0
    return float(2.0 * np.pi * (simpson * np.diff(z)).sum())


@pytest.mark.parametrize(("share", "right"), [(1.0, True), (0.98, False)])
def test_pressures_of_the_film_add_up_to_the_force_of_the_contact(
    dry_contact: DryContact, share: float, right: bool
) -> None:
    system, x = dry_contact.system, dry_contact.x.copy()
    z, _ = system.arc_film(x)
    before, z0 = z[system.section.lowest - 1 :][:2]
    low = 0.5 * (before + z0) + 0.5 * (z0 - before)  # half of a segment beyond has no pressure
    pressing = -float((system.rod_multipliers(x) * system.rod_areas).sum())
    r = system.rod_radius + OFFSET
    force = pressing + 3.0 * 2.0 * np.pi * r * (low - z[0])
    system.rod_multipliers(x)[:] *= share
    rows = pressed_film(system, x, 3.0)[system.pressure_dofs()]
    assert rows[[0, -1], [0, -1]] == pytest.approx([3.0, 0.0], abs=1e-12)
    found = around(dry_contact, np.append(rows[:, 0], rows[-1, -1]))
    assert bool(abs(found / force - 1.0) < 5e-3) is right


def test_they_bear_the_section(begun: tuple[Relaxed, Array], dry_contact: DryContact) -> None:
    """What is left of its equilibrium is a per cent of what it is without them; half leave half."""
    (problem, start), x = begun, dry_contact.x
    part = dry_contact.system.layout.part(DISPLACEMENT)
    left, half, without = (
        np.linalg.norm(problem.scaled(problem.residual(y))[part])
        for y in (start, 0.5 * (start + x), x)
    )
    assert left < 0.03 * without
    assert half == pytest.approx(0.5 * without, rel=0.05)


@pytest.mark.parametrize("viscosity", [SQUEEZED.viscosity, 1e-11], ids=["usual", "thin"])
def test_the_first_step_holds_the_film_where_it_is(
    dry_contact: DryContact, squeeze_film: SqueezeFilm, viscosity: float
) -> None:
    """Also of an oil whose film is a thousand times thinner than the gap of the contact."""
    p = SQUEEZED.model_copy(update={"viscosity": viscosity})
    system, start = (
        dry_contact.system.moved(p, dry_contact.system.section),
        pressed_film(dry_contact.system, dry_contact.x, 3.0),
    )
    scales = InletScales.of(system, "out", 400.0, dry_contact.x)
    assert scales is not None
    begun = replace(squeeze_film, system=system, scales=scales)
    steps, first = FilmCorrectors.of(system, dry_contact.newton).steps(), begun.first
    found = steps.solve(begun.step(start, first, 0.0), start)
    assert found.converged, found.message
    assert 0.0 < begun.change(start, found.x) < 0.7
    longer = steps.solve(begun.step(start, 1e5 * first, 0.0), start)
    assert not longer.converged or begun.change(start, longer.x) > 0.7


# ------------------------------------------------------------------------------- masses and steps


def test_masses_add_up_to_what_a_wider_gap_holds(dry_contact: DryContact) -> None:
    """A gap that is 1 um wider everywhere holds 1 um times the length of the film more."""
    system, x = dry_contact.system, dry_contact.x
    wider = np.zeros_like(x)
    wider[system.layout.part(DISPLACEMENT).start + 2 * system.mesh.arc_nodes + 1] = 1e-3
    z, _ = system.arc_film(x)
    held = 1e-3 * (z[-1] - z[0])
    assert (gap_masses(system, x) @ wider).sum() == pytest.approx(held, rel=1e-12)
    # a weight that is linear along the rod is in the middle as large as on average
    weights = (z - z[0]) / (z[-1] - z[0])
    assert (gap_masses(system, x, weights) @ wider).sum() == pytest.approx(0.5 * held, rel=1e-12)


def test_tangents_are_those_of_the_residuals(begun: tuple[Relaxed, Array]) -> None:
    """Of the whole problem and of its layer, by central differences; both agree in the layer."""
    problem, start = begun
    start[problem.interior] += 0.1  # away from where the film begins to cavitate
    m, dx = len(problem.shared), np.zeros_like(start)
    dx[problem.shared] = 1e-7 * np.random.default_rng(3).standard_normal(m)
    dx[problem.problem.fixed] = 0.0
    change = 0.5 * (problem.residual(start + dx) - problem.residual(start - dx))
    _, K = problem.linearise(start)
    assert np.linalg.norm(K @ dx - change) < 1e-5 * np.linalg.norm(change)
    small = 0.5 * (problem.layer_residual(start + dx) - problem.layer_residual(start - dx))
    _, L = problem.layer_linearise(start)
    assert np.linalg.norm(L.shared @ dx[problem.shared] - small) < 1e-5 * np.linalg.norm(small)
    assert small[m:] == pytest.approx(change[problem.interior], rel=1e-9, abs=1e-12)
    # and the term counts: without it the tangent is another one
    assert np.linalg.norm(np.asarray(problem.term @ dx)) > 1e-2 * np.linalg.norm(
        change[problem.interior]
    )


def test_a_step_is_the_same_for_newton_s_method(begun: tuple[Relaxed, Array]) -> None:
    """`Anchored` holds any problem as `Relaxed` holds one with a layer."""
    relaxed, x = begun
    x[relaxed.shared] += 1e-6
    anchored = Anchored(relaxed.problem, relaxed.term, relaxed.state)
    (r, K), (s, L) = relaxed.linearise(x), anchored.linearise(x)
    assert r == pytest.approx(s, rel=1e-12, abs=1e-15)
    assert anchored.residual(x) == pytest.approx(r, rel=1e-9, abs=1e-9)
    assert abs(K - L).max() <= 1e-12 * abs(K).max()
    bare = relaxed.problem.residual(x)
    assert np.linalg.norm(r - bare) > 1e-6 * np.linalg.norm(bare)


def test_an_implicit_step_conserves_what_the_film_holds(
    dry_contact: DryContact, squeeze_film: SqueezeFilm
) -> None:
    """Outflow minus inflow is what the film has lost, by the local time steps."""
    system, start = (
        dry_contact.system,
        pressed_film(dry_contact.system, dry_contact.x, 3.0),
    )
    step = squeeze_film.step(start, 0.3, 0.0)
    solution = FilmCorrectors.of(system, dry_contact.newton).monolithic().solve(step, start)
    assert solution.converged, solution.message
    rows = np.setdiff1d(system.layout.dofs("pressure"), step.problem.fixed)
    fluxes = np.add.reduce(step.problem.residual(solution.x)[rows])
    held = np.asarray(step.term @ (solution.x - start))[rows].sum()
    assert held != 0.0
    assert fluxes == pytest.approx(-held, rel=1e-3)


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_change_is_that_of_the_logarithm_of_the_gap(
    dry_contact: DryContact, squeeze_film: SqueezeFilm, ratio: float
) -> None:
    system, x = dry_contact.system, dry_contact.x.copy()
    node = system.mesh.arc_nodes[5]
    _, h = system.arc_film(x)
    system.displacements(x)[node, 1] += (ratio - 1.0) * h[5]
    assert squeeze_film.change(dry_contact.x, x) == pytest.approx(np.log(2.0), rel=1e-6)
    system.displacements(x)[node, 1] -= 2.0 * ratio * h[5]
    assert squeeze_film.change(dry_contact.x, x) == np.inf
