"""Benchmarks of trusses, cables, beams, plates, shells and membranes."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.optimize import brentq

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


def line(count: int, length: float, dimension: int = 3) -> Mesh:
    """A straight line along x."""
    points = np.zeros((count + 1, dimension))
    points[:, 0] = np.linspace(0.0, length, count + 1)
    pairs = np.arange(count)[:, None] + [0, 1]
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
        return H * (L / 2) / EA + H / w * np.arcsinh(w * L / 2 / H)

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
