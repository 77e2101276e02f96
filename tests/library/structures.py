"""Benchmarks of trusses, cables, beams, plates, shells and membranes."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from softehl import Mesh, Result, Study
from softehl.runtime.arrays import Array, Flags, Integers
from tests.library.benchmark import Benchmark, Convergence

BENCHMARKS: list[Benchmark] = []


def truss_of_von_mises() -> float:
    """Largest force of a shallow truss, by its symmetric half, over E A."""
    a, h = 10.0, 1.0
    study = Study(
        Mesh(np.array([[0.0, 0, 0], [a, h, 0]]), {"line2": np.array([[0, 1]], dtype=np.int64)})
    )
    study.add("bar", element="truss", E=1.0, A=1.0)
    study.fix((0, 0, 0), u_x=0, u_y=0, u_z=0)
    study.fix((a, h, 0), u_x=0, u_z=0)
    study.load((a, h, 0), u_y=-1e-3)
    path = study.follow(step=0.02, until=lambda r: r.at((a, h, 0))["u_y"] < -1.5)
    return float(path.limits[0].t * 1e-3)


def _limit_of_truss() -> float:
    """Closed form: the largest E A ln(l / L) L / l (h - v) / l over v."""
    a, h = 10.0, 1.0
    v = np.linspace(0, 1, 2_000_001)
    L, length = np.hypot(a, h), np.hypot(a, h - v)
    return float(np.max(-np.log(length / L) * L / length * (h - v) / length))


BENCHMARKS.append(
    Benchmark(
        "truss",
        "limit load of the shallow truss of von Mises, 10 x 1, over E A",
        _limit_of_truss(),
        1e-6,
        "closed form",
        truss_of_von_mises,
    )
)


def line(count: int, length: float, dimension: int = 3) -> Mesh:
    """A straight line along x."""
    points = np.zeros((count + 1, dimension))
    points[:, 0] = np.linspace(0.0, length, count + 1)
    pairs = np.arange(count)[:, None] + np.array([0, 1])
    return Mesh(points, {"line2": pairs})


def half_circle(count: int = 64) -> float:
    """Height of the tip of a cantilever of length pi in bending by EI."""
    study = Study(line(count, np.pi, dimension=2))
    study.add("beam", element="beam2d_reissner", EA=1e4, GA=1e4, EI=1.0)
    study.fix((0.0, 0.0), u_x=0, u_y=0, theta=0)
    study.load((np.pi, 0.0), theta=1.0)
    return float(study.solve(steps=5).at((np.pi, 0.0))["u_y"])


BENCHMARKS.append(
    Benchmark(
        "beam2d_reissner",
        "cantilever bent to a half circle by an end moment, 64 elements: height of tip",
        2.0,
        2e-4,
        "closed form",
        half_circle,
    )
)


def one_beam() -> float:
    """Deflection of the tip of a cantilever of one element, at 30 degrees, across it."""
    tip = (10 * np.cos(np.pi / 6), 10 * np.sin(np.pi / 6))
    study = Study(Mesh(np.array([[0.0, 0.0], tip]), {"line2": np.array([[0, 1]])}))
    study.add("beam", element="beam2d_timoshenko", EA=1e3, GA=50.0, EI=100.0)
    study.fix((0.0, 0.0), u_x=0, u_y=0, theta=0)
    study.load(tip, u_x=-np.sin(np.pi / 6), u_y=np.cos(np.pi / 6))
    at = study.solve().at(tip)
    return float(-np.sin(np.pi / 6) * at["u_x"] + np.cos(np.pi / 6) * at["u_y"])


BENCHMARKS.append(
    Benchmark(
        "beam2d_timoshenko",
        "cantilever of one element, P = 1, l = 10, EI = 100, GA = 50: P l^3 / (3 EI) + P l / GA",
        1000 / 300 + 10 / 50,
        1e-10,
        "closed form",
        one_beam,
    )
)


def sag(count: int = 40) -> float:
    """Sag of an elastic cable with supports at one height."""
    span, unstretched, weight, EA = 100.0, 110.0, 0.1, 500.0
    study = Study(line(count, span))
    ratio = unstretched / span
    study.add("cable", element="cable", EA=EA, weight=weight, ratio=ratio, slack=1e-6)
    for x in (0.0, span):
        study.fix((x, 0.0, 0.0), u_x=0, u_y=0)
    study.fix(lambda x: x[:, 2] == 0, u_z=0)
    study.start(
        lambda x: (x[:, 0] > 0) & (x[:, 0] < span), u_y=lambda x: x[:, 0] * (x[:, 0] - span) / 70
    )
    return float(-study.solve(until=0.0).at((span / 2, 0.0, 0.0))["u_y"])


def _elastic_catenary() -> float:
    """Sag by Irvine: H from the span, then the height at half the unstretched length."""
    span, L, w, EA = 100.0, 110.0, 0.1, 500.0

    def half(H: float) -> float:
        return float(H * (L / 2) / EA + H / w * np.arcsinh(w * L / 2 / H))

    H = float(brentq(lambda H: half(H) - span / 2, 0.1, 100.0, xtol=1e-14))
    V = w * L / 2
    return float(V**2 / (2 * EA * w) + H / w * (np.sqrt(1 + (V / H) ** 2) - 1))


BENCHMARKS.append(
    Benchmark(
        "cable",
        "elastic catenary, 40 elements: sag [mm]",
        _elastic_catenary(),
        2e-3,
        "Irvine (1981), closed form",
        sag,
    )
)


def plate(thickness: float, count: int) -> float:
    """Deflection w D / (p a^4) of a simply supported square plate of length 1, by a quarter."""
    E, nu, p = 1.0, 0.3, 1.0
    study = Study(Mesh.rectangle(0.5, 0.5, cells=(count, count)))
    study.add("plate", element="plate_mitc4", E=E, nu=nu, t=thickness, p=p)
    study.fix("left", w=0, theta_y=0)
    study.fix("bottom", w=0, theta_x=0)
    study.fix("right", theta_x=0)
    study.fix("top", theta_y=0)
    D = E * thickness**3 / (12 * (1 - nu**2))
    return float(study.solve(until=1.0).at((0.5, 0.5))["w"] * D)


for thickness, published in ((0.001, 0.0040624), (0.1, 0.0042728)):
    BENCHMARKS.append(
        Benchmark(
            "plate_mitc4",
            f"simply supported square plate, t / a = {thickness}, 32 x 32 cells: w D / (p a^4)",
            published,
            5e-4,
            "series of Navier",
            partial(plate, thickness, 16),
        )
    )


def arc(component: str) -> float:
    """Place of the tip of a 45-degree cantilever of radius 100, section 1 x 1, force 600."""
    angle = np.linspace(0.0, np.pi / 4, 9)
    points = np.stack([100 * np.sin(angle), 0 * angle, 100 * (1 - np.cos(angle))], axis=1)
    study = Study(Mesh(points, {"line2": np.arange(8)[:, None] + np.array([0, 1])}))
    E, G = 1e7, 5e6
    stiffness: dict[str, Any] = {"EA": E, "GA_1": G, "GA_2": G, "EI_1": E / 12, "EI_2": E / 12}
    study.add("beam", element="beam3d_simo", **stiffness, GJ=G / 6, a_x=0, a_y=1, a_z=0)
    study.fix((0.0, 0.0, 0.0), u_x=0, u_y=0, u_z=0, w_x=0, w_y=0, w_z=0)
    study.load(tuple(points[-1]), u_y=600.0)
    tip = study.solve(steps=8).at(tuple(points[-1]))
    return float(points[-1]["xyz".index(component)] + tip[f"u_{component}"])


for component, published in (("z", 15.79), ("x", 47.23), ("y", 53.37)):
    BENCHMARKS.append(
        Benchmark(
            "beam3d_simo",
            f"45-degree arc of radius 100, 8 elements, force 600: tip along {component}",
            published,
            6e-3,
            "Simo and Vu-Quoc (1986)",
            partial(arc, component),
        )
    )


def shell(mesh: Mesh, normal: Array, **given: Any) -> Study:
    """Study of a shell with directors (n, 3) at its nodes."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    study = Study(mesh)
    data: dict[str, Any] = {f"n_{c}": normal[:, k] for k, c in enumerate("xyz")}
    data |= {f"a_{c}": first[:, k] for k, c in enumerate("xyz")}
    load: dict[str, Any] = {"q_x": 0.0, "q_y": 0.0, "q_z": 0.0}
    study.add("shell", element="shell_mitc4", **data, **{**load, **given})
    return study


def surface(n: int, place: Callable[[Array], Array]) -> Mesh:
    """n x n cells on a surface: places of points of the unit square."""
    flat = Mesh.rectangle(1.0, 1.0, cells=(n, n))
    return Mesh(place(flat.points), flat.cells)


def roof(n: int = 16) -> float:
    """Deflection of the middle of a free edge, a quarter; x along the axis, z upwards."""
    radius, half, angle, scale = 25.0, 25.0, np.radians(40), 1e-6

    def place(s: Array) -> Array:
        a = angle * s[:, 1]
        return np.stack([half * s[:, 0], radius * np.sin(a), radius * np.cos(a)], axis=1)

    mesh = surface(n, place)
    normal = mesh.points * [0, 1, 1] / radius
    study = shell(mesh, normal, E=4.32e8, nu=0.0, t=0.25, q_z=-90.0 * scale)
    middle = lambda x: np.isclose(x[:, 0], 0)  # noqa: E731
    study.fix(middle, u_x=0)
    study.fix(lambda x: np.isclose(x[:, 0], half), u_y=0, u_z=0)
    study.fix(lambda x: np.isclose(x[:, 1], 0), u_y=0)
    _symmetric(study, normal, middle, 0)
    _symmetric(study, normal, lambda x: np.isclose(x[:, 1], 0), 1)
    edge = place(np.array([[0.0, 1.0]]))[0]
    return float(-study.solve().at(tuple(edge))["u_z"] / scale)


def _symmetric(study: Study, normal: Array, where: Callable[[Array], Flags], axis: int) -> None:
    """No rotation of the director out of a plane of symmetry, whose normal is a or n x a."""
    nodes = np.flatnonzero(where(study.mesh.points))
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])[nodes]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal[nodes], first)
    for k in range(len(nodes)):
        # the director moves along turn x n: theta_1 a x n + theta_2 (n x a) x n
        moves = np.array(
            [np.cross(first[k], normal[nodes[k]]), np.cross(second[k], normal[nodes[k]])]
        )
        which = int(np.abs(moves[:, axis]).argmax())
        assert abs(moves[1 - which, axis]) < 1e-9
        study.fix(tuple(study.mesh.points[nodes[k]]), **{f"theta_{which + 1}": 0})


BENCHMARKS.append(
    Benchmark(
        "shell_mitc4",
        "roof of Scordelis and Lo, 16 x 16 cells a quarter: deflection of the free edge",
        0.3024,
        1.5e-2,
        "MacNeal and Harder (1985)",
        roof,
    )
)


def cylinder(n: int = 32) -> float:
    """Deflection under the load of a pinched cylinder with end diaphragms, an eighth."""
    radius, half, scale = 300.0, 300.0, 1e-3

    def place(s: Array) -> Array:
        a = np.pi / 2 * s[:, 1]
        return np.stack([half * s[:, 0], radius * np.sin(a), radius * np.cos(a)], axis=1)

    mesh = surface(n, place)
    normal = mesh.points * [0, 1, 1] / radius
    study = shell(mesh, normal, E=3e6, nu=0.3, t=3.0)
    study.fix(lambda x: np.isclose(x[:, 0], half), u_y=0, u_z=0)
    for axis in range(3):
        where = lambda x, axis=axis: np.isclose(x[:, axis], 0, atol=1e-9)  # noqa: E731
        study.fix(where, **{f"u_{'xyz'[axis]}": 0})
        _symmetric(study, normal, where, axis)
    study.load((0.0, 0.0, radius), u_z=-0.25 * scale)
    return float(-study.solve().at((0.0, 0.0, radius))["u_z"] / scale)


SPHERE = 10.0
"""Radius of the hemisphere."""


def pinched_hemisphere(n: int, force: float) -> Study:
    """A quarter of a hemisphere with a hole of 18 degrees: outward forces along x, inward along y.

    force: of a whole hemisphere, half of which acts on the quarter.
    """

    def place(s: Array) -> Array:
        a, b = np.pi / 2 * s[:, 0], np.radians(72) * s[:, 1]
        return SPHERE * np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)

    mesh = surface(n, place)
    normal = mesh.points / SPHERE
    study = shell(mesh, normal, E=6.825e7, nu=0.3, t=0.04)
    for axis in (0, 1):
        where = lambda x, axis=axis: np.isclose(x[:, axis], 0, atol=1e-9)  # noqa: E731
        study.fix(where, **{f"u_{'xyz'[axis]}": 0})
        _symmetric(study, normal, where, axis)
    study.fix((SPHERE, 0.0, 0.0), u_z=0)
    study.load((SPHERE, 0.0, 0.0), u_x=force / 2)
    study.load((0.0, SPHERE, 0.0), u_y=-force / 2)
    return study


def hemisphere(n: int = 16) -> float:
    """Deflection under the loads of a hemisphere with a hole of 18 degrees, a quarter."""
    scale = 1e-3
    result = pinched_hemisphere(n, 2 * scale).solve()
    return float(result.at((SPHERE, 0.0, 0.0))["u_x"] / scale)


BENCHMARKS += [
    Benchmark(
        "shell_mitc4",
        "pinched cylinder with diaphragms, 32 x 32 cells an eighth: deflection under the load",
        1.8248e-5,
        3e-2,
        "MacNeal and Harder (1985)",
        cylinder,
        slow=True,
    ),
    Benchmark(
        "shell_mitc4",
        "hemisphere with a hole of 18 degrees, 16 x 16 cells a quarter: deflection of a load",
        0.0940,
        2e-2,
        "MacNeal and Harder (1985)",
        hemisphere,
        slow=True,
    ),
]


@cache
def hemisphere_path(n: int = 32) -> Array:
    """Parts of a force of 400, and the displacements of the loads: inwards, outwards."""
    rows: list[list[float]] = []

    def record(result: Result) -> None:
        inwards = -result.at((0.0, SPHERE, 0.0))["u_y"]
        rows.append([result.t, inwards, result.at((SPHERE, 0.0, 0.0))["u_x"]])

    pinched_hemisphere(n, 400.0).solve(steps=20, on_step=record)
    return np.array(rows)


@cache
def slit_plate(radial: int, around: int) -> tuple[Study, Integers]:
    """A ring of radii 6 and 10, slit along the x axis, clamped on one side of it and lifted on the
    other by a line force of 0.8; and the inner and the outer corner that are lifted.
    """
    flat = Mesh.rectangle(1.0, 1.0, cells=(around, radial))
    a, r = 2 * np.pi * flat.points[:, 0], 6 + 4 * flat.points[:, 1]
    points = np.stack([r * np.cos(a), r * np.sin(a), 0 * a], axis=1)
    mesh = Mesh(points, flat.cells, sides=flat.sides)
    study = shell(mesh, np.tile([0.0, 0.0, 1.0], (len(points), 1)), E=21e6, nu=0.0, t=0.03)
    study.fix("left", u_x=0, u_y=0, u_z=0, theta_1=0, theta_2=0)
    study.load("right", u_z=0.8)
    end = flat.nodes("right")
    return study, end[np.argsort(r[end])[[0, -1]]]


def slit_plate_path(radial: int = 10, around: int = 80) -> Array:
    """Parts of the line force, and the deflections of the inner and the outer corner."""
    study, corners = slit_plate(radial, around)
    rows: list[list[float]] = []
    study.solve(steps=40, on_step=lambda s: rows.append([s.t, *s.values("u_z")[corners]]))
    return np.array(rows)


def on_path(path: Callable[[], Array], column: int, share: float) -> float:
    """A displacement at a part of the load, between the steps by a spline."""
    rows = path()
    return float(CubicSpline(rows[:, 0], rows[:, column])(share))


LARGE_ROTATIONS: list[tuple[str, Callable[[], Array], int, str, dict[float, float]]] = [
    (
        "hemisphere with a hole of 18 degrees, 32 x 32 cells a quarter, F = {:.3g}",
        hemisphere_path,
        1,
        "inward displacement",
        {0.25: 3.833, 0.5: 5.902, 1.0: 8.178},
    ),
    (
        "hemisphere with a hole of 18 degrees, 32 x 32 cells a quarter, F = {:.3g}",
        hemisphere_path,
        2,
        "outward displacement",
        {0.25: 2.596, 0.5: 3.406, 1.0: 4.067},
    ),
    (
        "slit ring of radii 6 and 10, 10 x 80 cells, line force {:.3g}",
        slit_plate_path,
        1,
        "deflection at radius 6",
        {0.2: 6.725, 0.5: 10.468, 1.0: 13.891},
    ),
    (
        "slit ring of radii 6 and 10, 10 x 80 cells, line force {:.3g}",
        slit_plate_path,
        2,
        "deflection at radius 10",
        {0.2: 9.160, 0.5: 13.768, 1.0: 17.528},
    ),
]
"""Problem, path, its column, what it is, and part of the load -> displacement as published."""
for problem, path, column, what, values in LARGE_ROTATIONS:
    largest = 400.0 if path is hemisphere_path else 0.8
    for share, value in values.items():
        BENCHMARKS.append(
            Benchmark(
                "shell_mitc4",
                f"{problem.format(share * largest)}: {what}",
                value,
                1.5e-2,
                "Sze, Liu and Lo (2004)",
                partial(on_path, path, column, share),
                slow=True,
            )
        )


def sphere(n: int = 8) -> float:
    """Pressure p R / (2 mu t) of a sphere at 1.3 times its radius, an eighth."""
    stretch, s = 1.3, np.tan(np.pi / 4 * np.linspace(0.0, 1.0, n + 1))
    flat = Mesh.rectangle(1.0, 1.0, cells=(n, n))
    a, b = np.interp(flat.points.T, np.linspace(0.0, 1.0, n + 1), s)
    first = np.stack([1 + 0 * a, a, b], axis=1) / np.sqrt(1 + a**2 + b**2)[:, None]
    points = np.concatenate([first, np.roll(first, 1, 1), np.roll(first, 2, 1)])
    cells = np.concatenate([flat.cells["quad4"] + k * len(first) for k in range(3)])
    _, kept, place = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    study = Study(Mesh(points[kept], {"quad4": place.reshape(-1)[cells]}))
    p = 2 * (1 / stretch - stretch**-7)
    study.add("skin", element="membrane", mu=1.0, t=1.0, slack=1e-6, p=p)
    for k, c in enumerate("xyz"):
        where = lambda x, k=k: np.isclose(x[:, k], 0)  # noqa: E731
        study.fix(where, **{f"u_{c}": 0})
        study.start(**{f"u_{c}": lambda x, k=k: 0.25 * x[:, k]})
    result = study.solve(until=0.0)
    return float(1 + result.at((1.0, 0.0, 0.0))["u_x"])


def wrinkled_strip(slack: float = 1e-6) -> float:
    """Moment over force and height of a strip, wrinkled up to 0.3 of its height."""
    length, strain = 0.25, 1e-4
    study = Study(Mesh.rectangle(length, 1.0, cells=(8, 40)).map(lift))
    study.add("strip", element="membrane", mu=1.0, t=1.0, p=0.0, slack=slack)
    study.fix(lambda x: x[:, 2] == 0, u_z=0)
    study.fix(lambda x: np.isclose(x[:, 0], 0), u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0)

    def edge(x: Array) -> Flags:
        return np.isclose(x[:, 0], length)

    study.fix(edge, u_x=lambda x, t: t * strain * length * (x[:, 1] - 0.3))
    result = study.solve(steps=4)
    heights = np.linspace(0.0, 1.0, 41)
    forces = []
    for y in heights:
        here = lambda x, y=y: edge(x) & np.isclose(x[:, 1], y)  # noqa: E731
        forces.append(float(result.reaction(here)["u_x"]))
    return float(np.dot(forces, heights - 0.5) / np.sum(forces))


def lift(x: Array) -> Array:
    """Points of a plane in space."""
    return np.column_stack([x, np.zeros(len(x))])


BENCHMARKS += [
    Benchmark(
        "membrane",
        "sphere under the pressure 2 mu t / R (1 / 1.3 - 1.3^-7), 3 x 8 x 8 cells an eighth: "
        "stretch",
        1.3,
        5e-3,
        "closed form",
        sphere,
    ),
    Benchmark(
        "membrane",
        "bent strip, wrinkled up to 0.3 of its height, 8 x 40 cells: moment by force and height",
        1 / 6 + 0.3 / 3,
        5e-3,
        "Stein and Hedgepeth (1961), closed form",
        wrinkled_strip,
    ),
]


def curved(n: int, length: float, radius: float, angle: float, thickness: float) -> Mesh:
    """n x n cells of a part of a cylinder along x, one through its thickness."""

    def place(s: Array) -> Array:
        r, a = radius + (s[:, 2] - 0.5) * thickness, angle * s[:, 1]
        return np.stack([length * s[:, 0], r * np.sin(a), r * np.cos(a)], axis=1)

    return Mesh.box((1.0, 1.0, 1.0), cells=(n, n, 1)).map(place)


def solid_roof(n: int = 16) -> float:
    """Deflection of the middle of a free edge, a quarter, by solid shells: mean of two nodes."""
    scale, angle, t = 1e-6, np.radians(40), 0.25
    study = Study(curved(n, 25.0, 25.0, angle, t))
    study.add(
        "shell", element="solid_shell", E=4.32e8, nu=0.0, q_x=0.0, q_y=0.0, q_z=-90.0 / t * scale
    )
    study.fix(lambda x: np.isclose(x[:, 0], 0), u_x=0)
    study.fix(lambda x: np.isclose(x[:, 0], 25.0), u_y=0, u_z=0)
    study.fix(lambda x: np.isclose(x[:, 1], 0), u_y=0)
    result = study.solve()
    places = [(0.0, r * np.sin(angle), r * np.cos(angle)) for r in (25.0 - t / 2, 25.0 + t / 2)]
    return float(-np.mean([result.at(x)["u_z"] for x in places]) / scale)


def solid_cylinder(n: int = 32) -> float:
    """Deflection under the load of a pinched cylinder, an eighth; the mean of two nodes."""
    scale, radius, t = 1e-3, 300.0, 3.0
    study = Study(curved(n, 300.0, radius, np.pi / 2, t))
    study.add("shell", element="solid_shell", E=3e6, nu=0.3, q_x=0.0, q_y=0.0, q_z=0.0)
    study.fix(lambda x: np.isclose(x[:, 0], 300.0), u_y=0, u_z=0)
    for axis, c in enumerate("xyz"):
        where = lambda x, axis=axis: np.isclose(x[:, axis], 0, atol=1e-9)  # noqa: E731
        study.fix(where, **{f"u_{c}": 0})
    places = [(0.0, 0.0, r) for r in (radius - t / 2, radius + t / 2)]
    for x in places:
        study.load(x, u_z=-0.125 * scale)
    result = study.solve()
    return float(-np.mean([result.at(x)["u_z"] for x in places]) / scale)


def solid_strip() -> float:
    """Deflection of a strip of one layer of solid shells by a moment, over the closed form."""
    scale, E = 1e-6, 1000.0
    study = Study(Mesh.box((10.0, 1.0, 0.1), cells=(5, 1, 1)))
    study.add("strip", element="solid_shell", E=E, nu=0.3, q_x=0.0, q_y=0.0, q_z=0.0)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0, u_z=0)
    study.fix((0.0, 1.0, 0.0), u_z=0)
    study.load("right", u_x=lambda x, t: t * scale * (0.05 - x[:, 2]))
    return float(study.solve().at((10.0, 0.0, 0.0))["u_z"] / (scale * 100 / (2 * E)))


BENCHMARKS += [
    Benchmark(
        "solid_shell",
        "pure bending of a strip 10 x 1 x 0.1 of 5 cells, nu = 0.3: deflection by M l^2 / (2 E I)",
        1.0,
        1e-6,
        "closed form",
        solid_strip,
    ),
    Benchmark(
        "solid_shell",
        "roof of Scordelis and Lo, 16 x 16 x 1 cells a quarter: deflection of the free edge",
        0.3024,
        1.5e-2,
        "MacNeal and Harder (1985)",
        solid_roof,
    ),
    Benchmark(
        "solid_shell",
        "pinched cylinder with diaphragms, 32 x 32 x 1 cells an eighth: deflection under the load",
        1.8248e-5,
        3e-2,
        "MacNeal and Harder (1985)",
        solid_cylinder,
        slow=True,
    ),
]


def thin_plate(clamped: bool, count: int = 16) -> float:
    """Deflection w D / (p a^4) of a square plate of length 1, by a quarter of distorted cells."""

    def distort(x: Array) -> Array:
        s = 0.1 * np.sin(2 * np.pi * x[:, 0]) * np.sin(2 * np.pi * x[:, 1])
        return x + np.column_stack([s, -s]) * 0.5

    E, nu, t = 1.0, 0.3, 0.001
    study = Study(Mesh.rectangle(0.5, 0.5, cells=(count, count)).map(distort))
    study.add("plate", element="plate_dkq", E=E, nu=nu, t=t, p=1.0)
    study.fix("left", w=0, theta_y=0)
    study.fix("bottom", w=0, theta_x=0)
    study.fix("right", theta_x=0)
    study.fix("top", theta_y=0)
    if clamped:
        study.fix("left", theta_x=0)
        study.fix("bottom", theta_y=0)
    D = E * t**3 / (12 * (1 - nu**2))
    return float(study.solve(until=1.0).at((0.5, 0.5))["w"] * D)


for words, clamped, published, source in (
    ("simply supported", False, 0.00406235, "series of Navier"),
    ("clamped", True, 0.00126532, "Taylor and Govindjee (2004)"),
):
    BENCHMARKS.append(
        Benchmark(
            "plate_dkq",
            f"{words} square plate, 16 x 16 distorted cells a quarter: w D / (p a^4)",
            published,
            4e-3,
            source,
            partial(thin_plate, clamped),
        )
    )


def elastica() -> float:
    """Deflection over length of a cantilever strip of solid shells, P l^2 / (E I) = 10."""
    E, width, t, length = 1e6, 1.0, 0.1, 10.0
    force = 10 * E * width * t**3 / 12 / length**2
    study = Study(Mesh.box((length, width, t), cells=(20, 1, 1)))
    study.add("strip", element="solid_shell", E=E, nu=0.0, q_x=0.0, q_y=0.0, q_z=0.0)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.load("right", u_z=force / (width * t))
    result = study.solve(steps=10)
    return float(np.mean([result.at((length, 0.0, z))["u_z"] for z in (0.0, t)]) / length)


def _elastica(load: float = 10.0) -> float:
    """Closed form by elliptic integrals, load = P l^2 / (E I)."""
    root = np.sqrt(load)

    def start(k2: float) -> float:
        return float(np.arcsin(np.sqrt(1 / (2 * k2))))

    def excess(k2: float) -> float:
        return float(ellipk(k2) - ellipkinc(start(k2), k2) - root)

    k2 = float(brentq(excess, 0.5 + 1e-12, 1 - 1e-12, xtol=1e-15))
    return float(1 - 2 / root * (ellipe(k2) - ellipeinc(start(k2), k2)))


BENCHMARKS.append(
    Benchmark(
        "solid_shell",
        "cantilever strip, P l^2 / (E I) = 10, 20 cells: deflection by length",
        _elastica(),
        3e-3,
        "Bisshopp and Drucker (1945), closed form",
        elastica,
    )
)


def solid_hemisphere(n: int = 16) -> float:
    """Deflection under the loads of a hemisphere with a hole, a quarter, by solid shells."""
    scale, t = 1e-3, 0.04

    def place(s: Array) -> Array:
        a, b = np.pi / 2 * s[:, 0], np.radians(72) * s[:, 1]
        r = SPHERE + (s[:, 2:] - 0.5) * t
        place = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)
        return np.asarray(r * place)

    study = Study(Mesh.box((1.0, 1.0, 1.0), cells=(n, n, 1)).map(place))
    study.add("shell", element="solid_shell", E=6.825e7, nu=0.3, q_x=0.0, q_y=0.0, q_z=0.0)
    for axis, c in ((0, "x"), (1, "y")):
        where = lambda x, axis=axis: np.isclose(x[:, axis], 0, atol=1e-9)  # noqa: E731
        study.fix(where, **{f"u_{c}": 0})
    study.fix((SPHERE - t / 2, 0.0, 0.0), u_z=0)
    places = [(r, 0.0, 0.0) for r in (SPHERE - t / 2, SPHERE + t / 2)]
    for x in places:
        study.load(x, u_x=scale / 2)
        study.load((0.0, x[0], 0.0), u_y=-scale / 2)
    result = study.solve()
    return float(np.mean([result.at(x)["u_x"] for x in places]) / scale)


CONVERGENCE = [
    Convergence(entry, problem, published, tolerance, "MacNeal and Harder (1985)", run)
    for problem, published, tolerance, runs in (
        ("roof of Scordelis and Lo, a quarter", 0.3024, 1.5e-2, (roof, solid_roof)),
        (
            "pinched cylinder with diaphragms, an eighth",
            1.8248e-5,
            2e-2,
            (cylinder, solid_cylinder),
        ),
        (
            "hemisphere with a hole of 18 degrees, a quarter",
            0.0940,
            2e-2,
            (hemisphere, solid_hemisphere),
        ),
    )
    for entry, run in zip(("shell_mitc4", "solid_shell"), runs, strict=True)
]
