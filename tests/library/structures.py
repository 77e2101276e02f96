"""Benchmarks of trusses, cables, beams, plates, shells and membranes."""

from __future__ import annotations

import numpy as np

from softehl import Mesh, Study
from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []


def truss_of_von_mises() -> float:
    """Largest force of a shallow truss, by its symmetric half, over E A."""
    a, h = 10.0, 1.0
    study = Study(Mesh(np.array([[0.0, 0, 0], [a, h, 0]]), {"line2": np.array([[0, 1]])}))
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
