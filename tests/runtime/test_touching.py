"""Contact of deformable bodies: patch, tangent, Hertz, rolling, ironing, a side with itself."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.contact.search import ContactProblem
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.results.result import Result
from softehl.runtime.solve.solution import NotConverged
from tests.runtime.touching_bodies import (
    elastic,
    force,
    gasket,
    half_space,
    lower_disc,
)

RUBBER: dict[str, Any] = {"mu": 1.0, "K": 5.0}


def stacked(
    upper: int, lower: int, *, apart: float = 0.0, geometry: str | None = None, friction: float = 0
) -> Study:
    """Two blocks of these orders, one on the other, on meshes that do not match."""
    below = Mesh.rectangle(1, 1, cells=(3, 2), order=lower).map(lambda x: np.add(x, [0, 1]))
    above = Mesh.rectangle(1, 1, cells=(4, 3), order=upper).map(lambda x: np.add(x, [0, 2 + apart]))
    study = Study(Mesh.union(lower=below, upper=above), geometry=geometry)
    study.add("body", elastic, **RUBBER)
    study.contact("upper:bottom", "lower:top", friction=friction)
    return study


@pytest.mark.parametrize("orders", [(1, 1), (1, 2), (2, 1), (2, 2)])
def test_a_uniform_pressure_passes_between_meshes_that_do_not_match(
    orders: tuple[int, int],
) -> None:
    study = stacked(*orders)
    study.fix("lower:bottom", u_y=0)
    study.fix("upper:top", u_y=-0.2)
    study.fix("lower:left", u_x=0)
    study.fix("upper:left", u_x=0)
    result = study.solve()
    before, last = result.residual_norms[-2:]
    assert last < max(1e2 * before**2, 1e-10)
    pressure = study.solve(start=result).fields("contact")["pressure"]
    assert np.ptp(pressure) < 1e-10 * pressure.max()
    assert pressure.min() > 0.1


def test_a_body_that_only_contact_could_hold_is_told() -> None:
    study = stacked(1, 1, apart=0.1)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.fix("upper:left", u_x=0)
    study.load("upper:top", u_y=-0.2)
    with pytest.raises(NotConverged, match="nothing prevents a translation along y"):
        study.solve()
    study.spring("upper:top", u_y=1e-4)
    assert force(study.solve(steps=2)) == pytest.approx(0.2, rel=1e-3)


def test_no_step_jumps_over_a_thin_body() -> None:
    """A plate 0.1 thick, moved by 0.4 at once, is stopped by what it meets after 0.2."""
    block = Mesh.rectangle(1, 1, cells=(3, 3))
    plate = Mesh.rectangle(1, 0.1, cells=(4, 1)).map(lambda x: np.add(x, [0, 1.2]))
    study = Study(Mesh.union(block=block, plate=plate))
    study.add("body", elastic, **RUBBER)
    study.contact("plate:bottom", "block:top")
    study.fix("block:bottom", u_x=0, u_y=0)
    study.fix("plate:top", u_x=0, u_y=-0.4)
    result = study.solve()
    assert force(result) > 0.1
    assert result.at((0.5, 0.99))["u_y"] < -0.1


@pytest.mark.parametrize("orders", [(1, 2), (2, 1)])
@pytest.mark.parametrize("geometry", ["plane strain", "axisymmetric"])
def test_the_tangent_is_the_derivative(orders: tuple[int, int], geometry: str) -> None:
    study = stacked(*orders, geometry=geometry, friction=0.3)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.fix("upper:top", u_x=0.05, u_y=-0.2)
    result = study.solve(steps=2)
    system = result.system
    problem = system.problem(system.quasi_static_step(1.0, result.x, {}))
    rng = np.random.default_rng(1)
    x = result.x.copy()
    for name in ("u_x", "u_y"):
        part = system.numbering.layout.part(name)
        x[part] += 0.004 * rng.normal(size=part.stop - part.start)
    _, K = problem.linearise(x)
    y = rng.normal(size=len(x))
    y[problem.fixed] = 0.0
    h = 1e-6
    half, whole = (
        (problem.residual(x + s * y) - problem.residual(x - s * y)) / (2 * s) for s in (h / 2, h)
    )
    difference = (4 * half - whole) / 3
    size = np.abs(difference).max()
    assert np.abs(K @ y - difference).max() < 1e-8 * size
    assert isinstance(problem, ContactProblem)
    frozen = replace(problem, contacts=(), latest=[])  # a tangent without contact is seen
    assert np.abs(frozen.linearise(x)[1] @ y - difference).max() > 1e-2 * size


def test_hertz() -> None:
    """Two elastic bodies, a disc of radius 10 on a half-space: a = sqrt(4 P R / (pi E*))."""
    E, nu, R = 1000.0, 0.3, 10.0
    mesh = Mesh.union(disc=lower_disc(16, R, 2), block=half_space(14, 100.0, 2))
    study = Study(mesh)
    study.add("body", elastic, mu=E / 2 / (1 + nu), K=E / 3 / (1 - 2 * nu))
    study.contact("disc:bottom", "block:top")
    study.fix("block:bottom", u_x=0, u_y=0)
    study.fix("disc:top", u_x=0, u_y=-0.06)
    result = study.solve()
    assert result.iterations <= 12
    tail = result.residual_norms[-3:]
    assert tail[1] < 10 * tail[0] ** 1.5
    assert tail[2] < 1e-9
    P, found = force(result), result.fields("contact")
    assert result.reaction("block:bottom")["u_y"] == pytest.approx(P, rel=1e-3)
    a = np.sqrt(4 * P * R / np.pi / (E / (1 - nu**2) / 2))
    assert found["pressure"].max() == pytest.approx(2 * P / np.pi / a, rel=0.01)
    second = (found["pressure"] * found["area"] * found["x"] ** 2).sum()
    assert np.sqrt(4 * second / P) == pytest.approx(a, rel=0.02)  # a^2 / 4 of the half ellipse


def ironed(friction: float) -> list[Result]:
    """A stiff die of radius 0.75, pressed 0.2 mm into a block and drawn along it by 1.5 mm."""
    die = lower_disc(8, 0.75, 1, rate=0)
    block = Mesh.rectangle(5, 1.5, cells=(25, 6)).map(lambda x: x - [2, 1.5])
    study = Study(Mesh.union(die=die, block=block))
    study.add("die", elastic, cells="die", mu=100.0, K=500.0)
    study.add("block", elastic, cells="block", **RUBBER)
    study.contact("block:top", "die:bottom", friction=friction)
    study.fix("block:bottom", u_x=0, u_y=0)
    study.fix(
        "die:top",
        u_x=lambda x, t: 1.5 * max(t - 1, 0) + 0 * x[:, 0],
        u_y=lambda x, t: -0.2 * min(t, 1),
    )
    steps: list[Result] = []
    pressed = study.solve(steps=3)
    study.solve(steps=12, start=pressed, until=2.0, on_step=steps.append)
    return steps


def test_ironing_slips_at_the_coefficient_of_friction() -> None:
    steps = ironed(0.3)
    for result in steps[4:]:
        found = result.fields("contact")
        p, q = ((found[n] * found["area"]).sum() for n in ("pressure", "shear"))
        assert abs(q) == pytest.approx(0.3 * p, rel=1e-6)
    pull = [r.reaction("block:bottom") for r in steps]
    assert pull[-1]["u_x"] < -0.2 * pull[-1]["u_y"]


@pytest.mark.parametrize("order", [1, 2])
def test_a_gasket_is_pressed_until_it_touches_itself(order: int) -> None:
    study = Study(gasket(2, order))
    study.add("body", elastic, **RUBBER)
    study.contact("boundary")
    study.fix("upper", u_x=0, u_y=-0.5)
    study.fix("lower", u_x=0, u_y=0.5)
    steps: list[Result] = []
    study.solve(steps=10, on_step=steps.append)
    found = [r.fields("contact") for r in steps]
    assert found[2]["pressure"].max() < 1e-9  # not yet, nor at the corners of the arms
    pressed = found[-1]["pressure"] > 0.05
    assert pressed.sum() > 10
    x, y = (found[-1][n][pressed] for n in "xy")
    assert (x > 0.1).any()
    assert (x < -0.1).any()
    assert np.abs(y).max() < 0.2  # between the arms, on either side


def test_misspelt_names_are_told_in_one_line() -> None:
    mesh = Mesh.union(
        disc=Mesh.rectangle(1, 1, cells=(1, 1)), block=Mesh.rectangle(1, 1, cells=(1, 1))
    )
    study = Study(mesh)
    study.add("body", elastic, **RUBBER)
    with pytest.raises(
        MeshError, match=re.escape("no side 'disk:bottom' (did you mean 'disc:bottom'?)")
    ):
        study.contact("disk:bottom", "block:top")
    with pytest.raises(StudyError, match=re.escape("friction = -0.1, must be at least 0")):
        study.contact("disc:bottom", "block:top", friction=-0.1)
    study.contact("disc:bottom", "block:top", of=("v_x", "v_y"))
    with pytest.raises(StudyError, match=re.escape("no unknown 'v_x'")):
        study.solve()
    with pytest.raises(StudyError, match="the name is taken"):
        study.contact("disc:bottom", "block:top")


def test_a_union_has_the_names_of_its_parts() -> None:
    disc = Mesh.rectangle(1, 1, cells=(2, 1)).with_group("left", lambda x: x[:, 0] < 0.5)
    block = Mesh.rectangle(2, 1, cells=(3, 2), shape="triangle")
    mesh = Mesh.union(disc=disc, block=block)
    assert len(mesh.points) == 6 + 12
    assert set(mesh.groups) == {"disc", "disc:left", "block"}
    assert {"disc:bottom", "disc:boundary", "block:top"} <= set(mesh.sides)
    assert mesh.nodes("block:bottom").min() >= 6
    assert mesh.points[mesh.nodes("block:right")][:, 0].tolist() == [2.0] * 3
    with pytest.raises(MeshError, match="one number of coordinates"):
        Mesh.union(disc=disc, bar=Mesh.line(1, cells=1))
    with pytest.raises(MeshError, match="disc is str"):
        Mesh.union(disc="disc")  # type: ignore[arg-type]


@pytest.mark.parametrize("sides", [("upper:bottom", "lower:top"), ("lower:top", "upper:bottom")])
def test_bodies_that_exactly_touch_at_the_start_with_friction(sides: tuple[str, str]) -> None:
    """There sticking and slipping alternate, in load steps of any length."""
    upper = Mesh.rectangle(1, 1, cells=(3, 3)).map(lambda x: np.add(x, [0, 1]))
    lower = Mesh.rectangle(2, 1, cells=(6, 6)).map(lambda x: np.add(x, [-0.5, 0]))
    study = Study(Mesh.union(upper=upper, lower=lower))
    study.add("body", material="neo_hooke", mu=1.0, kappa=3.0)
    study.contact(*sides, friction=0.3)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.fix("upper:top", u_x=0, u_y=-0.02)
    result = study.solve(steps=4)
    found = result.fields("contact")
    pressed = (found["pressure"] * found["area"]).sum()
    assert pressed == pytest.approx(result.reaction("lower:bottom")["u_y"], rel=1e-3)
