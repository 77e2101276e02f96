"""Standard rings by name.

`as568.csv` holds the 349 general sizes of SAE AS568 (-001 to -475, inch): inside diameter, section
and their tolerances. They were compared, one by one, with the public ISO 3601-1 class A table of
bell-jamie/o-ring-studio. Every inside diameter agrees within rounding. So does every tolerance but
those of -228 to -231: that table has no band for 0.020 in, which other series have at these
diameters.

`ring_series.csv` holds series whose names are a letter and a size, mm, a row for each section: the
size less a constant is the inside diameter, or it stands behind the size. P, G and V are those of
JIS B 2401-1, with the tolerances of their sections and, of P and G, the grooves of cylinders of JIS
B 2401-2 (without back-up rings). S is the slim series of Japanese makers, not that of JIS B 2401-1
of 2012. R is the French series from R8 on; R28 to R52 are AS568-325 to -349. Of these series single
rows alone were compared with another list.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from softehl.cases.seal.gland.grooves import INCH, Groove, Kind, gland
from softehl.cases.seal.gland.tables import rows
from softehl.cases.seal.gland.trade.normalise_text import NotUnderstoodError, refused
from softehl.cases.seal.gland.trade.ring_names import RingName, read_ring, size_of

STANDARDS = {"P": "JIS B 2401", "G": "JIS B 2401", "V": "JIS B 2401"}
"""Series -> the standard that it is of, where there is one."""

FRENCH = {f"R{28 + n}": 325 + n for n in range(25)}
"""Size of the French series -> the size of AS568 that it is."""


@dataclass(frozen=True)
class Ring:
    """A ring as it is sold, mm. Tolerances are +-, None where the class gives none.

    groove: that of its standard, for hydraulics; None where a chart for the section has it.
    """

    name: str
    inner_diameter: float
    section_diameter: float
    inner_tolerance: float | None = None
    section_tolerance: float | None = None
    groove: Groove | None = None

    @property
    def outer_diameter(self) -> float:
        """Inside diameter and twice the section, mm."""
        return self.inner_diameter + 2.0 * self.section_diameter


def ring(name: str) -> Ring:
    """The ring of a name (trade.ring_names), of a round section or an X-ring.

    A metric ring has the tolerances of ISO 3601-1, class B, for general use. Raises
    NotUnderstoodError, which names the nearest rings.
    """
    ring_name, text = read_ring(name), name.strip()
    if ring_name.outer is not None:
        raise refused("ring", name, "is a U-cup, which is named by its groove")
    if ring_name.inch is not None:
        return _by_inches(text, ring_name)
    if ring_name.code is not None:
        return _by_code(text, ring_name.code)
    if ring_name.number is not None:
        return _by_number(text, ring_name)
    return _metric(text, ring_name.inner, ring_name.section)


def ring_gland(name: str | None, section: float, kind: Kind, shape: str = "round") -> Groove:
    """The standard gland of a ring of this name, or of a section (mm) of this shape.  ValueError.

    A ring of JIS B 2401 has the groove of that standard, except in pneumatics.
    """
    if name and read_ring(name).outer is None:
        result = ring(name)
        section = result.section_diameter  # as it was made: the seal may have swollen
        if result.groove is not None and kind != "pneumatic" and shape == "round":
            return result.groove
    return gland(section, kind, shape)


def ring_for(name: str, inner: float) -> str | None:
    """The ring of the same catalogue and section as the one of a name, for another inside, mm.

    Its inside is within 5 % of what is asked for; None where there is none.
    """
    ring_name = read_ring(name)
    if ring_name.outer is not None:
        return None
    result = ring(name)
    if ring_name.code is None and ring_name.number is None and ring_name.inch is None:
        return f"{round(inner):g}x{result.section_diameter:g}" if inner >= 1.0 else None
    letter = ring_name.code[0] if ring_name.code else ""
    names = {code: r for code, r in series().items() if code[0] == letter}
    same = names or {r.name: r for r in as568().values()}
    close = {n: r for n, r in same.items() if r.section_diameter == result.section_diameter}
    best = min(close, key=lambda n: abs(close[n].inner_diameter - inner), default=None)
    if best is None or abs(close[best].inner_diameter / inner - 1.0) > 0.05:
        return None
    return best


@cache
def as568() -> dict[int, Ring]:
    """The 349 general sizes by number, mm."""
    return {int(row["number"]): _ring(row) for row in rows("as568.csv")}


def _ring(row: dict[str, str]) -> Ring:
    names = ("inner_in", "section_in", "inner_tolerance_in", "section_tolerance_in")
    inner, section, of_inner, of_section = (round(float(row[n]) * INCH, 4) for n in names)
    return Ring(f"AS568-{row['number']}", inner, section, of_inner, of_section)


@cache
def series() -> dict[str, Ring]:
    """The rings of the series by letter and size, mm."""
    rings = {}
    for row in rows("ring_series.csv"):
        section, letter = float(row["section"]), row["series"]
        groove = None
        if row["depth"]:
            groove = Groove(section, float(row["depth"]), float(row["width"]))
        tolerance = float(row["section_tolerance"]) if row["section_tolerance"] else None
        for size in row["sizes"].split():
            number, _, inner = size.partition("=")
            inner = inner or str(round(float(number.removesuffix("A")) - float(row["less"]), 2))
            code = letter + number
            name = f"{STANDARDS.get(letter, '')} {code}".strip()
            rings[code] = Ring(name, float(inner), section, None, tolerance, groove)
    return rings


def _by_code(text: str, code: str) -> Ring:
    """A ring of a series.  NotUnderstoodError names its neighbours."""
    if code in FRENCH:
        return as568()[FRENCH[code]]
    result = series()
    if code in result:
        return result[code]

    def away(other: str) -> float:
        return abs(size_of(other) - size_of(code))

    same = sorted((c for c in (*result, *FRENCH) if c[0] == code[0]), key=away)
    standard = STANDARDS.get(code[0], f"series {code[0]}")
    forms = sorted(same[:2], key=size_of)
    raise refused("ring", text, f"is no size of {standard} that is known here", *forms)


def _metric(name: str, inner: float, section: float) -> Ring:
    """A ring of any size with the tolerances of class B."""
    if not 0.5 * section <= inner <= 1500.0 or not 0.5 <= section <= 20.0:
        raise NotUnderstoodError(
            f'ring = "{name}" has an inside diameter of {inner:g} and a section of {section:g} mm; '
            "write inside diameter x section in mm, the section 0.5 to 20 mm"
        )
    return _class_b(f"ISO 3601 {inner:g}x{section:g}", inner, section)


def _class_b(name: str, inner: float, section: float) -> Ring:
    """A ring with the tolerances of class B: its rule (A.1) and its steps of the section."""
    steps = {2.25: 0.08, 3.15: 0.09, 4.50: 0.10, 6.30: 0.13, 8.40: 0.15}
    tolerance = round(0.009 * inner**0.95 + 0.11, 2)
    of_section = next((steps[limit] for limit in steps if section <= limit), None)
    return Ring(name, inner, section, tolerance, of_section)


def _by_number(text: str, ring_name: RingName) -> Ring:
    """A size of AS568, which has the tolerances of class A unless it is said to be of class B."""
    rings, number = as568(), ring_name.number or 0
    if number not in rings:
        below, above = [n for n in rings if n < number][-1:], [n for n in rings if n > number][:1]
        neighbours = " and ".join(f'"{rings[n].name}"' for n in (*below, *above))
        raise NotUnderstoodError(
            f'ring = "{text}": AS568 has no general size -{number:03d}; nearest: {neighbours} '
            "(-001 to -050, -102 to -178, -201 to -284, -309 to -395, -425 to -475)"
        )
    result = rings[number]
    sizes = result.inner_diameter, result.section_diameter
    named = ring_name.inner, ring_name.section
    if ring_name.inner and max(abs(a - b) for a, b in zip(sizes, named, strict=True)) > 0.02:
        raise NotUnderstoodError(
            f'ring = "{text}": size {number:03d} is {sizes[0]:.2f}x{sizes[1]:.2f}, not '
            f'{named[0]:g}x{named[1]:g}; write "{result.name}" or "{named[0]:g}x{named[1]:g}"'
        )
    return _class_b(f"ISO 3601 {number:03d}B", *sizes) if ring_name.iso_class == "B" else result


NOMINAL = {1 / 16: 0.070, 3 / 32: 0.103, 1 / 8: 0.139, 3 / 16: 0.210, 1 / 4: 0.275}
"""Section as AS568 names it -> as it is, in."""


def _by_inches(text: str, ring_name: RingName) -> Ring:
    """A ring by inches: of nominal sizes (1/8 in is 0.139 in), or as it is.

    A nominal inside diameter is up to 0.07 in larger than the true one. Raises NotUnderstoodError.
    """
    inner, section = ring_name.inner, ring_name.section
    if ring_name.inch == "nominal":
        true = NOMINAL.get(section)
        if true is None:
            names = ", ".join(str(Fraction(n)) for n in NOMINAL)
            raise NotUnderstoodError(
                f'ring = "{text}": nominal sections of AS568 are {names} in; write other sections '
                'as they are, as in "1.484 in x 0.139 in"'
            )
        same = [r for r in as568().values() if abs(r.section_diameter / INCH - true) < 5e-4]
        result = min(same, key=lambda r: abs(r.inner_diameter / INCH + 0.015 - inner))
        away = inner - result.inner_diameter / INCH
        if (32.0 * inner) % 1.0 or not -0.002 <= away <= 0.07:
            raise refused("ring", text, "is no nominal size of AS568; the nearest is", result.name)
        return result
    close = [r for r in as568().values() if abs(r.inner_diameter - INCH * inner) <= 0.13]
    close = [r for r in close if abs(r.section_diameter - INCH * section) <= 0.08]
    if close:
        return min(close, key=lambda r: abs(r.inner_diameter - INCH * inner))
    return _metric(text, round(INCH * inner, 4), round(INCH * section, 4))
