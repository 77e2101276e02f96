"""Plan of a run of a seal: its strokes and speeds, finer meshes, missing states."""

from collections.abc import Mapping, Sequence

from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import DENSITIES, Discretisation, Duty
from softehl.cases.seal.gland.surfaces import FULL
from softehl.cases.seal.states.state import (
    CLIPPED,
    ESTIMATED,
    OSCILLATING,
    UNCERTAIN,
    UNDER_RESOLVED,
    FilmRow,
)
from softehl.cases.seal.states.verdict import DOUBTFUL, FINER

SIGNS: dict[Stroke, float] = {"out": 1.0, "in": -1.0}
"""Stroke -> sign of its rod speed U."""

USUAL = 0.2
"""Rms roughness of usual surfaces, rod and rubber together, um."""

THIN = FULL * USUAL
"""Film thickness below which these would touch, um."""

DOUBTS = {
    UNDER_RESOLVED: f"the inlet is too short for this mesh, h* may be far off; {FINER}",
    CLIPPED: "the arc ends within the film, h* may be far off",
    UNCERTAIN: DOUBTFUL,
    ESTIMATED: "no film was computed: h* is that of the theory of the inlet, friction is not known",
    OSCILLATING: f"the film zigzags from node to node; h* is right, the profile is not; {FINER}",
}
"""Verdict of a state that is kept but is not ok -> what is to be known of it."""


SPECIFIC = CLIPPED, UNCERTAIN, ESTIMATED
"""Verdicts of which each state says more."""


def reservations(rows: Sequence[FilmRow], advice: Mapping[float, str]) -> dict[str, list[FilmRow]]:
    """Advice for states that are not ok -> these states, worst first.

    advice: what states came with, by U: why one has a verdict of SPECIFIC, if not by its error.
    """
    rows_by_reservation: dict[str, list[FilmRow]] = {}
    for word in DOUBTS:
        for row in rows:
            if row.verdict == word:
                specific = advice.get(row.key) if word in SPECIFIC else None
                rows_by_reservation.setdefault(f"{word}: {specific or DOUBTS[word]}", []).append(
                    row
                )
    return rows_by_reservation


def strokes_of(parameters: Duty) -> tuple[Stroke, ...]:
    """The strokes that are asked for, one by one."""
    return tuple(SIGNS) if parameters.stroke == "both" else (parameters.stroke,)


def rod_speeds(parameters: Duty) -> list[float]:
    """The signed rod speeds U that are asked for."""
    signs = [SIGNS[stroke] for stroke in strokes_of(parameters)]
    return [sign * speed for sign in signs for speed in parameters.speeds]


def refinements(parameters: Seal) -> list[Seal]:
    """The run, and where it has a tolerance the same on every finer mesh there is."""
    if parameters.tolerance is None:
        return [parameters]
    finer = [d for d in DENSITIES if d >= parameters.density]
    return [parameters.model_copy(update={"density": density}) for density in finer]


def pieces(parameters: Seal, rows: Sequence[FilmRow], jobs: int) -> list[Seal]:
    """The parameter sets still to be run at this density: one for both strokes, or one for each.

    Strokes go separately where they can run side by side or miss different speeds.
    """
    missing: dict[str, tuple[float, ...]] = {
        stroke: speeds
        for stroke in strokes_of(parameters)
        if (speeds := missing_speeds(parameters, stroke, rows))
    }
    if jobs == 1 and len(missing) == 2 and missing["out"] == missing["in"]:
        missing = {"both": missing["out"]}
    return [
        parameters.model_copy(update={"stroke": stroke, "speeds": speeds})
        for stroke, speeds in missing.items()
    ]


def missing_speeds(parameters: Seal, stroke: Stroke, rows: Sequence[FilmRow]) -> tuple[float, ...]:
    """The requested speeds |U| of a stroke to be solved.

    They have no row, or one of a coarser mesh that does not meet the tolerance.
    """
    outside = {row.key for row in outside_tolerance(parameters, rows)}
    again = {
        r.key
        for r in rows
        if r.key in outside and r.density < parameters.density and r.verdict != ESTIMATED
    }
    solved = {r.key for r in rows} - again
    return tuple(u for u in parameters.speeds if SIGNS[stroke] * u not in solved)


def outside_tolerance(parameters: Discretisation, rows: Sequence[FilmRow]) -> list[FilmRow]:
    """The rows that do not meet the tolerance, if there is one."""
    tolerance = parameters.tolerance
    return [row for row in rows if tolerance is not None and not row.within(tolerance)]
