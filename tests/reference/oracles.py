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
    rigid,
    section,
    sheet,
    solids,
    touch,
    upwind,
)
from tests.reference.differentiate import (
    Arguments,
    Matrix,
    Number,
    Potential,
    Vector,
    gradient,
    hessian,
    jacobian,
    mpf,
    numbers,
)
from tests.reference.material import LAWS
from tests.reference.states import State

TOLERANCE = 1e-12
Block = tuple[str, slice]
SEGMENTS = ("film", "film_eyring", "film_carreau")
OTHERS = {name: law for name, law in LAWS.items() if name != "mooney_rivlin"}


def _of(energy: Callable[..., Number], **more: Any) -> Callable[[Arguments], Potential]:
    return lambda a: partial(energy, a, **more)


ENERGIES: dict[str, Callable[[Arguments], Potential]] = {
    "solid_q4": solids.plain,
    "solid_taylor": solids.taylor,
    "solid_taylor_mean": solids.taylor_mean,
    **{f"solid_taylor_mean_{n}": partial(solids.taylor_mean, law=law) for n, law in OTHERS.items()},
    **{f"sheet_{n}": _of(sheet.energy, law=law) for n, law in LAWS.items()},
    "contact_corner": _of(boundary.corner),
    "mean_rotation": _of(section.rotation),
    "mean_axial": _of(section.axial),
    "axial_spring": _of(section.spring),
    **{f"rigid_link_{d}": _of(rigid.link) for d in (2, 3)},
}
"""Families with a potential, by the arguments of an element: residual and tangent follow."""
WEAK: dict[str, Callable[[Arguments, Vector], Vector]] = {
    "solid_fbar": solids.fbar,
    "follower_pressure": boundary.pressure,
    "contact": boundary.contact,
    "contact_friction": boundary.friction,
    **dict.fromkeys(SEGMENTS, film.residual),
    "film_upwind": upwind.residual,
    "film_facet": facet.residual,
    **mixed.RESIDUALS,
    **mortar.RESIDUALS,
    **touch.RESIDUALS,
    "rigid_moment": rigid.moment,
    **{f"rigid_touch_{d}": rigid.touch for d in (2, 3)},
}
"""Residuals of the others."""
FIELDS: dict[str, Callable[[Arguments, Vector], Matrix]] = {
    "solid_q4": solids.plain_fields,
    "solid_fbar": solids.fbar_fields,
    "solid_taylor": solids.taylor_fields,
    "solid_taylor_mean": solids.taylor_mean_fields,
    **{
        f"solid_taylor_mean_{n}": partial(solids.taylor_mean_fields, law=law)
        for n, law in OTHERS.items()
    },
    **dict.fromkeys(SEGMENTS, film.fields),
    "film_facet": facet.fields,
    **mixed.FIELDS,
    **mortar.FIELDS,
    **touch.FIELDS,
}


def exact(state: State) -> tuple[Arguments, Vector]:
    """Arguments and unknowns of a state as exact numbers."""
    data = numbers(state.data or state.point_data)
    X, parameters = numbers(state.coordinates), numbers(state.parameters)
    return Arguments(X, parameters, data, state.kind, state.count), numbers(state.dofs)


def new_residual(state: State) -> Vector:
    """Exact residual (ndof) of a state that occurs once."""
    arguments, dofs = exact(state)
    if state.family in WEAK:
        return WEAK[state.family](arguments, dofs)
    return gradient(ENERGIES[state.family](arguments), dofs)


@lru_cache
def residual(state: State) -> Vector:
    """Exact residual (ndof)."""
    return new_residual(state)


@lru_cache
def tangent(state: State) -> Matrix:
    """Exact tangent (ndof, ndof); no state may sit on a switch."""
    arguments, dofs = exact(state)
    if state.family in WEAK:
        return jacobian(partial(WEAK[state.family], arguments), dofs)
    return hessian(ENERGIES[state.family](arguments), dofs)


def energy(state: State) -> Number:
    """Exact potential, for the families in `ENERGIES`."""
    arguments, dofs = exact(state)
    return ENERGIES[state.family](arguments)(dofs)


def fields(state: State) -> Matrix:
    """Exact fields (points, fields), for the families in `FIELDS`."""
    arguments, dofs = exact(state)
    return FIELDS[state.family](arguments, dofs)


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
