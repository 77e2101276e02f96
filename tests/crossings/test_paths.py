"""Paths that begin with a result are the paths that were not interrupted."""

from typing import Any

import numpy as np
import pytest

import softehl
from softehl import Mesh, Study


@softehl.material
def creeping(m: Any) -> None:
    """Hooke's law, whose stress relaxes by the share dt / tau in each step."""
    E, tau, dt = m.parameters(E="modulus [MPa]", tau="time of relaxation [s]", dt="step [s]")
    (v,) = m.point_data(v="viscous strain")
    e = m.strain
    new = m.define("new", (v + dt / tau * e[0, 0]) / (1 + dt / tau))
    stress = E * e
    stress[0, 0] -= E * new
    m.stress(stress)
    m.history(v=new)


def held() -> Study:
    """A block that is stretched at once, and relaxes."""
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    study.add("body", material=creeping, E=1.0, tau=2.0, dt=0.5)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    study.fix("right", u_x=lambda x, t: np.full(len(x), 0.2))
    return study


def test_a_path_that_goes_on_makes_no_step_more() -> None:
    """A history with a given dt does not go on at the start."""
    study, points = held(), list[float]()
    whole = study.solve(steps=8, record=True)
    half = study.solve(steps=4, until=0.5, record=True)
    result = study.solve(
        steps=4, start=half, record=True, on_step=lambda r: points.append(float(r.t))
    )
    assert points[0] == 0.5
    assert len(points) == 5
    known = whole.reaction("right")["u_x"]
    assert result.reaction("right")["u_x"] == pytest.approx(known, rel=1e-12)
    slopes = [
        r.sensitivity("u_x", reaction="right", by={"body": ["tau"]})["body", "tau"]
        for r in (result, whole)
    ]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-10)
    other = held().solve(steps=4, start=half)  # another study: its equations hold at the start
    assert other.reaction("right")["u_x"] < 0.99 * known


def test_friction_goes_on() -> None:
    """Points that slip at the start of a path have the slip of the step before."""
    block = Mesh.rectangle(1, 0.5, cells=(3, 1)).map(lambda x: x + np.array([0.5, 1.0]))
    study = Study(Mesh.union(block=block, base=Mesh.rectangle(2, 1, cells=(8, 2))))
    for name in ("block", "base"):
        study.add(name, material="neo_hooke", cells=name, mu=1.0, kappa=3.0)
    study.contact("block:bottom", "base:top", friction=0.3)
    study.fix("base:bottom", u_x=0, u_y=0)
    study.fix(
        "block:top",
        u_x=lambda x, t: np.full(len(x), 0.2 * max(t - 0.5, 0.0)),
        u_y=lambda x, t: np.full(len(x), -0.1 * min(2.0 * t, 1.0)),
    )
    whole = study.solve(steps=8)
    result = study.solve(steps=2, start=study.solve(steps=6, until=0.75))
    np.testing.assert_allclose(result.x, whole.x, atol=1e-9)
