"""Numbers with units, as a user types them: "50 bar", "0.2 m/s", "12 %", "1 3/8 in".

Everything is computed in mm, MPa, N, s; a key says which of these it is in, and a text with a unit
of the same kind is converted to it. There is no arithmetic of units here.
"""

import re
from collections.abc import Collection
from fractions import Fraction

_QUANTITY = re.compile(
    r"""[ ]*((?:\d+[ -])?\d+/[1-9]\d*(?=[ ]*(?:in|inch|")[ ]*$)
    |[+-]?(?:\d+,\d{1,2}(?!\d)|\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
    [ ]*(1/\S+|(?![eE][+-]?\d)[A-Za-z%"\xb5\xb0\u03bc][^\n]*?)[ ]*""",
    re.VERBOSE,
)

_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")

_KINDS = {
    "mm": {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3, "µm": 1e-3, "in": 25.4, "inch": 25.4},
    "MPa": {
        **{"MPa": 1.0, "GPa": 1e3, "kPa": 1e-3, "Pa": 1e-6, "bar": 0.1, "mbar": 1e-4},
        **{"psi": 6.894757293168361e-3, "N/mm2": 1.0, "N/mm^2": 1.0},
        **{"ksi": 6.894757293168361, "kgf/cm2": 0.0980665, "atm": 0.101325},
    },
    "mm/s": {
        **{"mm/s": 1.0, "m/s": 1e3, "cm/s": 10.0, "um/s": 1e-3, "µm/s": 1e-3},
        **{"mm/min": 1.0 / 60.0, "m/min": 1e3 / 60.0, "in/s": 25.4, "ft/s": 304.8},
    },
    "MPa s": {
        **{"MPa s": 1.0, "Pa s": 1e-6, "mPa s": 1e-9, "cP": 1e-9, "P": 1e-7},
        **{"MPas": 1.0, "Pas": 1e-6, "mPas": 1e-9},
    },
    "1/MPa": {"1/MPa": 1.0, "1/GPa": 1e-3, "1/Pa": 1e6, "1/bar": 10.0},
    "degrees": {"degrees": 1.0, "degree": 1.0, "deg": 1.0, "°": 1.0},
    "%": {"%": 1.0, "percent": 1.0},
    "um": {"um": 1.0, "µm": 1.0, "nm": 1e-3, "mm": 1e3, "uin": 0.0254, "µin": 0.0254},
    "1/s": {"1/s": 1.0, "Hz": 1.0, "1/min": 1.0 / 60.0},
    "degC": {"degC": 1.0, "°C": 1.0, "C": 1.0},
    "kg/m3": {"kg/m3": 1.0, "kg/m^3": 1.0, "kg/m³": 1.0, "g/cm3": 1e3, "g/ml": 1e3, "kg/l": 1e3},
}

_SPELT = {
    **dict.fromkeys(("Bar", "barg", "bar(g)", "bar g"), "bar"),
    **dict.fromkeys(("Psi", "psig", "psi g", "lbf/in2"), "psi"),
    **dict.fromkeys(("Mpa", "N/mm²"), "MPa"),
    **dict.fromkeys(("kgf/cm²", "kg/cm2", "kg/cm²", "kp/cm2", "kp/cm²"), "kgf/cm2"),
    **dict.fromkeys(("cps", "mPaS"), "cP"),
    **dict.fromkeys(("microinch", "microinches", "μin"), "uin"),
    **dict.fromkeys(("ips", "in/sec"), "in/s"),
    '"': "in",
}
"""Other spellings of units; bar(g) and psig are bar and psi."""

_FAHRENHEIT = ("F", "degF", "°F", "deg F")

_TOLERANCE_CLASS = re.compile(r"[A-Za-z]{1,2} ?\d{1,2}")  # of ISO 286, as f7
_KINEMATIC = ("cSt", "St", "mm2/s", "mm^2/s", "mm²/s", "m2/s")


def is_quantity(text: str) -> bool:
    """True if a text is a number and something behind it."""
    return _QUANTITY.fullmatch(text) is not None


def is_number(text: str) -> bool:
    """True if a text is a number alone, with a decimal point or comma."""
    return _NUMBER.fullmatch(text.strip()) is not None


def read_number(text: str) -> float | int:
    """The number that a text is.

    Raises ValueError, in words, for a text that is none or whose comma may be one of thousands.
    """
    plain = text.strip()
    if _THOUSANDS.fullmatch(plain):
        point, without = plain.replace(",", "."), plain.replace(",", "")
        raise ValueError(f'"{text}" is {point} or {without}; write one of them')
    try:
        return int(plain)
    except ValueError:
        return float(plain.replace(",", "."))


def read_fraction(text: str) -> float:
    """A number, or a whole number and a fraction: "1 3/8", "1-3/8", "3/4"."""
    return float(sum(map(Fraction, re.split("[ -]", text))))


def read_quantity(text: str, unit: str) -> float:
    """The number of a text in `unit`.

    Raises ValueError, in words, for a text without a unit of that kind.
    """
    factors, match = _KINDS.get(unit, {unit: 1.0}), _QUANTITY.fullmatch(text)
    spelling = match[2].replace("·", " ").replace("*", " ") if match else ""
    if match and "/" in match[1]:  # a whole number and a fraction: 1 3/8
        number = read_fraction(match[1])
    else:
        number = float(match[1].replace(",", ".")) if match else 0.0
    if (spelling := _spelt(spelling, factors)) in factors:
        return number * factors[spelling]
    if unit == "degC" and spelling in _FAHRENHEIT:
        return round((number - 32.0) / 1.8, 9)
    if unit == "MPa s" and spelling in _KINEMATIC:
        raise ValueError(
            f'"{text}" is a kinematic viscosity; write the dynamic one, which is it times the '
            'density: for an oil of 870 kg/m3, 46 cSt are "40 mPa s"'
        )
    if match and unit == "mm" and _TOLERANCE_CLASS.fullmatch(spelling):
        raise ValueError(
            f'"{text}" is a size with a tolerance class, which is not read; write the size alone, '
            f'"{match[1]} mm"'
        )
    units = [*factors, *(_FAHRENHEIT if unit == "degC" else ())]
    raise ValueError(f'"{text}" is not a number in {unit}; allowed units: {", ".join(units)}')


def _spelt(text: str, units: Collection[str]) -> str:
    """A unit as it is units: also from capitals or small letters alone, if they mean one unit."""
    if text in units or (text := _SPELT.get(text, text)) in units:
        return text
    same = [unit for unit in units if unit.lower() == text.lower()]
    return same[0] if len(same) == 1 and text in (text.lower(), text.upper()) else text
