"""Why a run ended early, in the words of the problem: ring, gland, pressure, film."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.numerics import Numerics
from softehl.cases.seal.solve.films import NoFilm
from softehl.cases.seal.solve.path import StageError
from softehl.runtime.solve.solution import Status

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
_THICK = "try a finer mesh (larger density), or lower speeds or a thinner oil where films are thick"
_HIGH = 1.5  # shear moduli


def explained(failed: StageError, where: str, p: Numerics) -> tuple[Status, str]:
    """Status and message of a run that ends with this stage.

    where: which part of the run it was.
    """
    advice = f"; {ROLLING}" if p.rotation == "free" else ""
    return failed.branch.status, f"{where}: {failed}{advice}"


def without_films(missed: Sequence[NoFilm], p: Seal) -> tuple[Status, str]:
    """Status and message of a stroke that lacks the films of these speeds."""
    first, speeds = missed[0], ", ".join(f"{film.speed:g}" for film in missed)
    advice = ROLLING if p.rotation == "free" else _film_advice(p)
    words = f"{first.stroke}stroke: no film was found at {speeds} mm/s; {advice}"
    return first.status, f"{words}; the solver says: {first.message}"


def _film_advice(p: Seal) -> str:
    """Advice for a film that was not found."""
    if p.given_arc:
        return _ARC.format(*p.given_arc)
    times = p.sealed_pressure / p.shear_modulus
    return _FILM.format(times) if times > _HIGH else _THICK
