"""Why a run ended early, in the words of the problem: ring, gland, pressure, film."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.films import NoFilm
from softehl.cases.seal.solve.path import StageFailed
from softehl.runtime.solve.solution import Status

ROLLING = (
    'with rotation = "free" hardly anything but the film turns or holds the section: use "fixed"'
)

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
_FILM = (
    "films are hard to find at this sealed pressure, {:.2g} times the shear modulus; try a finer "
    "mesh (larger density), a lower sealed_pressure or a harder rubber"
)
_ARC = (
    "part of it may be beyond the given arc, {:g} to {:g} degrees; leave arc_start and arc_end out"
)
_FOLD = (
    "the path ends or turns back there; use a finer mesh (larger density), a lower sealed_pressure "
    "or a harder rubber"
)
_THICK = "try a finer mesh (larger density), or lower speeds or a thinner oil where films are thick"
_HIGH = 1.5  # shear moduli


def explained(failed: StageFailed, where: str, p: ORing) -> tuple[Status, str]:
    """Status and message of a run that ends with this stage.

    where: which part of the run it was.
    """
    if p.rotation == "free":
        text = f"{failed.message}; {ROLLING}"
    else:
        text = _contact(failed, p) or f"{failed.message}; {_FOLD}"
    return failed.branch.status, f"{where}: {text}"


def without_films(missed: Sequence[NoFilm], p: ORing) -> tuple[Status, str]:
    """Status and message of a stroke that lacks the films of these speeds."""
    first, speeds = missed[0], ", ".join(f"{film.speed:g}" for film in missed)
    advice = ROLLING if p.rotation == "free" else _film_advice(p)
    words = f"{first.stroke}stroke: no film was found at {speeds} mm/s: {first.message}; {advice}"
    return first.status, words


def _contact(failed: StageFailed, p: ORing) -> str:
    """Of a stage that every contact path has; empty for others."""
    name = failed.stage.name.split(": ")[-1]
    points = failed.branch.points
    reached = points[-1].parameter if points else 0.0
    if name == "squeeze":
        way = f"only {100.0 * reached:.0f} % of the way"
        return f"{_ring(p)} can be pressed into its gland ({_gland(p)}) {way}; {_GLAND}"
    if name == "lean":
        return (
            f"{_ring(p)} cannot be pushed against the wall of the air side ({_gland(p)}); {_GLAND}"
        )
    if name == "sealed pressure":
        return (
            f"sealed pressure {p.sealed_pressure:g} MPa was not reached, only {reached:.4g} MPa "
            f"({reached / p.shear_modulus:.2g} times the shear modulus, {_gland(p)}); {_corner(p)}"
        )
    if name.startswith("contact"):
        return f"{name} was not found ({_gland(p)}, p_s = {p.sealed_pressure:g} MPa); {_corner(p)}"
    return ""


def _corner(p: ORing) -> str:
    """What happens between wall and rod at too high a pressure."""
    return _EXTRUSION.format(p.extrusion_gap, p.corner_fillet) if p.opens else _PRESSURE


def _film_advice(p: ORing) -> str:
    """What may help a film that was not found."""
    if p.given_arc:
        return _ARC.format(*p.given_arc)
    times = p.sealed_pressure / p.shear_modulus
    return _FILM.format(times) if times > _HIGH else _THICK


def _ring(p: ORing) -> str:
    stretch = catalogue.stretch(p.inner_diameter, p.rod_diameter)
    ring = f"{p.inner_diameter:g} x {p.section_diameter:g} mm"
    what = "a ring" if p.round else f"this {p.named}"
    return f"{what} of {ring}, stretched by {stretch:.2g} %,"


def _gland(p: ORing) -> str:
    depth = 0.5 * (p.housing_diameter - p.rod_diameter)
    squeeze = catalogue.squeeze(p.section_diameter, depth)
    return f"squeeze {squeeze:.3g} %, width {p.groove_width:g} mm"
