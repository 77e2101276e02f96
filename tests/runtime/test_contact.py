"""Contact: rigid obstacles, bodies in the plane, faces in space and of rings."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.contact.rigid_obstacles import (
    contact_block,
    inner_cylinder,
    outer_cylinder,
    plane,
    tributary_areas,
)
from softehl.runtime.contact.search import ContactProblem
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.results.result import Result
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged
from tests.runtime.springs import Spring
from tests.runtime.touching_bodies import (
    elastic,
    extruded,
    force,
    gasket,
    half_space,
    lower_disc,
)

# --- Obstacles, tributary areas and the data of contact elements ----------------------------------


POINTS = np.array([[0.0, 25.0], [0.3, 25.1], [0.9, 25.4], [1.0, 26.0]])
SEGMENTS = np.array([[0, 1], [1, 2], [2, 3]])


@pytest.mark.parametrize(
    ("obstacle", "expected"),
    [
        (inner_cylinder("rod", 25.05), [-0.05, 0.05, 0.35, 0.95]),
        (outer_cylinder("bore", 25.5), [0.5, 0.4, 0.1, -0.5]),
        (plane("left", 0.2, faces=1), [-0.2, 0.1, 0.7, 0.8]),
        (plane("right", 0.95, faces=-1), [0.95, 0.65, 0.05, -0.05]),
    ],
)
def test_gap_is_positive_in_free_space(obstacle: object, expected: list[float]) -> None:
    assert obstacle.gap(POINTS) == pytest.approx(expected)  # type: ignore[attr-defined]


def test_a_plane_faces_one_way() -> None:
    with pytest.raises(ValueError, match="must be 1 or -1"):
        plane("wall", 0.0, faces=0)


def test_areas_add_up_to_the_surface_of_the_cones() -> None:
    ends = POINTS[SEGMENTS]
    slant = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    surface = np.pi * (ends[:, :, 1].sum(axis=1) * slant).sum()
    assert tributary_areas(POINTS, SEGMENTS, np.arange(4)).sum() == pytest.approx(
        surface, rel=1e-14
    )


def test_area_is_the_integral_of_the_shape_function() -> None:
    s, weights = np.polynomial.legendre.leggauss(4)
    shape, radius = 0.5 * (1 - s), 25.0 * 0.5 * (1 - s) + 25.1 * 0.5 * (1 + s)
    length = np.hypot(0.3, 0.1)
    exact = 2.0 * np.pi * 0.5 * length * (weights * shape * radius).sum()
    assert tributary_areas(POINTS, SEGMENTS, np.array([0])) == pytest.approx([exact], rel=1e-14)


def test_contact_elements_carry_normal_position_area_and_stiffness() -> None:
    nodes, multipliers = np.array([1, 2]), np.array([20, 21])
    block = contact_block(
        plane("wall", 2.0, faces=-1), Spring(), POINTS, (nodes, SEGMENTS, multipliers), 3.66
    )
    assert block.name == "wall"
    assert block.dofs.tolist() == [[2, 3, 20], [4, 5, 21]]
    assert block.data is not None
    assert block.data[:, :3].tolist() == [[-1.0, 0.0, -2.0]] * 2
    areas = tributary_areas(POINTS, SEGMENTS, nodes)
    assert block.data[:, 3] == pytest.approx(areas)
    assert block.data[:, 4] == pytest.approx(3.66 * 2 * np.pi * POINTS[nodes, 1] / areas)


# --- Contact of deformable bodies: patch, tangent, Hertz, rolling, ironing, a side with itself ----


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


# --- Contact in space and of rings: patch, tangent, friction, a side with itself, Hertz, ----------


Kinds = tuple[str, str]
"""Cells of the upper and of the lower body."""
CELLS: dict[str, Any] = {
    "hex8": ("hex", 1),
    "hex20": ("serendipity", 2),
    "hex27": ("hex", 2),
    "tet4": ("tetrahedron", 1),
    "tet10": ("tetrahedron", 2),
}
"""Shape and order."""


def box(cell: str, cells: tuple[int, int, int]) -> Mesh:
    """The unit cube."""
    shape, order = CELLS[cell]
    return Mesh.box((1, 1, 1), cells=cells, shape=shape, order=order)


def boxes(upper: int, lower: int, kinds: Kinds) -> Mesh:
    """Two boxes, one on the other, with so many cells along the common side."""
    above, below = (box(k, (n, n, 1)) for k, n in zip(kinds, (upper, lower), strict=True))
    return Mesh.union(lower=below, upper=above.map(lambda x: np.add(x, [0, 0, 1])))


def pressed(mesh: Mesh) -> Study:
    """The upper box is pressed down by 0.1; nothing holds them aside."""
    study = Study(mesh)
    study.add("body", elastic, **RUBBER)
    study.contact("upper:bottom", "lower:top")
    study.fix("lower:bottom", u_z=0)
    study.fix("upper:top", u_z=-0.1)
    for body in ("lower", "upper"):
        study.fix(f"{body}:left", u_x=0)
        study.fix(f"{body}:front", u_y=0)
    return study


def inclined(upper: int, lower: int, kinds: Kinds, friction: float) -> Study:
    """The blocks with an interface that rises along x; nothing bulges."""

    def tilt(x: Array) -> Array:
        return x + np.outer(0.3 * x[:, 0] * (1 - np.abs(x[:, 2] - 1)), [0, 0, 1])

    study = Study(boxes(upper, lower, kinds).map(tilt))
    study.add("body", elastic, **RUBBER)
    study.contact("upper:bottom", "lower:top", friction=friction)
    study.fix("lower:bottom", u_z=0)
    study.fix("upper:top", u_z=-0.1)
    return study


TIGHT = Newton(tolerance=1e-13)
LINEAR: list[Any] = [(2, 2, ("hex8", "hex8")), (3, 2, ("hex8", "hex8")), (2, 3, ("tet4", "hex8"))]
QUADRATIC: list[Any] = [(1, 2, ("tet10", "hex20")), (2, 1, ("hex27", "tet10"))]
MORE = [(3, 2, ("hex20", "hex20")), (2, 3, ("hex27", "tet4")), (2, 3, ("hex8", "hex27"))]
FEW = [LINEAR[2], QUADRATIC[0]]
REST = [pair for pair in (*LINEAR, *QUADRATIC, *MORE) if pair not in FEW]
PAIRS = [*FEW, *(pytest.param(*pair, marks=pytest.mark.slow) for pair in REST)]


@pytest.mark.parametrize(("upper", "lower", "kinds"), PAIRS)
def test_a_uniform_pressure_passes_between_faces(upper: int, lower: int, kinds: Kinds) -> None:
    result = pressed(boxes(upper, lower, kinds)).solve(newton=TIGHT)
    pressure = result.fields("contact")["pressure"]
    assert np.ptp(pressure) < 1e-10 * pressure.max()
    assert result.reaction("lower:bottom")["u_z"] == pytest.approx(force(result), rel=1e-10)


@pytest.mark.parametrize(
    ("upper", "lower", "kinds"), [FEW[0], pytest.param(*FEW[1], marks=pytest.mark.slow)]
)
def test_a_uniform_stress_passes_where_the_interface_is_inclined(
    upper: int, lower: int, kinds: Kinds
) -> None:
    """Friction holds the slope of 0.3, whose shear is no more than 0.5 of the pressure."""
    study = inclined(upper, lower, kinds, 0.5)
    for body in ("lower", "upper"):
        study.fix(f"{body}:left", u_x=0)
        study.fix(f"{body}:front", u_y=0)
    found = study.solve(newton=TIGHT).fields("contact")
    for name in ("pressure", "shear_x", "shear_y", "shear_z"):
        assert np.ptp(found[name]) < 1e-10 * found["pressure"].max()
    shear = np.array([found[f"shear_{c}"].mean() for c in "xyz"])
    assert np.linalg.norm(shear) > 0.1 * found["pressure"].max()
    assert np.linalg.norm(shear) < 0.5 * found["pressure"].max()


CURVED = [(("hex20", "tet10"), 0.02), (("tet10", "hex27"), 5.0)]
MIXED: list[Any] = [(("hex8", "tet4"), 0.02), (("tet4", "hex8"), 5.0)]


@pytest.mark.parametrize(
    ("kinds", "friction"), [*MIXED, *(pytest.param(*c, marks=pytest.mark.slow) for c in CURVED)]
)
def test_the_tangent_of_faces_is_the_derivative(kinds: Kinds, friction: float) -> None:
    """All points press, and stick or slip far from the limit: none changes in a difference."""

    def bent(x: Array) -> Array:
        up = 0.1 * x[:, 0] ** 2 + 0.05 * x[:, 0] * x[:, 1]
        return x + np.outer(up * (1 - np.abs(x[:, 2] - 1)), [0, 0, 1])

    curved = kinds in dict(CURVED)
    mesh = boxes(2, 3, kinds)
    study = Study(mesh.map(bent) if curved else mesh)
    study.add("body", elastic, **RUBBER)
    study.contact("upper:bottom", "lower:top", friction=friction)
    study.fix("lower:bottom", u_x=0, u_y=0, u_z=0)
    study.fix("upper:top", u_x=0.03, u_y=0.02, u_z=-0.1)
    result = study.solve(steps=2)
    assert result.residual_norms[-1] < 1e-8
    slide = 0.05 if friction < 1.0 else 0.0
    assert max(off_tangent(result, slide, seed) for seed in (1, 2, 3)) < 1e-8


def off_tangent(result: Result, slide: float, seed: int) -> float:
    """Relative difference between the tangent near a result and differences of residuals.

    slide: of the whole upper body along (3, 2, 0) since the result, from which slip counts.
    """
    system, rng = result.system, np.random.default_rng(seed)
    problem = system.problem(system.quasi_static_step(1.0, result.x, {}))
    x = result.x.copy()
    for name in ("u_x", "u_y", "u_z"):
        part = system.numbering.layout.part(name)
        x[part] += 0.002 * rng.normal(size=part.stop - part.start)
    upper = system.mesh.nodes("upper:boundary")
    for name, share in (("u_x", 3.0), ("u_y", 2.0)):
        x[system.numbering.nodal[name][upper]] += share * slide
    y = rng.normal(size=len(x))
    y[problem.fixed] = 0.0
    half, whole = (
        (problem.residual(x + h * y) - problem.residual(x - h * y)) / (2 * h) for h in (5e-7, 1e-6)
    )
    difference = (4 * half - whole) / 3
    off = np.abs(problem.linearise(x)[1] @ y - difference).max()
    return float(off / np.abs(difference).max())


def test_a_block_slides_at_the_coefficient_of_friction() -> None:
    """Along its way, in each step, wherever it is on the mesh of the other one."""
    below = Mesh.box((2, 1, 0.5), cells=(4, 2, 1))
    block = Mesh.box((0.7, 0.6, 0.3), cells=(2, 1, 1)).map(lambda x: np.add(x, [0.2, 0.2, 0.5]))
    study = Study(Mesh.union(block=block, below=below))
    study.add("block", elastic, cells="block", mu=50.0, K=250.0)
    study.add("below", elastic, cells="below", **RUBBER)
    study.contact("block:bottom", "below:top", friction=0.3)
    study.fix("below:bottom", u_x=0, u_y=0, u_z=0)
    along, aside = ((lambda x, t, v=v: v * max(t - 1, 0) + 0 * x[:, 0]) for v in (0.8, 0.1))
    study.fix("block:top", u_x=along, u_y=aside, u_z=lambda x, t: -0.02 * min(t, 1) + 0 * x[:, 0])
    steps: list[Result] = []
    study.solve(steps=4, start=study.solve(), until=2.0, on_step=steps.append)
    way = np.array([0.8, 0.1]) / np.hypot(0.8, 0.1)
    for result in steps[1:]:
        found = result.fields("contact")
        shear = [(found[f"shear_{c}"] * found["area"]).sum() for c in "xy"]
        assert abs(way @ shear) == pytest.approx(0.3 * force(result), rel=5e-3)


@pytest.mark.slow
def test_a_section_in_space_is_pressed_until_it_touches_itself() -> None:
    flat = gasket(1, 1)
    mesh = extruded(flat, 0.3)
    study = Study(mesh)
    study.add("body", elastic, **RUBBER)
    study.contact("skin", "skin")
    study.fix("upper", u_x=0, u_y=-0.5)
    study.fix("lower", u_x=0, u_y=0.5)
    study.fix(lambda x: (x[:, 2] < 1e-9) | (x[:, 2] > 0.3 - 1e-9), u_z=0)
    plane = Study(flat)
    plane.add("body", elastic, **RUBBER)
    plane.contact("boundary")
    plane.fix("upper", u_x=0, u_y=-0.5)
    plane.fix("lower", u_x=0, u_y=0.5)
    results = [s.solve(steps=10) for s in (study, plane)]
    reaction, expected = (r.reaction("upper")["u_y"] for r in results)
    assert reaction / 0.3 == pytest.approx(expected, rel=0.01)
    assert force(results[0]) / 0.3 > 0.05 * abs(expected)


def fine(s: Array) -> Array:
    """[0, 1] to itself, even steps about zero, then longer ones."""
    return 0.04 * s + 0.96 * s**3


@pytest.mark.slow
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


@pytest.mark.slow
def test_hertz_of_a_sphere_in_space() -> None:
    """A quarter of a sphere on a block, 5 and 4 quadratic cells along 1.3 times the radius of the
    contact: peak and radius within 2 %.
    """
    E, nu, R, L = 1000.0, 0.3, 10.0, 5.0

    def along(cells: int) -> Array:
        """Ends of cells: even ones up to 0.6, then two that grow up to L."""
        return np.concatenate([np.linspace(0, 0.6, cells + 1), [1.9, L]])

    def at(s: Array, ends: Array) -> Array:
        return np.interp(s * (len(ends) - 1), np.arange(len(ends)), ends)

    def sphere(x: Array) -> Array:
        X, Y = at(x[:, 0], along(5)), at(x[:, 1], along(5))
        z = R - np.sqrt(R**2 - X**2 - Y**2)
        return np.stack([X, Y, z + (1 - z / L) * at(x[:, 2], deep)], axis=1)

    def block(x: Array) -> Array:
        flat = (at(x[:, k], along(4)) for k in (0, 1))
        return np.stack([*flat, -at(1 - x[:, 2], deep)], axis=1)

    deep = np.array([0.0, 0.25, 1.1, L])
    upper, lower = box("hex20", (7, 7, 3)).map(sphere), box("hex20", (6, 6, 3)).map(block)
    study = Study(Mesh.union(sphere=upper, block=lower))
    study.add("body", elastic, mu=E / 2 / (1 + nu), K=E / 3 / (1 - 2 * nu))
    study.contact("sphere:bottom", "block:top")
    study.fix("block:bottom", u_x=0, u_y=0, u_z=0)
    study.fix("sphere:top", u_x=0, u_y=0, u_z=-0.02)
    for body in ("sphere", "block"):
        study.fix(f"{body}:left", u_x=0)
        study.fix(f"{body}:front", u_y=0)
    result = study.solve()
    P, found = 4 * force(result), result.fields("contact")
    a = (3 * P * R / 4 / (E / (1 - nu**2) / 2)) ** (1 / 3)
    assert result.reaction("block:bottom")["u_z"] == pytest.approx(P / 4, rel=1e-3)
    assert found["pressure"].max() == pytest.approx(3 * P / 2 / np.pi / a**2, rel=0.02)
    second = 4 * (found["pressure"] * found["area"] * (found["x"] ** 2 + found["y"] ** 2)).sum()
    assert np.sqrt(2.5 * second / P) == pytest.approx(a, rel=0.02)


def test_faces_of_higher_order_are_refused() -> None:
    cube = Mesh.box((1, 1, 1), cells=(1, 1, 1), order=3)
    study = Study(Mesh.union(lower=cube, upper=cube.map(lambda x: np.add(x, [0, 0, 1]))))
    study.add("body", elastic, **RUBBER)
    words = "quad16 cannot touch; tri3, quad4, tri6, quad8, quad9 can"
    with pytest.raises(StudyError, match=words):
        study.contact("upper:bottom", "lower:top")
