"""Seals in other units: features of a seal together, against the analysis of dimensions.

Twice all pressures, or half of all times, must give the same film to rounding: each key and each
column says by its unit how it scales. A constant with a dimension somewhere in the program, or a
feature that leaves a key out where another one is given, shows.
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import pytest

from softehl.cases.harness.parameters import declared
from softehl.cases.oring import run_oring
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmRow, FilmState, Silent

UNITS = {
    **{"MPa": (1, 0), "1/MPa": (-1, 0), "MPa s": (1, 1), "N": (1, 0), "N mm": (1, 0)},
    **{"mm/s": (0, -1), "1/s": (0, -1), "mm3/s": (0, -1), "mm/(MPa s)": (-1, -1), "W": (1, -1)},
}
"""Unit -> powers of pressure and time in it; a length stays, so a force is a pressure."""

RELATIONS = {"pressure": (1, 0), "time": (0, 1)}

NOT_COMPARED = {"newton_iterations", "oscillation_index", "flux_variation", "flux_mismatch_percent"}
"""Columns that are rounding, or depend on it."""

CUP: dict[str, Any] = {
    **{"section": "u_cup", "inner_diameter": 49.4, "section_diameter": 5.5},
    **{"rod_diameter": 50.0, "housing_diameter": 60.12, "groove_width": 8.0},
}
EYRING, ROUGH, GAP = {"eyring_stress": 0.05}, {"roughness": [0.2, 0.4]}, {"extrusion_gap": 0.2}
GENT = {"material": "gent", "mu": 2.0, "J_m": 20.0}
FEATURES: dict[str, Mapping[str, Any]] = {
    "piston, rough": {"bore": 50.0, **ROUGH},
    "piston, gap, Eyring, high pressure": {"bore": 50.0, **GAP, **EYRING, "sealed_pressure": 6.0},
    "U-cup, rough": {**CUP, **ROUGH},
    "rectangle, Eyring, sensitivity": {
        **{"section": "rectangular", "housing_diameter": 56.4},
        **{"groove_width": 4.6, **EYRING, "sensitivity": True},
    },
    "Gent, rough, high pressure": {**GENT, **ROUGH, "sealed_pressure": 6.0},
    "Carreau, ruptured film, monolithic": {
        **{"carreau_stress": 0.005, "carreau_exponent": 0.6, "solver": "monolithic"},
        **{"cavitation": "mass-conserving", "cavitation_pressure": -0.05},
    },
    "gap, sensitivity, estimate": {**GAP, "sensitivity": True, "error_estimate": True},
    "dg, F-bar, no pressure": {"reynolds": "dg", "solid": "fbar", "sealed_pressure": 0.0},
}
QUICK = "piston, rough"


def factor(unit: str, relation: tuple[int, int]) -> float:
    """Two to the power that a unit has in a relation."""
    powers = UNITS.get(unit, (0, 0))
    return float(2.0 ** sum(a * b for a, b in zip(powers, relation, strict=True)))


def scaled(p: Seal, relation: tuple[int, int]) -> Seal:
    """The seal with all its keys in another unit."""
    values = p.model_dump(exclude_none=True)
    for name in values:
        if (by := factor(declared(Seal.model_fields[name])["unit"], relation)) != 1.0:
            value = values[name]
            values[name] = [by * v for v in value] if isinstance(value, tuple) else by * value
    return Seal(**values)


@cache
def states(p: Seal) -> tuple[FilmState, ...]:
    found = run_oring(p, Silent())
    assert len(found.states) == 2, found.message
    return found.states


def differences(one: FilmState, other: FilmState, relation: tuple[int, int]) -> list[str]:
    """Columns and derivatives of two states that do not agree."""
    found = []
    for column in FilmRow.columns():
        a, b = getattr(one, column.name), getattr(other, column.name)
        if column.name in NOT_COMPARED:
            continue
        if not isinstance(a, str):
            a *= factor(column.unit, relation)
        if a != b and not _agree(a, b, 1e-3 if column.name.endswith("error_percent") else 1e-7):
            found.append(f"{column.name}: {a} and {b}")
    others = other.sensitivity or {}
    for quantity, slopes in (one.sensitivity or {}).items():
        found += [
            f"{quantity} by {key}: {slope} and {others[quantity][key]}"
            for key, slope in slopes.items()
            if not math.isclose(slope, others[quantity][key], rel_tol=1e-4, abs_tol=1e-4)
        ]
    return found


def _agree(a: Any, b: Any, small: float) -> bool:
    numbers = isinstance(a, float) and isinstance(b, float)
    alike = numbers and math.isclose(a, b, rel_tol=2e-6, abs_tol=small)
    return alike or (numbers and math.isnan(a) and math.isnan(b))


def case(name: str) -> Seal:
    """Both strokes of a combination on a coarse mesh."""
    given = {"density": 1, "error_estimate": False, "speeds": [400.0], **FEATURES[name]}
    return Seal(**given)


@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n != QUICK)) for n in FEATURES]
)
def test_a_seal_in_other_units(name: str, relation: str) -> None:
    powers = RELATIONS[relation]
    pairs = zip(states(case(name)), states(scaled(case(name), powers)), strict=True)
    assert [differences(a, b, powers) for a, b in pairs] == [[], []]


def test_a_key_that_is_left_out_shows() -> None:
    """The oracle itself: with a viscosity that keeps its unit."""
    powers, p = RELATIONS["time"], case(QUICK)
    wrong = scaled(p, powers).model_copy(update={"viscosity": p.viscosity})
    found = differences(states(p)[0], states(wrong)[0], powers)
    assert {text.partition(":")[0] for text in found} >= {"h_star_um", "rod_friction_N"}
