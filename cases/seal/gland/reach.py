"""Sealed pressure over the shear modulus: what decides whether films are found."""

from __future__ import annotations

from softehl.cases.seal.gland.records.solid import Solid

MOST = 6.0
"""Largest p_s / mu that is not refused: runs above it take minutes to `uncertain` states."""


def ratio(p: Solid, pressure: float) -> float:
    """Sealed pressure (MPa) over the shear modulus of the softest part of the section."""
    parts = [*([""] if p.has_body else []), *p.materials]
    return pressure / min(p.rubber(part).shear_modulus for part in parts)
