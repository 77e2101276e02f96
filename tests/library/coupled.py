"""Benchmarks of elements of coupled fields and fluids."""

from __future__ import annotations

import numpy as np

from softehl import Mesh, Study
from tests.library.benchmark import Benchmark

BENCHMARKS: list[Benchmark] = []


def heated_bar() -> float:
    """Temperature at the middle of a bar of length 1 at t = 0.1, diffusivity 1."""
    study = Study(Mesh.rectangle(1.0, 0.1, cells=(20, 1), order=2))
    study.add("bar", element="heat", conductivity=1.0, capacity=1.0, supply=0.0)
    study.fix("left", T=lambda x, t: 1.0)
    *_, last = study.march(dt=1e-3, until=0.1, method="bdf2")
    return float(last.at((0.5, 0.05))["T"])


def _step_of_temperature(x: float, t: float) -> float:
    """Bar that is insulated at x = 1 and has 1 at x = 0 from t = 0 on."""
    k = (2 * np.arange(200) + 1) * np.pi / 2
    return float(1 - np.sum(2 / k * np.sin(k * x) * np.exp(-(k**2) * t)))


BENCHMARKS.append(
    Benchmark(
        "heat",
        "step of temperature at one end, 20 cells of order 2, 100 steps: middle at k t / l^2 = 0.1",
        _step_of_temperature(0.5, 0.1),
        1e-3,
        "Carslaw and Jaeger (1959), series",
        heated_bar,
    )
)


def consolidation() -> float:
    """Pore pressure at the closed end of a column of height 1, by the load, at T = 0.2."""
    E, nu, k = 1.0, 0.25, 1.0
    stiffness = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    study = Study(Mesh.rectangle(0.1, 1.0, cells=(1, 20), order=2))
    study.add("soil", element="biot", E=E, nu=nu, mobility=k)
    study.fix("bottom", u_y=0)
    for side in ("left", "right"):
        study.fix(side, u_x=0)
    study.fix("top", p=0)
    study.load("top", u_y=lambda x, t: -1e-3 * np.ones(len(x)))
    until = 0.2 / (stiffness * k)
    *_, last = study.march(dt=until / 200, until=until, method="euler")
    return float(last.at((0.0, 0.0))["p"] / 1e-3)


BENCHMARKS.append(
    Benchmark(
        "biot",
        "Terzaghi's column, 20 cells of order 2, 200 steps: pressure at the closed end, T = 0.2",
        1 - _step_of_temperature(1.0, 0.2),
        5e-3,
        "Terzaghi (1923), series",
        consolidation,
    )
)
