"""Benchmarks of elements of solids."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []

INNER, OUTER, STRETCH = 1.0, 2.0, 1.5
"""Radii of a tube, and the stretch of its inner radius."""


def tube(element: str, cells: tuple[int, int], order: int, **parameters: Any) -> float:
    """Inner stretch of a tube under the pressure that stretches it to STRETCH, by a quarter."""

    def ring(x: Array) -> Array:
        r, angle = INNER + (OUTER - INNER) * x[:, 0], 0.5 * np.pi * x[:, 1]
        return np.column_stack([r * np.cos(angle), r * np.sin(angle)])

    study = Study(Mesh.rectangle(1.0, 1.0, cells=cells, order=order).map(ring))
    study.add("tube", element=element, mu=1.0, **parameters)
    study.fix("bottom", u_y=0)
    study.fix("top", u_x=0)
    study.pressure("left", _tube())
    return float(1 + study.solve(steps=10).at((INNER, 0.0))["u_x"] / INNER)


def _tube() -> float:
    """Inner pressure over mu at the stretch."""
    outer = np.sqrt(OUTER**2 + (STRETCH**2 - 1) * INNER**2) / OUTER
    return float(np.log(STRETCH / outer) + (outer**-2 - STRETCH**-2) / 2)


for entry, cells, order, tolerance, parameters in (
    ("q1p0", (16, 16), 1, 2e-3, {"kappa": 1e5}),
    ("fbar", (16, 16), 1, 2e-3, {"kappa": 1e5}),
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
