"""Benchmark of a notched plate that breaks: phase field beside Griffith's energy balance."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

from softehl import Mesh, NotConverged, Study
from softehl.runtime.arrays import Array, Flags
from tests.library.benchmark import Benchmark

LAME, SHEAR, TOUGHNESS, LENGTH = 121.15e3, 80.77e3, 2.7, 0.015
"""Steel of Miehe, Welschinger and Hofacker (2010): MPa, N/mm and mm."""
SIZE = LENGTH / 2
"""Edge of the cells along the crack."""
ELASTIC: dict[str, Any] = {
    "E": SHEAR * (3 * LAME + 2 * SHEAR) / (LAME + SHEAR),
    "nu": LAME / (2 * (LAME + SHEAR)),
}


def growing(start: float, end: float) -> Array:
    """Points from start to end at steps that grow from SIZE by a quarter, to 0.08."""
    steps = [SIZE]
    while sum(steps) < abs(end - start):
        steps.append(min(1.25 * steps[-1], 0.08))
    x = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(start + (end - start) * x / x[-1])


def along_crack() -> Array:
    """Places of the nodes along x: of one distance from 0.47 on, with one at 0.5."""
    x = np.concatenate([growing(0.47, 0.0)[:0:-1], np.linspace(0.47, 1.0, round(0.53 / SIZE) + 1)])
    x[np.abs(x - 0.5).argmin()] = 0.5
    return x


def notched(tip: float) -> Mesh:
    """Square of edge 1 mm with a slit at half its height, from the left side to x = tip."""
    x, band = along_crack(), 3 * LENGTH
    up = np.concatenate([np.linspace(0.0, band, round(band / SIZE) + 1)[:-1], growing(band, 0.5)])
    X, Y = np.meshgrid(x, 0.5 + np.concatenate([-up[:0:-1], up]))
    nodes = np.arange(X.size).reshape(X.shape)
    row = len(up) - 1
    slit = nodes[row, x < tip - 1e-9]
    above = nodes.copy()
    above[row, : len(slit)] = X.size + np.arange(len(slit))
    low, high = np.concatenate([nodes[:row], above[row:-1]]), nodes[1:]
    cells = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2).reshape(-1, 4)
    points = np.column_stack([X.ravel(), Y.ravel()])
    return Mesh(np.concatenate([points, points[slit]]), {"quad4": cells})


def bottom(x: Array) -> Flags:
    """Nodes of the lower side."""
    return np.isclose(x[:, 1], 0.0)


def top(x: Array) -> Flags:
    """Nodes of the upper side."""
    return np.isclose(x[:, 1], 1.0)


@cache
def peak(element: str) -> float:
    """Largest force [kN]: up to 4.5 um in 9 steps, then in steps of 0.05 um, until the crack runs.

    Where it does, the path of a given displacement ends: the solver cuts its steps.
    """
    study = Study(notched(0.5))
    study.add("plate", element=element, **ELASTIC, Gc=TOUGHNESS, length=LENGTH)
    study.fix(bottom, u_x=0, u_y=0)
    study.fix(top, u_x=0, u_y=lambda x, t: np.interp(t, [0, 9, 49], [0, 4.5e-3, 6.5e-3]))
    largest, previous = 0.0, 0.0
    try:
        for result in study.march(dt=1.0, until=49.0, method="euler"):
            force = float(result.reaction(top)["u_y"]) / 1000
            if force < largest or 0 < result.t - previous < 0.3:
                break
            largest, previous = force, result.t
    except NotConverged:
        pass
    return largest


def griffith() -> float:
    """Force [kN] at which the elastic plate releases the toughness of the mesh.

    The release is -u^2 / 2 times the slope of the stiffness by the length of the slit; cells of
    SIZE need 1 + SIZE / (2 LENGTH) times the toughness.
    """
    x = along_crack()
    middle = int(np.abs(x - 0.5).argmin())
    ends = x[[middle - 1, middle + 1]]
    stiffness = []
    for tip in (*ends, 0.5):
        study = Study(notched(float(tip)))
        study.add("plate", material="hooke", **ELASTIC)
        study.fix(bottom, u_x=0, u_y=0)
        study.fix(top, u_x=0, u_y=1e-6)
        stiffness.append(study.solve().reaction(top)["u_y"] / 1e-6)
    slope = (stiffness[1] - stiffness[0]) / (ends[1] - ends[0])
    toughness = TOUGHNESS * (1 + SIZE / (2 * LENGTH))
    return float(stiffness[2] * np.sqrt(-2 * toughness / slope) / 1000)


BENCHMARKS = [
    Benchmark(
        "at2_spectral",
        "notched plate in tension, l = 0.015, h = l / 2: peak force [kN], 0.70 to 0.75 in figures",
        0.725,
        3.5e-2,
        "Miehe, Welschinger and Hofacker (2010)",
        partial(peak, "at2_spectral"),
        slow=True,
    ),
    Benchmark(
        "at2_spectral",
        "notched plate in tension, l = 0.015, h = l / 2: peak force [kN] by Griffith's balance",
        0.723444,
        2.5e-2,
        "elastic plate, Gc (1 + h / (2 l)) as in Bourdin et al. (2008)",
        partial(peak, "at2_spectral"),
        slow=True,
    ),
]
