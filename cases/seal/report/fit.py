"""Tests of a rubber and the material that was fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softehl.cases.seal.gland.rubbers.materials import MATERIALS, SECOND, nominal_stress, strains
from softehl.cases.seal.gland.rubbers.rubber_data import COLUMNS, Fit, fit, read_data
from softehl.cases.seal.report import style
from softehl.runtime.io import write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber

_COLOURS = dict(zip(SECOND, ("#1b6ca8", "#c8553d", "#4f8a52"), strict=True))
_LINES = ("-", "--", ":", "-.")


def fit_of(p: Rubber, temperature: float | None) -> Fit | None:
    """The fit that a rubber was taken from.  Raises ValueError where it cannot be read."""
    if p.fit is None:
        return None
    return fit(p.material, read_data(Path(p.fit)), p.ogden_terms, temperature)


def write_residuals(found: Fit, path: Path) -> None:
    """The points, the stresses of the model there and the differences, as a table."""
    data = found.data
    columns = data.test.tolist(), data.stretch, data.stress, found.model, found.model - data.stress
    rows = [(t, *map(float, numbers)) for t, *numbers in zip(*columns, strict=True)]
    write_csv(path, (*COLUMNS, "model_MPa", "difference_MPa"), rows)


def fit_figure(fits: Sequence[Fit]) -> Figure:
    """Tests as marks, a line style for each material fitted to them, all to the same tests."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4, 4.0))
    axes = figure.subplots()
    data = fits[0].data
    for test in dict.fromkeys(data.test.tolist()):
        chosen = data.part(data.test == test)
        axes.plot(
            chosen.stretch, chosen.stress, "o", color=_COLOURS[test], markersize=3.5, label=test
        )
        stretch = np.linspace(min(1.0, chosen.stretch.min()), chosen.stretch.max(), 200)
        e = strains(test, stretch)
        for found, line in zip(fits, _LINES, strict=False):
            material = MATERIALS[found.material]
            values = material.kernel_values(found.values)
            stress = nominal_stress(material, values, e, stretch)
            axes.plot(stretch, stress, line, color=_COLOURS[test], linewidth=1.1)
    for found, line in zip(fits, _LINES, strict=False):
        label = f"{found.material}: error {found.error:.3g} MPa, $R^2$ = {found.quality:.4f}"
        axes.plot([], [], line, color="0.3", label=label)
    axes.set_xlabel("stretch")
    axes.set_ylabel("nominal stress [MPa]")
    axes.legend()
    style.set_margins(figure, left=0.6, right=0.12, bottom=0.5, top=0.12)
    return figure
