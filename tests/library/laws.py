"""Benchmarks of materials."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

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


def stress_path(
    material: str, strains: Sequence[float], *, dt: float = 1.0, **parameters: Any
) -> list[float]:
    """Axial stresses [MPa] of a bar, free at its sides, at given axial strains, one a step."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("bar", material=material, **parameters)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0, u_z=0)
    study.fix((0.0, 1.0, 0.0), u_z=0)
    times = dt * np.arange(len(strains) + 1)
    study.fix("right", u_x=lambda x, t: np.interp(t, times, [0.0, *strains]))
    until = dt * len(strains)
    return [r.reaction("right")["u_x"] for r in study.march(dt=dt, until=until, method="euler")]


def hardening_line() -> float:
    """Stress after tension to 2 % and back to 1 %."""
    strains = [0.001, 0.005, 0.01, 0.02, 0.019, 0.015, 0.01]
    return stress_path("j2", strains, E=2e5, nu=0.3, sy=250.0, H=500.0, H_kin=1000.0)[-1]


def _hardening_line() -> float:
    E, sy, H, Hk = 2e5, 250.0, 500.0, 1000.0
    p = (E * 0.02 - sy) / (E + H + Hk)  # after tension
    # reverse flow: E (e - q) - Hk q = -(sy + H (p + (p - q)))
    q = (E * 0.01 + sy + 2 * H * p) / (E + Hk + H)
    return E * (0.01 - q)


BENCHMARKS.append(
    Benchmark(
        "j2",
        "tension to 2 % and back to 1 %, mixed hardening: stress [MPa]",
        _hardening_line(),
        1e-9,
        "closed form",
        hardening_line,
    )
)


def necking_free() -> float:
    """Kirchhoff stress at a stretch of 1.2."""
    data = {"E": 2e5, "nu": 0.3, "sy": 250.0, "Q": 200.0, "b": 10.0, "H": 100.0}
    return uniaxial("hencky_j2", 1.2, steps=10, **data) * 1.2


def _necking_free() -> float:
    E, sy, Q, b, H = 2e5, 250.0, 200.0, 10.0, 100.0
    p = brentq(
        lambda p: E * (np.log(1.2) - p) - (sy + Q * (1 - np.exp(-b * p)) + H * p), 0, 1, xtol=1e-16
    )
    return float(E * (np.log(1.2) - p))


BENCHMARKS.append(
    Benchmark(
        "hencky_j2",
        "tension to 1.2 times the length: Kirchhoff stress [MPa]",
        _necking_free(),
        1e-8,
        "closed form",
        necking_free,
    )
)


def creep() -> float:
    """Strain after 100 s at 100 MPa, which is there from the start."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("bar", material="norton", E=1e5, nu=0.3, A=1e-12, n=4.0)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0, u_z=0)
    study.fix((0.0, 1.0, 0.0), u_z=0)
    study.load("right", u_x=lambda x, t: 100.0)
    *_, last = study.march(dt=10.0, until=100.0, method="euler")
    return float(last.at((1, 0, 0))["u_x"])


BENCHMARKS.append(
    Benchmark(
        "norton",
        "100 s at 100 MPa, A = 1e-12, n = 4: strain",
        100.0 / 1e5 + 1e-12 * 100.0**4 * 100.0,
        1e-8,
        "closed form",
        creep,
    )
)

CYCLIC: dict[str, Any] = {"E": 2e5, "nu": 0.3, "sy": 200.0, "C1": 5e4, "g1": 400.0}


def saturated_cycle() -> float:
    """Largest stress of the fifth cycle between -1 and 1 %."""
    ramp = np.linspace(0, 1, 101)[1:]
    cycle = np.concatenate([1 - 2 * ramp, 2 * ramp - 1])
    strains = 0.01 * np.concatenate([ramp, *[cycle] * 4])
    data = {**CYCLIC, "Q": 0.0, "b": 0.0, "C2": 0.0, "g2": 0.0}
    return max(stress_path("chaboche", strains.tolist(), **data)[-100:])


def _saturated_cycle() -> float:
    E, sy, C, g = (CYCLIC[k] for k in ("E", "sy", "C1", "g1"))
    return float(
        brentq(lambda s: s - sy - C / g * np.tanh(g * (0.02 - 2 * s / E) / 2), sy, 1e3, xtol=1e-12)
    )


BENCHMARKS.append(
    Benchmark(
        "chaboche",
        "cycles between -1 and 1 %, 100 steps a half: amplitude [MPa], sy + C / g tanh(g dep / 2)",
        _saturated_cycle(),
        2e-3,
        "Lemaitre and Chaboche (1990), closed form",
        saturated_cycle,
        slow=True,
    )
)


def constant_rate() -> float:
    """Stress after 2 % at 0.01 / s, without hardening."""
    data = {"E": 2e5, "nu": 0.3, "sy": 200.0, "H": 0.0, "n": 5.0, "rate_0": 10.0}
    return stress_path("perzyna", np.linspace(0, 0.02, 41)[1:].tolist(), dt=0.05, **data)[-1]


BENCHMARKS.append(
    Benchmark(
        "perzyna",
        "2 % at a rate of 0.01 / s, n = 5: stress [MPa], sy (1 + (rate / rate_0)^(1 / n))",
        200.0 * (1 + (0.01 / 10.0) ** 0.2),
        1e-6,
        "closed form",
        constant_rate,
    )
)

SOIL: dict[str, Any] = {"E": 1e4, "nu": 0.25, "a": 0.6, "a_flow": 0.3, "k": 2.0}

for sign, word in ((1, "tension"), (-1, "compression")):
    BENCHMARKS.append(
        Benchmark(
            "drucker_prager",
            f"flow in {word}, a = 0.6, k = 2: stress [MPa], k / (1 / sqrt(3) +- a / 3)",
            sign * 2.0 / (1 / np.sqrt(3) + sign * 0.2),
            1e-9,
            "closed form",
            lambda sign=sign: stress_path(  # type: ignore[misc]
                "drucker_prager", [sign * 2e-4 * k for k in range(1, 6)], **SOIL
            )[-1],
        )
    )

SHEET: dict[str, Any] = {"E": 7e4, "nu": 0.3, "sy": 100.0, "H": 0.0}
RATIOS: dict[str, Any] = {
    "r_xx": 1.2,
    "r_yy": 0.9,
    "r_zz": 1.0,
    "r_xy": 1.1,
    "r_yz": 1.0,
    "r_xz": 1.0,
}


def hill_in_shear() -> float:
    """Shear stress of a block in simple shear in the x-y plane."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("block", material="hill", **SHEET, **RATIOS)
    study.fix("boundary", u_x=lambda x, t: 0.01 * t * x[:, 1], u_y=0, u_z=0)
    return float(study.solve(steps=5).fields("block")["sigma_xy"].mean())


BENCHMARKS += [
    Benchmark(
        "hill",
        "flow along x, ratio 1.2, sy = 100: stress [MPa]",
        120.0,
        1e-8,
        "closed form",
        lambda: stress_path("hill", [0.001, 0.003, 0.01], **SHEET, **RATIOS)[-1],
    ),
    Benchmark(
        "hill",
        "flow in shear, ratio 1.1, sy = 100: stress [MPa], 110 / sqrt(3)",
        110.0 / np.sqrt(3),
        1e-8,
        "closed form",
        hill_in_shear,
    ),
]

ARTERY: dict[str, Any] = {"mu": 0.01, "k1": 0.5, "k2": 5.0, "dispersion": 0.2, "angle": np.pi / 4}


def artery() -> float:
    """Cauchy stress of a sheet at stretches 1.1 along x and y."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("sheet", material="hgo", kappa=1e5, **ARTERY)
    study.fix("left", u_x=0)
    study.fix("front", u_y=0)
    study.fix("bottom", u_z=0)
    study.fix("right", u_x=0.1)
    study.fix("back", u_y=0.1)
    return float(study.solve(steps=5).fields("sheet")["sigma_xx"].mean())


def _artery() -> float:
    """Incompressible: sigma = l dW/dl / 2 of both stretches l together."""
    mu, k1, k2, d = (ARTERY[k] for k in ("mu", "k1", "k2", "dispersion"))
    a = 1.1
    I1, rate = 2 * a**2 + a**-4, 4 * a - 4 * a**-5
    strain = d * (I1 - 3) + (1 - 3 * d) * (a**2 - 1)
    slope = d * rate + (1 - 3 * d) * 2 * a
    W = mu / 2 * rate + 2 * k1 * strain * np.exp(k2 * strain**2) * slope
    return float(a * W / 2)


BENCHMARKS.append(
    Benchmark(
        "hgo",
        "incompressible sheet, fibres at 45 degrees, stretches 1.1: stress [MPa]",
        _artery(),
        1e-5,
        "closed form",
        artery,
    )
)

RUBBER: dict[str, Any] = {"mu": 0.5, "kappa": 5.0, "beta": [1.2, 0.7, 0.3], "tau": [0.2, 1.0, 8.0]}


def relaxation() -> float:
    """Shear stress of a block that is sheared to 1 in 1 s and held for 1 s."""
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("block", material="prony", **RUBBER)
    study.fix("boundary", u_x=lambda x, t: min(t, 1.0) * x[:, 1], u_y=0, u_z=0)
    *_, last = study.march(dt=0.02, until=2.0, method="euler")
    return float(last.fields("block")["sigma_xy"].mean())


def _relaxation() -> float:
    """Components of the second stress relax; F = 1 + g e_x e_y at the end, g = 1."""
    mu, branches = RUBBER["mu"], list(zip(RUBBER["beta"], RUBBER["tau"], strict=True))

    def shape(g: float) -> tuple[float, float]:
        """S_xy and S_yy of mu (1 - I1 / 3 C^-1), with I1 = 3 + g^2."""
        return mu * (1 + g**2 / 3) * g, -mu * g**2 / 3

    def rate(g: float) -> float:
        """Rate of S_xy + S_yy, g = t."""
        return float(mu * (1 + g**2 - 2 * g / 3))

    over = sum(
        b * quad(lambda t, tau=tau: np.exp((t - 2) / tau) * rate(t), 0, 1)[0] for b, tau in branches
    )
    return float(sum(shape(1.0)) + over)


BENCHMARKS.append(
    Benchmark(
        "prony",
        "simple shear to 1 in 1 s, held 1 s, 100 steps, 3 branches: shear stress [MPa]",
        _relaxation(),
        2e-4,
        "hereditary integral",
        relaxation,
    )
)

DUCTILE: dict[str, Any] = {"E": 2e5, "nu": 0.3, "sy": 250.0, "H": 1000.0, "S": 0.5, "s": 1.5}


def torn() -> float:
    """Stress at a strain of 10 %."""
    strains = np.linspace(0, 0.1, 101)[1:].tolist()
    return stress_path("damage", strains, **DUCTILE, D_c=0.9)[-1]


def _torn() -> float:
    E, sy, H, S, s = (DUCTILE[k] for k in ("E", "sy", "H", "S", "s"))
    p = (E * 0.1 - sy) / (E + H)
    stress, power = sy + H * p, 2 * s + 1
    D = (stress**power - sy**power) / (H * power * (2 * E * S) ** s)
    return float((1 - D) * stress)


BENCHMARKS.append(
    Benchmark(
        "damage",
        "tension to 10 %, H = 1000, s = 1.5, 100 steps: stress [MPa], (1 - D) (sy + H p)",
        _torn(),
        1e-3,
        "Lemaitre (1985), closed form",
        torn,
    )
)

COPPER: dict[str, Any] = {"C11": 1.684e5, "C12": 1.214e5, "C44": 7.54e4, "tau_0": 60.0}
GLIDE: dict[str, Any] = {"h": 50.0, "n": 20.0, "rate_0": 1e-3}
AXES: dict[str, dict[str, Any]] = {
    "[001]": {"phi_1": 0.0, "Phi": 0.4, "phi_2": 0.0},
    "[111]": {"phi_1": float(np.arcsin(1 / np.sqrt(3))), "Phi": np.pi / 2, "phi_2": -np.pi / 4},
}


def glide(axis: str) -> float:
    """Stress after 2 % at 0.001 / s along an axis of the crystal."""
    strains = np.linspace(0, 0.02, 101)[1:].tolist()
    return stress_path("crystal", strains, dt=0.2, **COPPER, **GLIDE, **AXES[axis])[-1]


def _glide(axis: str) -> float:
    """`count` systems of one Schmid factor: one slip by time, of all alike."""
    C11, C12, C44, tau_0 = (COPPER[k] for k in ("C11", "C12", "C44", "tau_0"))
    h, n, rate_0 = (GLIDE[k] for k in ("h", "n", "rate_0"))
    S11, S12 = (C11 + C12) / (C11 - C12) / (C11 + 2 * C12), -C12 / (C11 - C12) / (C11 + 2 * C12)
    along = 1 / 3 if axis == "[111]" else 0.0
    E = 1 / (S11 - 2 * (S11 - S12 - 1 / (2 * C44)) * along)
    count, schmid = {"[001]": (8, 1 / np.sqrt(6)), "[111]": (6, 2 / (3 * np.sqrt(6)))}[axis]

    def rate(t: float, slip: Any) -> Any:
        stress = E * (0.001 * t - count * schmid * slip)
        return rate_0 * (schmid * stress / (tau_0 + h * count * slip)) ** n

    slip = solve_ivp(rate, (0, 20), [0.0], "Radau", rtol=1e-10, atol=1e-14).y[0, -1]
    return float(E * (0.02 - count * schmid * slip))


for axis, count in (("[001]", 8), ("[111]", 6)):
    BENCHMARKS.append(
        Benchmark(
            "crystal",
            f"2 % along {axis} at 0.001 / s, {count} systems slip alike, 100 steps: stress [MPa]",
            _glide(axis),
            1e-3,
            "Schmid's law, one equation for the slip",
            partial(glide, axis),
        )
    )

RIGID: dict[str, Any] = {"kappa": 1e5}
STRETCH = 1.5
PULL = STRETCH - STRETCH**-2
"""Nominal stress of an incompressible bar of I1 alone: 2 dW/dI1 PULL."""
EXCESS = STRETCH**2 + 2 / STRETCH - 3
"""I1 - 3."""


def _chains(mu: float, lambda_m: float) -> float:
    """Exact inverse b of Langevin's function: 2 dW/dI1 = mu lambda_m b / (3 stretch)."""
    chain = np.sqrt((EXCESS + 3) / 3)
    b = brentq(lambda b: 1 / np.tanh(b) - 1 / b - chain / lambda_m, 1e-3, 10, xtol=1e-15)
    return float(mu * lambda_m * b / (3 * chain) * PULL)


TERMS = ((0.63, 1.3), (0.0012, 5.0), (-0.01, -2.0))
_OGDEN = {
    f"{a}_{p}": v for p, t in enumerate(TERMS, 1) for a, v in zip(("mu", "alpha"), t, strict=True)
}
TENSION: dict[str, tuple[dict[str, Any], float, str]] = {
    "hooke": ({"E": 2.0, "nu": 0.3}, 2.0 * 0.5, "E strain"),
    "saint_venant": (
        {"E": 2.0, "nu": 0.3},
        2.0 * STRETCH * (STRETCH**2 - 1) / 2,
        "E stretch (stretch^2 - 1) / 2",
    ),
    "neo_hooke": ({"mu": 0.4, **RIGID}, 0.4 * PULL, "incompressible"),
    "mooney_rivlin": (
        {"mu_1": 0.3, "mu_2": 0.2, **RIGID},
        (0.3 + 0.2 / STRETCH) * PULL,
        "incompressible",
    ),
    "yeoh": (
        {"c_1": 0.2, "c_2": -0.01, "c_3": 0.002, **RIGID},
        2 * (0.2 - 0.02 * EXCESS + 0.006 * EXCESS**2) * PULL,
        "incompressible",
    ),
    "gent": ({"mu": 0.4, "J_m": 5.0, **RIGID}, 0.4 * 5 / (5 - EXCESS) * PULL, "incompressible"),
    "arruda_boyce": (
        {"mu": 0.4, "lambda_m": 5.0, **RIGID},
        _chains(0.4, 5.0),
        "incompressible, Langevin's function",
    ),
    "ogden": (
        {**_OGDEN, **RIGID},
        sum(mu * (STRETCH ** (a - 1) - STRETCH ** (-a / 2 - 1)) for mu, a in TERMS),
        "incompressible, three terms",
    ),
}
"""Laws that are built in: parameters, nominal stress, and how it is found."""

for name, (data, stress, how) in TENSION.items():
    BENCHMARKS.append(
        Benchmark(
            name,
            f"{name}: tension to 1.5 times the length: nominal stress [MPa], {how}",
            stress,
            2e-5,
            "closed form",
            partial(uniaxial, name, STRETCH, **data),
        )
    )
