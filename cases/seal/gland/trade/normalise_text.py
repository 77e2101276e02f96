"""Normalised texts of the trade: one spelling of every sign, one form of refusal."""

from __future__ import annotations

import re
import unicodedata

from softehl.errors import SoftehlError

_SIGNS = str.maketrans(
    {"\u00d7": "x", "\u2715": "x", "\u03bc": "u"}
    | dict.fromkeys("\u2300\u2205\u00d8\u00f8\u03a6\u03c6\u00ae\u2122", " ")
)
"""Times, micro; diameter, also as a Greek letter, and marks."""

_DASHES = str.maketrans(dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212", "-"))
_COMMA = re.compile(r"(?<=\d),(?=\d)")
_TIMES = re.compile(r"(?<=[\d.m])\s*[xX*]\s*(?=\d)")

NUMBER = r"\d+(?:\.\d+)?"
"""A number in a pattern, after `plain`."""


def form(pattern: str) -> re.Pattern[str]:
    """A form of names, in small or capital letters."""
    return re.compile(pattern, re.IGNORECASE)


class NotUnderstoodError(SoftehlError, ValueError):
    """A name of the trade that is not understood; its text says what to write."""


def plain(text: str) -> str:
    """A text with a decimal point, an x between sizes, plain dashes and single spaces."""
    text = unicodedata.normalize("NFKC", text.translate(_SIGNS)).translate(_SIGNS)
    text = _COMMA.sub(".", text.translate(_DASHES))
    return " ".join(_TIMES.sub("x", text).split()).strip(" ,;")


def number_text(value: float) -> str:
    """A number as one would type it."""
    return f"{value:.10g}"


def quoted(forms: tuple[str, ...]) -> str:
    """Forms in words, each in quotation marks."""
    *others, last = (f'"{form}"' for form in forms)
    return f"{', '.join(others)} or {last}" if others else last


def refused(key: str, text: str, why: str, *forms: str) -> NotUnderstoodError:
    """The refusal of a text: what was given, why, and what to write."""
    write = f"; write {quoted(forms)}" if forms else ""
    return NotUnderstoodError(f'{key} = "{text}" {why}{write}')
