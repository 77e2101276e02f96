"""Standard rings by name.

`as568.csv` holds the 349 general sizes of SAE AS568 (-001 to -475, inch): inside diameter, section
and their tolerances. They were compared, one by one, with the public ISO 3601-1 class A table of
bell-jamie/o-ring-studio. Every inside diameter agrees within rounding. So does every tolerance but
those of -228 to -231: that table has no band for 0.020 in, which other series have at these
diameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from softehl.cases.seal.gland.grooves import INCH
from softehl.cases.seal.gland.tables import rows
from softehl.cases.seal.gland.trade.normalise_text import NotUnderstoodError, refused
from softehl.cases.seal.gland.trade.ring_names import read_ring


@dataclass(frozen=True)
class Ring:
    """A ring as it is sold, mm. Tolerances are +-, None where the class gives none."""

    name: str
    inner_diameter: float
    section_diameter: float
    inner_tolerance: float | None = None
    section_tolerance: float | None = None

    @property
    def outer_diameter(self) -> float:
        """Inside diameter and twice the section, mm."""
        return self.inner_diameter + 2.0 * self.section_diameter


def ring(name: str) -> Ring:
    """The ring of a name (trade.ring_names), of a round section or an X-ring.

    A metric ring has the tolerances of ISO 3601-1, class B, for general use. Raises
    NotUnderstoodError, which names the nearest rings.
    """
    ring_name = read_ring(name)
    if ring_name.outer is not None:
        raise refused("ring", name, "is a U-cup, which is named by its groove")
    if ring_name.number is not None:
        return _by_number(name.strip(), ring_name.number)
    return _metric(name.strip(), ring_name.inner, ring_name.section)


@cache
def as568() -> dict[int, Ring]:
    """The 349 general sizes by number, mm."""
    return {int(row["number"]): _ring(row) for row in rows("as568.csv")}


def _ring(row: dict[str, str]) -> Ring:
    names = ("inner_in", "section_in", "inner_tolerance_in", "section_tolerance_in")
    return Ring(f"AS568-{row['number']}", *(round(float(row[name]) * INCH, 4) for name in names))


def _metric(name: str, inner: float, section: float) -> Ring:
    """A ring with the tolerances of class B: its rule (A.1) and its steps of the section."""
    if not 0.5 * section <= inner <= 1500.0 or not 0.5 <= section <= 20.0:
        raise NotUnderstoodError(
            f'ring = "{name}" has an inside diameter of {inner:g} and a section of {section:g} mm; '
            "write inside diameter x section in mm, the section 0.5 to 20 mm"
        )
    steps = {2.25: 0.08, 3.15: 0.09, 4.50: 0.10, 6.30: 0.13, 8.40: 0.15}
    tolerance = round(0.009 * inner**0.95 + 0.11, 2)
    of_section = next((steps[limit] for limit in steps if section <= limit), None)
    return Ring(f"ISO 3601 {inner:g}x{section:g}", inner, section, tolerance, of_section)


def _by_number(text: str, number: int) -> Ring:
    rings = as568()
    if number in rings:
        return rings[number]
    below, above = [n for n in rings if n < number][-1:], [n for n in rings if n > number][:1]
    neighbours = " and ".join(f'"{rings[n].name}"' for n in (*below, *above))
    raise NotUnderstoodError(
        f'ring = "{text}": AS568 has no general size -{number:03d}; nearest: {neighbours} '
        "(-001 to -050, -102 to -178, -201 to -284, -309 to -395, -425 to -475)"
    )
