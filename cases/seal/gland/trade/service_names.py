"""Service of a seal: "1e6 cycles", "2000 h", "500 km", to a number of cycles."""

from __future__ import annotations

import re

from softehl.cases.seal.gland.trade.normalise_text import form, plain, refused

_KINDS = {
    "cycles": (1.0, r"cycles?|double strokes?"),
    "s": (3600.0, r"h|hrs?|hours?"),
    "mm": (1e6, r"km"),
}
"""What service is counted in -> how much of it one of a unit is, and the unit."""
_SERVICE = form(r"(?P<number>\d+(?:[ _]\d{3})*(?:\.\d+)?(?:e[+]?\d+)?) ?(?P<unit>[a-z][a-z ]*)")


def read_service(text: str) -> tuple[float, str]:
    """A service as an amount of cycles, of seconds ("s") or of millimetres of travel ("mm").

    Raises NotUnderstoodError.
    """
    if match := _SERVICE.fullmatch(plain(text)):
        number = float(re.sub(r"[ _]", "", match["number"]))
        for kind, (factor, pattern) in _KINDS.items():
            if number > 0.0 and re.fullmatch(pattern, match["unit"].strip(), re.IGNORECASE):
                return factor * number, kind
    raise refused("service", text, "is not understood", "1e6 cycles", "2000 h", "500 km")


def service_cycles(text: str, travel: float, period: float) -> float:
    """Number of cycles in a service.

    travel: of the rod from end to end, mm, twice in a cycle. period: of a cycle, s. Raises
    NotUnderstoodError.
    """
    amount, kind = read_service(text)
    return amount / {"cycles": 1.0, "s": period, "mm": 2.0 * travel}[kind]
