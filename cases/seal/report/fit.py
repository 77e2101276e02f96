"""Tests of a rubber and the material that was fitted to them."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from softehl.cases.seal.gland.rubbers.materials import MATERIALS, SECOND, nominal_stress, strains
from softehl.cases.seal.gland.rubbers.rubber_data import Fit

_COLOURS = dict(zip(SECOND, ("#1b6ca8", "#c8553d", "#4f8a52"), strict=True))


def fit_figure(found: Fit) -> Figure:
    """Tests as marks, the material that was fitted to them as lines."""
    figure = Figure(figsize=(5.4, 4.0))
    axes = figure.subplots()
    material, data = MATERIALS[found.material], found.data
    values = material.kernel_values(found.values)
    for test in dict.fromkeys(data.test.tolist()):
        chosen, colour = data.part(data.test == test), _COLOURS[test]
        axes.plot(chosen.stretch, chosen.stress, "o", color=colour, markersize=3.5, label=test)
        stretch = np.linspace(min(1.0, chosen.stretch.min()), chosen.stretch.max(), 200)
        stress = nominal_stress(material, values, strains(test, stretch), stretch)
        axes.plot(stretch, stress, color=colour, linewidth=1.1)
    label = f"{found.material}: error {found.error:.3g} MPa, $R^2$ = {found.quality:.4f}"
    axes.plot([], [], color="0.3", label=label)
    axes.set(xlabel="stretch", ylabel="nominal stress [MPa]")
    axes.legend()
    return figure
