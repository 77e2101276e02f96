"""Integrators as objects and by short names, what each refuses, and the options of solvers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import softehl
from softehl import Newton, SolverOptions
from softehl.runtime.analyses.callbacks import read_series
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.study import Study
from tests.runtime.test_dynamics import oscillator, pendulum
from tests.runtime.test_march import rod


def damped() -> Study:
    return oscillator(c=0.4)


def states(study: Study, **given: Any) -> Array:
    results = list(study.march(**{"dt": 0.05, "until": 0.2, **given}))
    return np.array([[result.t, *result.x] for result in results])


@pytest.mark.parametrize(
    ("make", "name", "integrator", "given"),
    [
        (rod, "euler", softehl.Euler(), {"tolerance": 1e-3}),
        (rod, "bdf2", softehl.BDF2(), {"tolerance": 1e-3}),
        (damped, "newmark", softehl.Newmark(), {}),
        (damped, "generalised-alpha", softehl.GeneralisedAlpha(), {}),
        (damped, "midpoint", softehl.Midpoint(), {}),
        (damped, "explicit", softehl.CentralDifference(), {}),
    ],
)
def test_a_string_is_the_short_name_of_an_integrator(
    make: Any, name: Any, integrator: Any, given: dict[str, Any]
) -> None:
    named, as_object = (states(make(), method=m, **given) for m in (name, integrator))
    np.testing.assert_array_equal(named, as_object)
    assert integrator.name == name


def test_the_spectral_radius_is_a_parameter_of_generalised_alpha() -> None:
    named = states(damped(), method="generalised-alpha", rho_inf=0.3)
    as_object = states(damped(), method=softehl.GeneralisedAlpha(rho_inf=0.3))
    np.testing.assert_array_equal(named, as_object)
    assert (named != states(damped(), method="generalised-alpha")).any()


@pytest.mark.parametrize(("beta", "gamma"), [(0.25, 0.5), (0.3025, 0.6), (1.0 / 6.0, 0.5)])
def test_newmarks_coefficients(beta: float, gamma: float) -> None:
    """A linear oscillator m w'' + k w = 0, against Newmark's recursion in displacements."""
    study = Study(softehl.Mesh.line(1.0, cells=1))
    study.add("pendulum", pendulum(), on=lambda x: x[:, 0] == 0.0, mass=2.0, k=3.0)
    study.start(w=1e-7)  # of which the cube is below rounding
    dt, w, v = 0.1, 1e-7, 0.0
    a = -1.5 * w
    expected = []
    for _ in range(5):
        predicted = w + dt * v + dt**2 * (0.5 - beta) * a
        v += dt * (1.0 - gamma) * a
        w = predicted / (1.0 + 1.5 * beta * dt**2)
        a = -1.5 * w
        v += dt * gamma * a
        expected.append(w)
    results = study.march(dt=dt, until=0.5, method=softehl.Newmark(beta=beta, gamma=gamma))
    assert [r.values("w")[0] for r in results] == pytest.approx(expected, rel=1e-10)


class Trapezoid:
    """An integrator of a user: BDF2 by another formula, of equal steps."""

    name: ClassVar[str] = "own"
    order: ClassVar[int] = 2

    def weights(self, steps: Sequence[float]) -> Array:
        if len(steps) == 1:
            return np.array([1.0, -1.0]) / steps[0]
        return np.array([1.5, -2.0, 0.5]) / steps[0]

    def error_fraction(self, dt: float, two_steps: float) -> float:
        return 2.0 / 11.0


def test_users_write_integrators() -> None:
    own, shipped = (states(rod(), method=m) for m in (Trapezoid(), "bdf2"))
    np.testing.assert_allclose(own, shipped, rtol=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"method": softehl.BDF2(), "mass": {}}, 'mass: method = "bdf2" has no such thing'),
        ({"method": softehl.Euler(), "velocity": {}}, 'velocity: method = "euler" has no such'),
        ({"method": softehl.Newmark(), "tolerance": 1e-3}, 'tolerance: method = "newmark"'),
        ({"method": softehl.Midpoint(), "checkpoint": "a"}, 'checkpoint: method = "midpoint"'),
        ({"method": softehl.CentralDifference(), "restart": "a"}, 'restart: method = "explicit"'),
        ({"method": softehl.Midpoint(), "rho_inf": 0.5}, "rho_inf = 0.5: give it to the integ"),
        ({"method": "bdf2", "rho_inf": 0.5}, 'only method = "generalised-alpha" has it'),
        ({"method": softehl.BDF2}, "allowed are .* or an integrator such as softehl.BDF2()"),
        ({"method": ["bdf2"]}, "allowed are"),
    ],
)
def test_options_of_other_integrators_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(StudyError, match=message) as error:
        damped().march(**{"dt": 1.0, "until": 2.0, **given})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: softehl.Newmark(beta=0.0), "beta = 0: must be positive; .*CentralDifference"),
        (lambda: softehl.Newmark(gamma=0.4), "gamma = 0.4: must be at least 0.5"),
        (lambda: softehl.GeneralisedAlpha(-0.1), "rho_inf = -0.1: allowed is 0"),
    ],
)
def test_coefficients_are_checked(make: Any, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        make()


def test_solver_options_travel_together(tmp_path: Path) -> None:
    options = SolverOptions(newton=Newton(tolerance=1e-3), write=tmp_path / "rod.pvd")
    study = rod(cells=4)
    loose = list(study.march(dt=0.05, until=0.1, options=options))
    assert len(read_series(tmp_path / "rod.pvd")) == len(loose)
    keyword = list(study.march(dt=0.05, until=0.1, newton=Newton(tolerance=1e-3)))
    np.testing.assert_array_equal(loose[-1].x, keyword[-1].x)
    other = tmp_path / "other.pvd"
    list(study.march(dt=0.05, until=0.1, options=options, write=other))
    assert len(read_series(other)) == len(loose)


def test_following_takes_no_engine() -> None:
    with pytest.raises(StudyError, match="follow takes no engine"):
        rod(cells=2).follow(step=1.0, until=bool, options=SolverOptions(engine="serial"))
