"""Sizes with a tolerance: classes of ISO 286 ("36 f7", "40 H8") and limits ("36 -0.025/-0.05").

Limits may be in inches, and deviations of a size in mm in um.

`iso286.csv` holds the standard tolerances and fundamental deviations of ISO 286-1 up to 500 mm, um.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass

from softehl.cases.harness.units import read_fraction
from softehl.cases.seal.gland.grooves import INCH
from softehl.cases.seal.gland.tables import rows
from softehl.cases.seal.gland.trade.normalise_text import NUMBER, number_text, plain, refused

_TABLE = rows("iso286.csv")


def _column(name: str) -> tuple[int, ...]:
    return tuple(int(row[name]) for row in _TABLE)


STEPS = _column("to_mm")
"""Upper ends of the steps of the nominal size, mm."""

GRADES = {
    int(name.removeprefix("IT")): _column(name) for name in _TABLE[0] if name.startswith("IT")
}
"""Grade IT -> standard tolerance in each step, um."""

DEVIATIONS = {letter: _column(letter) for letter in "defgh"}
"""Letter of a shaft -> how far its upper limit is below the nominal size in each step, um.

A hole of the same letter has its lower limit as far above it; js and JS lie around it.
"""

_SIZE = rf"(?:d ?|dia\.? ?)?(?P<size>{NUMBER}) ?(?:mm)?"
_CLASS = re.compile(rf"{_SIZE}[ -]*(?P<letter>[A-Za-z]{{1,2}}) ?(?P<grade>\d{{1,2}})")
_ENDS = re.compile(rf"({NUMBER}) ?(?:mm)? ?(?:to|\.\.+|-|bis) ?({NUMBER}) ?(?:mm)?")
_BOTH = re.compile(rf"{_SIZE} ?[A-Za-z]{{1,2}} ?\d{{1,2}} ?/ ?[A-Za-z]{{1,2}} ?\d{{1,2}}")
_EQUAL = re.compile(rf"{_SIZE} ?(?:±|\+ ?/? ?-) ?(?P<by>{NUMBER}) ?(?:mm|(?P<um>um))?")
_LIMITS = re.compile(
    rf"{_SIZE} ?(?P<one>[+-] ?{NUMBER}|0(?=[ /;]))? ?[ /;]+(?P<two>[+-] ?{NUMBER}|0)"
    r" ?(?:mm|(?P<um>um))?"
)
_IN = re.compile(r"(?<=\d) ?(?:in(?:ch(?:es)?)?\b\.?|\"|'')", re.IGNORECASE)
_FRACTION = re.compile(r"^(?:\d+[ -])?\d+/[1-9]\d*(?![\d/])")
_POINT = re.compile(r"(?<![\d.])\.(?=\d)")


@dataclass(frozen=True)
class Band:
    """A size and its limits, mm."""

    nominal: float
    low: float
    high: float

    @property
    def middle(self) -> float:
        """Of the limits."""
        return round(0.5 * (self.low + self.high), 6)

    @property
    def half(self) -> float:
        """From the middle to a limit."""
        return 0.5 * (self.high - self.low)


def read_fit(key: str, size_text: str, *, hole: bool | None = False) -> Band | None:
    """The limits of a size; None for a text without a tolerance.  Raises NotUnderstoodError.

    hole: whether the size is that of a hole, whose classes have capital letters; None for a size
    that is neither a hole nor a shaft and takes both.
    """
    text = re.sub(
        r" ?[(](?:ISO 286[^)]*|(?P<limits>[^)]*))[)]$", r" \g<limits>", plain(size_text)
    ).strip()
    text, inches = _IN.subn("", text)
    unit = INCH if inches else 1.0
    if inches:
        text = _POINT.sub("0.", _FRACTION.sub(lambda match: str(read_fraction(match[0])), text))
    if match := _ENDS.fullmatch(text):
        low, high = sorted(unit * float(end) for end in match.groups())
        if 0.9 * high < low:
            return Band(round(0.5 * (low + high), 6), low, high)
    if inches and (_CLASS.fullmatch(text) or "mm" in text):
        raise refused(key, size_text, "mixes inches with mm", f"{re.split('[^0-9.]', text)[0]} in")
    if match := _CLASS.fullmatch(text):
        return _class(key, size_text, match, hole)
    if match := _BOTH.fullmatch(text):
        shown_size = number_text(float(match["size"]))
        why = "is a pair of classes; a diameter has one"
        raise refused(key, size_text, why, f"{shown_size} {'H8' if hole else 'f7'}")
    if match := _EQUAL.fullmatch(text):
        deviations = [-float(match["by"]), float(match["by"])]
    elif match := _LIMITS.fullmatch(text):
        deviations = sorted(float((match[k] or "0").replace(" ", "")) for k in ("one", "two"))
    else:
        return None
    size = unit * float(match["size"])
    micro = 1e-3 if match["um"] else unit
    low, high = size + micro * deviations[0], size + micro * deviations[1]
    if not 0.0 < low <= high or high - low > 0.1 * size:
        usual = f"{size / unit:g} in ±0.002 in" if inches else f"{size:g} ±0.05"
        raise refused(key, size_text, "has limits that are no tolerance of it", usual)
    return Band(size, low, high)


def band(nominal: float, letter: str, grade: int) -> Band:
    """The limits of a class, small letters for shafts.  KeyError, IndexError beyond the tables."""
    step = bisect_left(STEPS, nominal)
    width, small = 1e-3 * GRADES[grade][step], letter.lower()
    if small == "js":
        return Band(nominal, nominal - 0.5 * width, nominal + 0.5 * width)
    away = 1e-3 * DEVIATIONS[small][step]
    if letter == small:
        return Band(nominal, nominal - away - width, nominal - away)
    return Band(nominal, nominal + away, nominal + away + width)


def _class(key: str, size_text: str, match: re.Match[str], hole: bool | None) -> Band:
    size, letter, grade = float(match["size"]), match["letter"], int(match["grade"])
    shown_size, usual = number_text(size), "H8" if hole else "f7"
    letters = (*DEVIATIONS, "js")
    if letter.lower() not in letters or grade not in GRADES:
        why = f"is beyond the tables here: {', '.join(letters)} and grades 5 to 12"
        raise refused(key, size_text, why, f"{shown_size} {usual}", f"{shown_size} ±0.05")
    part, case, other = ("hole", "capital", letter.upper())
    if not hole:
        part, case, other = ("shaft", "small", letter.lower())
    if hole is not None and letter != other:
        why = f"has the letter of a {'shaft' if hole else 'hole'}: a {part} has {case} letters"
        raise refused(key, size_text, why, f"{shown_size} {other}{grade}")
    if not 0.0 < size <= STEPS[-1]:
        why = "is beyond the tables: ISO 286 classes are read up to 500 mm"
        raise refused(key, size_text, why, f"{shown_size} ±0.05")
    return band(size, letter, grade)
