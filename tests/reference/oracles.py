"""Exact residual, tangent, energy and fields of a `State`, and the block-wise comparison."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

from tests.reference import (
    boundary,
    facet,
    film,
    mixed,
    mortar,
    section,
    sheet,
    solids,
    touch,
    upwind,
)
from tests.reference.differentiate import Matrix, Number, Vector, mpf, numbers
from tests.reference.material import LAWS
from tests.reference.states import State

TOLERANCE = 1e-12
Block = tuple[str, slice]
Oracle = Callable[[State], Any]


def _film(function: Callable[..., Any]) -> Callable[[State], Any]:
    return lambda s: function(*_exact(s), s.kind, s.count)


def _plain(function: Callable[..., Any]) -> Callable[[State], Any]:
    return lambda s: function(*_exact(s))


def _single(function: Callable[..., Any]) -> Callable[[State], Any]:
    def call(s: State) -> Any:
        X, u, parameters = _exact(s)
        return function(X, u, parameters[0])

    return call


def _sheet(function: Callable[..., Any], law: Any) -> Callable[[State], Any]:
    return lambda s: function(*_exact(s)[1:], law)


def _contact(function: Callable[..., Any]) -> Callable[[State], Any]:
    def call(s: State) -> Any:
        X, u, parameters = _exact(s)
        return function(X, u, numbers(s.data), parameters)

    return call


def _mixed(function: Callable[..., Any]) -> Callable[[State], Any]:
    def call(s: State) -> Any:
        X, u, parameters = _exact(s)
        return function(X, u, numbers(s.data or s.point_data), parameters)

    return call


def _exact(s: State) -> tuple[Vector, Vector, Vector]:
    return numbers(s.coordinates), numbers(s.dofs), numbers(s.parameters)


SEGMENTS = ("film", "film_eyring", "film_carreau")
OTHERS = {name: law for name, law in LAWS.items() if name != "mooney_rivlin"}

RESIDUALS: dict[str, Oracle] = {
    "solid_q4": _plain(solids.residual_q4),
    "solid_fbar": _plain(solids.residual_fbar),
    "solid_taylor": _plain(solids.residual_taylor),
    "solid_taylor_mean": _plain(solids.residual_taylor_mean),
    **{
        f"solid_taylor_mean_{n}": _plain(partial(solids.residual_taylor_mean, law=law))
        for n, law in OTHERS.items()
    },
    **{f"sheet_{n}": _sheet(sheet.residual, law) for n, law in LAWS.items()},
    "follower_pressure": _single(boundary.residual_pressure),
    "contact": _contact(boundary.residual_contact),
    "contact_friction": _contact(boundary.residual_friction),
    "contact_corner": _contact(boundary.residual_corner),
    **{name: _film(film.residual_film) for name in SEGMENTS},
    "film_upwind": _plain(upwind.residual_upwind),
    "film_facet": _plain(facet.residual_facet),
    "mean_rotation": _plain(section.residual_rotation),
    "mean_axial": _plain(section.residual_axial),
    "axial_spring": _single(section.residual_spring),
    **{family: _mixed(residual) for family, residual in mixed.RESIDUALS.items()},
    **{
        family: _contact(residual)
        for family, residual in {**mortar.RESIDUALS, **touch.RESIDUALS}.items()
    },
}
TANGENTS: dict[str, Oracle] = {
    "solid_q4": _plain(solids.tangent_q4),
    "solid_fbar": _plain(solids.tangent_fbar),
    "solid_taylor": _plain(solids.tangent_taylor),
    "solid_taylor_mean": _plain(solids.tangent_taylor_mean),
    **{
        f"solid_taylor_mean_{n}": _plain(partial(solids.tangent_taylor_mean, law=law))
        for n, law in OTHERS.items()
    },
    **{f"sheet_{n}": _sheet(sheet.tangent, law) for n, law in LAWS.items()},
    "follower_pressure": _single(boundary.tangent_pressure),
    "contact": _contact(boundary.tangent_contact),
    "contact_friction": _contact(boundary.tangent_friction),
    "contact_corner": _contact(boundary.tangent_corner),
    **{name: _film(film.tangent_film) for name in SEGMENTS},
    "film_upwind": _plain(upwind.tangent_upwind),
    "film_facet": _plain(facet.tangent_facet),
    "mean_rotation": _plain(section.tangent_rotation),
    "mean_axial": _plain(section.tangent_axial),
    "axial_spring": _single(section.tangent_spring),
    **{family: _mixed(partial(mixed.tangent, family)) for family in mixed.RESIDUALS},
    **{
        family: _contact(tangent)
        for family, tangent in {**mortar.TANGENTS, **touch.TANGENTS}.items()
    },
}
ENERGIES: dict[str, Oracle] = {
    "solid_q4": _plain(solids.energy_q4),
    "solid_taylor": _plain(solids.energy_taylor),
    "solid_taylor_mean": _plain(solids.energy_taylor_mean),
    **{
        f"solid_taylor_mean_{n}": _plain(partial(solids.energy_taylor_mean, law=law))
        for n, law in OTHERS.items()
    },
    **{f"sheet_{n}": _sheet(sheet.energy, law) for n, law in LAWS.items()},
    "contact_corner": _contact(boundary.energy_corner),
    "mean_rotation": _plain(section.energy_rotation),
    "mean_axial": _plain(section.energy_axial),
    "axial_spring": _single(section.energy_spring),
}
FIELDS: dict[str, Oracle] = {
    "solid_q4": _plain(solids.fields_q4),
    "solid_fbar": _plain(solids.fields_fbar),
    "solid_taylor": _plain(solids.fields_taylor),
    "solid_taylor_mean": _plain(solids.fields_taylor_mean),
    **{
        f"solid_taylor_mean_{n}": _plain(partial(solids.fields_taylor_mean, law=law))
        for n, law in OTHERS.items()
    },
    **{name: _film(film.fields_film) for name in SEGMENTS},
    "film_facet": _plain(facet.fields_facet),
    **{family: _mixed(fields) for family, fields in mixed.FIELDS.items()},
    **{family: _contact(fields) for family, fields in {**mortar.FIELDS, **touch.FIELDS}.items()},
}


@lru_cache
def residual(state: State) -> Vector:
    """Exact residual (ndof)."""
    exact: Vector = RESIDUALS[state.family](state)
    return exact


@lru_cache
def tangent(state: State) -> Matrix:
    """Exact tangent (ndof, ndof)."""
    exact: Matrix = TANGENTS[state.family](state)
    return exact


@lru_cache
def energy(state: State) -> Number:
    """Exact potential, for the families in `ENERGIES`."""
    return ENERGIES[state.family](state)


@lru_cache
def fields(state: State) -> Matrix:
    """Exact fields (points, fields), for the families in `FIELDS`."""
    exact: Matrix = FIELDS[state.family](state)
    return exact


PAIRS = (*mixed.CONSERVING, "film_rough", "film_squeeze", "film_squeeze_rough")
"""Families with pressures and void fractions."""


def blocks(family: str, count: int) -> tuple[Block, ...]:
    """Groups of unknowns of one kind: displacements, and pressures or multipliers."""
    known = {
        "contact": 2,
        "contact_friction": 2,
        "contact_corner": 2,
        **dict.fromkeys(SEGMENTS, 4),
        "film_upwind": 4,
        "film_facet": 6,
        **{family: 2 * sum(map(int, family[-2:])) for family in mortar.FAMILIES},
        **{family: 2 * nodes for family, nodes in mortar.SIDES.items()},
        "touch": 12,
        **{family: 3 * nodes for family, nodes in touch.SIDES.items()},
    }
    known |= {"mean_rotation": 8, "mean_axial": 8, "film_upwind_rough": 4}
    if family in PAIRS:
        middle = 4 + (count - 4) // 2
        parts = ("u", slice(0, 4)), ("p", slice(4, middle)), ("v", slice(middle, count))
        return parts
    split = known.get(family, count)
    rest = () if split == count else (("p", slice(split, count)),)
    return (("u", slice(0, split)), *rest)


def _difference(actual: np.ndarray, exact: np.ndarray, largest: Number) -> float:
    """Largest difference over the largest exact entry of its block."""
    if not np.all(np.isfinite(actual)):
        return float("inf")
    wrong = max(abs(mpf(float(a)) - e) for a, e in zip(actual.flat, exact.flat, strict=True))
    here = max(abs(e) for e in exact.flat)
    if here <= largest * mpf("1e-35"):  # an empty block must be empty, exactly
        return 0.0 if not np.any(actual) else float("inf")
    return float(wrong / here)


def residual_errors(actual: np.ndarray, exact: Sequence[Number], family: str) -> dict[str, float]:
    """Error of each block of a residual (ndof,), relative to the largest exact entry in it."""
    reference = np.array(exact, dtype=object)
    largest = max(abs(e) for e in exact)
    return {
        name: _difference(np.asarray(actual)[rows], reference[rows], largest)
        for name, rows in blocks(family, len(exact))
    }


def tangent_errors(actual: np.ndarray, exact: Matrix, family: str) -> dict[str, float]:
    """Error of each block of a tangent (ndof, ndof), relative to the largest exact entry in it."""
    reference = np.array(exact, dtype=object)
    largest = max(abs(e) for e in reference.flat)
    parts = blocks(family, len(exact))
    return {
        row + column: _difference(np.asarray(actual)[i, j], reference[i, j], largest)
        for row, i in parts
        for column, j in parts
    }


def agrees(errors: dict[str, float], tolerance: float = TOLERANCE) -> bool:
    """Whether every block is within the tolerance (NaN is not)."""
    return all(error <= tolerance for error in errors.values())
