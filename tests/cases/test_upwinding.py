"""The O-ring with the bubble-load upwinding: none at c = 0, both routes and treatments with it."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from softehl.cases.harness.observer import Outcome
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import FilmState
from softehl.runtime.discretisation.problem import Problem
from tests.cases.oring_cases import oring
from tests.cases.test_method import Recorder

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


@pytest.mark.parametrize("reynolds", TREATMENTS)
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
