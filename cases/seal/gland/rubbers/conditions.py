"""Rubber in service: its modulus over temperature, and what swelling makes of it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from scipy.constants import zero_Celsius

from softehl.cases.seal.gland.tables import reading

Rule = Literal["wlf", "entropic", "constant"]
"""Rules for the modulus of a hardness at another temperature."""

ROOM = 23.0
"""Temperature of a hardness test, ISO 18517, degC."""

GLASSY = 1000.0
"""Shear modulus of a glass, MPa: polymers have 0.7 to 1.5 GPa."""

C_1, C_2 = 17.44, 51.6
"""Universal constants of Williams, Landel and Ferry (1955), the second in K."""

EXPONENT = 0.7
"""Slope of log modulus over log time in the transition."""

LEAST = 5.0
"""The rule ends so far above the glass transition, K: 2 K double the modulus there."""

NEAR = 30.0
"""Below this distance from the glass transition a rubber is not as its hardness says, K."""


def shift(above: float) -> float:
    """Factor a_T of the relaxation times so many kelvin above the glass transition, 1 there."""
    return float(10.0 ** (-C_1 * above / (C_2 + above)))


def glassy_share(above: float) -> float:
    """Share of the glassy modulus that is left 10 s after a load, so many K above the transition.

    1 / (1 + (t / tau)^n), with tau = a_T 10 s: a seal is at rest, and its rubber has the time of a
    stroke.
    """
    return float(1.0 / (1.0 + shift(above) ** -EXPONENT))


def modulus_at(
    mu: float, temperature: float, glass: float | None, rule: Rule | None = None
) -> float:
    """Shear modulus at a temperature, MPa, from that at room temperature.

    wlf: constant above room temperature, and below with the share of the glass. entropic: also in
    proportion to the absolute temperature. glass: glass transition, degC; None where not known.
    """
    if rule == "constant":
        return mu
    if rule == "entropic":
        mu *= (temperature + zero_Celsius) / (ROOM + zero_Celsius)
    if glass is None or temperature >= ROOM:
        return mu
    return mu + GLASSY * (glassy_share(temperature - glass) - glassy_share(ROOM - glass))


def modulus_of_table(path: Path, temperature: float) -> float:
    """Shear modulus at a temperature by a table, MPa: the logarithm is linear between its lines.

    Columns temperature_degC and shear_modulus_MPa. Raises ValueError.
    """
    with reading(path):
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        rows = [[part.strip() for part in line.split(",")] for line in lines if line.strip()]
        if not rows or rows[0] != ["temperature_degC", "shear_modulus_MPa"]:
            raise ValueError("its first line must be temperature_degC,shear_modulus_MPa")
        points = np.array(sorted((float(heat), float(mu)) for heat, mu in rows[1:]))
        if len(points) < 2 or not (points[:, 1] > 0.0).all() or not np.isfinite(points).all():
            raise ValueError("it needs two or more lines, each with a modulus above 0")
        low, high = points[[0, -1], 0]
        if not low <= temperature <= high:
            raise ValueError(
                f"temperature = {temperature:g} degC is outside {low:g} to {high:g} degC; nothing "
                "is extrapolated"
            )
    return float(np.exp(np.interp(temperature, points[:, 0], np.log(points[:, 1]))))


def swollen_modulus(swelling: float) -> float:
    """Factor of the shear modulus of a network that has swollen by so many per cent in volume.

    G = G_0 phi^(1/3), phi the volume fraction of the rubber (P. J. Flory, Principles of Polymer
    Chemistry, 1953; L. R. G. Treloar, The Physics of Rubber Elasticity, 1975).
    """
    return float((1.0 + 0.01 * swelling) ** (-1.0 / 3.0))


def swollen_length(swelling: float) -> float:
    """Factor of the lengths of a rubber that has swollen freely by so many per cent in volume."""
    return float((1.0 + 0.01 * swelling) ** (1.0 / 3.0))
