"""Benchmarks of elements of coupled fields and fluids."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

from softehl import Mesh, Result, Study
from softehl.runtime.arrays import Array
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


SOIL: dict[str, Any] = {"E": 1.0, "mobility": 1.0}


def _modulus(nu: float) -> float:
    """Stiffness of the soil without lateral strain."""
    return float(SOIL["E"] * (1 - nu) / ((1 + nu) * (1 - 2 * nu)))


def slab(nu: float, share: float) -> float:
    """Pressure times width by force in the middle of Mandel's slab, at c t / a^2 = share."""
    study = Study(Mesh.rectangle(1.0, 0.1, cells=(20, 1), order=2))
    study.add("soil", element="biot", nu=nu, **SOIL)
    study.fix("bottom", u_y=0)
    study.fix("left", u_x=0)
    study.fix("right", p=0)
    study.tie(lambda x: np.isclose(x[:, 1], 0.1) & (x[:, 0] > 0), (0.0, 0.1), "u_y")
    study.load("top", u_y=lambda x, t: -1e-3 * np.ones(len(x)))
    until = share / _modulus(nu)
    *_, last = study.march(dt=until / 200, until=until, method="euler")
    return float(last.at((0.0, 0.0))["p"] / 1e-3)


def _slab(nu: float, share: float) -> float:
    """Series of Mandel for an incompressible fluid."""
    eta = (1 - nu) / (0.5 - nu)
    balance = lambda a: np.sin(a) - eta * a * np.cos(a)  # noqa: E731
    a = np.array(
        [brentq(balance, k * np.pi + 1e-3 * (k == 0), (k + 0.5) * np.pi) for k in range(100)]
    )
    weights = np.sin(a) / (a - np.sin(a) * np.cos(a)) * (1 - np.cos(a))
    return float(np.sum(weights * np.exp(-(a**2) * share)))


def ball(share: float, nu: float = 0.25, n: int = 16) -> float:
    """Pressure by load in the centre of Cryer's sphere, at c t / R^2 = share, by half a section."""

    def quarter(s: Array) -> Array:
        return np.asarray(s * np.sqrt(1 - s[:, ::-1] ** 2 / 2))

    mesh = Mesh.rectangle(1.0, 1.0, cells=(n, n), order=2).map(quarter)
    study = Study(mesh, geometry="axisymmetric")
    study.add("soil", element="biot", nu=nu, **SOIL)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    for side in ("right", "top"):
        study.fix(side, p=0)
        study.load(side, u_x=lambda x, t: -1e-3 * x[:, 0], u_y=lambda x, t: -1e-3 * x[:, 1])
    until = share / _modulus(nu)
    *_, last = study.march(dt=until / 200, until=until, method="euler")
    return float(last.at((0.0, 0.0))["p"] / 1e-3)


def _ball(share: float, nu: float = 0.25) -> float:
    """Series of Cryer for an incompressible fluid, as in Verruijt."""
    eta = (1 - nu) / (1 - 2 * nu)

    def balance(a: Any) -> Any:
        return (1 - eta * a**2 / 2) * np.sin(a) - a * np.cos(a)

    grid = np.linspace(1e-2, 100 * np.pi, 4000)
    signs = np.signbit(balance(grid))
    left = np.flatnonzero(signs[1:] != signs[:-1])
    a = np.array([brentq(balance, grid[k], grid[k + 1]) for k in left])
    weights = (np.sin(a) - a) / ((eta - 1) * np.sin(a) + eta * a * np.cos(a) / 2)
    return float(eta * np.sum(weights * np.exp(-(a**2) * share)))


BENCHMARKS += [
    *(
        Benchmark(
            "biot",
            f"Mandel's slab, nu = {nu}, 20 cells of order 2, 200 steps: p a / F in the middle, "
            f"T = {share}",
            _slab(nu, share),
            2e-3,
            "Mandel (1953), Geotechnique 3, series",
            partial(slab, nu, share),
        )
        for nu, share in ((0.25, 0.05), (0.0, 0.1), (0.0, 0.5))
    ),
    *(
        Benchmark(
            "biot",
            f"Cryer's sphere, nu = 0.25, 16 x 16 cells of order 2, 200 steps: p / P in the "
            f"centre, T = {share}",
            _ball(share),
            5e-3,
            "Cryer (1963), Q. J. Mechanics and Applied Mathematics 16, series",
            partial(ball, share),
            slow=True,
        )
        for share in (0.05, 0.1)
    ),
]


CRACK: dict[str, Any] = {"E": 1000.0, "nu": 0.0, "Gc": 1.0, "length": 0.5}


def strength(element: str) -> float:
    """Largest stress of a homogeneous bar by its strength in closed form."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1)))
    study.add("bar", element=element, **CRACK)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    E, Gc, length = (CRACK[k] for k in ("E", "Gc", "length"))
    at2 = 9 / 16 * np.sqrt(E * Gc / (3 * length))
    closed = at2 if element == "at2" else np.sqrt(3 * E * Gc / (8 * length))
    study.fix("right", u_x=2 * closed / E)
    stresses: list[float] = []
    study.solve(steps=200, on_step=lambda r: stresses.append(r.reaction("right")["u_x"]))
    return float(max(stresses) / closed)


for entry, formula in (
    ("at2", "9 / 16 sqrt(E Gc / (3 l))"),
    ("at1", "sqrt(3 E Gc / (8 l))"),
    ("at1_amor", "sqrt(3 E Gc / (8 l)), volume and deviator"),
    ("at1_spectral", "sqrt(3 E Gc / (8 l)), principal strains"),
):
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
    ("at1_amor", 1000.0 / 1.5, "K"),
    ("at1_spectral", 1200.0, "lambda + 2 G"),
):
    order = entry[:3].upper()
    BENCHMARKS.append(
        Benchmark(
            entry,
            f"broken point of {order} in uniaxial compression: stress [MPa], 0.01 ({formula})",
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


@cache
def driven_cavity(reynolds: float, n: int = 24) -> Result:
    """Cavity with a moving lid, by cells that are smaller at the walls."""

    def graded(x: Array) -> Array:
        return np.asarray(x - 0.7 * np.sin(2 * np.pi * x) / (2 * np.pi))

    study = Study(Mesh.rectangle(1.0, 1.0, cells=(n, n), order=2).map(graded))
    study.add("fluid", element="navier_stokes", rho=reynolds, eta=1.0)
    for side in ("left", "right", "bottom"):
        study.fix(side, v_x=0, v_y=0)
    inside = lambda x: (x[:, 1] == 1.0) & (x[:, 0] > 0.0) & (x[:, 0] < 1.0)  # noqa: E731
    study.fix(inside, v_x=1.0, v_y=0)
    study.fix((0.0, 0.0), p=0)
    return study.solve(steps=4)


def in_cavity(reynolds: float, place: tuple[float, float], component: str) -> float:
    """A velocity of the cavity."""
    return float(driven_cavity(reynolds).at(place)[component])


GHIA = "Ghia, Ghia and Shin (1982)"
BOTELLA = "Botella and Peyret (1998), Computers & Fluids 27, 421-433"
for reynolds, component, place, published, tolerance, source in (
    (400, "v_x", (0.5, 0.2813), -0.32726, 1e-2, GHIA),
    (400, "v_y", (0.2266, 0.5), 0.30203, 1e-2, GHIA),
    (400, "v_y", (0.8594, 0.5), -0.44993, 1.5e-2, GHIA),
    (1000, "v_x", (0.5, 0.1719), -0.38289, 2e-2, GHIA),
    (1000, "v_y", (0.1563, 0.5), 0.37095, 2e-2, GHIA),
    (1000, "v_y", (0.9063, 0.5), -0.51550, 3e-2, GHIA),
    (1000, "v_x", (0.5, 0.1717), -0.3885698, 2e-3, BOTELLA),
    (1000, "v_y", (0.1578, 0.5), 0.3769447, 2e-3, BOTELLA),
    (1000, "v_y", (0.9092, 0.5), -0.5270771, 4e-3, BOTELLA),
):
    BENCHMARKS.append(
        Benchmark(
            "navier_stokes",
            f"cavity with a moving lid, Re = {reynolds}, 24 x 24 cells of order 2: {component} at "
            f"({place[0]:g}, {place[1]:g})",
            published,
            tolerance,
            source,
            partial(in_cavity, reynolds, place, component),
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

CONCRETE: dict[str, Any] = {"E": 2e4, "nu": 0.2, "a": 0.9, "b": 500.0, "ratio": 10.0}


def softening() -> float:
    """Stress of a homogeneous bar at a strain of 1e-3, after unloading to half of it."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("bar", element="gradient_damage", **CONCRETE, length=1.0, k_0=1e-4)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0)
    study.fix("right", u_x=lambda x, t: 1e-3 * np.interp(t, [0, 1, 2], [0, 1, 0.5]))
    *_, last = study.march(dt=0.05, until=2.0, method="euler")
    return last.reaction("right")["u_x"]


def smoothed() -> float:
    """Smoothed strain by the strain, one length from an end where it is fixed at zero."""
    study = Study(Mesh.rectangle(4.0, 0.1, cells=(40, 1), order=2))
    study.add("bar", element="gradient_damage", **{**CONCRETE, "nu": 0.0}, length=1.0, k_0=1.0)
    study.fix("left", u_x=0, e=0)
    study.fix("bottom", u_y=0)
    study.fix("right", u_x=4e-4)
    return float(study.solve().at((1.0, 0.05))["e"] / 1e-4)


BENCHMARKS += [
    Benchmark(
        "gradient_damage",
        "homogeneous bar to 0.1 % and back to half: stress [MPa], (1 - D) E strain",
        0.1 * (1 - 0.9 + 0.9 * float(np.exp(-500.0 * 9e-4))) * 2e4 * 5e-4,
        1e-8,
        "Peerlings et al. (1996), closed form",
        softening,
    ),
    Benchmark(
        "gradient_damage",
        "elastic bar of 4 lengths, e = 0 at one end: e by the strain, one length from it",
        1 - float(np.cosh(3.0) / np.cosh(4.0)),
        1e-5,
        "closed form",
        smoothed,
    ),
]

SWELLING: dict[str, Any] = {"E": 10.0, "nu": 0.3, "D": 1.0, "c_0": 1e-5, "RT": 2.5e6}
MOLAR = 2e4
RESERVOIR = 1.25e6


def swelling(*, free: bool) -> float:
    """Strain of a free block, or change of concentration of one that cannot grow."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("gel", element="diffusion", **SWELLING, volume=MOLAR)
    for side, u in (("left", "u_x"), ("front", "u_y"), ("bottom", "u_z")):
        study.fix(side, **{u: 0})
    study.fix("boundary", mu=RESERVOIR)
    if not free:
        study.fix("boundary", u_x=0, u_y=0, u_z=0)
    last = study.solve(steps=5).at((1, 1, 1))
    return float(last["u_x"] if free else last["c"] / SWELLING["c_0"])


def _confined() -> float:
    """R T ln(1 + c / c_0) + volume^2 K c = mu, by c / c_0."""
    E, nu, c_0, RT = (SWELLING[k] for k in ("E", "nu", "c_0", "RT"))
    K = E / (3 - 6 * nu)
    balance = lambda x: RT * np.log(1 + x) + MOLAR**2 * K * c_0 * x - RESERVOIR  # noqa: E731
    return float(brentq(balance, 0, 1, xtol=1e-15))


BENCHMARKS += [
    Benchmark(
        "diffusion",
        "free block, mu = R T / 2: strain, volume c_0 (exp(1 / 2) - 1) / 3",
        MOLAR * 1e-5 * float(np.exp(0.5) - 1) / 3,
        1e-8,
        "closed form",
        partial(swelling, free=True),
    ),
    Benchmark(
        "diffusion",
        "confined block, mu = R T / 2: c / c_0, R T ln(1 + c / c_0) + volume^2 K c = mu",
        _confined(),
        1e-8,
        "closed form",
        partial(swelling, free=False),
    ),
]


def joule() -> float:
    """Rise of the temperature of a rubber that is stretched to three times its length."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    given: dict[str, Any] = {"mu": 0.4, "kappa": 1e5, "alpha": 0.0, "capacity": 1.8}
    study.add("rubber", element="entropic", **given, conductivity=0.0, T_0=293.0)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0)
    study.fix("right", u_x=lambda x, t: 2.0 * t)
    *_, last = study.march(dt=0.1, until=1.0, method="euler")
    return float(last.at((1, 1, 1))["T"])


BENCHMARKS.append(
    Benchmark(
        "entropic",
        "adiabatic to 3 times the length: rise [K], T_0 (exp(W / (c T_0)) - 1)",
        293.0 * float(np.expm1(0.4 / 2 * (9 + 2 / 3 - 3) / (1.8 * 293.0))),
        1e-4,
        "closed form",
        joule,
    )
)

# PZT-5H, in N, mm, V
CERAMIC: dict[str, Any] = {
    **{"C11": 126e3, "C12": 79.5e3, "C13": 84.1e3, "C33": 117e3, "C44": 23e3},
    **{"e31": -6.5e-3, "e33": 23.3e-3, "e15": 17e-3, "k11": 1.505e-8, "k33": 1.302e-8},
}


def actuator(direction: str) -> float:
    """Displacement of the corner of a free block of edge 1 mm at 1000 V [nm]."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("block", element="piezo", **CERAMIC)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0, phi=0)
    study.fix("top", phi=-1000.0)
    return float(study.solve().at((1, 1, 1))[direction] * 1e6)


def _actuator(direction: str) -> float:
    """Strains of zero stress: C strain = e field, C of xx, yy and zz."""
    C11, C12, C13, C33, e31, e33 = (CERAMIC[k] for k in ("C11", "C12", "C13", "C33", "e31", "e33"))
    C = np.array([[C11, C12, C13], [C12, C11, C13], [C13, C13, C33]])
    strain = np.linalg.solve(C, np.array([e31, e31, e33]) * 1000.0)
    return float(strain[["u_x", "u_y", "u_z"].index(direction)] * 1e6)


for direction, name in (("u_z", "d33"), ("u_x", "d31")):
    BENCHMARKS.append(
        Benchmark(
            "piezo",
            f"free block of PZT-5H, 1000 V over 1 mm: {direction} [nm], 1000 {name}",
            _actuator(direction),
            1e-8,
            "closed form",
            partial(actuator, direction),
        )
    )


def shear_actuator() -> float:
    """Shear of a block that is poled along z under 1000 V along x, by 1e-6."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("block", element="piezo", **CERAMIC)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("boundary", phi=lambda x, t: -1000.0 * x[:, 0])
    study.fix("boundary", u_y=0, u_z=0)
    return float(study.solve().at((1, 1, 1))["u_x"] * 1e6)


BENCHMARKS.append(
    Benchmark(
        "piezo",
        "block of PZT-5H, 1000 V across the poling over 1 mm: shear by 1e-6, 1000 e15 / C44",
        17e-3 / 23e3 * 1e9,
        1e-8,
        "closed form",
        shear_actuator,
    )
)


def plates() -> float:
    """Velocity in the middle between two plates."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(8, 8)))
    study.add("fluid", element="stokes_pspg", eta=0.5)
    study.fix("left", p=1.0, v_y=0)
    study.fix("right", p=0.0, v_y=0)
    for side in ("bottom", "top"):
        study.fix(side, v_x=0, v_y=0)
    study.load("left", v_x=1.0)
    return float(study.solve().at((1.0, 0.5))["v_x"])


BENCHMARKS.append(
    Benchmark(
        "stokes_pspg",
        "flow between plates, 8 x 8 cells of order 1: velocity in the middle, p' h^2 / (8 eta)",
        0.5 / (8 * 0.5),
        1e-8,
        "Poiseuille, closed form",
        plates,
    )
)


def kovasznay(n: int = 32) -> float:
    """Velocity along x at (0.25, 0) behind a grid, Re = 40."""
    rate = 20 - np.sqrt(400 + 4 * np.pi**2)
    study = Study(Mesh.rectangle(1.5, 1.0, cells=(3 * n // 2, n)).map(lambda x: x - 0.5))
    study.add("fluid", element="pspg_supg", rho=1.0, eta=1 / 40)
    study.fix(
        "boundary",
        v_x=lambda x, t: t * (1 - np.exp(rate * x[:, 0]) * np.cos(2 * np.pi * x[:, 1])),
        v_y=lambda x, t: (
            t * rate / (2 * np.pi) * np.exp(rate * x[:, 0]) * np.sin(2 * np.pi * x[:, 1])
        ),
    )
    study.fix((1.0, 0.5), p=0)
    return float(study.solve(steps=2).at((0.25, 0.0))["v_x"])


def lid(n: int = 32) -> float:
    """Velocity along x at the centre of the cavity, Re = 100."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(n, n)))
    study.add("fluid", element="pspg_supg", rho=100.0, eta=1.0)
    for side in ("left", "right", "bottom"):
        study.fix(side, v_x=0, v_y=0)
    study.fix(lambda x: (x[:, 1] == 1.0) & (x[:, 0] > 0.0) & (x[:, 0] < 1.0), v_x=1.0, v_y=0)
    study.fix((0.0, 0.0), p=0)
    return float(study.solve(steps=2).at((0.5, 0.5))["v_x"])


BENCHMARKS += [
    Benchmark(
        "pspg_supg",
        "flow behind a grid, Re = 40, 48 x 32 cells of order 1: v_x at (0.25, 0)",
        float(1 - np.exp((20 - np.sqrt(400 + 4 * np.pi**2)) / 4)),
        1e-2,
        "Kovasznay (1948), closed form",
        kovasznay,
    ),
    Benchmark(
        "pspg_supg",
        "cavity with a moving lid, Re = 100, 32 x 32 cells of order 1: v_x at the centre",
        -0.20581,
        2e-2,
        "Ghia, Ghia and Shin (1982)",
        lid,
        slow=True,
    ),
]
