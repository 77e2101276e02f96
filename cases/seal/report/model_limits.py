"""Title of a run of a seal, and the limits of its model in words."""

from __future__ import annotations

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sections.section_keys import NAMES, ROUND

LEFT_OUT = (
    "Time: every speed is a steady state; no start, no stop, no dwell.",
    "Breakaway: the force to start after a rest, which grows with the time at rest.",
    "Viscoelasticity and set: the rubber is hyperelastic, and as it was made.",
    "Heat: oil and rubber are at one temperature, which friction does not raise, unless the case "
    "has heating; rod and housing do not become warm over many strokes.",
    "Shear thinning, unless the case has keys for it: the oil is then Newtonian.",
    "Roughness of rod and seal, unless the case has keys for it: a film thinner than the surfaces "
    "are rough is not what the numbers say.",
    "Starvation: both ends of the film are flooded, unless the case says otherwise.",
    "Eccentricity and bending: everything is axisymmetric.",
    "Fillets of the groove: its corners are sharp.",
    "The extrusion gap, unless the case opens it: the wall of the air side reaches the rod.",
    "Friction of the seal on its housing, unless the case has a coefficient.",
    "Wear and ageing: dimensions and moduli are those given. Swelling and compression set, unless "
    "the case has keys for them.",
)
"""A report ends with these."""


BREAKAWAY = (
    "the force to start after a rest (breakaway) is not in these numbers: the film is "
    "squeezed out, the rubber sticks, and handbooks give up to three times the friction in motion"
)
"""Caution of steady states."""


def cautions(p: Seal) -> list[str]:
    """Differences of friction from measurements (docs/validation/measurements.md)."""
    if not p.round:
        return []
    return [
        "the friction of an O-ring may differ from a measured one by several times: it depends on "
        "the roughness and on the friction of what touches (docs/validation/measurements.md)"
    ]


def titled(title: str, p: Seal) -> str:
    """The title of a case with the seal of a run: its shape, its size and its rubber."""
    size = f"{p.ring_diameter:g} \N{MULTIPLICATION SIGN} {p.section_diameter:g} mm"
    rubber = f" of {p.compound}" if p.compound else ""
    named = title.replace(NAMES[ROUND], f"{p.named} {size}{rubber}")
    return named.replace("a rod seal", "a piston seal") if p.piston else named
