"""Onset of oscillations: the ripple of the film over speed, density, p_s and stroke."""

from __future__ import annotations

from softehl.cases.paper.checks import STUDY_PRESSURES
from softehl.cases.paper.item import STUDY_DENSITIES, Item, Product, Scope, Table, both
from softehl.cases.paper.query import ripple
from softehl.cases.paper.states import Request, Store, ask, setup
from softehl.runtime.io import Cell


def _requests(scope: Scope) -> list[Request]:
    return [
        ask(setup(d, p), both(scope.some_speeds()))
        for d in scope.meshes(STUDY_DENSITIES, default=8)
        for p in scope.some_pressures(STUDY_PRESSURES)
    ]


def onset(store: Store, scope: Scope) -> Product:
    """The ripple in h*, a row for each density, p_s and stroke, a column for each |U|."""
    speeds, rows = scope.some_speeds(), []
    for p_s in scope.some_pressures(STUDY_PRESSURES):
        for sign, stroke in ((1.0, "out"), (-1.0, "in")):
            for d in scope.meshes(STUDY_DENSITIES, default=8):
                states = store.states(setup(d, p_s), [sign * u for u in speeds])
                row: list[Cell] = [p_s, stroke, d, *(round(ripple(s), 4) for s in states)]
                rows.append(row)
    header = ("sealed_pressure_MPa", "stroke", "density", *(f"U_{u:g}" for u in speeds))
    caption = (
        "Largest rise of h on the way from the inlet to the dip, in h*; a smooth film has none."
    )
    return Product({"onset": Table(header, rows)}, caption)


ITEMS = (Item("onset", "Onset of oscillations", onset, _requests),)
