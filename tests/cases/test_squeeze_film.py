"""The contact squeezed out to a film: its start, its masses, its steps in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softehl.cases.seal.correctors.proximal_term import Anchored, Relaxed
from softehl.cases.seal.equations.definition import DISPLACEMENT
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact_stages import OFFSET
from softehl.cases.seal.solve.correctors import FilmCorrectors
from softehl.cases.seal.solve.driver import DryContact
from softehl.cases.seal.solve.film_solver import NoFilm
from softehl.cases.seal.solve.inlet import InletScales
from softehl.cases.seal.solve.squeeze_film import SqueezeFilm, gap_masses, pressed_film
from softehl.cases.seal.states.state import Silent
from softehl.runtime.arrays import Array

P = Seal(ring="AS568-210", rod=19.0, sealed_pressure=3.0, density=1, speeds=(400.0,), mu_1=1.5)


@pytest.fixture(scope="module")
def dry() -> DryContact:
    """AS568-210 under 3 MPa on a coarse mesh."""
    return DryContact.of(P, Silent())


@pytest.fixture(scope="module")
def squeeze_film(dry: DryContact) -> SqueezeFilm:
    found = dry.film("out", 400.0)
    assert not isinstance(found, NoFilm), found.message
    return found.squeeze_film


@pytest.fixture
def begun(dry: DryContact, squeeze_film: SqueezeFilm) -> tuple[Relaxed, Array]:
    """A step of a thousandth of T from the start, and that start."""
    start = pressed_film(dry.system, dry.x, 3.0)
    problem = squeeze_film.step(start, 1e-3, 0.5)
    return problem, problem.admissible(start)


# ------------------------------------------------------------------------------------- the start


def around(dry: DryContact, p: Array) -> float:
    """Radial force of a pressure p (arc nodes,) that is linear between the nodes, N."""
    z, r = dry.system.deformed(dry.x)[dry.system.mesh.arc_nodes].T
    middle = 4.0 * 0.25 * (p[1:] + p[:-1]) * (r[1:] + r[:-1])
    simpson = (p[1:] * r[1:] + p[:-1] * r[:-1] + middle) / 6.0
    return float(2.0 * np.pi * (simpson * np.diff(z)).sum())


@pytest.mark.parametrize(("share", "right"), [(1.0, True), (0.98, False)])
def test_pressures_of_the_film_add_up_to_the_force_of_the_contact(
    dry: DryContact, share: float, right: bool
) -> None:
    system, x = dry.system, dry.x.copy()
    z, _ = system.arc_film(x)
    before, z0 = z[system.section.lowest - 1 :][:2]
    low = 0.5 * (before + z0) + 0.5 * (z0 - before)  # half of a segment beyond has no pressure
    pressing = -float((system.rod_multipliers(x) * system.rod_areas).sum())
    r = system.rod_radius + OFFSET
    force = pressing + 3.0 * 2.0 * np.pi * r * (low - z[0])
    system.rod_multipliers(x)[:] *= share
    rows = pressed_film(system, x, 3.0)[system.pressure_dofs()]
    assert rows[[0, -1], [0, -1]] == pytest.approx([3.0, 0.0], abs=1e-12)
    found = around(dry, np.append(rows[:, 0], rows[-1, -1]))
    assert bool(abs(found / force - 1.0) < 5e-3) is right


def test_they_bear_the_section(begun: tuple[Relaxed, Array], dry: DryContact) -> None:
    """What is left of its equilibrium is a per cent of what it is without them; half leave half."""
    (problem, start), x = begun, dry.x
    part = dry.system.layout.part(DISPLACEMENT)
    left, half, without = (
        np.linalg.norm(problem.scaled(problem.residual(y))[part])
        for y in (start, 0.5 * (start + x), x)
    )
    assert left < 0.03 * without
    assert half == pytest.approx(0.5 * without, rel=0.05)


@pytest.mark.parametrize("viscosity", [P.viscosity, 1e-11], ids=["usual", "thin"])
def test_the_first_step_holds_the_film_where_it_is(
    dry: DryContact, squeeze_film: SqueezeFilm, viscosity: float
) -> None:
    """Also of an oil whose film is a thousand times thinner than the gap of the contact."""
    p = P.model_copy(update={"viscosity": viscosity})
    system, start = dry.system.moved(p, dry.system.section), pressed_film(dry.system, dry.x, 3.0)
    scales = InletScales.of(system, "out", 400.0, dry.x)
    assert scales is not None
    begun = replace(squeeze_film, system=system, scales=scales)
    steps, first = FilmCorrectors.of(system, dry.newton).steps(), begun.first
    found = steps.solve(begun.step(start, first, 0.0), start)
    assert found.converged, found.message
    assert 0.0 < begun.change(start, found.x) < 0.7
    longer = steps.solve(begun.step(start, 1e5 * first, 0.0), start)
    assert not longer.converged or begun.change(start, longer.x) > 0.7


# ------------------------------------------------------------------------------- masses and steps


def test_masses_add_up_to_what_a_wider_gap_holds(dry: DryContact) -> None:
    """A gap that is 1 um wider everywhere holds 1 um times the length of the film more."""
    system, x = dry.system, dry.x
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
    dry: DryContact, squeeze_film: SqueezeFilm
) -> None:
    """Outflow minus inflow is what the film has lost, by the local time steps."""
    system, start = dry.system, pressed_film(dry.system, dry.x, 3.0)
    step = squeeze_film.step(start, 0.3, 0.0)
    solution = FilmCorrectors.of(system, dry.newton).monolithic().solve(step, start)
    assert solution.converged, solution.message
    rows = np.setdiff1d(system.layout.dofs("pressure"), step.problem.fixed)
    fluxes = np.add.reduce(step.problem.residual(solution.x)[rows])
    held = np.asarray(step.term @ (solution.x - start))[rows].sum()
    assert held != 0.0
    assert fluxes == pytest.approx(-held, rel=1e-3)


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_change_is_that_of_the_logarithm_of_the_gap(
    dry: DryContact, squeeze_film: SqueezeFilm, ratio: float
) -> None:
    system, x = dry.system, dry.x.copy()
    node = system.mesh.arc_nodes[5]
    _, h = system.arc_film(x)
    system.displacements(x)[node, 1] += (ratio - 1.0) * h[5]
    assert squeeze_film.change(dry.x, x) == pytest.approx(np.log(2.0), rel=1e-6)
    system.displacements(x)[node, 1] -= 2.0 * ratio * h[5]
    assert squeeze_film.change(dry.x, x) == np.inf
