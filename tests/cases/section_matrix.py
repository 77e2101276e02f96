"""Seals of every section drawn at random, by number: the others of docs/validation/glands.md.

`python -m tests.cases.section_matrix FIRST LAST FILE`; see `tests.cases.gland_matrix`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sections.shapes import SECTIONS
from tests.cases.gland_matrix import SPEEDS, main

SEED = 17
NAMES = tuple(name for name in SECTIONS if name != "round")

RUBBERS: tuple[dict[str, Any], ...] = (
    {"mu_1": 0.83, "mu_2": 0.17},
    {"material": "neo-hooke", "mu": 1.0},
    {"material": "gent", "mu": 1.0, "J_m": 30.0},
    {"material": "arruda-boyce", "mu": 1.0, "lambda_m": 3.0},
    {"material": "yeoh", "c_10": 0.5, "c_20": -0.01, "c_30": 0.002},
)
"""Rubbers of a modulus of about 1 MPa."""
_MODULI = ("mu", "mu_1", "mu_2", "c_10", "c_20", "c_30")

_SHARES = {
    "rectangular": {"section_width": (0.7, 1.3), "corner_radius": (0.06, 0.25)},
    "x_ring": {"section_width": (0.9, 1.1), "lobe_radius": (0.22, 0.32)},
    "d_ring": {"section_width": (0.8, 1.1), "nose_radius": (0.56, 0.9)},
    "trapezoid": {"rod_width": (0.45, 0.9), "corner_radius": (0.05, 0.14)},
    "u_cup": {"mouth_depth": (0.45, 0.7), "heel_height": (0.78, 0.9)},
}
"""Dimensions over section_diameter, from and to."""


def drawn(number: int) -> Seal:
    """A seal of one of the sections on a rod of 10 to 200 mm.

    Height 2 to 7 mm, squeeze 7 to 20 %, stretch 0 to 4 %, 1.03 to 1.5 widths of its section wide,
    filled up to 95 %; modulus 1 to 6 MPa, kappa 200 to 2000 MPa, p_s / mu 0 to 2, oil of 5 to 500
    mPa s. Dimensions that do not go together are drawn again.
    """
    rng = np.random.default_rng([SEED, number])
    section = NAMES[number % len(NAMES)]
    while True:
        try:
            p = _once(rng, section)
        except ValueError:
            continue
        outline, depth = p.free_section.outline, 0.5 * (p.housing_diameter - p.rod_diameter)
        if outline.area <= 0.95 * depth * p.groove_width:
            return p


def _once(rng: np.random.Generator, section: str) -> Seal:
    height, rod = rng.uniform(2.0, 7.0), math.exp(rng.uniform(math.log(10.0), math.log(200.0)))
    sizes = {k: round(rng.uniform(*ends) * height, 4) for k, ends in _SHARES[section].items()}
    depth = height * (1.0 - rng.uniform(0.07, 0.20))
    mu = rng.uniform(1.0, 6.0)
    rubber = {
        key: round(mu * value, 4) if key in _MODULI else value
        for key, value in RUBBERS[int(rng.integers(len(RUBBERS)))].items()
    }
    given: dict[str, Any] = {
        "section": section,
        **sizes,
        **rubber,
        "section_diameter": round(height, 4),
        "inner_diameter": round(rod / (1.0 + rng.uniform(0.0, 0.04)), 4),
        "rod_diameter": round(rod, 4),
        "housing_diameter": round(rod + 2.0 * depth, 4),
        "bulk_modulus": round(math.exp(rng.uniform(math.log(200.0), math.log(2000.0))), 1),
        "sealed_pressure": round(rng.uniform(0.0, 2.0) * mu, 3),
        "viscosity": float(f"{10.0 ** rng.uniform(-8.3, -6.3):.3g}"),
        "groove_width": 10.0 * height,
        "speeds": SPEEDS,
        "error_estimate": False,
    }
    width = Seal(**given).axial_width
    return Seal(**{**given, "groove_width": round(rng.uniform(1.03, 1.5) * width, 3)})


if __name__ == "__main__":
    main(drawn, __doc__)
