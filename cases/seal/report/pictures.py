"""Pictures of a run, and their figures: curve, rubber fit, Stribeck curve, tornado.

The curve is the film thickness over the rod speed: h* with its errors, verdicts and slope. The fit
shows the tests of a rubber and its material. The Stribeck curve is the friction over eta U / p
between rough surfaces, with regimes and the shares of asperities. The tornado shows the largest
sensitivities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from softehl.cases.harness.pictures import save
from softehl.cases.harness.report.part import FinishedRun, ReportPicture
from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Oil
from softehl.cases.seal.gland.rubbers.materials import MATERIALS, SECOND, nominal_stress, strains
from softehl.cases.seal.gland.rubbers.rubber_fit import RubberFit
from softehl.cases.seal.gland.surfaces import FULL, MIXED
from softehl.cases.seal.report import style
from softehl.cases.seal.report.profiles import profiles_figure
from softehl.cases.seal.report.section import section_figure, views_of
from softehl.cases.seal.report.tables import SHOWN, Slopes, fit_of, read_slopes
from softehl.cases.seal.states.state import FilmRow
from softehl.cases.seal.states.state_files import read_profile
from softehl.runtime.arrays import Array


def curve_figure(head: str, rows: Sequence[FilmRow], rejected: Sequence[FilmRow] = ()) -> Figure:
    """h* over |U|, both logarithmic, a line a stroke; rejected states are marked on the axis.

    head: what it is about. Bars of both strokes where there is one speed. Not drawn: rough films so
    slow that the sealed pressure drives oil against the rod, h* < 0.
    """
    rows = sorted((row for row in rows if row.h_star_um > 0.0), key=lambda r: abs(r.rod_speed_mm_s))
    several = len({abs(row.rod_speed_mm_s) for row in (*rows, *rejected)}) > 1
    figure = Figure(figsize=(5.4, 4.4) if several else (4.2, 3.8))
    axes = figure.subplots()
    if several:
        _draw_lines(axes, rows, rejected)
    else:
        _draw_bars(axes, rows, rejected)
    axes.set_ylabel(style.H_STAR)
    style.write_head(figure, head)
    return figure


def _draw_lines(axes: Axes, rows: Sequence[FilmRow], rejected: Sequence[FilmRow]) -> None:
    axes.set(xscale="log", yscale="log", xlabel=style.SPEED)
    axes.margins(x=0.07)
    for stroke, selected in style.by_stroke(rows).items():
        _draw_film_curve(axes, stroke, selected)
    _draw_slope(axes, rows)
    for stroke, selected in style.by_stroke(rejected).items():  # crosses on the lower axis
        axes.plot(
            [abs(row.rod_speed_mm_s) for row in selected],
            [0.02] * len(selected),
            "x",
            color=style.COLOURS[stroke],
            transform=axes.get_xaxis_transform(),
            label=f"{style.STROKES[stroke]}, film collapsed: no result",
        )
    if rows:  # room for the legend
        axes.set_ylim(top=1.7 * max(row.h_star_um for row in rows))
    style.tick_plainly(axes.xaxis)
    style.tick_plainly(axes.yaxis)
    axes.legend(loc="upper left")


def _draw_bars(axes: Axes, rows: Sequence[FilmRow], rejected: Sequence[FilmRow]) -> None:
    """A bar for each stroke with its error, its number and what is wrong with it."""
    states = sorted((*rows, *rejected), key=lambda row: -row.rod_speed_mm_s)
    heights = [row.h_star_um if row in rows else 0.0 for row in states]
    errors = np.nan_to_num([0.01 * abs(row.h_star_error_percent) for row in states]) * heights
    colours = [style.COLOURS[row.stroke] for row in states]
    bars = axes.bar(range(len(states)), heights, 0.5, yerr=errors, color=colours)
    axes.bar_label(
        bars, [_bar_label(row) if row in rows else _COLLAPSED for row in states], padding=3
    )
    axes.set_xticks(range(len(states)), [style.STROKES[row.stroke] for row in states])
    axes.set_xlabel(f"|U| = {abs(states[0].rod_speed_mm_s):g} mm/s")
    axes.margins(x=0.2, y=0.35)
    axes.grid(visible=False, axis="x")


_COLLAPSED = "film collapsed:\nno result"


def _bar_label(row: FilmRow) -> str:
    lines = [f"{row.h_star_um:.4g} µm"]
    if np.isfinite(row.h_star_error_percent):
        lines.append(f"± {abs(row.h_star_error_percent):.2g} %")
    return "\n".join(lines if row.verdict == OK else [*lines, row.verdict])


def fitted_exponent(rows: Sequence[FilmRow]) -> float | None:
    """n of h* ~ |U|^n, one for both strokes, by least squares of the logarithms.

    Only states that are ok count. None where no stroke has two of them.
    """
    products = squares = 0.0
    for selected in style.by_stroke(row for row in rows if row.verdict == OK).values():
        x, y = np.log(_film_columns(selected)[:2])
        products += float((x - x.mean()) @ (y - y.mean()))
        squares += float((x - x.mean()) @ (x - x.mean()))
    return products / squares if squares else None


def _draw_film_curve(axes: Axes, stroke: str, rows: Sequence[FilmRow]) -> None:
    """A line with the bars of the estimated error; hollow markers with a word where not ok."""
    label, colour = style.STROKES[stroke], style.COLOURS[stroke]
    finite = [row for row in rows if np.isfinite(row.h_star_error_percent)]
    if finite:
        speed, film, error = _film_columns(finite)
        label += f" (error bars: at most {error.max():.2g} %)"
        axes.errorbar(speed, film, 0.01 * error * film, color=colour, fmt="none", capsize=3)
    speed, film, _ = _film_columns(rows)
    axes.plot(speed, film, color=colour, marker=style.MARKERS[stroke], label=label)
    for row in rows:
        if row.verdict == OK:
            continue
        position = abs(row.rod_speed_mm_s), row.h_star_um
        axes.plot(
            position[0], position[1], style.MARKERS[stroke], color=colour, markerfacecolor="white"
        )
        shift = (-5, 4) if stroke == "out" else (5, -4)
        style.write_beside(axes, position, row.verdict, shift, color=colour)


def _draw_slope(axes: Axes, rows: Sequence[FilmRow]) -> None:
    """A line above the curve at the slope that was measured."""
    exponent = fitted_exponent(rows)
    if exponent is None:
        return
    speed, film, _ = _film_columns(rows)
    ends_speed = speed[[0, -1]]
    line = 1.2 * float((film / speed**exponent).max()) * ends_speed**exponent
    axes.plot(
        ends_speed, line, "--", color="0.45", linewidth=1.0, label=f"slope {exponent:.3f} (fitted)"
    )


def _film_columns(rows: Sequence[FilmRow]) -> Array:
    """|U|, h* and its error (per cent, nan where not known), (3, n)."""
    names = "rod_speed_mm_s", "h_star_um", "h_star_error_percent"
    return np.abs([[getattr(row, name) for row in rows] for name in names])


def tornado_figure(head: str, log_derivatives: Slopes) -> Figure:
    """Bars: per cent of each quantity for one per cent of a key, at the slowest speeds.

    Of each quantity the ten keys that matter most.
    """
    fast_first = sorted((speed for speed, _ in log_derivatives), key=abs, reverse=True)
    slowest = {"out" if u > 0.0 else "in": u for u in fast_first}
    bars = [(stroke, slowest[stroke]) for stroke in style.STROKES if stroke in slowest]
    figure = Figure(figsize=(3.3 * len(SHOWN) + 1.2, 4.2))
    panels = figure.subplots(1, len(SHOWN))
    for axes, quantity in zip(panels, SHOWN, strict=True):
        values_by_stroke = [log_derivatives[u, quantity] for _, u in bars]
        names = sorted(
            values_by_stroke[0], key=lambda name: max(abs(s[name]) for s in values_by_stroke)
        )[-10:]
        positions, height = np.arange(len(names)), 0.8 / len(bars)
        for k, ((stroke, u), values) in enumerate(zip(bars, values_by_stroke, strict=True)):
            axes.barh(
                positions + height * (0.5 * (len(bars) - 1) - k),
                [values[name] for name in names],
                height,
                color=style.COLOURS[stroke],
                label=f"{style.STROKES[stroke]} {abs(u):g} mm/s",
            )
        axes.set_yticks(positions, [name.replace("_", " ") for name in names])
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_xticks([-10, -1, 0, 1, 10], ["-10", "-1", "0", "1", "10"])
        axes.minorticks_off()
        axes.set_xlabel("% for 1 % of the parameter")
        axes.set_title("film thickness $h^*$" if quantity == "h_star" else quantity)
        axes.axvline(0.0, color="0.2", linewidth=0.8)
    handles, labels = panels[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2)  # where no bar is
    style.write_head(figure, head)
    return figure


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
            log_bounds = np.log([hersey_um(p, below), hersey_um(p, above)])
            return float(np.exp(np.interp(np.log(ratio), np.log(ratios), log_bounds)))
    return None


def stribeck_figure(p: Seal, rows: Sequence[FilmRow]) -> Figure | None:
    """Friction of both strokes and the shares of asperities.

    None for smooth surfaces, and where fewer than two speeds have a friction that is known.
    """
    rough = [row for row in rows if row.regime and np.isfinite(row.rod_friction_N)]
    if len({abs(row.rod_speed_mm_s) for row in rough}) < 2:
        return None
    figure = Figure(figsize=(5.4, 5.6))
    friction, fractions = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    for stroke, selected in style.by_stroke(rough).items():
        _draw_friction(p, friction, fractions, stroke, selected)
    friction.set(xscale="log", yscale="log", ylabel=style.FRICTION)
    fractions.set(ylim=(-4.0, 104.0), ylabel="asperities [%]", xlabel=_HERSEY)
    style.tick_plainly(friction.yaxis)
    friction.legend(loc="lower left")
    fractions.legend(loc="best", title="share of load (line), of friction (dashes)")
    speed = 1e3 * p.viscosity / rows[0].contact_p_max_MPa
    above = friction.secondary_xaxis("top", functions=(lambda x: x / speed, lambda u: u * speed))
    above.set_xlabel(style.SPEED)
    rod, seal = p.roughness
    style.write_head(figure, style.subject(p) + f"; rms rod {rod:g}, seal {seal:g} µm")
    return figure


def _draw_friction(
    p: Oil, friction: Axes, fractions: Axes, stroke: str, rows: Sequence[FilmRow]
) -> None:
    x = [hersey_um(p, row) for row in rows]
    colour, label = style.COLOURS[stroke], style.STROKES[stroke]
    forces = [abs(row.rod_friction_N) for row in rows]
    friction.plot(x, forces, color=colour, marker=style.MARKERS[stroke], label=label)
    fractions.plot(x, [row.asperity_load_percent for row in rows], color=colour, label=label)
    fractions.plot(x, [row.boundary_friction_percent for row in rows], "--", color=colour)
    for ratio, regime_text in _REGIMES.items():
        position = crossing(p, rows, ratio)
        if position is None:
            continue
        for axes in (friction, fractions):
            axes.axvline(position, color=colour, linestyle=":", linewidth=1.0)
        friction.text(
            x=position,
            y=0.98,
            s=f"{regime_text} ",
            transform=friction.get_xaxis_transform(),
            rotation=90,
            ha="right" if stroke == "out" else "left",
            va="top",
            fontsize="x-small",
            color=colour,
        )


_TEST_COLOURS = dict(zip(SECOND, ("#1b6ca8", "#c8553d", "#4f8a52"), strict=True))


def fit_figure(result: RubberFit) -> Figure:
    """Tests as marks, the material that was fitted to them as lines."""
    figure = Figure(figsize=(5.4, 4.0))
    axes = figure.subplots()
    material, data = MATERIALS[result.material], result.data
    values = material.kernel_values(result.values)
    for test in dict.fromkeys(data.test.tolist()):
        selected, colour = data.part(data.test == test), _TEST_COLOURS[test]
        axes.plot(selected.stretch, selected.stress, "o", color=colour, markersize=3.5, label=test)
        stretch = np.linspace(min(1.0, selected.stretch.min()), selected.stretch.max(), 200)
        stress = nominal_stress(material, values, strains(test, stretch), stretch)
        axes.plot(stretch, stress, color=colour, linewidth=1.1)
    label = f"{result.material}: error {result.error:.3g} MPa, $R^2$ = {result.quality:.4f}"
    axes.plot([], [], color="0.3", label=label)
    axes.set(xlabel="stretch", ylabel="nominal stress [MPa]")
    axes.legend()
    return figure


Draw: TypeAlias = Callable[[FinishedRun], Figure | None]
"""Draws a run, whose rows have their files in its folder; None where it has nothing to show.

Raises OSError, and ValueError where a file cannot be read back.
"""


def _fit(run: FinishedRun) -> Figure | None:
    try:
        result = fit_of(run.parameters)
    except ValueError:
        return None  # the table of tests is elsewhere now
    return fit_figure(result) if result else None


def _tornado(run: FinishedRun) -> Figure | None:
    log_derivatives = read_slopes(run.parameters, run.folder)
    return (
        tornado_figure(style.subject(run.parameters), log_derivatives) if log_derivatives else None
    )


def _section(run: FinishedRun) -> Figure | None:
    views = views_of(run.folder, run.rows)
    return section_figure(run.parameters, views) if views else None


FIGURES: Mapping[str, Draw] = {
    "curve": lambda run: curve_figure(style.subject(run.parameters), run.rows, run.rejected),
    "profiles": lambda run: profiles_figure(
        style.subject(run.parameters), [(row, read_profile(run.folder, row)) for row in run.rows]
    ),
    "fit": _fit,
    "stribeck": lambda run: stribeck_figure(run.parameters, run.rows),
    "tornado": _tornado,
    "section": _section,
}
"""Pictures of a run by the names of their files."""


def write_plots(run: FinishedRun, kinds: Sequence[str] = ("png",)) -> None:
    """Draw every picture of a run into its folder.  kinds: of the files of each.  See `Draw`."""
    with style.drawing():
        for name, draw in FIGURES.items():
            if figure := draw(run):
                save(figure, run.folder / name, kinds)


def pictures_of(
    runs: Sequence[FinishedRun],
    draw: Draw,
    caption: Callable[[FinishedRun], str] = lambda run: run.name,
) -> list[ReportPicture]:
    """Pictures for a page, of the runs that have something to show."""
    with style.drawing():
        figures = [(caption(run), draw(run)) for run in runs]
        return [ReportPicture(title, _png(figure)) for title, figure in figures if figure]


def _png(figure: Figure) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
