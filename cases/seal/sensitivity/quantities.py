"""The reported quantities of a film and how they follow from its fields: values and gradients.

They are those of `cases.seal.states.results`. A point or a segment that is chosen there (the
largest pressure, the segment of the flux, the place where the film ends, the least film) is held.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from softehl.cases.seal.equations.definition import DISPLACEMENT, FACET, FILM
from softehl.cases.seal.sensitivity.frozen_mesh_map import SPEED, FilmCase
from softehl.cases.seal.sensitivity.pseudo_loads import FieldRates, Inputs, weighted
from softehl.cases.seal.states.contacts import CONTACT_FILM, GROOVE, contact_film, contact_level
from softehl.cases.seal.states.results import film_parts, metering
from softehl.runtime.arrays import Array

CALLED = {
    "h_star": ("film thickness h*", "um"),
    "friction": ("friction", "N"),
    "leakage": ("leakage of the stroke", "mm3/s"),
    "p_max": ("largest film pressure", "MPa"),
    "contact_width": ("contact width", "mm"),
}
"""Names of the quantities -> what a reader calls them, and their unit in `curve.csv`."""

QUANTITIES = tuple(CALLED)
"""Names of the quantities."""


@dataclass(frozen=True, eq=False)
class SealQuantity:
    """A quantity and the derivatives of its logarithm.

    value: in mm, N, mm^3/s, MPa, mm. fields: block -> field -> weights (elements, points) of its
    values. z, h: (arc nodes,) weights of the places and film thicknesses of the arc nodes. rod,
    speed: derivatives by the logarithms of rod diameter and |U| that come on top.
    """

    value: float
    fields: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    z: Array | None = None
    h: Array | None = None
    rod: float = 0.0
    speed: float = 0.0


def quantities(case: FilmCase, x: Array) -> dict[str, SealQuantity]:
    """All quantities of a converged film x (n,)."""
    at = case.problem.fields(FILM, x)
    flux, by_flux = _flux(case, at, x)
    ring = case.system.around
    friction = float((at["tau_rod"] * at["dx"]).sum())
    shear = {"tau_rod": at["dx"] / friction, "dx": at["tau_rod"] / friction}
    top = np.unravel_index(int(at["p"].argmax()), at["p"].shape)
    p_max, highest = float(at["p"][top]), np.zeros_like(at["p"])
    highest[top] = 1.0 / p_max
    return {
        "h_star": SealQuantity(flux / (0.5 * case.film.rod_speed), by_flux, speed=-1.0),
        "friction": SealQuantity(ring * friction, {FILM: shear}, rod=1.0),
        "leakage": SealQuantity(ring * flux, by_flux, rod=1.0),
        "p_max": SealQuantity(p_max, {FILM: {"p": highest}}),
        "contact_width": _width(case, x),
    }


def _flux(
    case: FilmCase, at: Mapping[str, Array], x: Array
) -> tuple[float, dict[str, dict[str, Array]]]:
    """The flux at the largest pressure and the weights of its logarithm; see `film_numbers`."""
    h = case.system.arc_film(x)[1]
    parts = film_parts(h, contact_film(h, case.system.parameters.lobes))
    first = metering(at, parts, case.film.stroke)
    top = int(first.start + np.argmax(at["p"][first].max(axis=1)))
    if case.system.parameters.reynolds == "dg":
        flux = case.problem.fields(FACET, x)["flux"]
        segments = slice(max(top - 1, 0), top + 1)
        q, weights = float(flux[segments].mean()), np.zeros_like(flux)
        weights[segments] = 1.0 / flux[segments].size / q
        return q, {FACET: {"flux": weights}}
    dx, flux = at["dx"][top], at["flux"][top]
    q = float((flux * dx).sum() / dx.sum())
    by_flux, by_dx = np.zeros_like(at["dx"]), np.zeros_like(at["dx"])
    by_flux[top], by_dx[top] = dx / dx.sum() / q, (flux - q) / dx.sum() / q
    return q, {FILM: {"flux": by_flux, "dx": by_dx}}


def _width(case: FilmCase, x: Array) -> SealQuantity:
    """Length of what counts as contact (`contact_level`), piecewise linear between nodes."""
    z, h = case.system.arc_film(x)
    level = contact_level(h)
    by_z, by_h = np.zeros(len(z)), np.zeros(len(z))
    inside, end_positions = np.flatnonzero(h < level), []
    for at, outside, sign in ((inside[0], -1, -1.0), (inside[-1], 1, 1.0)):
        other = at + outside
        if not 0 <= other < len(z):
            by_z[at] += sign
            end_positions.append(z[at])
            continue
        rise = h[other] - h[at]
        t = (level - h[at]) / rise
        slope = (z[other] - z[at]) / rise
        by_z[at] += sign * (1.0 - t)
        by_z[other] += sign * t
        by_h[at] -= sign * slope * (1.0 - t)
        by_h[other] -= sign * slope * t
        if level > CONTACT_FILM:
            by_h[h.argmin()] += sign * slope * GROOVE
        end_positions.append(z[at] + t * (z[other] - z[at]))
    width = float(end_positions[1] - end_positions[0])
    return SealQuantity(width, z=by_z / width, h=by_h / width)


def by_unknowns(case: FilmCase, x: Array, q: SealQuantity) -> Array:
    """Derivative (n,) of the logarithm of a quantity by the unknowns x (n,)."""
    gradient = np.zeros(len(x))
    for name, weights in q.fields.items():
        gradient += FieldRates(case.problem, name, x).by_unknowns(weights)
    start, nodes = case.system.layout.part(DISPLACEMENT).start, case.system.mesh.arc_nodes
    for component, nodal in enumerate((q.z, q.h)):
        if nodal is not None:
            gradient[start + 2 * nodes + component] += nodal
    return gradient


Moved = Mapping[str, Mapping[str, Array]]
"""Block -> field -> (elements, points), how fast its values change; blocks at rest are left out."""


def fields_along(
    case: FilmCase, x: Array, rate: Inputs, of: Iterable[SealQuantity]
) -> dict[str, dict[str, Array]]:
    """Change of the fields of these quantities with a parameter, the unknowns held.

    rate: that of the inputs, see `FilmCase.rate`.
    """
    blocks = {block for q in of for block in q.fields if rate.blocks[block].any()}
    return {b: FieldRates(case.problem, b, x).along(rate.blocks[b]) for b in blocks}


def along(case: FilmCase, q: SealQuantity, name: str, rate: Inputs, moved: Moved) -> float:
    """Derivative of the logarithm of a quantity by that of a parameter, the unknowns held.

    rate, moved: of the inputs and of the fields that follow from these alone, see `fields_along`.
    """
    total = q.speed * (name == SPEED) + q.rod * (name == "rod_diameter")
    for block, weights in q.fields.items():
        if block in moved:
            total += float(weighted(moved[block], weights).sum())
    if q.z is not None and q.h is not None:
        nodes_by_segment = rate.blocks[FILM][:, :4].reshape(
            -1, 2, 2
        )  # (segments, both nodes, (z, r))
        nodes = np.concatenate([nodes_by_segment[:, 0], nodes_by_segment[-1:, 1]])
        names = case.problem.assembler.block(FILM).kernel.parameters
        rod = rate.blocks[FILM][0, names.index("rod_radius") - len(names)]
        total += float(q.z @ nodes[:, 0] + q.h @ (nodes[:, 1] - rod))
    return float(total)
