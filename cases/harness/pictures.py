"""A plain picture of rows: columns of their first files, a line a row."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from softehl.runtime.arrays import Array
from softehl.runtime.io import replacing


def draw_columns(
    path: Path, tables: Mapping[str, Mapping[str, Array]], names: Sequence[str]
) -> None:
    """Write a picture with a panel for each of names[1:] over names[0], which all tables share.

    tables: label of a line -> column -> values (n,).
    """
    from matplotlib.figure import Figure  # late: it is slow to import

    _, *shown = names
    figure = Figure(figsize=(5.6, 2.4 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, shown, strict=True):
        for label, columns in tables.items():
            axes.plot(columns[names[0]], columns[name], label=label)
        axes.set_ylabel(titled(name))
        axes.grid(alpha=0.35)
    panels[0].legend(fontsize="small", frameon=False)
    panels[-1].set_xlabel(titled(names[0]))
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=160)


def titled(name: str) -> str:
    """The title of a column: `p_MPa` is p [MPa], `flux_mm2_s` is flux [mm2/s]."""
    quantity, _, unit = name.partition("_")
    return f"{quantity} [{unit.replace('_', '/').replace('um', 'µm')}]"
