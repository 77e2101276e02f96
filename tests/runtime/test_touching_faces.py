"""Contact of bodies in space and of rings: patch, tangent, Hertz's sphere, what is refused."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.statement.records import StudyError
from tests.runtime.touching_bodies import elastic, force

RUBBER: dict[str, Any] = {"mu": 1.0, "K": 5.0}


def boxes(upper: int, lower: int, shapes: tuple[Any, Any], order: int = 1) -> Mesh:
    """Two boxes, one on the other, with so many cells along the common side."""
    below = Mesh.box((1, 1, 1), cells=(lower, lower, 1), shape=shapes[1], order=order)
    above = Mesh.box((1, 1, 1), cells=(upper, upper, 1), shape=shapes[0], order=order)
    return Mesh.union(lower=below, upper=above.map(lambda x: np.add(x, [0, 0, 1])))


def pressed(upper: int, lower: int, shapes: tuple[Any, Any]) -> Study:
    """The upper box is pressed down by 0.1; nothing holds them aside."""
    study = Study(boxes(upper, lower, shapes))
    study.add("body", elastic, **RUBBER)
    study.contact("upper:bottom", "lower:top")
    study.fix("lower:bottom", u_z=0)
    study.fix("upper:top", u_z=-0.1)
    for body in ("lower", "upper"):
        study.fix(f"{body}:left", u_x=0)
        study.fix(f"{body}:front", u_y=0)
    return study


def test_a_uniform_pressure_passes_between_faces() -> None:
    found = pressed(2, 2, ("hex", "hex")).solve().fields("contact")
    uniform = found["pressure"]
    assert np.ptp(uniform) < 1e-10 * uniform.max()
    # points are not where the other faces end: so much is lost where meshes do not match
    for upper, lower, shapes in ((3, 2, ("hex", "hex")), (2, 3, ("tetrahedron", "hex"))):
        result = pressed(upper, lower, shapes).solve()
        pressure = result.fields("contact")["pressure"]
        assert np.abs(pressure / uniform.mean() - 1).max() < 0.05
        assert result.reaction("lower:bottom")["u_z"] == pytest.approx(force(result), rel=1e-4)


@pytest.mark.parametrize("shapes", [("hex", "tetrahedron"), ("tetrahedron", "hex")])
def test_the_tangent_is_the_derivative(shapes: tuple[str, str]) -> None:
    result = pressed(2, 3, shapes).solve()
    system, rng = result.system, np.random.default_rng(1)
    problem = system.problem(system.still(1.0, result.x, {}))
    x = result.x.copy()
    for name in ("u_x", "u_y", "u_z"):
        part = system.numbering.layout.part(name)
        x[part] += 0.002 * rng.normal(size=part.stop - part.start)
    y = rng.normal(size=len(x))
    y[problem.fixed] = 0.0
    half, whole = (
        (problem.residual(x + h * y) - problem.residual(x - h * y)) / (2 * h) for h in (5e-7, 1e-6)
    )
    difference = (4 * half - whole) / 3
    off = np.abs(problem.linearise(x)[1] @ y - difference).max()
    assert off < 1e-8 * np.abs(difference).max()


def fine(s: Array) -> Array:
    """[0, 1] to itself, even steps about zero, then longer ones."""
    return 0.04 * s + 0.96 * s**3


def test_hertz_of_a_sphere_as_a_ring() -> None:
    """a^3 = 3 P R / (4 E*), p_max = 3 P / (2 pi a^2), about the x axis."""
    E, nu, R = 1000.0, 0.3, 10.0

    def sphere(x: Array) -> Array:
        angle, r = np.pi / 2 * fine(x[:, 0]), R * (1 - 0.7 * fine(x[:, 1]))
        return np.stack([r * np.cos(angle) - R, r * np.sin(angle)], axis=1)

    def block(x: Array) -> Array:
        return 15 * np.stack([fine(1 - x[:, 1]), fine(x[:, 0])], axis=1)

    square = Mesh.rectangle(1, 1, cells=(28, 24), order=2)
    study = Study(Mesh.union(sphere=square.map(sphere), block=square.map(block)), "axisymmetric")
    study.add("body", elastic, mu=E / 2 / (1 + nu), K=E / 3 / (1 - 2 * nu))
    study.contact("sphere:bottom", "block:top")
    study.fix("block:bottom", u_x=0, u_y=0)
    study.fix("sphere:top", u_x=0.05, u_y=0)
    study.fix("sphere:left", u_y=0)
    study.fix("block:left", u_y=0)
    result = study.solve()
    P, found = force(result), result.fields("contact")
    a = (3 * P * R / 4 / (E / (1 - nu**2) / 2)) ** (1 / 3)
    assert result.reaction("block:bottom")["u_x"] == pytest.approx(-P, rel=1e-3)
    assert found["pressure"].max() == pytest.approx(3 * P / 2 / np.pi / a**2, rel=0.01)
    second = (found["pressure"] * found["area"] * found["y"] ** 2).sum()
    assert np.sqrt(2.5 * second / P) == pytest.approx(a, rel=0.01)


@pytest.mark.parametrize(
    ("order", "sides", "given", "words"),
    [
        (1, ("upper:bottom", "lower:top"), {"friction": 0.1}, "in 3-D contact is of two sides"),
        (1, ("boundary",), {}, "without friction"),
        (2, ("upper:bottom", "lower:top"), {}, "quad9 cannot touch; tri3 and quad4 can"),
    ],
)
def test_what_space_does_not_have_is_refused(
    order: int, sides: tuple[str, ...], given: dict[str, Any], words: str
) -> None:
    study = Study(boxes(1, 1, ("hex", "hex"), order))
    study.add("body", elastic, **RUBBER)
    with pytest.raises(StudyError, match=re.escape(words)):
        study.contact(*sides, **given)
