"""A film is the same whatever it is found from: contact, another speed, another mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.adaptation import FITS, Adaptation, Adapted
from softehl.cases.seal.solve.arc_meshing import film_layout, misfit
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.driver import DryContact, run
from softehl.cases.seal.solve.film_solver import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.solve.transfer import FilmTransfer
from softehl.cases.seal.states.estimate import Estimate
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Status

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
