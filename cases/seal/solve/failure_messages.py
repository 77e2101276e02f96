"""Messages of failure: why a run ended early and what may help, in terms of the seal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Gland, Numerics
from softehl.runtime.solve.solution import Status

if TYPE_CHECKING:  # both import the ends of a path
    from softehl.cases.seal.solve.film_solver import NoFilm
    from softehl.cases.seal.solve.load_stages import StageError

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

ROLLING = (
    'with rotation = "free" hardly anything but the film turns or holds the section: use "fixed"'
)

_FILM = (
    "films are hard to find at this sealed pressure, {:.2g} times the shear modulus; try a finer "
    "mesh (larger density), a lower sealed_pressure or a harder rubber"
)

_ARC = (
    "part of it may be beyond the given arc, {:g} to {:g} degrees; leave arc_start and arc_end out"
)

_OTHER_SPEEDS = (
    "try a finer mesh (larger density); where films are thick lower speeds or a thinner oil help, "
    "where they are thin higher speeds"
)

_HIGH = 1.5  # shear moduli


def not_squeezed(p: Gland, share: float) -> str:
    """Rod and housing came this share of their way, 0 to 1."""
    progress = f"only {100.0 * share:.0f} % of the way"
    return f"{_ring(p)} can be pressed into its gland ({_gland(p)}) {progress}; {_GLAND}"


def not_released(p: Gland) -> str:
    """Friction did not take the place of what holds the section."""
    return (
        f"friction of the housing does not hold {_ring(p)} in its gland ({_gland(p)}); {_RELEASE}"
    )


def not_loaded(p: Seal, reached: float) -> str:
    """The sealed pressure rose to `reached`, MPa."""
    return (
        f"the sealed pressure rose to {reached:.4g} of {p.sealed_pressure:.4g} MPa only "
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


def explained(failed: StageError, p: Numerics) -> tuple[Status, str]:
    """Status and message of a run that ends with this stage of the contact."""
    advice = f"; {ROLLING}" if p.rotation == "free" else ""
    return failed.branch.status, f"contact: {failed}{advice}"


def without_films(missed: Sequence[NoFilm], p: Seal) -> tuple[Status, str]:
    """Status and message of a stroke that lacks the films of these speeds."""
    first, speeds = missed[0], ", ".join(f"{film.speed:g}" for film in missed)
    advice = ROLLING if p.rotation == "free" else _film_advice(p)
    message = f"{first.stroke}stroke: no film was found at {speeds} mm/s; {advice}"
    return first.status, f"{message}; the solver says: {first.message}"


def _film_advice(p: Seal) -> str:
    """Advice for a film that was not found."""
    if p.given_arc:
        return _ARC.format(*p.given_arc)
    times = p.sealed_pressure / p.shear_modulus
    return _FILM.format(times) if times > _HIGH else _OTHER_SPEEDS
