"""Names of rubbers: polymer and hardness, "NBR 70", "FKM 75 Shore A", "PU 95".

`polymers.csv` has the polymers, with their temperatures and patterns of their other names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise

from softehl.cases.seal.gland.tables import rows
from softehl.cases.seal.gland.trade.normalise_text import NUMBER, form, number_text, plain, refused

_TABLE = rows("polymers.csv")

RANGES = {
    row["polymer"]: (float(row["from_degC"]), float(row["to_degC"])) if row["to_degC"] else None
    for row in _TABLE
}
"""Polymer -> temperatures at which a common chart of makers lets it be used for long, degC."""

GLASS = {row["polymer"]: float(row["glass_degC"]) for row in _TABLE if row["glass_degC"]}
"""Polymer -> glass transition that is typical of its common compounds, degC.

It moves with the polymer: of NBR by the acrylonitrile, -50 degC at 18 % and -15 degC at 45 %; of
FKM -30 degC and lower for grades with perfluorinated ethers.
"""

SHORE_D = ((29.0, 80.0), (33.0, 85.0), (39.0, 90.0), (46.0, 95.0), (58.0, 100.0))
"""Hardness Shore D and A, in the conversion chart of ASTM D2240."""

_SPELT = {
    word: row["polymer"]
    for row in _TABLE
    for word in (row["polymer"], *filter(None, row["also"].split("|")))
}
_POLYMER = rf"(?P<name>{'|'.join(sorted(_SPELT, key=len, reverse=True))})"
_UNIT = (
    r"(?:(?:°|deg)? ?(?:(?:sh(?:ore)?\.?)? ?-?(?P<scale>[AD])|sh(?:ore)?|(?P<irhd>IRHD)"
    r"|duro(?:meter)?|JIS[ -]?A|Hs)|°)"
)
_SHORE = rf"(?P<shore>{NUMBER})(?: ?{_UNIT})?"
_FORMS = (
    form(rf"{_POLYMER}(?:[ /-]*{_SHORE})?"),
    form(rf"{_SHORE}[ /-]*{_POLYMER}"),
    form(rf"{_POLYMER}[ ,/-]+(?:sh(?:ore)?) ?(?P<scale>[AD])[ =]*(?P<shore>{NUMBER})"),
    form(rf"(?P<shore>{NUMBER}) ?{_UNIT}"),
    form(rf"(?:sh(?:ore)?\.?|JIS) ?(?P<scale>[AD])[ =]*(?P<shore>{NUMBER})"),
    form(rf"sh(?:ore)? ?(?P<shore>{NUMBER}) ?(?P<scale>[AD])"),
)
_SHORT = {"N": "NBR", "V": "FKM", "E": "EPDM", "S": "VMQ"}
_PLASTICS = form(r"(?:PTFE|Teflon|POM|PA ?6?|PEEK|UHMW-?PE)\b.*")


@dataclass(frozen=True)
class RubberName:
    """Polymer, None where only the hardness is named, and hardness Shore A.

    hardness_text: the hardness on another scale, "70 IRHD" or "50 Shore D"; shore_A follows from
    it.
    """

    polymer: str | None
    shore_A: float
    hardness_text: str = ""

    @property
    def text(self) -> str:
        """As it is written here."""
        shore = number_text(self.shore_A)
        if self.hardness_text:
            return f"{self.polymer} {self.hardness_text}" if self.polymer else self.hardness_text
        return f"{self.polymer} {shore}" if self.polymer else f"{shore} Shore A"


def read_rubber(key: str, value: str) -> RubberName | None:
    """The rubber of a name, None where the text is not like one.  Raises NotUnderstoodError."""
    text = plain(value)
    for pattern in _FORMS:
        if match := pattern.fullmatch(text):
            return _read(key, value, match.groupdict())
    if is_plastic(text):
        why = "is a plastic, no rubber: it may be a cap, cap_thickness and materials.cap"
        raise refused(key, value, why)
    if short := re.fullmatch(r"([NVES]) ?-?(\d\d)", text, re.IGNORECASE):
        name = _SHORT[short[1].upper()]
        raise refused(key, value, "is a maker's short name", f"{name} {short[2]}")
    if match := re.match(rf"{_POLYMER}[ /-]*(?P<shore>\d\d)\b", text, re.IGNORECASE):
        shorter = _read(key, value, match.groupdict()).text
        raise refused(key, value, "says more than polymer and hardness", shorter)
    if shore := re.search(r"(?<!\d)[1-9]\d(?!\d)", text):
        forms = ("NBR 70", "FKM 75", "EPDM 80", "PU 95", f"{shore[0]} Shore A")
        raise refused(key, value, "names no polymer that is known here", *forms)
    return None


def is_plastic(text: str) -> bool:
    """True if a name is that of a plastic."""
    return _PLASTICS.fullmatch(plain(text)) is not None


def _read(key: str, text: str, groups: dict[str, str | None]) -> RubberName:
    name = groups.get("name")
    polymer = next((n for w, n in _SPELT.items() if name and re.fullmatch(w, name, re.I)), None)
    if groups["shore"] is None:
        usual = 95 if polymer == "PU" else 70
        raise refused(key, text, "needs its hardness in Shore A", f"{polymer} {usual}")
    shore, scale = float(groups["shore"]), (groups.get("scale") or "A").upper()
    if scale == "D":
        return _of_shore_d(key, text, polymer, shore)
    if not 10.0 <= shore < 100.0:
        raise refused(key, text, "is no hardness Shore A", f"{polymer or 'NBR'} 70")
    said = f"{number_text(shore)} IRHD" if groups.get("irhd") else ""
    return RubberName(polymer, shore, said)


def _of_shore_d(key: str, text: str, polymer: str | None, shore: float) -> RubberName:
    """A hardness Shore D as one Shore A.  Raises NotUnderstoodError beyond the chart."""
    low, high = SHORE_D[0][0], SHORE_D[-1][0]
    if not low <= shore < high:
        why = (
            f"is beyond the conversion chart, {low:g} to {high:g} Shore D; write the shear "
            "modulus, mu, or a hardness within it"
        )
        raise refused(key, text, why, f"{polymer or 'PU'} 46 Shore D")
    below, above = next(pair for pair in pairwise(SHORE_D) if shore < pair[1][0])
    part = (shore - below[0]) / (above[0] - below[0])
    shore_a = round(below[1] + part * (above[1] - below[1]), 2)
    return RubberName(polymer, shore_a, f"{number_text(shore)} Shore D")
