"""Oils: from an ISO grade or two measured viscosities to those at the temperature of a seal.

Kinematic viscosities in cSt (mm^2/s), temperatures in degC, densities in kg/m^3; a case has the
dynamic viscosity in MPa s and the pressure-viscosity coefficient in 1/MPa.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import log, log10
from typing import Any

import numpy as np
from scipy.constants import zero_Celsius
from scipy.optimize import brentq

from softehl.cases.seal.gland.key_values import number, put
from softehl.cases.seal.gland.records import THICKEST, Oil
from softehl.cases.seal.gland.tables import rows
from softehl.cases.seal.gland.trade.oil_names import GRADES, read_oil_name
from softehl.runtime.arrays import Array

Viscosity = Callable[[Array], Array]
"""Rise of the temperature (n,), K -> viscosity over that of the cold oil (n,)."""

DENSITY = 870.0
"""At 15 degC, of a mineral oil, kg/m^3."""

# --- viscosity over temperature -----------------------------------------------------------------


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
        x_1, x_2 = (log10(t + zero_Celsius) for t in (t_1, t_2))
        B = (y_1 - y_2) / (x_2 - x_1)
        return cls(y_1 + B * x_1, B)

    def __call__(self, temperature: float) -> float:
        """Kinematic viscosity, cSt."""
        return float(10.0 ** (10.0 ** (self.A - self.B * log10(temperature + zero_Celsius))) - 0.7)


def read_oil(text: str) -> Walther:
    """An oil from its name (trade.oil_names).  Raises ValueError.

    A grade is one of a mineral oil, or has a viscosity index: given, the least of HVLP oils, or
    that of its family of fluids.
    """
    name = read_oil_name(text)
    if name.grade is None:
        return Walther.through(*name.points)
    if name.grade not in GRADES:
        nearest = sorted(GRADES, key=lambda g: abs(log(g / name.grade)) if name.grade else g)[:2]
        raise ValueError(
            f'oil = "{text}": there is no grade {name.grade}; nearest: '
            f"{' and '.join(f'ISO VG {g}' for g in sorted(nearest))}"
        )
    at_40 = float(name.grade)
    family, index = name.family, name.index
    if family is not None and index is None:
        if family.at_100 is not None:  # all grades have the slope of ISO VG 46
            B = Walther.through((46.0, 40.0), (family.at_100, 100.0)).B
            return Walther(log10(log10(at_40 + 0.7)) + B * log10(40.0 + zero_Celsius), B)
        index = family.index
    at_100 = GRADES[name.grade] if index is None else at_100_of_index(at_40, index)
    return Walther.through((at_40, 40.0), (at_100, 100.0))


# --- viscosity index, ASTM D2270: a high one means little fall with temperature -----------------

_H = [tuple(map(float, row.values())) for row in rows("astm_d2270.csv")]
"""From a viscosity at 100 degC on: H = d Y^2 + e Y + f, of the standard's annex."""


def at_40_of_100(at_100: float) -> float:
    """Viscosity at 40 degC of an oil of index 100 from that at 100 degC, 2 to 40 cSt."""
    _, d, e, f = max(row for row in _H if row[0] <= at_100)
    return d * at_100**2 + e * at_100 + f


def viscosity_index(at_40: float, at_100: float) -> float:
    """The index of an oil, 100 or more, from its two viscosities."""
    n = (log10(at_40_of_100(at_100)) - log10(at_40)) / log10(at_100)
    return float((10.0**n - 1.0) / 0.00715 + 100.0)


def at_100_of_index(at_40: float, index: float) -> float:
    """Viscosity at 100 degC of an oil of this index and viscosity at 40 degC.  ValueError.

    Oils of the industry have 2 to 40 cSt there, and polyglycols indices up to 280.
    """
    if not 100.0 <= index <= 400.0:
        raise ValueError(f"a viscosity index is read from 100 to 400, given {index:g}")

    def beyond(at_100: float) -> float:
        return viscosity_index(at_40, at_100) - index

    if beyond(2.0) * beyond(40.0) > 0.0:
        raise ValueError(f"there is no oil of index {index:g} and {at_40:g} cSt at 40 degC here")
    return float(brentq(beyond, 2.0, 40.0, xtol=1e-9))


# --- the keys of a case -------------------------------------------------------------------------


def density(temperature: float, at_15: float = DENSITY) -> float:
    """Density of a mineral oil at a temperature from that at 15 degC, kg/m^3.

    It falls by 0.65 kg/m^3 for each degC; that of lubricants by 0.63 in ASTM D1250.
    """
    return at_15 - 0.65 * (temperature - 15.0)


CURVATURE = 3.7
"""Power of the absolute temperature by which ln eta falls: B of Walther's line of mineral oils."""


def relative_viscosity(slope: float, temperature: float) -> Viscosity:
    """Viscosity of an oil by the rise of its temperature, over that at a temperature.

    slope: fall of ln eta for a degree there, 1/K. Within 3e-3 of Walther's line of ISO VG 46 for a
    rise of 10 K from 40 degC.
    """
    cold = temperature + zero_Celsius

    def ratio(rise: Array) -> Array:
        power = (1.0 + rise / cold) ** -CURVATURE
        return np.asarray(np.exp(slope * cold / CURVATURE * (power - 1.0)))

    return ratio


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


def with_oil(specified: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a case with viscosity and pressure-viscosity coefficient of its oil filled in.

    Raises ValueError as `with_rubber`.
    """
    values = dict(specified)
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
    law, name = read_oil(oil), read_oil_name(oil)
    named, family = name.temperature, name.family
    if named is not None:
        put(values, "temperature", named, f'oil = "{oil}"')
        heat = values["temperature"]
    if heat is None:
        raise ValueError(f'oil = "{oil}" needs its temperature, as in temperature = "40 degC"')
    if not number(heat) or not -60.0 <= heat <= 200.0:
        return
    at_15 = values.get("oil_density")
    usual = family.density if family else DENSITY
    rho = density(heat, at_15 if number(at_15) else usual)
    eta = law(heat) * rho * 1e-12
    if eta > THICKEST:
        raise ValueError(
            f'oil = "{oil}" would have {1e9 * eta:.2g} mPa s at {heat:g} degC, where it does not '
            f"flow; allowed are up to {1e9 * THICKEST:g} mPa s, at a higher temperature"
        )
    put(values, "viscosity", eta, f'oil = "{oil}" at {heat:g} degC ({1e9 * eta:.4g} mPa s)')
    if values.get("heating") is True and values.get("viscosity_slope") is None:
        given = at_15 if number(at_15) else usual
        below, above = (law(t) * density(t, given) for t in (heat - 0.01, heat + 0.01))
        values["viscosity_slope"] = log(below / above) / 0.02
    if values.get("pressure_viscosity") is None and values.get("roelands") is None:
        values["pressure_viscosity"] = (family.pressure_share if family else 1.0) * barus(eta)
