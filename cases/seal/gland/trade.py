"""How the trade writes rubbers and roughnesses: read, or answered with what to write instead."""

from __future__ import annotations

import re
from math import pi, sqrt

RMS_OF_RA = sqrt(0.5 * pi)
"""Rms height over mean height (Ra) of a surface whose heights have a normal distribution."""

_POLYMERS = (
    *("NBR", "HNBR", "XNBR", "FKM", "FPM", "FFKM", "FEPM", "EPDM", "EPM", "VMQ", "MVQ", "FVMQ"),
    *("CR", "ACM", "AEM", "IIR", "SBR", "NR", "AU", "EU", "PU", "PUR", "TPU"),
)
_NUMBER = r"(?P<shore>\d{1,3}(\.\d+)?)"
_RUBBER = re.compile(
    rf"(?P<name>{'|'.join(_POLYMERS)})([\s-]*{_NUMBER}\s*((sh(ore)?)?\s*A)?)?", re.IGNORECASE
)
_SHORE = re.compile(rf"{_NUMBER}\s*sh(ore)?\s*A?|sh(ore)?\s*A\s*(?P<also>\d{{1,3}})", re.IGNORECASE)
_HEIGHT = re.compile(r"R(?P<kind>[aqz])\s*=?\s*(?P<height>\d+\.?\d*)\s*(um|µm)?", re.IGNORECASE)


def hardness(text: str) -> float | None:
    """Shore A of a rubber, "NBR 70" or "70 Shore A"; None for another text.

    Raises ValueError for a polymer without a hardness.
    """
    if found := _RUBBER.fullmatch(text.strip()):
        if found["shore"] is None:
            name = found["name"].upper()
            raise ValueError(f'"{text}" needs its hardness in Shore A: write "{name} 70"')
        return float(found["shore"])
    if found := _SHORE.fullmatch(text.strip()):
        return float(found["shore"] or found["also"])
    return None


def no_height(text: str) -> str:
    """Why a text is no rms height in um, and what to write."""
    found = _HEIGHT.fullmatch(text.strip())
    if not found:
        return f'"{text}" is no rms height; write a number in um, as in 0.25'
    height = float(found["height"])
    if found["kind"] == "a":
        return (
            f'"{text}" is a mean height; write the rms height, {RMS_OF_RA:.3g} times as much '
            f"where heights are distributed normally: {RMS_OF_RA * height:.3g}"
        )
    if found["kind"] == "q":
        return f'"{text}" is an rms height: write {height:g}'
    return f'"{text}" is a height from peak to valley; write the rms height Rq in um, as in 0.25'
