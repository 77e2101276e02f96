"""The tornado picture: what the largest sensitivities of a run are."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from softehl.cases.seal.report import style
from softehl.cases.seal.report.tables import SHOWN, Slopes


def tornado_figure(head: str, slopes: Slopes) -> Figure:
    """Bars: per cent of each quantity for one per cent of a key, at the slowest speeds.

    Of each quantity the ten keys that matter most.
    """
    fast_first = sorted((speed for speed, _ in slopes), key=abs, reverse=True)
    slowest = {"out" if u > 0.0 else "in": u for u in fast_first}
    bars = [(stroke, slowest[stroke]) for stroke in style.STROKES if stroke in slowest]
    figure = Figure(figsize=(3.3 * len(SHOWN) + 1.2, 4.2))
    panels = figure.subplots(1, len(SHOWN))
    for axes, quantity in zip(panels, SHOWN, strict=True):
        found = [slopes[u, quantity] for _, u in bars]
        names = sorted(found[0], key=lambda name: max(abs(s[name]) for s in found))[-10:]
        places, height = np.arange(len(names)), 0.8 / len(bars)
        for k, ((stroke, u), values) in enumerate(zip(bars, found, strict=True)):
            axes.barh(
                places + height * (0.5 * (len(bars) - 1) - k),
                [values[name] for name in names],
                height,
                color=style.COLOURS[stroke],
                label=f"{style.STROKES[stroke]} {abs(u):g} mm/s",
            )
        axes.set_yticks(places, [name.replace("_", " ") for name in names])
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
