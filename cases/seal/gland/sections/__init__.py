"""Sections of seals by name, one file each: the dimensions and the outline."""

from softehl.cases.seal.gland.sections.base import Section
from softehl.cases.seal.gland.sections.d_ring import DRing
from softehl.cases.seal.gland.sections.rectangular import Rectangular
from softehl.cases.seal.gland.sections.round import Round
from softehl.cases.seal.gland.sections.trapezoid import Trapezoid
from softehl.cases.seal.gland.sections.u_cup import UCup
from softehl.cases.seal.gland.sections.x_ring import XRing

SECTIONS: dict[str, type[Section]] = {
    "round": Round,
    "rectangular": Rectangular,
    "x_ring": XRing,
    "d_ring": DRing,
    "trapezoid": Trapezoid,
    "u_cup": UCup,
}
"""Every section by its name."""
