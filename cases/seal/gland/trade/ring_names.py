"""Names of rings: "36x4", "ISO 3601-1 210A", "AS568-210", "P20", "U-cup 25x35x8"."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal, get_args

from softehl.cases.harness.units import read_fraction
from softehl.cases.seal.gland.trade.normalise_text import NUMBER, form, plain, refused
from softehl.cases.seal.gland.trade.rubber_names import read_rubber

Kind = Literal["round", "x_ring", "u_cup"]


@dataclass(frozen=True)
class RingName:
    """A ring as its name says, mm.  kind: of the section, None where the name does not say it.

    number: of SAE AS568, iso_class: A or B, its class in ISO 3601-1; code: letter and size of a
    series ("P22A"); else inner and section, in mm, or in inches: inch is "nominal" or "true" then.
    A U-cup is named by its groove instead: rod (inner), groove diameter (outer) and groove width.
    bore_first: named as a piston seal is, by its bore (outer), groove diameter (inner) and width.
    rubber: polymer and hardness, where the name has it; standard: what that follows from.
    """

    number: int | None = None
    inner: float = 0.0
    section: float = 0.0
    code: str | None = None
    iso_class: str | None = None
    inch: Literal["nominal", "true"] | None = None
    rubber: str | None = None
    standard: str | None = None
    kind: Kind | None = None
    outer: float | None = None
    width: float | None = None
    bore_first: bool = False


_SECTIONS = {
    "round": r"O[- ]?rings?|O ?形(?:密封)?圈|ORs?|O[- ]?seals?|RORs?|toroidal seals?|circular",
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
    r"|\bDIN[ -]?377[01](?:-[1-5](?!\d))?|\bGB/?T[ -]?3452(?:\.1)?(?:-(?:19|20)\d\d)?"
    r"|\bBS[ -]?4518(?::(?:19|20)\d\d)?|\bJIS ?B ?2401(?:-[1-4](?![A-D\d]))?(?::(?:19|20)\d\d)?"
    r"|\bNF ?T ?47-50[123]|\bSMS[ -]?158[68]"
)
_DASH = form(
    r"(?P<said>(?:SAE )?AS[ -]?568[A-G]?(?: dash| no\.?)?|ARP ?568|#|BS(?: ?1806)?|Parker"
    r"|dash|size|no\.?)?"
    r"[ -]*?(?P<dash>2-|-)?(?P<number>\d{1,3})[AB]?"
)
_QUAD = re.compile(r"4-?(?P<number>\d{3})")
_ISO = form(
    rf"(?P<number>\d{{3}})(?P<iso_class>[AB])?(?:[ -]+(?P<inner>{NUMBER})x(?P<section>{NUMBER}))?"
    r"(?:[ -]+(?:N|S|CS))?"
)
"""Size code of ISO 3601-1, class, sizes, grade of ISO 3601-3."""
_MILITARY = form(
    r"(?P<name>MS ?-?(?:28775|29513)|M ?-?(?:25988|83248|83461|83485)(?:/\d)?"
    r"|NAS ?-?(?:1593|1594|1611))"
    r"[ -]+(?P<number>\d{3})[A-Z]?"
)
"""Standards of rubbers whose rings have the dash numbers of AS568."""
_MILITARY_RUBBERS = {
    "MS28775": "NBR 70",
    "M25988/1": "FVMQ 70",
    "M83248/1": "FKM 75",
    "M83248/2": "FKM 90",
    "M83461/1": "NBR 75",
    "M83485/1": "FKM 75",
    "NAS1593": "FKM 75",
    "NAS1594": "FKM 90",
    "NAS1611": "EPDM 80",
}
"""Standard of a ring -> the rubber that it asks for."""
_PARKER = form(r"(?P<ring>.*\d)[ /,-]+(?P<compound>[NVESC]0?\d{3,4}-\d\d)")
_PARKER_RUBBERS = {
    "N674-70": "NBR 70",
    "N552-90": "NBR 90",
    "V747-75": "FKM 75",
    "V709-90": "FKM 90",
    "E540-80": "EPDM 80",
    "S604-70": "VMQ 70",
}
"""Compound of Parker's O-ring handbook, without the 0 behind its letter -> rubber."""
_SERIES = form(
    r"(?:JIS[ -]*)?(?:(?:class )?(?P<class_>[1-4][A-D])[ -]+)?(?P<letter>[PGVSR])[ -]?"
    r"(?P<size>\d+(?:\.\d)?(?: ?A)?)(?:[ -]+(?:class )?(?P<type>[1-4][A-D]))?(?:[ -]+(?:N|S|CS))?"
)
"""Class of rubber of JIS B 2401 before 2012, letter and size, grade of JIS B 2401-3 of 2012."""
_JIS_GRADE = form(r"(?<=\bNBR-70)-[12](?!\d)")
"""What JIS B 2401-1 of 2012 adds to its NBR 70: for mineral oil or for fuel."""
_JIS_RUBBERS = {"1A": "NBR 70", "1B": "NBR 90", "4C": "VMQ 70", "4D": "FKM 70"}
"""Class of rubber of JIS B 2401 before 2012 -> rubber."""
_BS_4518 = form(r"(?P<inner>\d{4})-(?P<section>16|24|30|41|57|84)")
"""Size code of BS 4518: inside diameter and section in tenths of a millimetre."""
_IN = r"""(?:in(?:ch(?:es)?)?\b\.?|"|'')"""
_INCHES = rf"((?:\d+[ -])?\d+/[1-9]\d*|\d*\.?\d+) ?{_IN}?"
_INCH = form(rf"{_INCHES} ?x ?{_INCHES}(?: ?x ?{_INCHES})?")
_COMPOUND = form(
    r"(?P<ring>.*\d)[ ,;/-]+(?P<rubber>(?:[XH]?NBR|F?FKM|FPM|EPDM|F?VMQ|PUR?|CR|ACM)[ -]?\d\d\b.*)"
)
_COMPOUND_FIRST = form(
    r"(?P<rubber>(?:[XH]?NBR|F?FKM|FPM|EPDM|F?VMQ|PUR?|CR|ACM|Viton)[ -]?\d\d)[ ,;/-]+"
    r"(?P<ring>.*\d.*)"
)
_POLYMER = form(
    r"(?P<ring>.*\d)[ ,;/-]+(?P<rubber>(?:[XH]?NBR|F?FKM|FPM|EPDM|F?VMQ|PUR?|CR|ACM|Viton)\b.*)"
)
_NO_CUP = "is a U-cup, which is named by rod x groove diameter x width in mm"
_SWOLLEN = form(r"\b(?:pre-?)?(?:swollen|swelled|swell(?:ing)?|aged)\b")
_SIZE = form(
    rf"(?:\d{{3}}[AB][ -]+)?(?:ID|d1)?[ =]*(?P<inner>{NUMBER}) ?(?:mm)?x(?P<section>{NUMBER})"
    rf" ?(?:mm)?(?:x(?P<third>{NUMBER}) ?(?:mm)?)?(?:[ -]*[GA])?(?:[ -]+(?:N|S|CS))?"
)
_WORDS = form(
    rf"(?:ID|d1|inside|inner)?[ =]*(?P<inner>{NUMBER}) ?(?:mm)?[ ,;/]+(?:CS|d2|section)[ =]*"
    rf"(?P<section>{NUMBER}) ?(?:mm)?"
)
_OUTSIDE = form(
    rf"(?:(?P<word>ID|inside|CS|section)[ =]*(?P<other>{NUMBER}) ?(?:mm)?[ ,;/x-]+)?"
    rf"(?:OD|outside)[ =]*(?P<outer>{NUMBER}) ?(?:mm)?"
    rf"(?:[ ,;/x-]+(?P<word_2>ID|inside|CS|section)[ =]*(?P<other_2>{NUMBER}) ?(?:mm)?)?"
)


def read_ring(name: str) -> RingName:
    """The ring of a name.  Raises NotUnderstoodError."""
    text = _JIS_GRADE.sub("", re.sub(r"(?<=\d) ?(?:mm )?by (?=\d)", "x", plain(name)))
    bare = " ".join(_STANDARD.sub(" ", text).split()).lstrip(" -")
    if match := _COMPOUND.fullmatch(bare) or _COMPOUND_FIRST.fullmatch(bare):
        rubber = read_rubber("ring", match["rubber"])
        return replace(
            read_ring(match["ring"]), rubber=rubber.text if rubber else None, standard=None
        )
    if match := _PARKER.fullmatch(text):
        return _with_standard(name, match["ring"], match["compound"], _PARKER_RUBBERS)
    if match := _MILITARY.fullmatch(text):
        standard = re.sub(r"[ -]", "", match["name"])
        return _with_standard(name, f"AS568-{match['number']}", standard, _MILITARY_RUBBERS)
    remainder, kind = _without_kind(_STANDARD.sub(" ", text))
    if series := _by_series(remainder):
        if kind == "u_cup":
            raise refused("ring", name, _NO_CUP, "U-cup 25x35x8")
        return replace(series, kind=kind)
    if size := _in_inches(remainder, kind):
        return size
    if (match := _ISO.fullmatch(remainder)) and not text.startswith("-") and remainder[3:]:
        return RingName(
            number=int(match["number"]),
            inner=float(match["inner"] or 0.0),
            section=float(match["section"] or 0.0),
            kind=kind,
            iso_class=match["iso_class"] and match["iso_class"].upper(),
        )
    if ring_name := _by_outside(remainder, kind):
        return ring_name
    match = (
        None if text.startswith("-") else _SIZE.fullmatch(remainder) or _WORDS.fullmatch(remainder)
    )
    if match:
        sizes = match.groupdict()
        third = sizes.get("third")
        a, b = float(sizes["inner"]), float(sizes["section"])
        if third is None:
            if kind == "u_cup":
                usual = f"U-cup {a:g}x{a + 2 * b:g}x{round(1.6 * b, 1):g}"
                raise refused("ring", name, _NO_CUP, usual)
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


def _with_standard(name: str, ring: str, standard: str, rubbers: dict[str, str]) -> RingName:
    """A ring in the rubber of a standard, or of a maker.  Raises NotUnderstoodError."""
    rubber = rubbers.get(re.sub(r"(?<=^[A-Z])0", "", standard.upper()))
    if rubber is None:
        why = f"is a ring in the rubber of {standard}, which is not known here; give its material"
        raise refused("ring", name, why, ring)
    return replace(read_ring(ring), rubber=rubber, standard=standard)


def _by_series(text: str) -> RingName | None:
    """A ring by letter and size, or by the size code of BS 4518."""
    if match := _SERIES.fullmatch(text):
        kind = (match["type"] or match["class_"] or "").upper()
        standard = f"JIS B 2401 {kind}" if kind in _JIS_RUBBERS else None
        code = (match["letter"] + match["size"].replace(" ", "")).upper()
        return RingName(code=code, rubber=_JIS_RUBBERS.get(kind), standard=standard)
    if match := _BS_4518.fullmatch(text):
        return RingName(inner=int(match["inner"]) / 10, section=int(match["section"]) / 10)
    return None


def _in_inches(text: str, kind: Kind | None) -> RingName | None:
    """A ring in inches, by inside and section, or inside, outside and section."""
    match = _INCH.fullmatch(text)
    if not match or kind == "u_cup" or not re.search(rf"/|{_IN}", text):
        return None
    texts = [part for part in match.groups() if part]
    sizes = [read_fraction(part) for part in texts]
    if len(sizes) == 3 and abs(sizes[1] - sizes[0] - 2.0 * sizes[2]) > 0.02:
        return None
    nominal = "/" in texts[-1]
    return RingName(
        inner=sizes[0], section=sizes[-1], kind=kind, inch="nominal" if nominal else "true"
    )


def _by_outside(text: str, kind: Kind | None) -> RingName | None:
    """A ring in mm by its outside diameter, and by its inside diameter or its section."""
    match = _OUTSIDE.fullmatch(text)
    if not match or kind == "u_cup" or bool(match["word"]) == bool(match["word_2"]):
        return None
    outer, other = float(match["outer"]), float(match["other"] or match["other_2"])
    inside = (match["word"] or match["word_2"]).lower() in ("id", "inside")
    inner, section = (other, (outer - other) / 2.0) if inside else (outer - 2.0 * other, other)
    return RingName(inner=round(inner, 4), section=round(section, 4), kind=kind)


def size_of(code: str) -> float:
    """The size in the code of a series: 22 of "P22A"."""
    return float(code[1:].rstrip("A"))


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
    if match := _SWOLLEN.search(remainder):
        why = 'has its state in it, which is another key: swelling = "8 %" (by volume)'
        return refused("ring", name, why, " ".join(_SWOLLEN.sub(" ", remainder).split()))
    if match := _POLYMER.fullmatch(remainder):
        why = "has its rubber in it, which is another key: material, polymer and hardness"
        return refused("ring", name, why, match["ring"].strip(" ,;-/"))
    for section in ("d_ring", "rectangular", "trapezoid"):
        if match := re.search(rf"\b(?:{_SECTIONS[section]})\b", remainder, re.IGNORECASE):
            size = f"{remainder[: match.start()]} {remainder[match.end() :]}".strip(" ,;-")
            why = f'has its section in it, which is another key: section = "{section}"'
            readable = _SIZE.fullmatch(size) or _DASH.fullmatch(size)
            return refused("ring", name, why, size if readable else usual[0])
    if re.match(r"AS[ -]?568", remainder, re.IGNORECASE):
        return refused("ring", name, "is no size of AS568, which have three digits", usual[2])
    sizes = re.findall(NUMBER, remainder)
    if kind == "u_cup" and re.search(_IN, remainder):
        return refused("ring", name, _NO_CUP, "U-cup 25x35x8")
    if len(sizes) == 3 and (kind == "u_cup" or re.search(r"\dx[\d.]+x\d", remainder)):
        return refused("ring", name, "is not known", f"U-cup {'x'.join(sizes)}")
    if len(sizes) == 2 and not re.search(r'"|/|\bin', remainder):
        large, small = sorted(map(float, sizes), reverse=True)
        plain_sizes = not re.search(r"[A-Za-z]", re.sub(r"\bmm\b", "", remainder))
        if 0.5 <= small <= min(20.0, 2.0 * large) and plain_sizes:
            return refused("ring", name, "is not known", f"{large:g}x{small:g}", usual[2])
    return refused("ring", name, "is not known", *usual)
