"""Sixty seals by which two versions of the program are compared, in an order that may be cut short.

40 O-rings of `tests.cases.gland_matrix`, 10 X-rings and 10 seals of other sections of
`tests.cases.section_matrix` (5 U-cups), the pressure of the latter stretched from 0 to 2 shear
moduli to 0 to 5. Each fifth of p_s / mu from 0 to 5 has equal numbers of the three kinds. After any
block of six seals the kinds, after any five blocks the pressures are in their right proportion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, NamedTuple

from softehl.cases.seal.gland.parameters import ORing
from tests.cases import gland_matrix, section_matrix

STRATA = 5
HIGHEST = 20.0  # MPa, as for the O-rings
OTHERS = ("u_cup", "d_ring", "u_cup", "rectangular", "u_cup", "trapezoid")
BLOCK = ("round", "x_ring", "round", "other", "round", "round")
STATES = 2 * len(gland_matrix.SPEEDS)


class Drawn(NamedTuple):
    """A seal of the sample: its name, its p_s / mu, and the keys of its case file."""

    name: str
    section: str
    ratio: float
    keys: dict[str, Any]


def o_ring(number: int) -> ORing:
    """An O-ring by number."""
    return gland_matrix.drawn(number)


def other(number: int) -> ORing:
    """A seal of another section by number, at up to five shear moduli."""
    p = section_matrix.drawn(number)
    changes = {"sealed_pressure": round(2.5 * p.sealed_pressure, 3)}
    return p.model_copy(update=changes)


def first(draw: Callable[[int], ORing], section: str, stratum: int, taken: set[str]) -> Drawn:
    """The seal of lowest number with this section and whole number of p_s / mu, not yet taken."""
    for number in count():
        p, name = draw(number), f"{section} {number}"
        ratio = p.sealed_pressure / p.shear_modulus
        fits = p.section == section and int(ratio) == stratum and p.sealed_pressure <= HIGHEST
        if fits and name not in taken:
            taken.add(name)
            return Drawn(name, section, round(ratio, 3), keys(p))
    raise AssertionError("numbers do not end")


def keys(p: ORing) -> dict[str, Any]:
    """What a case file has to say of a seal; the estimate of its error is the default, on."""
    given = p.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    given = {k: v for k, v in given.items() if k not in ("error_estimate", "materials")}
    return {"case": "oring", **given, "stroke": "both"}


def sample() -> Iterator[Drawn]:
    """The seals, one after the other: ten blocks of six."""
    taken: set[str] = set()
    rounds = count()
    for block in range(10):
        for kind in BLOCK:
            if kind == "round":
                yield first(o_ring, kind, next(rounds) % STRATA, taken)
            elif kind == "x_ring":
                yield first(other, kind, block % STRATA, taken)
            else:
                section = OTHERS[block % len(OTHERS)]
                yield first(other, section, (block + 2) % STRATA, taken)
