"""Lists of the desk for each key, in words of the trade; other texts may be typed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from softehl.cases.seal.gland.catalogue import as568
from softehl.cases.seal.gland.trade.ring_names import read_ring
from softehl.cases.seal.gland.trade.rubber_names import RANGES
from softehl.cases.seal.gland.trade.text import NotUnderstoodError, number_text


@dataclass(frozen=True)
class Choice:
    """A key of a case: what it is called on the desk, what it begins with, what is offered."""

    key: str
    label: str
    value: str
    options: Sequence[str]


SPEEDS = (10, 20, 50, 100, 200, 400, 800, 1600)
"""Rod speeds that are offered, mm/s."""

USUAL_SPEEDS = (100, 400)
"""Choices that a new desk begins with."""

DENSITIES = {"coarse, seconds": 1, "usual": 2, "fine": 4, "very fine, minutes": 8}
"""Meshes in words -> the key `density`."""

_SIZES = (
    *("6x2", "8x2", "10x2", "12x2", "16x2", "20x2.65", "25x2.65", "28x3.55", "32x3.55"),
    *("36x3.55", "36x4", "40x4", "45x4", "50x5.3", "56x5.3", "63x5.3", "80x5.3", "100x7"),
)
_SMALL, _LARGE = 2.5, 500.0  # mm: those that have a gland and a fit
_RINGS = (
    *(f"ISO 3601 {size}" for size in _SIZES),
    *("X-ring 36x4", "X-ring AS568-210", "X-ring AS568-226"),
    *("U-cup 20x30x8", "U-cup 25x35x8", "U-cup 36x46x8", "U-cup 50x65x12"),
    *(ring.name for ring in as568().values() if _SMALL < ring.inner_diameter < _LARGE),
)
_HARDNESSES = {"FKM": (75, 80, 90), "EPDM": (70, 80), "PU": (90, 95)}
_RUBBERS = tuple(f"{p} {s}" for p in RANGES for s in _HARDNESSES.get(p, (70, 80, 90)))
_OILS = (
    *(f"HLP {grade}" for grade in (10, 15, 22, 32, 46, 68, 100)),
    *(f"HVLP {grade}" for grade in (15, 22, 32, 46, 68)),
    *(f"ISO VG {grade}" for grade in (10, 15, 22, 32, 46, 68, 100, 150, 220)),
    *("46 cSt at 40 degC, 6.8 cSt at 100 degC", "10 mPas", "100 mPas"),
)

CHOICES = (
    Choice("ring", "Seal", "ISO 3601 36x4", _RINGS),
    Choice("rod", "Rod, or bore of a piston", "36 f7", ()),
    Choice("compound", "Rubber", "NBR 70", _RUBBERS),
    Choice("oil", "Oil", "HLP 46", _OILS),
    Choice("temperature", "Temperature", "40 degC", [f"{t} degC" for t in range(20, 101, 10)]),
    Choice(
        *("sealed_pressure", "Sealed pressure", "10 bar"),
        [f"{p} bar" for p in (1, 2, 6, 10, 16, 25, 40, 63, 100, 160)],
    ),
    Choice(
        *("roughness", "Surface of the seal", "smooth"),
        ["smooth", *(f"Ra {height}" for height in (0.1, 0.2, 0.4, 0.8))],
    ),
    Choice("gland", "Gland", "hydraulic", ["hydraulic", "pneumatic"]),
)
"""All that is chosen by one text, in the order of the desk."""


BORE = "bore "
"""What the size of a bore begins with."""


def slides_on(text: str) -> tuple[str, str]:
    """The key and its value that a rod, or a bore, is in a case."""
    bore = text.lower().startswith(BORE)
    return ("bore", text[len(BORE) :].strip()) if bore else ("rod", text)


def rods(ring: str) -> list[str]:
    """Rods that a ring goes with, the usual one first, and the bore that it just fits into; none
    where the ring is not understood.
    """
    try:
        said = read_ring(ring)
    except NotUnderstoodError:
        return []
    if said.number is None:
        sizes: tuple[float, float] = (said.inner, ceil(1.02 * said.inner))
        bore = said.outer or said.inner + 2.0 * said.section
    elif said.number in as568():
        inner = as568()[said.number].inner_diameter
        sizes = (ceil(inner), round(1.02 * inner, 1))
        bore = round(as568()[said.number].outer_diameter, 1)
    else:
        return []
    shown = dict.fromkeys(map(number_text, sizes))
    found = [f"{size}{fit}" for size in shown for fit in _FITS]
    return [*found, *(f"{BORE}{number_text(bore)}{fit}" for fit in _HOLES)]


_HOLES = (" H8", " H9", "")
_FITS = (" f7", " f8", " h8", " h9", " e8", "")
