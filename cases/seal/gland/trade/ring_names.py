"""Names of rings: "36x4", "ISO 3601 36x4", "AS568-210", "X-ring 36x4", "U-cup 25x35x8"."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

from softehl.cases.seal.gland.trade.normalise_text import NUMBER, form, plain, refused

Kind = Literal["round", "x_ring", "u_cup"]


@dataclass(frozen=True)
class RingName:
    """A ring as its name says, mm.  kind: of the section, None where the name does not say it.

    number: of SAE AS568; else inner and section; a U-cup is named by its groove instead: rod
    (inner), groove diameter (outer) and groove width. bore_first: named as a piston seal is, by its
    bore (outer), groove diameter (inner) and width.
    """

    number: int | None = None
    inner: float = 0.0
    section: float = 0.0
    kind: Kind | None = None
    outer: float | None = None
    width: float | None = None
    bore_first: bool = False


_SECTIONS = {
    "round": r"O[- ]?rings?|ORs?|O[- ]?seals?|RORs?|toroidal seals?|circular",
    "x_ring": r"X[- ]?rings?|XRs?|quad(?:[- ]?(?:rings?|seals?))?|4[- ]?lobe(?:d)?(?: rings?)?"
    r"|Q-?(?=4-?\d\d\d)",
    "u_cup": r"U[- ]?cups?|U[- ]?rings?|U[- ]?seals?|lip seals?|Nutring",
    "d_ring": r"D[- ]?rings?",
    "rectangular": r"square(?:[- ]rings?)?|rectangle",
    "trapezoid": r"trapezoid(?:al)?(?: rings?)?",
}
"""Section -> what it is called."""

_STANDARD = form(
    r"\b(?:(?:DIN|EN|BS|GOST R)[ -]?)*ISO[ -]?3601(?:-[1-5][AB]?(?!\d))?(?:[:-](?:19|20)\d\d)?"
    r"|\bDIN[ -]?377[01](?:-[1-5](?!\d))?|\bGB/?T[ -]?3452(?:\.1)?"
)
_DASH = form(
    r"(?P<said>(?:SAE )?AS[ -]?568[A-G]?(?: dash| no\.?)?|ARP ?568|#|BS(?: ?1806)?|Parker"
    r"|dash|size|no\.?)?"
    r"[ -]*?(?P<dash>2-|-)?(?P<number>\d{1,3})[AB]?"
)
_QUAD = re.compile(r"4-?(?P<number>\d{3})")
_MILITARY = form(
    r"(?P<name>MS ?-?(?:28775|29513)|M ?-?(?:25988|83248|83461|83485)(?:/\d)?"
    r"|NAS ?-?(?:1593|1594|1611))"
    r"[ -]+(?P<number>\d{3})"
)
"""Standards of rubbers whose rings have the dash numbers of AS568."""
_COMPOUND = form(
    r"(?P<ring>.*\d)[ ,;/-]+(?P<rubber>(?:[XH]?NBR|F?FKM|FPM|EPDM|F?VMQ|PUR?|CR|ACM)[ -]?\d\d\b.*)"
)
_POLYMER = form(
    r"(?P<ring>.*\d)[ ,;/-]+(?P<rubber>(?:[XH]?NBR|F?FKM|FPM|EPDM|F?VMQ|PUR?|CR|ACM|Viton)\b.*)"
)
_SIZE = form(
    rf"(?:\d{{3}}[AB][ -]+)?(?:ID|d1)?[ =]*(?P<inner>{NUMBER}) ?(?:mm)?x(?P<section>{NUMBER})"
    rf" ?(?:mm)?(?:x(?P<third>{NUMBER}) ?(?:mm)?)?(?:[ -]+[NS])?"
)
_WORDS = form(
    rf"(?:ID|d1|inside|inner)?[ =]*(?P<inner>{NUMBER}) ?(?:mm)?[ ,;/]+(?:CS|d2|section)[ =]*"
    rf"(?P<section>{NUMBER}) ?(?:mm)?"
)


def read_ring(name: str) -> RingName:
    """The ring of a name.  Raises NotUnderstoodError."""
    text = plain(name)
    remainder, kind = _without_kind(_STANDARD.sub(" ", text))
    match = (
        None if text.startswith("-") else _SIZE.fullmatch(remainder) or _WORDS.fullmatch(remainder)
    )
    if match:
        sizes = match.groupdict()
        third = sizes.get("third")
        a, b = float(sizes["inner"]), float(sizes["section"])
        if third is None:
            if kind == "u_cup":
                why = "is a U-cup, which is named by rod x groove diameter x width"
                usual = f"U-cup {a:g}x{a + 2 * b:g}x{round(1.6 * b, 1):g}"
                raise refused("ring", name, why, usual)
            return RingName(inner=a, section=b, kind=kind)
        if (kind is None and b > a) or (kind == "u_cup" and b != a):
            inner, outer, width = min(a, b), max(a, b), float(third)
            return RingName(inner=inner, kind="u_cup", outer=outer, width=width, bore_first=a > b)
    if kind == "x_ring" and (match := _QUAD.fullmatch(remainder)):
        return RingName(number=int(match["number"]), kind=kind)
    if (match := _DASH.fullmatch(remainder)) and kind != "u_cup":
        number = match["number"]
        if not (match["said"] or match["dash"] or len(number) == 3):
            why = "is a number of AS568 or a diameter"
            raise refused("ring", name, why, f"AS568-{int(number):03d}", f"{number}x3.55")
        return RingName(number=int(number), kind=kind)
    raise _unknown(name, remainder, kind)


def read_section(word: str) -> str:
    """The section that a word of the trade means; any other text as it is."""
    text = plain(word)
    sections = (
        name for name, pattern in _SECTIONS.items() if re.fullmatch(pattern, text, re.IGNORECASE)
    )
    return next(sections, word)


def _without_kind(text: str) -> tuple[str, Kind | None]:
    """A text without the word for a section, and which it is."""
    kinds: tuple[Kind, ...] = get_args(Kind)
    for kind in kinds:
        match = re.search(rf"(?<![A-Za-z])(?:{_SECTIONS[kind]})(?![A-Za-z])", text, re.IGNORECASE)
        if match:
            text = f"{text[: match.start()]} {text[match.end() :]}"
            return " ".join(text.split()).strip(" ,;:-") or "", kind
    left = " ".join(text.split())
    return (left if re.fullmatch(r"-\d+", left) else left.strip(" ,;:-")), None


def _unknown(name: str, remainder: str, kind: Kind | None) -> Exception:
    usual = ("36x4", "ISO 3601 50.4x3.55", "AS568-226")
    if match := _COMPOUND.fullmatch(remainder):
        ring = match["ring"].strip(" ,;-/")
        why = f"has its rubber in it, which is another key: material = {match['rubber']!r}"
        return refused("ring", name, why.replace("'", '"'), ring)
    if match := _POLYMER.fullmatch(remainder):
        why = "has its rubber in it, which is another key: material, polymer and hardness"
        return refused("ring", name, why, match["ring"].strip(" ,;-/"))
    for section in ("d_ring", "rectangular", "trapezoid"):
        if match := re.search(rf"\b(?:{_SECTIONS[section]})\b", remainder, re.IGNORECASE):
            size = f"{remainder[: match.start()]} {remainder[match.end() :]}".strip(" ,;-")
            why = f'has its section in it, which is another key: section = "{section}"'
            readable = _SIZE.fullmatch(size) or _DASH.fullmatch(size)
            return refused("ring", name, why, size if readable else usual[0])
    if match := re.fullmatch(
        r"(?:JIS ?(?:B ?2401)? ?)?([PGVS])-? ?(\d+)A?", remainder, re.IGNORECASE
    ):
        size = f"{match[1].upper()}{match[2]}"
        why = f"is a size of JIS B 2401 ({size}), whose diameters are not in the catalogue"
        return refused("ring", name, why, *usual[:2])
    if match := _MILITARY.fullmatch(remainder):
        why = f"is a size of AS568 in the rubber of {match['name']}; give its material too"
        return refused("ring", name, why, f"AS568-{match['number']}")
    if re.match(r"AS[ -]?568", remainder, re.IGNORECASE):
        return refused("ring", name, "is no size of AS568, which have three digits", usual[2])
    sizes = re.findall(NUMBER, remainder)
    if len(sizes) == 3 and (kind == "u_cup" or re.search(r"\dx[\d.]+x\d", remainder)):
        return refused("ring", name, "is not known", f"U-cup {'x'.join(sizes)}")
    if len(sizes) == 2 and not re.search(r'"|/|\bin', remainder):
        large, small = sorted(map(float, sizes), reverse=True)
        if 0.5 <= small <= min(20.0, 2.0 * large) and not re.search(r"[A-Za-z]\d", remainder):
            return refused("ring", name, "is not known", f"{large:g}x{small:g}", usual[2])
    return refused("ring", name, "is not known", *usual)
