"""Oils: from an ISO grade or two measured viscosities to those at the temperature of a seal.

Kinematic viscosities in cSt (mm^2/s), temperatures in degC, densities in kg/m^3; a case has the
dynamic viscosity in MPa s and the pressure-viscosity coefficient in 1/MPa.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, log, log10
from typing import Any

from softehl.cases.seal.gland.given import number, put
from softehl.cases.seal.gland.records.oil import Oil
from softehl.cases.seal.gland.trade.oil_names import GRADES, read_oil_name
from softehl.cases.seal.gland.viscosity_index import at_100_of_index

DENSITY = 870.0
"""At 15 degC, of a mineral oil, kg/m^3."""

EXPANSION = 0.65
"""Fall of the density of a mineral oil, kg/m^3 for each degC."""

_KELVIN = 273.15
_SAME = 1e-6  # relative: two ways to a viscosity differ by less through rounding


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
    """True if an oil is given by its ISO grade, which says its viscosity to +-10 %."""
    return read_oil_name(text).grade is not None


def is_improved(text: str) -> bool:
    """True if a name says that an oil has a viscosity improver, but not its index."""
    return read_oil_name(text).improved


def read_oil(text: str) -> Walther:
    """An oil from its name (trade.oil_names).  Raises ValueError.

    A grade is one of a mineral oil, or has a viscosity index, given or the least of HVLP oils.
    """
    name = read_oil_name(text)
    if name.grade is None:
        return Walther.through(*name.points)
    if name.grade not in GRADES:
        near = sorted(GRADES, key=lambda g: abs(log(g / name.grade)) if name.grade else g)[:2]
        raise ValueError(
            f'oil = "{text}": there is no grade {name.grade}; nearest: '
            f"{' and '.join(f'ISO VG {g}' for g in sorted(near))}"
        )
    at_40 = float(name.grade)
    at_100 = GRADES[name.grade] if name.index is None else _of_index(text, at_40, name.index)
    return Walther.through((at_40, 40.0), (at_100, 100.0))


def _of_index(text: str, at_40: float, index: float) -> float:
    try:
        return at_100_of_index(at_40, index)
    except ValueError as error:
        raise ValueError(f'oil = "{text}": {error}') from None


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
        eta = values.get("viscosity", Oil.model_fields["viscosity"].default)
        if number(eta) and eta > 0.0:
            put(values, "pressure_viscosity", barus_of_roelands(eta, z), f"roelands = {z:g}")
    return values


def _with_grade(values: dict[str, Any], oil: str, heat: Any) -> None:
    law, named = read_oil(oil), read_oil_name(oil).temperature
    if named is not None:
        put(values, "temperature", named, f'oil = "{oil}"')
        heat = values["temperature"]
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
