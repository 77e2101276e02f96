"""Oils: from an ISO grade or two measured viscosities to those at the temperature of a seal.

Kinematic viscosities in cSt (mm^2/s), temperatures in degC, densities in kg/m^3; a case has the
dynamic viscosity in MPa s and the pressure-viscosity coefficient in 1/MPa.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import isclose, log, log10
from typing import Any

from softehl.cases.harness.units import read_quantity
from softehl.cases.seal.gland.given import number, put

GRADES = {
    **{10: 2.6, 15: 3.4, 22: 4.3, 32: 5.4, 46: 6.8, 68: 8.6},
    **{100: 11.1, 150: 14.7, 220: 19.0, 320: 24.0},
}
"""ISO 3448 grade, its viscosity at 40 degC (+-10 %) -> at 100 degC, of a mineral oil, cSt.

Typical of hydraulic oils without viscosity improver, viscosity index 90 to 105.
"""

DENSITY = 870.0
"""At 15 degC, of a mineral oil, kg/m^3."""

EXPANSION = 0.65
"""Fall of the density of a mineral oil, kg/m^3 for each degC."""

_KELVIN, _SAME = 273.15, 1e-6


@dataclass(frozen=True)
class Walther:
    """Kinematic viscosity over temperature, ASTM D341: log10 log10(nu + 0.7) = A - B log10 T."""

    A: float
    B: float

    @classmethod
    def through(cls, first: tuple[float, float], second: tuple[float, float]) -> Walther:
        """The line through two viscosities, each (cSt, degC).  ValueError where there is none."""
        (nu_1, t_1), (nu_2, t_2) = sorted([first, second], key=lambda point: point[1])
        if t_1 == t_2:
            raise ValueError(f"both viscosities are at {t_1:g} degC; give them at two temperatures")
        if not nu_1 > nu_2:
            raise ValueError(
                f"{nu_1:g} cSt at {t_1:g} degC and {nu_2:g} cSt at {t_2:g} degC: an oil is "
                "thinner where it is warmer"
            )
        y_1, y_2 = (log10(log10(nu + 0.7)) for nu in (nu_1, nu_2))
        x_1, x_2 = (log10(t + _KELVIN) for t in (t_1, t_2))
        B = (y_1 - y_2) / (x_2 - x_1)
        return cls(y_1 + B * x_1, B)

    def __call__(self, temperature: float) -> float:
        """Kinematic viscosity, cSt."""
        return float(10.0 ** (10.0 ** (self.A - self.B * log10(temperature + _KELVIN))) - 0.7)


def is_grade(text: str) -> bool:
    """Whether an oil is given by its ISO grade, which says its viscosity to +-10 %."""
    return _GRADE.fullmatch(text.strip()) is not None


def read_oil(text: str) -> Walther:
    """An oil from "ISO VG 46" or "46 cSt at 40 degC, 6.8 cSt at 100 degC".  Raises ValueError.

    "HL 46", "HLP 46" (DIN 51524) and "HM 46" (ISO 6743) are mineral oils of that grade, too.
    """
    if found := _GRADE.fullmatch(text.strip()):
        grade = int(found["grade"])
        if grade not in GRADES:
            near = sorted(GRADES, key=lambda g: abs(log(g / grade)) if grade else g)[:2]
            raise ValueError(
                f'oil = "{text}": there is no grade {grade}; nearest: '
                f"{' and '.join(f'ISO VG {g}' for g in sorted(near))}"
            )
        return Walther.through((float(grade), 40.0), (GRADES[grade], 100.0))
    points = [_POINT.fullmatch(part.strip()) for part in text.split(",")]
    if len(points) != 2 or not all(points):
        raise ValueError(f'oil = "{text}" {_not_understood(text)}')
    first, second = ((float(p["nu"]), float(p["at"])) for p in points if p)
    for nu, at in (first, second):
        if not (0.7 < nu < 1e6 and -60.0 <= at <= 300.0):
            raise ValueError(f'oil = "{text}": {nu:g} cSt at {at:g} degC is out of range')
    return Walther.through(first, second)


_GRADE = re.compile(
    r"((ISO[\s-]*)?VG|(HLP|HL|HM)([\s-]+(ISO[\s-]*)?VG)?)[\s-]*(?P<grade>\d{1,5})", re.IGNORECASE
)
_IMPROVED = re.compile(r"(HVLP|HV)[\s-]*((ISO[\s-]*)?VG)?[\s-]*(?P<grade>\d{1,5})", re.IGNORECASE)
_POINT = re.compile(
    r"(?P<nu>\d+\.?\d*)\s*(cSt|mm2/s|mm\^2/s|mm²/s)\s*(at|@)\s*(?P<at>-?\d+\.?\d*)\s*(degC|°C|C)",
    re.IGNORECASE,
)


def _not_understood(text: str) -> str:
    """Why a text is no oil, and what to write."""
    two = '"46 cSt at 40 degC, 6.8 cSt at 100 degC"'
    if found := _IMPROVED.fullmatch(text.strip()):
        return (
            f"has a viscosity improver, and is no ISO VG {found['grade']} at other temperatures "
            f"than 40 degC; write both viscosities of its data sheet, as {two}"
        )
    with suppress(ValueError):
        eta = 1e9 * read_quantity(text, "MPa s")
        return f'is a dynamic viscosity; leave oil out and write viscosity = "{eta:g} mPa s"'
    if "," not in text and any(unit in text for unit in ("cSt", "mm2/s", "mm²/s")):
        why = "is not understood (one viscosity says nothing of another temperature)"
    else:
        why = "is not understood"
    numbers = [int(n) for n in re.findall(r"\d+", text)]
    grade = next((n for n in numbers if n in GRADES), 46)
    return f'{why}; allowed: "ISO VG {grade}", or two viscosities, {two}'


def density(temperature: float, at_15: float = DENSITY) -> float:
    """Density of a mineral oil at a temperature from that at 15 degC, kg/m^3."""
    return at_15 - EXPANSION * (temperature - 15.0)


def barus(viscosity: float) -> float:
    """Pressure-viscosity coefficient of a mineral oil, 1/MPa, from its viscosity in MPa s.

    Wooster's correlation, alpha = (0.6 + 0.965 log10(eta_0 in mPa s)) 1e-8 / Pa; good to 15 %.
    """
    return 1e-2 * max(0.6 + 0.965 * log10(viscosity * 1e9), 0.0)


def barus_of_roelands(viscosity: float, z: float) -> float:
    """Coefficient (1/MPa) at low pressure of an oil with Roelands' index z and eta_0 in MPa s.

    ln(eta / eta_0) = (ln eta_0 + 9.67) ((1 + p / 196.2 MPa)^z - 1), eta_0 in Pa s, begins with it.
    """
    return z * (log(viscosity * 1e6) + 9.67) / 196.2


def with_oil(given: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a case with viscosity and pressure-viscosity coefficient of its oil filled in.

    Raises ValueError as `with_rubber`.
    """
    values = dict(given)
    oil, heat, z = (values.get(key) for key in ("oil", "temperature", "roelands"))
    if isinstance(oil, int | float):
        raise ValueError(
            f'oil = {oil}: write a text, as "ISO VG 46" or "46 cSt at 40 degC, '
            '6.8 cSt at 100 degC"; a dynamic viscosity is given by viscosity = "40 mPa s"'
        )
    if isinstance(oil, str):
        _with_grade(values, oil, heat)
    elif values.get("oil_density") is not None:
        raise ValueError(
            f'oil_density = {values["oil_density"]} needs an oil, as in oil = "ISO VG 46"'
        )
    if number(z) and z >= 0.0:
        eta = values.get("viscosity", 6.59e-8)
        if number(eta) and eta > 0.0:
            put(values, "pressure_viscosity", barus_of_roelands(eta, z), f"roelands = {z:g}")
    return values


def _with_grade(values: dict[str, Any], oil: str, heat: Any) -> None:
    law = read_oil(oil)
    if heat is None:
        raise ValueError(f'oil = "{oil}" needs its temperature, as in temperature = "40 degC"')
    if not number(heat) or not -60.0 <= heat <= 200.0:
        return
    at_15 = values.get("oil_density")
    rho = density(heat, at_15 if number(at_15) else DENSITY)
    eta = law(heat) * rho * 1e-12
    before = values.get("viscosity")
    if number(before) and not isclose(before, eta, rel_tol=_SAME):
        raise ValueError(
            f'viscosity = {before:g} and oil = "{oil}" contradict: at {heat:g} degC '
            f"it has {eta * 1e9:.4g} mPa s; leave one of them out"
        )
    values.setdefault("viscosity", eta)
    if values.get("pressure_viscosity") is None and values.get("roelands") is None:
        values["pressure_viscosity"] = barus(eta)
