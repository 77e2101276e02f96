"""Titles of runs, which name the seal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softehl.cases.seal.gland.sections.keys import NAMES, ROUND

if TYPE_CHECKING:
    from softehl.cases.seal.gland.parameters import Seal


_SEALS = (("", ""), ("a rod seal", "a piston seal"))


def titled(title: str, p: Seal) -> str:
    """The title of a case with the seal of a run: its shape, its size and its rubber."""
    size = f"{p.ring_diameter:g} \N{MULTIPLICATION SIGN} {p.section_diameter:g} mm"
    rubber = f" of {p.compound}" if p.compound else ""
    return title.replace(NAMES[ROUND], f"{p.named} {size}{rubber}").replace(*_SEALS[p.piston])
