"""Fits to measurements that are known, their covariance, and functions for optimisers."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from softehl import Mesh, Study
from softehl.runtime.results.result import Result
from softehl.runtime.study import StudyError
from tests.runtime.field_pages import rubber

MU, K = 0.4225, 0.9
PLACES = ((48.0, 60.0), (48.0, 44.0), (24.0, 40.0))
BY = {"rubber": ["mu", "K"]}


def cook(mu: float = MU, kappa: float = K) -> Study:
    panel = Mesh.rectangle(48, 44, cells=(4, 4)).map(
        lambda x: np.column_stack([x[:, 0], x[:, 1] + x[:, 0] / 48 * (44 - 28 / 44 * x[:, 1])])
    )
    study = Study(panel)
    study.add("rubber", rubber, mu=mu, K=kappa)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=1 / 16)
    return study


@cache
def truth() -> tuple[Result, ...]:
    path: list[Result] = []
    cook().solve(steps=4, on_step=path.append)
    return (*path,)


def displacements(result: Result) -> dict[Any, dict[str, float]]:
    return {place: {n: result.at(place)[n] for n in ("u_x", "u_y")} for place in PLACES}


@pytest.mark.parametrize("start", [(1.5, 0.5), (0.5, 1.5)])
def test_cook_from_half_off(start: tuple[float, float]) -> None:
    fit = cook(start[0] * MU, start[1] * K).fit(displacements(truth()[-1]), by=BY, steps=4)
    assert fit.values["rubber", "mu"] == pytest.approx(MU, rel=1e-8)
    assert fit.values["rubber", "K"] == pytest.approx(K, rel=1e-8)
    assert fit.evaluations < 10
    assert np.abs(fit.residuals).max() < 1e-8
    assert fit.result.at(PLACES[0])["u_y"] == pytest.approx(truth()[-1].at(PLACES[0])["u_y"])


def test_covariance_is_that_of_a_linear_model() -> None:
    """Slopes by differences: sigma^2 (J^T J)^-1, and the scatter where sigma is not given."""
    measured, step = displacements(truth()[-1]), 1e-4

    def numbers(mu: float, kappa: float) -> Any:
        found = displacements(cook(mu, kappa).solve(steps=4))
        return np.array([v for row in found.values() for v in row.values()])

    J = np.stack(
        [
            (numbers(MU + step, K) - numbers(MU - step, K)) / (2 * step),
            (numbers(MU, K + step) - numbers(MU, K - step)) / (2 * step),
        ],
        axis=1,
    )
    expected = np.linalg.inv(J.T @ J)
    fit = cook().fit(measured, by=BY, sigma=0.1, steps=4)
    assert fit.covariance == pytest.approx(0.1**2 * expected, rel=1e-4)
    assert fit.deviations == pytest.approx(0.1 * np.sqrt(np.diag(expected)), rel=1e-4)
    measured[PLACES[0]]["u_y"] += 0.01
    fit = cook().fit(measured, by=BY, steps=4)
    scatter = fit.residuals @ fit.residuals / (len(fit.residuals) - 2)
    assert fit.covariance == pytest.approx(scatter * expected, rel=0.05)


def test_numbers_along_the_path_and_reactions() -> None:
    path = truth()[1:]
    curve = {r.t: r.reaction("left")["u_y"] for r in path[::2]}
    measured: Any = {PLACES[0]: {"u_y": [r.at(PLACES[0])["u_y"] for r in path]}}
    measured["left"] = {"u_y": curve}
    fit = cook(0.6, 0.7).fit(measured, by={**BY, "load:right": "u_y"}, steps=4)
    assert [*fit.values.values()] == pytest.approx([MU, K, 1 / 16], rel=1e-7)


def test_newton_where_the_panel_cannot_be_as_measured() -> None:
    """Large residuals: the same values as Gauss-Newton, in fewer evaluations."""
    measured: Any = displacements(truth()[-1])
    for place, row in measured.items():
        row["u_y"] *= 1.3 if place is PLACES[1] else 0.6
    fits = [
        cook(0.5, 0.7).fit(measured, by=BY, steps=4, method=method)
        for method in ("gauss-newton", "newton")
    ]
    values = [np.array([*fit.values.values()]) for fit in fits]
    assert values[1] == pytest.approx(values[0], rel=1e-5)
    assert fits[1].evaluations < fits[0].evaluations
    assert fits[1].standard_errors["rubber", "K"] == pytest.approx(fits[1].deviations[1])


def test_bounds_hold() -> None:
    mu = ("rubber", "mu")
    for method in ("gauss-newton", "newton"):
        options: Any = {"bounds": {mu: (0.5, 1.0)}, "method": method}
        fit = cook(0.6).fit(displacements(truth()[-1]), by=BY, steps=4, **options)
        assert fit.values[mu] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize(
    ("measured", "options", "words"),
    [
        ({}, {}, "measured: a mapping is needed"),
        ({(48.0, 60.0): 1.0}, {}, "give unknowns"),
        ({48.0: {"u_y": 1.0}}, {}, "a place is a tuple of numbers, a side is a name"),
        ({(48.0, 60.0): {"u_y": [1.0, 2.0]}}, {"steps": 3}, "has 2 numbers and the path 3 steps"),
        ({(48.0, 60.0): {"u_y": {0.3: 1.0}}}, {}, "no step that ends at 0.3"),
        ({(48.0, 60.0): {"u_y": np.nan}}, {}, "must be finite numbers"),
        ({(48.0, 60.0): {"w": 1.0}}, {}, "no unknown 'w'"),
        ({(48.0, 60.0): {"u_y": 1.0}}, {"bounds": {("rubber", "m"): (0, 1)}}, "bounds: no input"),
        ({(48.0, 60.0): {"u_y": 1.0}}, {"bounds": {("rubber", "mu"): (1, 2)}}, "between"),
        ({(48.0, 60.0): {"u_y": 9.0}}, {"most": 1}, "1 trials were not enough"),
    ],
)
def test_what_cannot_be_fitted_is_refused(measured: Any, options: Any, words: str) -> None:
    with pytest.raises(StudyError) as error:
        cook().fit(measured, by=BY, **options)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_an_objective_for_scipy() -> None:
    wanted = truth()[-1].at(PLACES[0])["u_y"]
    tip = cook(0.6).objective("u_y", at=PLACES[0], by={"rubber": "mu"}, steps=4)

    def miss(p: Any) -> tuple[float, Any]:
        value, slope = tip(p)
        return (value - wanted) ** 2, 2 * (value - wanted) * slope

    found = minimize(
        miss, tip.start, jac=True, bounds=[(0.3, 1)], options={"ftol": 0, "gtol": 1e-9}
    )
    assert found.x == pytest.approx([MU], rel=1e-8)
