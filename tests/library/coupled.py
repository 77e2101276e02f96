"""Benchmarks of elements of coupled fields and fluids."""

from __future__ import annotations

from functools import partial
from typing import Any

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


CRACK: dict[str, Any] = {"E": 1000.0, "nu": 0.0, "Gc": 1.0, "length": 0.5}


def strength(element: str) -> float:
    """Largest stress of a homogeneous bar by its strength in closed form."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1)))
    study.add("bar", element=element, **CRACK)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    E, Gc, length = (CRACK[k] for k in ("E", "Gc", "length"))
    at2 = 9 / 16 * np.sqrt(E * Gc / (3 * length))
    closed = {"at2": at2, "at1": np.sqrt(3 * E * Gc / (8 * length))}[element]
    study.fix("right", u_x=2 * closed / E)
    stresses: list[float] = []
    study.solve(steps=200, on_step=lambda r: stresses.append(r.reaction("right")["u_x"]))
    return float(max(stresses) / closed)


for entry, formula in (("at2", "9 / 16 sqrt(E Gc / (3 l))"), ("at1", "sqrt(3 E Gc / (8 l))")):
    BENCHMARKS.append(
        Benchmark(
            entry,
            f"homogeneous bar, 200 steps: strength by {formula}",
            1.0,
            1e-2,
            "Pham et al. (2011), closed form",
            partial(strength, entry),
        )
    )


def closed_crack(element: str) -> float:
    """Stress of a broken point under uniaxial compression, strain 0.01, E = 1000, nu = 0.25."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("point", element=element, **{**CRACK, "nu": 0.25})
    study.fix("all" if "all" in study.mesh.sides else "boundary", d=1.0, u_y=0, u_z=0)
    study.fix("left", u_x=0)
    study.fix("right", u_x=-0.01)
    return float(study.solve().fields("point")["sigma_xx"].mean())


for entry, stiffness, formula in (
    ("at2_amor", 1000.0 / 1.5, "K"),
    ("at2_spectral", 1200.0, "lambda + 2 G"),
):
    BENCHMARKS.append(
        Benchmark(
            entry,
            f"broken point in uniaxial compression: stress [MPa], 0.01 ({formula})",
            -0.01 * stiffness,
            1e-6,
            "closed form",
            partial(closed_crack, entry),
        )
    )


def interface() -> float:
    """Concentration one width from a plane interface at rest."""
    width = 0.1
    study = Study(Mesh.rectangle(2.0, 0.1, cells=(40, 1), order=2))
    study.add("mixture", element="cahn_hilliard", width=width, mobility=1.0)
    study.start(c=lambda x: np.tanh((x[:, 0] - 1.0) / 0.2))
    *_, last = study.march(dt=0.01, until=0.5, method="euler")
    return float(last.at((1.0 + width, 0.05))["c"])


BENCHMARKS.append(
    Benchmark(
        "cahn_hilliard",
        "plane interface at rest, 2 cells of order 2 a width: concentration at one width",
        float(np.tanh(1 / np.sqrt(2))),
        2e-3,
        "van der Waals, closed form",
        interface,
    )
)


def cavity(n: int = 16) -> float:
    """Velocity along x at the centre of the cavity, Re = 100."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(n, n), order=2))
    study.add("fluid", element="navier_stokes", rho=100.0, eta=1.0)
    inside = lambda x: (x[:, 1] == 1.0) & (x[:, 0] > 0.0) & (x[:, 0] < 1.0)  # noqa: E731
    for side in ("left", "right", "bottom"):
        study.fix(side, v_x=0, v_y=0)
    study.fix(inside, v_x=1.0, v_y=0)
    study.fix((0.0, 0.0), p=0)
    return float(study.solve(steps=2).at((0.5, 0.5))["v_x"])


BENCHMARKS.append(
    Benchmark(
        "navier_stokes",
        "cavity with a moving lid, Re = 100, 16 x 16 cells of order 2: v_x at the centre",
        -0.20581,
        2e-2,
        "Ghia, Ghia and Shin (1982)",
        cavity,
        slow=True,
    )
)


def duct() -> float:
    """Pressure at the rigid end of a duct of length 1 with pressure 1 at its mouth, k = 1.2."""
    study = Study(Mesh.rectangle(1.0, 0.1, cells=(10, 1), order=2))
    study.add("air", element="helmholtz", k=1.2)
    study.fix("left", p=1.0)
    return float(study.solve().at((1.0, 0.05))["p"])


BENCHMARKS.append(
    Benchmark(
        "helmholtz",
        "closed duct, k l = 1.2, 10 cells of order 2: pressure at the end, 1 / cos(k l)",
        1 / np.cos(1.2),
        1e-6,
        "closed form",
        duct,
    )
)


def pull_in() -> float:
    """Largest nominal field of a free film, by sqrt(mu / permittivity)."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("film", element="dielectric", mu=1.0, kappa=1e4, permittivity=1.0)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0, phi=0)
    study.fix("top", phi=1.0)
    path = study.follow(step=0.05, until=lambda r: r.at((1, 1, 1))["u_x"] > 0.5)
    return float(path.limits[0].t)


BENCHMARKS.append(
    Benchmark(
        "dielectric",
        "pull-in of a free film: nominal field by sqrt(mu / permittivity)",
        float(np.sqrt(4 ** (-1 / 3) - 4 ** (-4 / 3))),
        2e-4,
        "Zhao and Suo (2007), closed form: 0.6874",
        pull_in,
    )
)


def kelvin() -> float:
    """Change of temperature of an insulated bar at 100 MPa."""
    E, nu, alpha, c, T_0 = 2e5, 0.3, 1.2e-5, 3.6e-3, 293.0
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    given: dict[str, Any] = {
        "E": E,
        "nu": nu,
        "alpha": alpha,
        "conductivity": 0.05,
        "capacity": c,
        "T_0": T_0,
    }
    study.add("bar", element="thermoelastic", **given)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0)
    study.load("right", u_x=lambda x, t: 100.0 * t * np.ones(len(x)))
    *_, last = study.march(dt=0.5, until=1.0, method="euler")
    return float(last.at((1, 1, 1))["T"])


def _kelvin() -> float:
    E, nu, alpha, c, T_0 = 2e5, 0.3, 1.2e-5, 3.6e-3, 293.0
    pressure = c + 9 * E / (3 - 6 * nu) * alpha**2 * T_0 / 1000  # capacity at constant stress
    return -alpha * T_0 * 100.0 / 1000 / pressure


BENCHMARKS.append(
    Benchmark(
        "thermoelastic",
        "insulated steel at 100 MPa: change of temperature [K]",
        _kelvin(),
        1e-8,
        "Kelvin (1853), closed form",
        kelvin,
    )
)
