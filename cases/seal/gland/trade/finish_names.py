"""Finishes of surfaces: "Ra 0.2" and "Rq 0.25" in micrometres, to rms heights."""

from __future__ import annotations

import re
from math import pi, sqrt

from softehl.cases.harness.units import read_quantity
from softehl.cases.seal.gland.trade.text import NUMBER, plain, refused

RMS_OF_RA = sqrt(0.5 * pi)
"""Rms height over mean height (Ra) of a surface whose heights have a normal distribution."""

_FINISH = re.compile(
    rf"(?P<kind>R[a-z]{{1,3}}\d?)[ =<:]*(?P<height>{NUMBER}) ?(?P<unit>um|nm|uin|mm)?"
    rf"|(?P<height2>{NUMBER}) ?(?P<unit2>um|nm|uin|mm)? ?(?P<kind2>R[a-z]{{1,3}}\d?)",
    re.IGNORECASE,
)


def read_finish(given: str) -> float | None:
    """Rms height in um of a finish, None where the text is a number with a unit.

    Raises NotUnderstoodError.
    """
    text = plain(given)
    if re.fullmatch(rf"{NUMBER} ?(um|nm|uin|mm)?", text):
        return None
    found = _FINISH.fullmatch(text)
    if not found:
        if re.fullmatch(r"N ?(1[0-2]|[1-9])", text, re.IGNORECASE):
            raise refused("roughness", given, "is a grade of ISO 1302, a band of Ra", "Ra 0.2")
        raise refused("roughness", given, "is no finish in um", "Ra 0.2", "Rq 0.25", "0.25 um")
    kind, unit = found["kind"] or found["kind2"], found["unit"] or found["unit2"] or "um"
    height = read_quantity(f"{found['height'] or found['height2']} {unit.lower()}", "um")
    if kind.lower() == "ra":
        return round(RMS_OF_RA * height, 6)
    if kind.lower() in ("rq", "rms"):
        return height
    raise refused(
        *("roughness", given, f"{kind} does not give a mean or rms height; write Ra or Rq"),
        *("Ra 0.2", "Rq 0.25"),
    )
