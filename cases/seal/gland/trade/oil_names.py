"""Names of oils: "HLP 46", "ISO VG 46", "HVLP 32", "ISO VG 46 VI 150 at 50 degC", "100 mPas"."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass

from softehl.cases.harness.units import read_quantity
from softehl.cases.seal.gland.tables import rows
from softehl.cases.seal.gland.trade.normalise_text import NUMBER, form, plain, refused


@dataclass(frozen=True)
class OilFamily:
    """Fluids of ISO 6743-4 and ISO 15380 that are no mineral oils, with values typical of them.

    density: at 15 degC, kg/m^3. index: viscosity index, None where at_100 has the viscosity at 100
    degC of the grade ISO VG 46. pressure_share: pressure-viscosity coefficient over that of a
    mineral oil of the same viscosity, known to a third. highest: temperature of use, degC. attacks:
    polymers that do not resist it.
    """

    name: str
    kind: str
    density: float
    index: float | None
    at_100: float | None
    pressure_share: float
    highest: float | None
    attacks: tuple[str, ...]


_FAMILY_ROWS = rows("oil_families.csv")


def _or_none(text: str) -> float | None:
    return float(text) if text else None


FAMILIES = {
    row["family"]: OilFamily(
        row["family"],
        row["kind"],
        float(row["density"]),
        _or_none(row["index"]),
        _or_none(row["at_100_of_46"]),
        float(row["pressure_share"]),
        _or_none(row["to_degC"]),
        tuple(row["attacks"].split()),
    )
    for row in _FAMILY_ROWS
}
"""Fluids by their letters."""

IMPROVED = 140.0
"""Least viscosity index of HVLP oils, DIN 51524-3."""

GRADES = {int(row["grade"]): float(row["at_100_degC_cSt"]) for row in rows("iso_vg.csv")}
"""ISO 3448 grade, its viscosity at 40 degC (+-10 %) -> at 100 degC, of a mineral oil, cSt.

Typical of hydraulic oils without viscosity improver, viscosity index 90 to 105.
"""

POUR = {
    (int(row["grade"]), improved): float(row[column])
    for row in rows("iso_vg.csv")
    for improved, column in ((False, "pour_degC"), (True, "pour_improved_degC"))
    if row[column]
}
"""ISO 3448 grade, and whether its oil is improved (HVLP) -> the highest pour point that DIN 51524-2
or -3 allows, degC. Many oils have a lower one."""

TWO = "46 cSt at 40 degC, 6.8 cSt at 100 degC"
"""Two viscosities, as an example."""


@dataclass(frozen=True)
class OilName:
    """An oil as its name says.  grade: of ISO 3448, or points: two viscosities, each (cSt, degC).

    index: viscosity index, None where it is that of a mineral oil. temperature: degC, None where
    the name does not say it. improved: whether the index is the least of HVLP oils. family: None of
    a mineral oil, and where two viscosities are all that is said.
    """

    grade: int | None = None
    index: float | None = None
    points: tuple[tuple[float, float], ...] = ()
    temperature: float | None = None
    improved: bool = False
    family: OilFamily | None = None


_STANDARD = form(r"(?:DIN ?51524(?:-\d)?|ISO ?(?:6743|11158|12922|15380)(?:-\d)?|JIS)[ ,:]*")
_MINERAL = r"HLP-?D|HLP|HL|(?:L-)?HM|CLP|CL|HH|AW|hydraulic oil"
_IMPROVED = r"HVLP-?D|HVLP"
_FAMILY = "|".join("|".join((row["family"], row["also"])) for row in _FAMILY_ROWS)
_ISO = r"ISO[ -]?VG|VG|ISO"
_DEGREE = r"(?:deg ?C|° ?C|C)"
_WARM = rf"(?P<at>-?{NUMBER}) ?(?:{_DEGREE}|(?P<f>(?:deg ?|° ?)?F))"
_AT = rf"(?:[ ,]*(?:at|@|/|bei)? ?[(]?{_WARM}[)]?)?"
_GRADE = form(
    rf"(?P<plain>ISO[ -]?)?(?:(?P<improved>{_IMPROVED})|(?P<mineral>{_MINERAL})"
    rf"|(?P<family>{_FAMILY}))?[ -]*"
    rf"(?P<iso>{_ISO})?[ -]*"
    rf"(?P<grade>\d{{1,5}})(?:[ ,(]*VI ?=? ?(?P<index>{NUMBER})\)?)?{_AT}"
)
_POINT = form(rf"(?P<nu>{NUMBER}) ?(?:cSt|mm\^?2/s) ?(?:at|@|/|bei)? ?{_WARM}")
_OF_FAMILY = form(rf"(?P<family>{_FAMILY})[ :,;]+(?P<points>.*cSt.*|.*mm.*2/s.*)")
_GREASE = form(r".*\b(?:grease|NLGI|Fett|lithium soap|molykote)\b.*")
_OTHER = form(
    r"(?:ISO )?(?P<kind>HV|HFA[ES]?|HFB|HFC|HFD-?[RU]?|HEES|HETG|HEPG|HEPR|ATF|PAO|DOT ?\d|SAE)\b.*"
    r"|(?P<word>water|air|emulsion|skydrol).*"
)


def read_oil_name(name: str) -> OilName:
    """The oil of a name.  Raises NotUnderstoodError."""
    text = _STANDARD.sub("", plain(name))
    match = _GRADE.fullmatch(text)
    if match and any(match[k] for k in ("plain", "improved", "mineral", "iso", "family")):
        return _of_grade(match)
    family, measured = None, text
    if of_family := _OF_FAMILY.fullmatch(text):
        family, measured = _family(of_family["family"]), of_family["points"]
    points = [_POINT.fullmatch(part.strip()) for part in re.split(r"[;,]| and ", measured)]
    if len(points) == 2 and all(points):
        pairs = tuple((float(p["nu"]), _celsius(p)) for p in points if p)
        for nu, at in pairs:
            if not (0.7 < nu < 1e6 and -60.0 <= at <= 300.0):
                raise refused("oil", name, f": {nu:g} cSt at {at:g} degC is out of range", TWO)
        return OilName(points=pairs, family=family)
    raise _unknown(name, text)


def dynamic(text: str) -> float | None:
    """The dynamic viscosity (MPa s) that a text is, None where it is none."""
    with suppress(ValueError):
        return read_quantity(plain(text), "MPa s")
    return None


def _celsius(match: re.Match[str]) -> float:
    """The temperature of a name, degC."""
    at = float(match["at"])
    return round((at - 32.0) / 1.8, 6) if match["f"] else at


def _of_grade(match: re.Match[str]) -> OilName:
    improved = bool(match["improved"] and not match["index"])
    index = float(match["index"]) if match["index"] else IMPROVED if improved else None
    at = _celsius(match) if match["at"] else None
    family = _family(match["family"]) if match["family"] else None
    return OilName(int(match["grade"]), index, temperature=at, improved=improved, family=family)


def _family(text: str) -> OilFamily:
    """The fluids that a word of `_FAMILY` means."""
    return next(
        FAMILIES[row["family"]]
        for row in _FAMILY_ROWS
        if re.fullmatch(f"{row['family']}|{row['also']}", text, re.IGNORECASE)
    )


def _unknown(name: str, text: str) -> Exception:
    """The refusal of a text that is no oil."""
    if _GREASE.fullmatch(text):
        why = (
            "is a grease: its film is one of its base oil, thinner where that does not flow back; "
            "write the base oil, by the viscosities of its data sheet"
        )
        return refused("oil", name, why, TWO)
    numbers = [int(n) for n in re.findall(r"(?<![\d.])\d+(?![\d.])", text)]
    grade = next((n for n in numbers if n in GRADES), 46)
    forms = (f"ISO VG {grade}", f"HLP {grade}", f"HVLP {grade}", TWO)
    if match := _OTHER.fullmatch(text):
        kind = match["kind"] or match["word"]
        if kind.upper() == "HV":
            return refused("oil", name, "does not say its viscosity index", *forms[2:])
        if kind.upper().replace("-", "") in FAMILIES:
            return refused("oil", name, "needs its grade", f"{kind} 46", TWO)
        why = (
            "does not say its viscosity: take two values from its data sheet, with oil_density and "
            "pressure_viscosity"
        )
        return refused("oil", name, why, TWO)
    if re.search(r"cSt|mm\^?2/s", text, re.IGNORECASE):
        why = "is not understood (one viscosity says nothing of another temperature)"
    elif re.search(r"[A-Za-z]{3,}", text):
        why = "is not understood (for a brand write the ISO VG of its data sheet)"
    else:
        why = "is not understood"
    return refused("oil", name, why, *forms)
