"""Finishes of surfaces: "Ra 0.2" and "Rq 0.25" in micrometres, to rms heights."""

from __future__ import annotations

import re
from math import pi, sqrt

from softehl.cases.harness.units import read_quantity
from softehl.cases.seal.gland.trade.normalise_text import NUMBER, form, plain, refused

RMS_OF_RA = sqrt(0.5 * pi)
"""Rms height over mean height (Ra) of a surface whose heights have a normal distribution."""

_UNIT = "um|nm|uin|microinch(?:es)?|mm"
_KIND, _HEIGHT = r"(?P<kind>R[a-z]{1,3}\d?)", rf"(?P<height>{NUMBER}) ?(?P<unit>{_UNIT})?"
_FINISH = form(rf"{_KIND}(?: max\.?)?[ =<\u2264:]*{_HEIGHT}")
_TURNED = form(rf"{_HEIGHT} ?{_KIND}")


def read_finish(finish: str) -> float | None:
    """Rms height in um of a finish, None where the text is a number with a unit.

    Raises NotUnderstoodError.
    """
    text = plain(finish)
    if re.fullmatch(rf"{NUMBER} ?({_UNIT})?", text):
        return None
    match = _FINISH.fullmatch(text) or _TURNED.fullmatch(text)
    if not match:
        if re.search(r"\d ?/ ?R", text):
            why = "has two finishes; write those of rod and seal"
            raise refused("roughness", finish, why, "Ra 0.1 and Ra 0.4")
        if re.fullmatch(r"N ?(1[0-2]|[1-9])", text, re.IGNORECASE):
            raise refused("roughness", finish, "is a grade of ISO 1302, a band of Ra", "Ra 0.2")
        raise refused("roughness", finish, "is no finish in um", "Ra 0.2", "Rq 0.25", "0.25 um")
    kind, unit = match["kind"].lower(), (match["unit"] or "um").lower()
    height = read_quantity(f"{match['height']} {unit}", "um")
    if kind == "rms" and height >= 1.0 and not match["unit"]:  # less would be um
        why = "is in micrometres or in microinches; write the unit"
        raise refused("roughness", finish, why, f"Rq {height:g} um", f"Rq {height:g} uin")
    if kind == "ra":
        return round(RMS_OF_RA * height, 6)
    if kind in ("rq", "rms"):
        return height
    raise refused("roughness", finish, "gives neither Ra nor Rq", "Ra 0.2", "Rq 0.25")
