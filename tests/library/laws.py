"""Benchmarks of materials."""

from __future__ import annotations

from typing import Any

import numpy as np

from softehl import Mesh, Study
from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []


def uniaxial(material: str, stretch: float, steps: int = 4, **parameters: Any) -> float:
    """Nominal stress of a bar that is stretched and free at its sides."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("bar", material=material, **parameters)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0, u_z=0)
    study.fix((0.0, 1.0, 0.0), u_z=0)
    study.fix("right", u_x=stretch - 1)
    return study.solve(steps=steps).reaction("right")["u_x"]


BENCHMARKS.append(
    Benchmark(
        "hencky",
        "tension to twice the length: nominal stress E ln(2) / 2, E = 1, nu = 0.3",
        float(np.log(2) / 2),
        1e-9,
        "closed form",
        lambda: uniaxial("hencky", 2.0, mu=1 / 2.6, kappa=1 / 1.2),
    )
)
