"""Sixty seals by which two versions of the program are compared, in an order that may be cut short.

40 O-rings of `tests.cases.gland_matrix`, 10 X-rings and 10 seals of other sections (5 U-cups) of
`tests.cases.section_matrix`, whose pressures are stretched from 0 to 2 to 0 to 5 shear moduli.
Each fifth of p_s / mu has the same number of each kind. A block of six seals has the kinds in
these proportions, five blocks have the pressures, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import count
from typing import Any, NamedTuple

from softehl.cases.seal.gland.parameters import Seal
from tests.cases import gland_matrix, section_matrix

STRATA = 5
HIGHEST = 20.0  # MPa, as for the O-rings
OTHERS = ("u_cup", "d_ring", "u_cup", "rectangular", "u_cup", "trapezoid")
OF_ALL_SECTIONS = {
    "round": (16, 13, 20),
    "rectangular": (10,),
    "trapezoid": (8,),
    "d_ring": (2,),
    "x_ring": (1, 66),
    "u_cup": (9, 14),
}
"""Numbers of ten seals of the sample, of all sections, with 60 states, at p_s / mu of 0.2 to 3."""

STATES = 2 * len(gland_matrix.SPEEDS)


class Drawn(NamedTuple):
    """A seal of the sample: its name, section and p_s / mu, and the keys of its case file."""

    name: str
    section: str
    ratio: float
    keys: dict[str, Any]


def sample() -> Iterator[Drawn]:
    """The seals, one after the other: ten blocks of six."""
    taken: set[str] = set()
    for block in range(10):
        others = [("x_ring", block), (OTHERS[block % len(OTHERS)], block + 2)]
        rounds = [("round", 4 * block + k) for k in range(4)]
        for section, place in (rounds[0], others[0], rounds[1], others[1], *rounds[2:]):
            yield first(section, place % STRATA, taken)


def first(section: str, stratum: int, taken: set[str]) -> Drawn:
    """The seal of lowest number with this section and whole number of p_s / mu, not yet taken."""
    numbered = ((f"{section} {n}", drawn(section == "round", n)) for n in count())
    name, p = next(
        (name, p)
        for name, p in numbered
        if p.section == section and name not in taken
        if int(p.sealed_pressure / p.shear_modulus) == stratum and p.sealed_pressure <= HIGHEST
    )
    taken.add(name)
    return Drawn(name, section, round(p.sealed_pressure / p.shear_modulus, 3), keys(p))


@cache
def drawn(is_round: bool, number: int) -> Seal:
    """An O-ring, or a seal of any other section, by number."""
    if is_round:
        return gland_matrix.drawn(number)
    p = section_matrix.drawn(number)
    return p.model_copy(update={"sealed_pressure": round(2.5 * p.sealed_pressure, 3)})


def keys(p: Seal) -> dict[str, Any]:
    """The keys of a case file, all but defaults; the estimate of the error stays on by default."""
    given = p.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    given = {k: v for k, v in given.items() if k not in ("error_estimate", "materials")}
    return {"case": "oring", **given, "stroke": "both"}
