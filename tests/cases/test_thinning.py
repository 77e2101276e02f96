"""From contact to a film: what contact holds the rod off is squeezed out; the rod comes near."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import log
from typing import Any

import numpy as np
import pytest

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import DISPLACEMENT
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve import film_path, method
from softehl.cases.seal.solve.contact import approach_stage
from softehl.cases.seal.solve.contact_route import ContactRoute
from softehl.cases.seal.solve.film import METHOD, FastFilm, shear_stage
from softehl.cases.seal.solve.film_path import FilmPath
from softehl.cases.seal.solve.method import run
from softehl.cases.seal.solve.nearing import NearRod, neared, nearing_stage, without_rounding
from softehl.cases.seal.solve.path import Followed, PathDriver, PathSettings, Stage, StageFailed
from softehl.cases.seal.solve.squeezing import gap_masses, pressed_film
from softehl.cases.seal.solve.stroke_start import StrokeStart
from softehl.cases.seal.solve.thinning import sooner, thinned_film, thinning_stage
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array
from softehl.runtime.fem.propped import Propped
from softehl.runtime.fem.relaxed import Relaxed
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.solution import Branch, Point, Solution, Status

SETTINGS = PathSettings()


@cache
def contact() -> tuple[SealSystem, Array]:
    """AS568-210 under 3 MPa on a coarse mesh."""
    p = ORing(ring="AS568-210", rod=19.0, sealed_pressure=3.0, density=1, speeds=(400.0,), mu_1=1.5)
    found = ContactRoute(SETTINGS, PathDriver(Silent()).follow).contact(p)
    assert not isinstance(found, StageFailed)
    return found


def thin(loads: FilmLoads) -> tuple[FastFilm, FilmLoads]:
    system, x = contact()
    linear = PathDriver(Silent()).newton.linear
    assert isinstance(linear, Condenser)
    return FastFilm.of(system, linear, x), loads


def loads() -> FilmLoads:
    system, x = contact()
    film = thinned_film(system, SETTINGS, "out", x)
    assert film is not None
    return film


def test_a_film_that_is_not_solved_at_its_first_time_begins_sooner() -> None:
    system, x = contact()
    fast, film = thin(loads())
    stage, _ = thinning_stage(fast, film, x)
    earlier = sooner(system, stage, film, x)
    assert earlier.start <= stage.start - log(1e3)
    assert earlier.stop == stage.stop
    # by the steepest edge: one on the sealed side that is hardly there asks for an earlier start
    flat = system.rod_multipliers(x)
    gentle = x.copy()
    touching = np.flatnonzero(flat < 0.0)
    system.rod_multipliers(gentle)[touching[:5]] *= 1e-3
    stage, _ = thinning_stage(fast, film, gentle)
    assert sooner(system, stage, film, gentle).start < stage.start - log(1e4)


def test_a_film_does_not_begin_where_rounding_is_all_that_moves() -> None:
    """The film of a thin oil is so much thinner than the gap that it would begin at once."""
    system, x = contact()
    p = system.parameters.model_copy(update={"viscosity": 1e-11})
    system = system.moved(p, system.section)
    film = thinned_film(system, SETTINGS, "out", x)
    linear = PathDriver(Silent()).newton.linear
    assert film is not None
    assert isinstance(linear, Condenser)
    stage, start = thinning_stage(FastFilm.of(system, linear, x), film, x)
    assert sooner(system, stage, film, x).start == stage.start
    for earlier, status in ((0.0, Status.CONVERGED), (9.0, Status.DIVERGED)):
        assert stage.corrector
        solution = stage.corrector.solve(stage.problem_at(stage.start - earlier), start)
        assert solution.status is status


def test_what_holds_no_length_of_the_rod_has_no_pressure_of_its_own() -> None:
    """A node between two segments on a wall: its force is on no area of the rod."""
    system, x = contact()
    nodes = system.mesh.arc_nodes[-3:]
    upright = x.copy()
    z = system.deformed(x)[nodes[0], 0]
    system.displacements(upright)[nodes, 0] += z - system.deformed(x)[nodes, 0]
    assert np.isfinite(pressed_film(system, upright, 3.0)).all()


def test_states_near_the_rod_are_found_once() -> None:
    system, x = contact()
    asked = list[str]()

    def follow(stage: Stage, start: Array) -> Followed:
        asked.append(stage.name)
        return PathDriver(Silent()).follow(stage, start)

    rod = NearRod(SETTINGS, follow, PathDriver(Silent()).newton)
    first, times = rod.states(system, x), len(asked)
    assert times > 0
    assert rod.states(system, x.copy()) is first
    assert len(asked) == times
    rod.states(system, x + 1e-12)  # another state
    assert len(asked) > times


def relaxed(tau: float) -> tuple[Relaxed, Array]:
    """The problem of a time over that of the inlet, and the start of the path."""
    fast, film = thin(loads())
    stage, start = thinning_stage(fast, film, contact()[1])
    problem = stage.problem_at(log(tau))
    assert isinstance(problem, Relaxed)
    return problem, problem.admissible(start)


def test_pressures_of_contact_bear_the_section() -> None:
    """What is left of its equilibrium is a per cent of what it is without them."""
    system, x = contact()
    problem, start = relaxed(1e-3)
    part = system.layout.part(DISPLACEMENT)
    left, without = (np.linalg.norm(problem.scaled(problem.residual(y))[part]) for y in (start, x))
    assert left < 0.02 * without


def test_where_pressures_are_left_out_nothing_bears_it() -> None:
    """Half of them leave half of the load: the test above can fail."""
    system, x = contact()
    problem, start = relaxed(1e-3)
    part = system.layout.part(DISPLACEMENT)
    half = 0.5 * (start + x)
    left, without = (np.linalg.norm(problem.scaled(problem.residual(y))[part]) for y in (half, x))
    assert left == pytest.approx(0.5 * without, rel=0.05)


def test_masses_add_up_to_what_a_wider_gap_holds() -> None:
    """A gap that is 1 um wider everywhere holds 1 um times the length of the film more."""
    system, x = contact()
    wider = np.zeros_like(x)
    wider[system.layout.part(DISPLACEMENT).start + 2 * system.mesh.arc_nodes + 1] = 1e-3
    z, _ = system.arc_film(x)
    assert (gap_masses(system, x) @ wider).sum() == pytest.approx(1e-3 * (z[-1] - z[0]), rel=1e-12)


def test_tangents_are_those_of_the_residuals() -> None:
    """Of the whole problem and of its layer, by central differences; both agree in the layer."""
    problem, start = relaxed(0.1)
    start[problem.own] += 0.1  # away from where the film begins to cavitate
    m, dx = len(problem.shared), np.zeros_like(start)
    dx[problem.shared] = 1e-7 * np.random.default_rng(3).standard_normal(m)
    dx[problem.problem.fixed] = 0.0
    change = 0.5 * (problem.residual(start + dx) - problem.residual(start - dx))
    _, K = problem.linearise(start)
    assert np.linalg.norm(K @ dx - change) < 1e-5 * np.linalg.norm(change)
    small = 0.5 * (problem.layer_residual(start + dx) - problem.layer_residual(start - dx))
    _, L = problem.layer_linearise(start)
    assert np.linalg.norm(L.shared @ dx[problem.shared] - small) < 1e-5 * np.linalg.norm(small)
    assert small[m:] == pytest.approx(change[problem.own], rel=1e-9, abs=1e-12)


def test_the_first_film_is_that_of_the_fading_contact() -> None:
    """By squeezing and by Newton's method with fading contact: one film at 400 mm/s."""
    system, x = contact()
    path, found = FilmPath(system, SETTINGS, PathDriver(Silent())), []

    def keep(film: FilmLoads, point: Point) -> None:
        if film.speed == 400.0:
            found.append(system.arc_film(point.solution.x)[1].min())

    assert path.thinned(loads(), x, keep) is None
    built = path.build(*next(StrokeStart(path, "out", x).starts()))
    assert path.slower(built, (400.0,), keep) is None
    assert found[0] == pytest.approx(found[1], rel=1e-7)


class Stalling(PathDriver):
    """One whose fast way ends where the shear stress begins to act."""

    def follow(self, stage: Stage, x0: Array) -> Followed:
        """See `PathDriver`."""
        if stage.name != "shear" or stage.method != METHOD:
            return super().follow(stage, x0)
        start = Solution(x0, Status.CONVERGED, "", (), 0, 0)
        return StageFailed(stage, Branch((Point(0.0, start),), Status.DIVERGED, "stalled"))


def test_where_the_fast_way_stalls_under_shear_newton_goes_on_to_the_same_film() -> None:
    system, x = contact()
    fast, film = thin(loads())
    first, y = thinning_stage(fast, film, x)
    built = PathDriver(Silent()).follow(first, y)
    assert not isinstance(built, StageFailed)
    stage, found = shear_stage(system, SETTINGS, replace(film, shear=1.0)), []
    for driver in (PathDriver(Silent()), Stalling(Silent())):
        end = FilmPath(system, SETTINGS, driver)._sheared(fast, stage, built)
        assert not isinstance(end, StageFailed)
        found.append(system.arc_film(end)[1])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-5)


class Unsteady(PathDriver):
    """One in which shear stress does not begin to act on the film that was squeezed first."""

    def follow(self, stage: Stage, x0: Array) -> Followed:
        """See `PathDriver`."""
        if stage.name == "shear" and len(self.records) == 1:
            return StageFailed(stage, Branch((), Status.DIVERGED, "not its start"))
        return super().follow(stage, x0)


def test_a_film_that_is_not_steady_is_squeezed_for_longer() -> None:
    """It is the same one then: what was left of the squeezing was 1e-4 of an inlet's."""
    system, x = contact()
    found: list[dict[float, float]] = []
    for kind in (PathDriver, Unsteady):
        films: dict[float, float] = {}

        def keep(film: FilmLoads, point: Point, into: dict[float, float] = films) -> None:
            into[film.speed] = system.arc_film(point.solution.x)[1].min()

        driver = kind(Silent())
        assert FilmPath(system, SETTINGS, driver).thinned(loads(), x, keep) is None
        found.append(films)
    assert found[1][400.0] == pytest.approx(found[0][400.0], rel=1e-7)


class StrongShear(PathDriver):
    """The shear stress of the first film leads nowhere."""

    def follow(self, stage: Stage, x0: Array) -> Followed:
        if stage.name == "shear" and not any(r.name == "falling speed" for r in self.records):
            return StageFailed(stage, Branch((), Status.DIVERGED, "too much of it"))
        return super().follow(stage, x0)


def test_shear_stress_that_leads_nowhere_begins_at_a_slower_film(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system, x = contact()
    monkeypatch.setattr(film_path, "lies_in_corner", lambda system: True)
    found: list[float] = []
    for kind in (PathDriver, StrongShear):
        driver = kind(Silent())

        def keep(film: FilmLoads, point: Point) -> None:
            if film.speed == 400.0:
                found.append(system.arc_film(point.solution.x)[1].min())

        assert FilmPath(system, SETTINGS, driver).thinned(loads(), x, keep) is None
    assert found[1] == pytest.approx(found[0], rel=1e-7)


def test_a_speed_that_is_missed_is_named_though_slower_ones_are_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    usual = FilmPath._falling

    def strong(path: FilmPath, fast: FastFilm, film: FilmLoads, *given: Any, **how: Any) -> Any:
        if film.speed > 200.0:
            stage = shear_stage(path.system, path.settings, film)
            return StageFailed(stage, Branch((), Status.DIVERGED, "too much of it"))
        return usual(path, fast, film, *given, **how)

    for place in (film_path, method):
        monkeypatch.setattr(place, "lies_in_corner", lambda system: True)
    monkeypatch.setattr(FilmPath, "_falling", strong)
    p = contact()[0].parameters.model_copy(update={"speeds": (400.0, 100.0), "stroke": "out"})
    outcome = run(p, Silent())
    assert [state.rod_speed_mm_s for state in outcome.states] == [100.0]
    assert not outcome.converged
    assert "speed 400 was not reached" in outcome.message


def test_a_rod_that_nothing_touches_has_no_such_film() -> None:
    system, _ = contact()
    assert thinned_film(system, SETTINGS, "out", system.at_rest()) is None


def test_a_rod_that_comes_near_finds_the_contact_that_newton_finds() -> None:
    """With the contact of the arc as the layer, and by Newton's method: one state."""
    system, x = contact()
    driver = PathDriver(Silent())
    linear = driver.newton.linear
    assert isinstance(linear, Condenser)
    near = neared(nearing_stage(system, SETTINGS, 0.004, x, linear), x, driver.follow)
    same = driver.follow(approach_stage(system, SETTINGS, 0.004), x)
    assert not isinstance(near, StageFailed)
    assert not isinstance(same, StageFailed)
    assert np.abs(near - x).max() > 1e-3
    pressure, wanted = system.rod_multipliers(near), system.rod_multipliers(same)
    assert np.abs(pressure - wanted).max() < 1e-4 * np.abs(wanted).max()
    touching = system.rod_multipliers(without_rounding(system, near)) < 0.0
    assert (touching == (wanted < 0.0)).all()


def test_props_of_a_body_change_no_residual_and_leave_their_layer() -> None:
    """The body's tangent and the layer's add up to that of the problem."""
    system, x = contact()
    linear = PathDriver(Silent()).newton.linear
    assert isinstance(linear, Condenser)
    problem = nearing_stage(system, SETTINGS, 0.004, x, linear).problem_at(log(0.008))
    assert isinstance(problem, Propped)
    dx = np.zeros_like(x)
    dx[problem.shared] = 1e-6 * np.random.default_rng(5).standard_normal(len(problem.shared))
    _, K = problem.linearise(x)
    _, L = problem.layer_linearise(x)
    both = np.asarray(problem.body(x) @ dx)[problem.shared] + L.shared @ dx[problem.shared]
    assert both == pytest.approx(np.asarray(K @ dx)[problem.shared], rel=1e-9, abs=1e-12)
