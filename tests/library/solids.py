"""Benchmarks of elements of solids."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from scipy.special import kv

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []

INNER, OUTER, STRETCH = 1.0, 2.0, 1.5
"""Radii of a tube, and the stretch of its inner radius."""


def ring(x: Array) -> Array:
    """A quarter of the ring from the unit square."""
    r, angle = INNER + (OUTER - INNER) * x[:, 0], 0.5 * np.pi * x[:, 1]
    return np.column_stack([r * np.cos(angle), r * np.sin(angle)])


def tube(element: str, cells: tuple[int, int], order: int, **parameters: Any) -> float:
    """Inner stretch of a tube under the pressure that stretches it to STRETCH, by a quarter."""

    study = Study(Mesh.rectangle(1.0, 1.0, cells=cells, order=order).map(ring))
    study.add("tube", element=element, mu=1.0, **parameters)
    study.fix("bottom", u_y=0)
    study.fix("top", u_x=0)
    study.pressure("left", _tube())
    return float(1 + study.solve(steps=10).at((INNER, 0.0))["u_x"] / INNER)


def thick_tube(n: int = 8) -> float:
    """As `tube`, by enhanced hexahedra in one layer of n x n."""
    study = Study(
        Mesh.box((1.0, 1.0, 0.2), cells=(n, n, 1)).map(
            lambda x: np.column_stack([ring(x), x[:, 2]])
        )
    )
    study.add("tube", element="q1e9", mu=1.0, kappa=1e5)
    study.fix("front", u_y=0)
    study.fix("back", u_x=0)
    study.fix("bottom", u_z=0)
    study.fix("top", u_z=0)
    study.pressure("left", _tube())
    return float(1 + study.solve(steps=10).at((INNER, 0.0, 0.0))["u_x"] / INNER)


def _tube() -> float:
    """Inner pressure over mu at the stretch."""
    outer = np.sqrt(OUTER**2 + (STRETCH**2 - 1) * INNER**2) / OUTER
    return float(np.log(STRETCH / outer) + (outer**-2 - STRETCH**-2) / 2)


for entry, cells, order, tolerance, parameters in (
    ("q1p0", (16, 16), 1, 2e-3, {"kappa": 1e5}),
    ("fbar", (16, 16), 1, 2e-3, {"kappa": 1e5}),
    ("q1e9", (16, 16), 1, 2e-3, {"kappa": 1e5}),
    ("taylor_hood", (8, 8), 2, 1e-4, {}),
):
    BENCHMARKS.append(
        Benchmark(
            entry,
            f"incompressible tube, radii 1 and 2, inner pressure {_tube():.5g} mu, "
            f"{cells[0]} x {cells[1]} cells of order {order}: inner stretch",
            STRETCH,
            tolerance,
            "closed form",
            partial(tube, entry, cells, order, **parameters),
        )
    )


BENCHMARKS.append(
    Benchmark(
        "q1e9",
        f"incompressible tube, radii 1 and 2, inner pressure {_tube():.5g} mu, 8 x 8 x 1 cells: "
        "inner stretch",
        STRETCH,
        3e-3,
        "closed form",
        thick_tube,
        slow=True,
    )
)


def cook(n: int) -> float:
    """Deflection of the middle of the loaded side of Cook's membrane, E = F = 1."""

    def tapered(x: Array) -> Array:
        return np.column_stack([x[:, 0], x[:, 1] + x[:, 0] / 48 * (44 - 28 / 44 * x[:, 1])])

    study = Study(Mesh.rectangle(48, 44, cells=(n, n)).map(tapered))
    study.add("panel", element="pian_sumihara", E=1.0, nu=1 / 3, t=1.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=1 / 16)
    return float(study.solve().at((48.0, 52.0))["u_y"])


for n, published in ((2, 21.13), (4, 23.02), (8, 23.69), (16, 23.88)):
    BENCHMARKS.append(
        Benchmark(
            "pian_sumihara",
            f"Cook's membrane, {n} x {n} cells: deflection",
            published,
            3e-4,
            "Pian and Sumihara (1984)",
            partial(cook, n),
        )
    )


def bending() -> float:
    """Deflection of a strip of one layer of cells by a moment."""
    E, nu, length = 1000.0, 0.3, 10.0
    study = Study(Mesh.rectangle(length, 1.0, cells=(5, 1)))
    study.add("strip", element="q1e4", E=E, nu=nu)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0), u_y=0)
    study.load("right", u_x=lambda x, t: t * (0.5 - x[:, 1]))
    return float(study.solve().at((length, 0.0))["u_y"])


BENCHMARKS.append(
    Benchmark(
        "q1e4",
        "pure bending in plane strain of 5 x 1 cells, 2 x 1 each: deflection M l^2 / (2 E' I)",
        (1 / 12) * 100.0 / (2 * 1000.0 / (1 - 0.3**2) / 12),
        1e-9,
        "closed form",
        bending,
    )
)


def disk() -> float:
    """Radial displacement of the inner side of a ring of thickness 2 under a pressure 1."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(8, 8), order=2).map(ring))
    study.add("disk", element="plane_stress", E=1.0, nu=0.3, t=2.0)
    study.fix("bottom", u_y=0)
    study.fix("top", u_x=0)
    for k, name in enumerate(("u_x", "u_y")):
        study.load("left", **{name: lambda x, t, k=k: 2.0 * t * x[:, k] / INNER})
    return float(study.solve().at((INNER, 0.0))["u_x"])


def strip() -> float:
    """Force of a strip of 4 x 1, thickness 2, at twice its height; its width is kept."""
    study = Study(Mesh.rectangle(4.0, 1.0, cells=(2, 1)))
    study.add("strip", element="plane_stress_neo_hooke", mu=1.0, kappa=1e5, t=2.0)
    study.fix("left", u_x=0)
    study.fix("right", u_x=0)
    study.fix("bottom", u_x=0, u_y=0)
    study.fix("top", u_x=0, u_y=1.0)
    return float(study.solve(steps=4).reaction("top")["u_y"])


BENCHMARKS += [
    Benchmark(
        "plane_stress",
        "ring, radii 1 and 2, inner pressure E, nu = 0.3, 8 x 8 cells of order 2: displacement",
        (0.7 * INNER**2 + 1.3 * OUTER**2) / (OUTER**2 - INNER**2) * INNER,
        1e-5,
        "closed form",
        disk,
    ),
    Benchmark(
        "plane_stress_neo_hooke",
        "strip of area 8 at twice its height, kappa = 1e5 mu: force, 8 mu (2 - 1 / 8)",
        8 * (2 - 1 / 8),
        2e-5,
        "Treloar (1944), closed form",
        strip,
    ),
]


def hole(N: float, length: float, nu: float = 0.3, outer: float = 60.0) -> float:
    """Largest stress at a hole of radius 1 in a plate under a tension 1.

    The displacements of the hole are u_r = A + B cos 2a, u_a = C sin 2a, so three nodes give
    the hoop strain; the stress along the free side is E / (1 - nu^2) times it.
    """

    def sector(x: Array) -> Array:
        r, angle = outer ** x[:, 0], 0.5 * np.pi * x[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle)])

    study = Study(Mesh.rectangle(1.0, 1.0, cells=(32, 8), order=2).map(sector))
    study.add("plate", element="micropolar", E=1.0, nu=nu, N=N, length=length)
    study.fix("bottom", u_y=0, phi=0)
    study.fix("top", u_x=0, phi=0)
    study.load("right", u_x=lambda x, t: t * x[:, 0] / outer)
    result = study.solve()
    at = result.at((np.sqrt(0.5), np.sqrt(0.5)))
    turned = (at["u_y"] - at["u_x"]) * np.sqrt(0.5)
    return float((result.at((0.0, 1.0))["u_y"] - 2 * turned) / (1 - nu**2))


def _hole(N: float, length: float, nu: float = 0.3) -> float:
    """Stress concentration (3 + F) / (1 + F) by Bessel functions of radius / decay length."""
    z = N / length
    F = 8 * (1 - nu) * N**2 / (4 + z**2 + 2 * z * kv(0, z) / kv(1, z))
    return float((3 + F) / (1 + F))


for N, length in ((0.5, 0.2), (0.9, 0.3), (0.9, 2.0)):
    BENCHMARKS.append(
        Benchmark(
            "micropolar",
            f"hole of radius 1 in a wide plate, nu = 0.3, N = {N}, length {length}: "
            "stress concentration",
            _hole(N, length),
            1e-3,
            "Mindlin (1963), Eringen (1966), closed form",
            partial(hole, N, length),
        )
    )


def layer() -> float:
    """Shear stress of a layer of height 1 whose sides move by 1 and do not strain."""
    study = Study(Mesh.rectangle(0.1, 1.0, cells=(1, 20), order=2))
    study.add("layer", element="strain_gradient", E=2.6, nu=0.3, length=0.1)
    study.fix(lambda x: x[:, 1] > -1.0, u_y=0)
    study.fix("bottom", u_x=0, e_xy=0)
    study.fix("top", u_x=1.0, e_xy=0)
    return float(study.solve().reaction("top")["u_x"] / 0.1)


BENCHMARKS.append(
    Benchmark(
        "strain_gradient",
        "layer in shear, height 10 lengths, no strain at its sides, 20 cells: stress over G",
        1 / (1 - 0.2 * np.tanh(5.0)),
        2e-5,
        "closed form",
        layer,
    )
)


def bending_in_space(element: str) -> float:
    """Deflection of a bar of one layer of cells by a moment."""
    study = Study(Mesh.box((10.0, 1.0, 1.0), cells=(5, 1, 1)))
    study.add("bar", element=element, E=1000.0, nu=0.3)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0, u_z=0)
    study.fix((0.0, 0.0, 1.0), u_y=0)
    study.load("right", u_x=lambda x, t: t * (0.5 - x[:, 1]))
    return float(study.solve().at((10.0, 0.0, 0.0))["u_y"])


def patch(name: str) -> float:
    """Mean of a stress in the cube of MacNeal and Harder: seven distorted cells, E = 1e6."""
    corners = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    )
    inner = [[0.249, 0.342, 0.192], [0.826, 0.288, 0.288], [0.850, 0.649, 0.263]]
    inner += [[0.273, 0.750, 0.230], [0.320, 0.186, 0.643], [0.677, 0.305, 0.683]]
    inner += [[0.788, 0.693, 0.644], [0.165, 0.745, 0.702]]
    faces = [[0, 1, 2, 3], [5, 4, 7, 6], [0, 4, 5, 1], [2, 6, 7, 3], [3, 7, 4, 0], [1, 5, 6, 2]]
    cells = [[*range(8, 16)], *([*f, *(k + 8 for k in f)] for f in faces)]
    study = Study(Mesh(np.concatenate([corners, inner]), {"hex8": np.array(cells)}))
    study.add("cube", element="pian_tong", E=1e6, nu=0.25)
    for k, component in enumerate("xyz"):
        for corner in corners:
            value = 1e-3 * (corner.sum() + corner[k]) / 2
            study.fix(tuple(corner.astype(float)), **{f"u_{component}": value})
    return float(study.solve().fields("cube")[name].max())


BENCHMARKS += [
    Benchmark(
        "pian_tong",
        "pure bending of 5 x 1 x 1 cells, 2 x 1 x 1 each: deflection M l^2 / (2 E I)",
        100.0 / (2 * 1000.0),
        1e-9,
        "closed form",
        partial(bending_in_space, "pian_tong"),
    ),
    Benchmark(
        "q1e4",
        "pure bending in space of 5 x 1 x 1 cells, nu = 0.3: deflection M l^2 / (2 E I)",
        100.0 / (2 * 1000.0),
        1e-9,
        "closed form",
        partial(bending_in_space, "q1e4"),
    ),
    Benchmark(
        "pian_tong",
        "patch test of seven cells: normal stress",
        2000.0,
        1e-9,
        "MacNeal and Harder (1985)",
        partial(patch, "sigma_xx"),
    ),
    Benchmark(
        "pian_tong",
        "patch test of seven cells: shear stress",
        400.0,
        1e-9,
        "MacNeal and Harder (1985)",
        partial(patch, "sigma_xy"),
    ),
]
