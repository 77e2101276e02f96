"""Sealed pressure up to which films are known to be found, told before a run.

The ratio of the sealed pressure to the shear modulus decides. The numbers are those of
docs/limits.md, of a random sample of 300 glands of O-rings and one of other sections.
"""

from __future__ import annotations

from softehl.cases.seal.gland.records.free_seal import FreeSeal
from softehl.cases.seal.gland.records.solid import Solid

MOST = 6.0
"""Largest p_s / mu that is not refused: runs above it take minutes to `uncertain` states."""

_SURE, _TRIED = 3.0, 5.4
"""p_s / mu up to which every film of an O-ring was right, and the largest that was tried."""

_OTHER = 2.0
"""Largest p_s / mu at which other sections were tried."""

_ROUND_WORDS = (
    f"in a sample of O-rings all films were right at ratios to {_SURE:g}, 98 % at 3 to 4, "
    "89 % at 4 to 5; above 5 states are uncertain, and nothing was tried above "
    f"{_TRIED:g} (docs/limits.md)"
)
_OTHER_WORDS = f"sections other than round were tried up to {_OTHER:g}, not above (docs/limits.md)"
_DO = "the run may take minutes and end without a film; a harder rubber or a lower pressure helps"


def ratio(p: Solid, pressure: float) -> float:
    """Sealed pressure (MPa) over the shear modulus of the softest part of the section."""
    parts = [*([""] if p.has_body else []), *p.materials]
    return pressure / min(p.rubber(part).shear_modulus for part in parts)


def reach(p: Solid, pressure: float) -> list[str]:
    """Line about the ratio and its meaning; nothing without a pressure or beyond the reach."""
    found = ratio(p, pressure)
    return [_line(p, found)] if 0.0 < found <= _most(p) else []


def beyond_reach(p: Solid, pressure: float) -> list[str]:
    """Line with advice where the ratio is above what is known to run."""
    found = ratio(p, pressure)
    return [f"{_line(p, found)}; {_DO}"] if found > _most(p) else []


def _most(p: FreeSeal) -> float:
    return _SURE if p.round else _OTHER


def _line(p: FreeSeal, found: float) -> str:
    words = _ROUND_WORDS if p.round else _OTHER_WORDS
    return f"sealed pressure / shear modulus = {found:.2g}: {words}"
