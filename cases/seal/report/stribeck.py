"""Friction over eta U / p between rough surfaces: regimes, and what asperities carry."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.oil import Oil
from softehl.cases.seal.gland.surfaces import FULL, MIXED
from softehl.cases.seal.report import style
from softehl.cases.seal.states.state import FilmRow

_HERSEY = "$\\eta_0 |U| / p_{\\mathrm{dry}}$ [µm]   ($p_{\\mathrm{dry}}$ largest dry pressure)"
_REGIMES = {MIXED: "boundary | mixed", FULL: "mixed | full"}


def hersey_um(p: Oil, row: FilmRow) -> float:
    """eta_0 |U| over the largest pressure of the dry contact, um."""
    return 1e3 * p.viscosity * abs(row.rod_speed_mm_s) / row.contact_p_max_MPa


def crossing(p: Oil, rows: Sequence[FilmRow], ratio: float) -> float | None:
    """eta U / p (um) where the rows of a stroke, by rising speed, first have this lambda ratio.

    By the logarithms of both; None where they have not.
    """
    for below, above in pairwise(rows):
        ratios = below.lambda_ratio, above.lambda_ratio
        if ratios[0] < ratio <= ratios[1]:
            ends = np.log([hersey_um(p, below), hersey_um(p, above)])
            return float(np.exp(np.interp(np.log(ratio), np.log(ratios), ends)))
    return None


def stribeck_figure(p: Seal, rows: Sequence[FilmRow]) -> Figure | None:
    """Friction of both strokes and the shares of asperities; None for smooth ones or one speed."""
    rough = [row for row in rows if row.regime]
    if len({abs(row.rod_speed_mm_s) for row in rough}) < 2:
        return None
    figure = Figure(figsize=(5.4, 5.6))
    friction, shares = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    for stroke, chosen in style.by_stroke(rough).items():
        _draw_stroke(p, friction, shares, stroke, chosen)
    friction.set(xscale="log", yscale="log", ylabel=style.FRICTION)
    shares.set(ylim=(-4.0, 104.0), ylabel="asperities [%]", xlabel=_HERSEY)
    style.tick_plainly(friction.yaxis)
    friction.legend(loc="lower left")
    shares.legend(loc="best", title="share of load (line), of friction (dashes)")
    speed = 1e3 * p.viscosity / rows[0].contact_p_max_MPa
    above = friction.secondary_xaxis("top", functions=(lambda x: x / speed, lambda u: u * speed))
    above.set_xlabel(style.SPEED)
    rod, seal = p.roughness
    style.write_head(figure, style.subject(p) + f"; rms rod {rod:g}, seal {seal:g} µm")
    return figure


def _draw_stroke(
    p: Oil, friction: Axes, shares: Axes, stroke: str, rows: Sequence[FilmRow]
) -> None:
    x = [hersey_um(p, row) for row in rows]
    colour, label = style.COLOURS[stroke], style.STROKES[stroke]
    forces = [abs(row.rod_friction_N) for row in rows]
    friction.plot(x, forces, color=colour, marker=style.MARKERS[stroke], label=label)
    shares.plot(x, [row.asperity_load_percent for row in rows], color=colour, label=label)
    shares.plot(x, [row.boundary_friction_percent for row in rows], "--", color=colour)
    for ratio, words in _REGIMES.items():
        place = crossing(p, rows, ratio)
        if place is None:
            continue
        for axes in (friction, shares):
            axes.axvline(place, color=colour, linestyle=":", linewidth=1.0)
        friction.text(
            *(place, 0.98, f"{words} "),
            transform=friction.get_xaxis_transform(),
            rotation=90,
            ha="right" if stroke == "out" else "left",
            va="top",
            fontsize="x-small",
            color=colour,
        )
