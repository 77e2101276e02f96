"""Files of pictures; a plain picture of rows: columns of their first files, a line a row."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softehl.runtime.arrays import Array
from softehl.runtime.io import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


KINDS = ("png", "svg")
"""Of the files of a picture."""

CHOICES = {"png": ("png",), "svg": ("svg",), "both": KINDS, "none": ()}
"""Kinds of pictures of a run: each is a drawing of its own."""

_HOW: Mapping[str, Mapping[str, Any]] = {
    "png": {"pil_kwargs": {"compress_level": 3}},  # a fifth larger than what takes 3 times as long
    "svg": {"metadata": {"Date": None}},
}


def save(figure: "Figure", stem: Path, kinds: Sequence[str]) -> None:
    """Write a figure, each file at once or not at all, the same bytes every time.

    Pictures of other kinds that an earlier run left are removed.
    """
    for kind in set(KINDS) - set(kinds):
        stem.with_suffix(f".{kind}").unlink(missing_ok=True)
    for kind in kinds:
        with replacing(stem.with_suffix(f".{kind}")) as temporary:
            figure.savefig(temporary, format=kind, **_HOW[kind])


def draw_columns(
    stem: Path,
    tables: Mapping[str, Mapping[str, Array]],
    names: Sequence[str],
    kinds: Sequence[str],
) -> None:
    """Write a picture with a panel for each of names[1:] over names[0], which all tables share.

    tables: label of a line -> column -> values (n,). kinds: of the files.
    """
    from matplotlib.figure import Figure  # late: it is slow to import

    _, *drawn = names
    figure = Figure(figsize=(5.6, 2.4 * len(drawn)), layout="constrained")
    panels = figure.subplots(len(drawn), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, drawn, strict=True):
        for label, columns in tables.items():
            axes.plot(columns[names[0]], columns[name], label=label)
        axes.set_ylabel(titled(name))
        axes.grid(alpha=0.35)
    panels[0].legend(fontsize="small", frameon=False)
    panels[-1].set_xlabel(titled(names[0]))
    figure.set_dpi(160)
    save(figure, stem, kinds)


_UNITS = frozenset(("mm", "mm2", "mm3", "um", "MPa", "N", "s", "mJ", "percent"))


def titled(name: str) -> str:
    """The title of a column: `p_MPa` is p [MPa], `flux_air_mm2_s` is flux air [mm2/s]."""
    parts = name.split("_")
    first = next((k for k, part in enumerate(parts[1:], 1) if part in _UNITS), len(parts))
    quantity, unit = " ".join(parts[:first]), "/".join(parts[first:])
    return f"{quantity} [{unit.replace('um', 'µm')}]" if unit else quantity
