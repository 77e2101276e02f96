"""Ends of a path of the contact, and what may help, in words of ring, gland and pressure."""

from __future__ import annotations

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.gland import Gland

_GLAND = (
    "glands with a squeeze of 6 to 30 %, a stretch of 0 to 6 % and a width of 1.02 to 2 sections "
    "are known to run (docs/limits.md); try one nearer to these, or a finer mesh (larger density)"
)
_PRESSURE = (
    "the rubber is driven into the corner between wall and rod there; try a lower sealed_pressure, "
    "a harder rubber (mu_1, mu_2) or a finer mesh (larger density)"
)
_EXTRUSION = (
    "the rubber is driven into the gap of {:g} mm between rod and housing there (fillet {:g} mm); "
    "try a back-up ring (backup = true), a smaller extrusion_gap, a larger corner_fillet or a "
    "harder rubber (mu_1, mu_2)"
)
_RELEASE = "try a smaller housing_friction or a finer mesh (larger density)"


def not_squeezed(p: Gland, share: float) -> str:
    """Rod and housing came this share of their way, 0 to 1."""
    way = f"only {100.0 * share:.0f} % of the way"
    return f"{_ring(p)} can be pressed into its gland ({_gland(p)}) {way}; {_GLAND}"


def not_released(p: Gland) -> str:
    """Friction did not take the place of what holds the section."""
    return (
        f"friction of the housing does not hold {_ring(p)} in its gland ({_gland(p)}); {_RELEASE}"
    )


def not_loaded(p: Seal, reached: float) -> str:
    """The sealed pressure rose to `reached`, MPa."""
    return (
        f"sealed pressure {p.sealed_pressure:g} MPa was not reached, only {reached:.4g} MPa "
        f"({reached / p.shear_modulus:.2g} times the shear modulus, {_gland(p)}); {_corner(p)}"
    )


def not_carried(p: Seal, name: str) -> str:
    """A state of another mesh led to none on this one; name: of the stage."""
    return f"{name} was not found ({_gland(p)}, p_s = {p.sealed_pressure:g} MPa); {_corner(p)}"


def _corner(p: Gland) -> str:
    """Words on the gap between wall and rod at too high a pressure."""
    return _EXTRUSION.format(p.extrusion_gap, p.corner_fillet) if p.opens else _PRESSURE


def _ring(p: Gland) -> str:
    ring = f"{p.ring_diameter:g} x {p.section_diameter:g} mm"
    what = "a ring" if p.round else f"this {p.named}"
    return f"{what} of {ring}, stretched by {p.stretch_percent:.2g} %,"


def _gland(p: Gland) -> str:
    return f"squeeze {p.squeeze_percent:.3g} %, width {p.groove_width:g} mm"
