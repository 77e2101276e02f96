"""The inverse hydrodynamic theory as a cross-check of h*, from the largest inlet gradient of p.

For a given p, the Reynolds equation (14) with (16), dp/dx = 12 eta u (h - h*) / h^3, u = U/2, is
an equation for h. At the largest (dp/dx) / eta its right side is stationary in h, so h = 3/2 h*,
and with w = max |dp/dx| / eta

    w = 16 u / (9 h*^2),    h* = sqrt(8 |U| / (9 w)).

This is the theory of Blok, as in Mueller and Nau, Fluid Sealing Technology [16] (there with
constant eta); the derivation above is what is used here. Its basic assumption is that p is that of
dry contact.
"""

from __future__ import annotations

from math import nan, sqrt

import numpy as np

from softehl.cases.paper.figure_spec import (
    STUDY_DENSITIES,
    CsvTable,
    FigureContent,
    Item,
    Scope,
    both,
)
from softehl.cases.paper.states import Request, RequestedState, Store, ask, setup
from softehl.cases.seal.gland.records import Oil
from softehl.runtime.arrays import Array
from softehl.runtime.io import Cell

PRESSURES = (1.0, 5.0)


def largest_inlet_gradient(x: Array, p: Array, p_ring: Oil, outstroke: bool) -> float:
    """max |dp/dx| / eta before the pressure maximum, 1/(mm s), from x (n,) in mm and p (n,) in MPa.

    Slopes of the chords between neighbouring points, with eta (13) at their middle. The inlet is
    the sealed side in outstroke, the air side in instroke.
    """
    if not outstroke:
        x, p = -x[::-1], p[::-1]
    top = int(np.argmax(p)) + 1
    x, p = x[:top], p[:top]
    separate = np.diff(x) > 1e-9  # a facet of discontinuous pressures has two rows
    slope = np.diff(p)[separate] / np.diff(x)[separate]
    middle = 0.5 * (p[1:] + p[:-1])[separate]
    eta = p_ring.viscosity * np.exp(p_ring.pressure_viscosity * middle)
    return float((slope / eta).max()) if len(slope) else nan


def film_of(gradient: float, speed: float) -> float:
    """h* in um for w in 1/(mm s) and |U| in mm/s."""
    return 1e3 * sqrt(8.0 * abs(speed) / (9.0 * gradient)) if gradient > 0.0 else nan


def _requests(scope: Scope) -> list[Request]:
    return [
        ask(setup(d, p), both(scope.some_speeds()))
        for d in scope.meshes(STUDY_DENSITIES, default=8)
        for p in scope.some_pressures(PRESSURES)
    ]


def inverse(store: Store, scope: Scope) -> FigureContent:
    """h* beside that of the inverse theory from dry pressure and from the film's own."""
    rows = [
        _row(store, store.state(setup(d, p_s), u))
        for p_s in scope.some_pressures(PRESSURES)
        for u in both(scope.some_speeds())
        for d in scope.meshes(STUDY_DENSITIES, default=8)
    ]
    header = (
        *("sealed_pressure_MPa", "rod_speed_mm_s", "density", "verdict", "h_star_um"),
        *("from_dry_contact_um", "from_film_pressure_um"),
    )
    caption = "h* = sqrt(8 |U| / (9 w)), w the largest |dp/dx| / eta of the inlet."
    return FigureContent({"inverse": CsvTable(header, rows)}, caption)


def _row(store: Store, state: RequestedState) -> list[Cell]:
    ring, u = state.setup, state.rod_speed
    dry, film = nan, nan
    contact = store.contact(ring)
    if contact is not None:
        x, p = contact
        dry = film_of(largest_inlet_gradient(x, p, ring, u > 0), u)
    if state.usable:
        profile = state.profile
        film = film_of(largest_inlet_gradient(profile.x_mm, profile.p_MPa, ring, u > 0), u)
    return [ring.sealed_pressure, u, ring.density, state.verdict, state.h_star, dry, film]


ITEMS = (Item("inverse", "Inverse hydrodynamic theory", inverse, _requests),)
