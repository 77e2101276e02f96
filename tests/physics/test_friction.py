"""Coulomb's friction: the stick of Cattaneo and Mindlin, and full sliding with hysteresis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result

PAGE = Path(__file__).parents[2] / "docs" / "gallery" / "models" / "block.py"
MU, G, NU, RADIUS = 0.3, 1.0, 0.4999, 10.0
BULK = 2 * G * (1 + NU) / (3 * (1 - 2 * NU))


def spread(s: Array) -> Array:
    """Equal cells to 1.4 mm on either side, then growing to 100 mm."""
    far = np.expm1(14 * np.maximum(abs(s) - 0.55, 0)) / 14
    return np.asarray(np.sign(s) * 1.4 / 0.55 * (np.minimum(abs(s), 0.55) + far))


def widths(x: Array) -> Array:
    order = np.argsort(x[:, 0])
    return np.asarray(np.gradient(x[order, 0])[np.argsort(order)])


def stresses(result: Result) -> tuple[Array, Array, Array]:
    """Width of the nodes, their pressure and tangential stress."""
    nodes = result.system.blocks["roller"].nodes[:, 0]
    p, tau = result.values("lambda"), result.values("tau")
    return widths(result.system.mesh.points[nodes]), np.maximum(-p, 0), tau


def pushed(n: int, shift: float) -> list[Result]:
    """Steps of a roller that is pressed 0.4 mm deep, then pushed by `shift`."""
    study = Study(Mesh.rectangle(2, 1, cells=(2 * n, n)).map(lambda x: spread(x - 1)))
    study.add("block", PAGE, G=G, K=BULK)
    given: dict[str, Any] = {"area": widths, "rho": lambda x: G / widths(x)}
    given["c"] = lambda x: -(x[:, 0] ** 2) / (2 * RADIUS)
    given |= {"n_z": 0.0, "n_r": -1.0, "offset": 0.0, "friction": MU}
    study.add("roller", "contact_friction", on="top", **given)
    study.fix("bottom", u_r=lambda x, t: 0.4 * min(t, 1), u_z=lambda x, t: shift * max(t - 1, 0))
    pressed, path = study.solve(steps=4), list[Result]()
    study.solve(steps=4, start=pressed, until=2.0, on_step=path.append)
    return path


def departure(path: list[Result], friction: float) -> float:
    """Largest error of the stick ratio against sqrt(1 - Q / (friction P)), in widths of a node."""
    worst = 0.0
    for result in path:
        w, p, tau = stresses(result)
        sticks = (p > 0) & (abs(tau) < MU * p * (1 - 1e-9))
        ratio = w[sticks].sum() / w[p > 0].sum()
        expected = max(1 - float(abs(tau @ w) / (friction * (p @ w))), 0.0) ** 0.5
        worst = max(worst, abs(ratio - expected) * w[p > 0].sum() / (2 * w[p > 0].max()))
    return worst


def test_stick_follows_cattaneo_and_mindlin() -> None:
    """Within one node; with another coefficient of friction the same comparison fails."""
    path = pushed(16, 0.12)
    assert departure(path, MU) < 1.0
    assert departure(path, 1.5 * MU) > 1.2


def test_a_roller_that_slides_everywhere_carries_mu_p() -> None:
    """|Q| = mu P to rounding, against the motion."""
    for shift in (0.5, -0.5):
        w, p, tau = stresses(pushed(12, shift)[-1])
        assert tau @ w == pytest.approx(-np.sign(shift) * MU * (p @ w), rel=1e-9)
        assert np.all(abs(abs(tau) - MU * p) <= 1e-9 * p.max())
