"""Sizes with a tolerance: classes of ISO 286 ("36 f7", "40 H8") and limits ("36 -0.025/-0.05").

Standard tolerances and fundamental deviations are those of the tables of ISO 286-1, up to 500 mm.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass

from softehl.cases.seal.gland.trade.text import NUMBER, number_text, plain, refused

STEPS = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
"""Upper ends of the steps of the nominal size, mm."""

GRADES: dict[int, tuple[int, ...]] = {
    5: (4, 5, 6, 8, 9, 11, 13, 15, 18, 20, 23, 25, 27),
    6: (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40),
    7: (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63),
    8: (14, 18, 22, 27, 33, 39, 46, 54, 63, 72, 81, 89, 97),
    9: (25, 30, 36, 43, 52, 62, 74, 87, 100, 115, 130, 140, 155),
    10: (40, 48, 58, 70, 84, 100, 120, 140, 160, 185, 210, 230, 250),
    11: (60, 75, 90, 110, 130, 160, 190, 220, 250, 290, 320, 360, 400),
    12: (100, 120, 150, 180, 210, 250, 300, 350, 400, 460, 520, 570, 630),
}
"""Grade IT -> standard tolerance in each step, um."""

DEVIATIONS: dict[str, tuple[int, ...]] = {
    "d": (20, 30, 40, 50, 65, 80, 100, 120, 145, 170, 190, 210, 230),
    "e": (14, 20, 25, 32, 40, 50, 60, 72, 85, 100, 110, 125, 135),
    "f": (6, 10, 13, 16, 20, 25, 30, 36, 43, 50, 56, 62, 68),
    "g": (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20),
    "h": (0,) * 13,
}
"""Letter of a shaft -> how far its upper limit is below the nominal size in each step, um.

A hole of the same letter has its lower limit as far above it; js and JS lie around it.
"""

_SIZE = rf"(?:d ?|dia\.? ?)?(?P<size>{NUMBER}) ?(?:mm)?"
_CLASS = re.compile(rf"{_SIZE}[ -]*(?P<letter>[A-Za-z]{{1,2}}) ?(?P<grade>\d{{1,2}})")
_ENDS = re.compile(rf"({NUMBER}) ?(?:mm)? ?(?:to|\.\.+|-|bis) ?({NUMBER}) ?(?:mm)?")
_BOTH = re.compile(rf"{_SIZE} ?[A-Za-z]{{1,2}} ?\d{{1,2}} ?/ ?[A-Za-z]{{1,2}} ?\d{{1,2}}")
_EQUAL = re.compile(rf"{_SIZE} ?(?:±|\+ ?/? ?-) ?(?P<by>{NUMBER}) ?(?:mm)?")
_LIMITS = re.compile(
    rf"{_SIZE} ?(?P<one>[+-] ?{NUMBER}|0(?=[ /;]))? ?[ /;]+(?P<two>[+-] ?{NUMBER}|0) ?(?:mm)?"
)


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


def read_fit(key: str, given: str, *, hole: bool = False) -> Band | None:
    """The limits of a size; None for a text without a tolerance.  Raises NotUnderstoodError.

    hole: whether the size is that of a hole, whose classes have capital letters.
    """
    text = re.sub(
        r" ?[(](?:ISO 286[^)]*|(?P<limits>[^)]*))[)]$", r" \g<limits>", plain(given)
    ).strip()
    if found := _ENDS.fullmatch(text):
        low, high = sorted(map(float, found.groups()))
        if 0.9 * high < low:
            return Band(round(0.5 * (low + high), 6), low, high)
    if found := _CLASS.fullmatch(text):
        return _class(key, given, found, hole)
    if found := _BOTH.fullmatch(text):
        shown = number_text(float(found["size"]))
        why = "is a pair of classes; a diameter has one"
        raise refused(key, given, why, f"{shown} {'H8' if hole else 'f7'}")
    if found := _EQUAL.fullmatch(text):
        ends = [-float(found["by"]), float(found["by"])]
    elif found := _LIMITS.fullmatch(text):
        ends = sorted(float((found[k] or "0").replace(" ", "")) for k in ("one", "two"))
    else:
        return None
    size = float(found["size"])
    low, high = size + ends[0], size + ends[1]
    if not 0.0 < low <= high or high - low > 0.1 * size:
        raise refused(key, given, "has limits that are no tolerance of it", f"{size:g} ±0.05")
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


def _class(key: str, given: str, found: re.Match[str], hole: bool) -> Band:
    size, letter, grade = float(found["size"]), found["letter"], int(found["grade"])
    shown, usual = number_text(size), "H8" if hole else "f7"
    small, other = letter.lower(), letter.upper() if hole else letter.lower()
    if small not in (*DEVIATIONS, "js") or grade not in GRADES:
        letters = ", ".join((*DEVIATIONS, "js"))
        raise refused(
            *(key, given, f"is beyond the tables here: {letters} and grades 5 to 12"),
            *(f"{shown} {usual}", f"{shown} ±0.05"),
        )
    if letter not in (small, small.upper()) or letter != other:
        part, case = ("hole", "capital") if hole else ("shaft", "small")
        raise refused(key, given, f"a {part} has {case} letters", f"{shown} {other}{grade}")
    if not 0.0 < size <= STEPS[-1]:
        raise refused(key, given, "ISO 286 classes are read up to 500 mm", f"{shown} ±0.05")
    return band(size, letter, grade)
