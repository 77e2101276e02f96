"""Pseudo-loads and rates of fields of the generated kernels against the 50-digit references.

Both are derivatives along a random variation of coordinates, data and parameters; the reference
differences the exact residual and the exact fields in 110 digits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softehl.runtime.kernels.kernel import ArgumentError, load_kernel
from tests.reference import oracles
from tests.reference.calling import rule_of
from tests.reference.differentiate import STEP, mpf, numbers
from tests.reference.states import State, all_states

FAMILIES = [s for s in all_states() if "pseudo_load" in load_kernel(s.family).tasks]
STATES = [
    *{s.family: s for s in reversed(FAMILIES)}.values(),
    *(s for s in FAMILIES if s.family == "contact"),
    *(s for s in FAMILIES if s.family.startswith("film") and "m4" in s.label),
    *(s for s in FAMILIES if s.family.startswith("solid") and "inner" in s.label),
]
RATED = [s for s in STATES if "fields_rate" in load_kernel(s.family).tasks]


def variation(state: State) -> list[float]:
    """How coordinates, data, parameters and unknowns move, relative to their size."""
    rng = np.random.default_rng(20)
    values = [*state.coordinates, *state.data, *state.parameters, *state.dofs]
    return [float(rng.uniform(-1, 1) * abs(v)) for v in values]


def moved(state: State, along: list[float], step: Any) -> Any:
    """The state with exact arguments, moved; unknowns only where the variation reaches them."""
    rest = list(along)
    new: dict[str, Any] = {}
    for name in ("coordinates", "data", "parameters", "dofs"):
        values = numbers(getattr(state, name))
        mine, rest = rest[: len(values)], rest[len(values) :]
        mine += [0.0] * (len(values) - len(mine))
        new[name] = tuple(v + step * mpf(m) for v, m in zip(values, mine, strict=True))
    return replace(state, **new)


def difference(function: Any, state: State, along: list[float]) -> Any:
    """Central difference of an exact function along a variation, as an array of numbers."""
    ahead, behind = (
        np.array(function(moved(state, along, s * STEP)), dtype=object) for s in (1, -1)
    )
    return (ahead - behind) / (2 * STEP)


def called(task: str, state: State, along: list[float]) -> np.ndarray:
    values = getattr(load_kernel(state.family), task)(
        np.array([state.coordinates]),
        np.array([state.dofs]),
        np.array([along]),
        data=np.array([state.data]) if state.data else None,
        parameters=np.array(state.parameters),
        rule=rule_of(state),
    )
    return np.asarray(values[0])


def design(state: State) -> list[float]:
    return variation(state)[: -len(state.dofs)]


def test_pseudo_load_agrees_with_the_reference() -> None:
    for state in STATES:
        found = called("pseudo_load", state, design(state))
        exact = difference(oracles.new_residual, state, design(state))
        errors = oracles.residual_errors(found, list(exact), state.family)
        assert oracles.agrees(errors, 1e-12), errors


def test_rates_of_fields_agree_with_the_reference() -> None:
    for state in RATED:
        found = called("fields_rate", state, variation(state))
        exact = difference(oracles.fields, state, variation(state)).astype(float)
        values = np.array(oracles.fields(state), dtype=object).astype(float)
        places = load_kernel(state.family).fields_at(
            np.array([state.coordinates]),
            np.array([state.dofs]),
            data=np.array([state.data]) if state.data else None,
            parameters=np.array(state.parameters),
            rule=rule_of(state),
        )[0]
        # the order of the points is the kernel's own: match them by place
        order, mine = (np.argsort(v[:, 0]) for v in (values, places))
        scale = np.abs(exact).max(axis=0)
        assert np.all(np.abs(found[mine] - exact[order]) <= 1e-12 * scale)


def test_one_argument_that_does_not_move_is_noticed() -> None:
    """Every coordinate, datum and parameter has its part in the pseudo-load, or none at all."""
    for state in STATES[:9]:
        exact = difference(oracles.new_residual, state, design(state))
        noticed = 0
        for k in range(len(design(state))):
            short = [0.0 if j == k else v for j, v in enumerate(design(state))]
            errors = oracles.residual_errors(
                called("pseudo_load", state, short), list(exact), state.family
            )
            noticed += not oracles.agrees(errors, 1e-12)
        assert noticed >= len(state.coordinates) // 2 + 1


def test_the_variation_must_fit() -> None:
    state = next(s for s in STATES if s.family == "film")
    with pytest.raises(ArgumentError, match=r"direction has shape \(1, 3\), must be \(1, 11\)"):
        called("pseudo_load", state, [0.0, 1.0, 0.0])
    with pytest.raises(ArgumentError, match=r"mean_rotation offers .*, not fields_rate"):
        called("fields_rate", next(s for s in STATES if s.family == "mean_rotation"), [])
