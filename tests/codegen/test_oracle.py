"""Every shipped kernel against the oracle that walks the unoptimised model in 90 digits.

Errors are relative to the largest entry of a block (displacements of one direction, multiplier,
pressures, and their couplings), which is stricter than the largest entry of the whole: a film's
force and flux entries are many orders of magnitude apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.codegen.graph.evaluate import Walk
from softehl.codegen.graph.graph import Node, Op
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Definition
from softehl.codegen.models import ALL
from softehl.codegen.tools.oracle import Oracle
from softehl.runtime.arrays import Array
from softehl.runtime.kernels import Kernel, load_kernel
from tests.codegen.element_states import Case, all_cases
from tests.codegen.workshop import compiled
from tests.shipped import ENERGIES, FIELDS

LIMIT = 1e-12
CASES = {f"{c.family}: {c.label}": c for c in all_cases()}


@cache
def definition(family: str) -> Definition:
    return ALL[family]()


@cache
def exact(name: str) -> tuple[Array, Array]:
    """Residual and tangent of the oracle, rounded once."""
    case = CASES[name]
    oracle, state = Oracle(definition(case.family)), case.exact()
    return rounded(oracle.residual(state)), rounded(oracle.tangent(state))


def rounded(values: Any) -> Array:
    """Doubles; differences of equal numbers leave 1e-60 where the exact value is zero."""
    array = np.array(values, dtype=object).astype(np.float64)
    return np.where(np.abs(array) < 1e-35 * np.abs(array).max(), 0.0, array)


def groups(d: Definition, ndof: int) -> list[list[int]]:
    """Unknowns of one kind: a name without the number of its node, or the interpolated field."""
    kinds: dict[str, list[int]] = {}
    for k in range(ndof):
        name = d.unknowns[k].rstrip("1234") if k < len(d.unknowns) else "interpolated"
        kinds.setdefault(name, []).append(k)
    return list(kinds.values())


def blocks(d: Definition, values: Array) -> Iterator[tuple[Any, ...]]:
    kinds = groups(d, len(values))
    for rows in kinds:
        if values.ndim == 1:
            yield (rows,)
        else:
            yield from (np.ix_(rows, columns) for columns in kinds)


def error(d: Definition, found: Array, expected: Array) -> float:
    """Largest error of any block relative to its largest entry; infinite where zero is missed."""
    worst = 0.0
    for place in blocks(d, expected):
        scale = np.abs(expected[place]).max()
        off = np.abs(found[place] - expected[place]).max()
        if not off <= (1e-300 if scale == 0 else np.inf):
            return np.inf
        worst = max(worst, off / scale if scale else 0.0)
    return worst


def called(case: Case, kernel: Kernel | None = None) -> tuple[Array, Array]:
    positional, named = case.arguments()
    R, K = (kernel or load_kernel(case.family)).tangent(*positional, **named)
    return R[0], K[0]


# --------------------------------------------------------------------------------- the comparisons


LONG = ("film_conserving_carreau: m1-far",)
"""Cases for which the oracle needs half a minute: seven unknowns, twice at every point."""


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in CASES]
)
def test_residual_and_tangent(name: str) -> None:
    case = CASES[name]
    d, (R, K) = definition(case.family), exact(name)
    found_R, found_K = called(case)
    assert error(d, found_R, R) <= LIMIT
    assert error(d, found_K, K) <= LIMIT
    positional, named = case.arguments()
    alone = load_kernel(case.family).residual(*positional, **named)[0]
    assert error(d, alone, R) <= LIMIT
    assert K.any() or case.label == "no pressure"


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.family in ENERGIES])
def test_energy(name: str) -> None:
    case = CASES[name]
    positional, named = case.arguments()
    found = load_kernel(case.family).energy(*positional, **named)[0]
    expected = float(Oracle(definition(case.family)).potential(case.exact()))
    assert expected != 0
    assert abs(found - expected) <= LIMIT * abs(expected)


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.family in FIELDS])
def test_fields(name: str) -> None:
    case = CASES[name]
    positional, named = case.arguments()
    found = load_kernel(case.family).fields_at(*positional, **named)[0]
    expected = rounded(Oracle(definition(case.family)).fields(case.exact()))
    assert found.shape == expected.shape
    scale = np.abs(expected).max(axis=0)  # a field that is zero must be found zero
    assert scale.any()
    assert (np.abs(found - expected) <= LIMIT * scale).all()


SMOOTH = ("p_a", "tau_a")
"""Fields of asperities, zero on the page of a smooth film."""


@pytest.mark.parametrize("family", FIELDS)
def test_no_field_is_zero_in_every_case(family: str) -> None:
    scales = [
        np.abs(rounded(Oracle(definition(c.family)).fields(c.exact()))).max(axis=0)
        for c in CASES.values()
        if c.family == family
    ]
    zero = np.array(load_kernel(family).fields)[np.max(scales, axis=0) == 0.0]
    assert tuple(zero) == (SMOOTH if family.startswith("film_conserving") else ())


# ------------------------------------------------------------------------------------- what is met


def test_cases_meet_every_family_and_every_branch() -> None:
    assert {c.family for c in CASES.values()} == set(ALL)
    for family in set(ALL) - {
        "contact",
        "contact_corner",
        "contact_friction",
        "film",
        "film_upwind",
    }:
        for branch in branches(definition(family)):
            assert outcomes(family, branch) == {True, False}, f"{family}: a branch is never taken"
    closed = {bool(called(c)[0][:2].any()) for c in CASES.values() if c.family == "contact"}
    assert closed == {True, False}
    widens = set()
    for case in CASES.values():
        if case.family == "film_upwind":  # h rises with the radius, downstream is along U
            rise = (case.coordinates + case.dofs[:4])[[3, 1]] @ (1.0, -1.0)
            widens.add(bool(case.parameters[1] * rise > 0.0))
    assert widens == {True, False}
    signs = set()
    for case in CASES.values():
        if case.family == "film":
            positional, named = case.arguments()
            kernel = load_kernel("film")
            p = kernel.fields_at(*positional, **named)[0, :, kernel.fields.index("p")]
            signs.add((bool(p.min() > 0), bool(p.max() < 0), bool(case.parameters[1] > 0)))
    assert signs == {(True, False, True), (False, True, True), (False, False, False)}
    offered = {f: load_kernel(f).tasks for f in ALL}
    assert [f for f in offered if "energy" in offered[f]] == list(ENERGIES)
    assert [f for f in offered if "fields" in offered[f]] == list(FIELDS)


def outcomes(family: str, branch: Node) -> set[bool]:
    """What the condition of a branch is at the points of the cases of a family."""
    found: set[bool] = set()
    for state in [c.exact() for c in CASES.values() if c.family == family]:
        walk = Walk(state, {})
        points = range(len(state.rule) if branch.args[0].varying else 1)
        found |= {bool(walk.at(branch.args[0], q)) for q in points}
    return found


def branches(d: Definition) -> list[Node]:
    return [n for n in reachable([d.potential]) if n.op is Op.BRANCH]


# --------------------------------------------------------------------------- what must be refused


@pytest.mark.parametrize("family", ALL)
def test_one_entry_wrong_by_1e9_is_refused(family: str) -> None:
    name = next(n for n, c in CASES.items() if c.family == family)
    d, (R, K) = definition(family), exact(name)
    assert error(d, R, R) == error(d, K, K) == 0
    for values in (R, K):
        for place in blocks(d, values):
            part = values[place]
            wrong = values.copy()
            if part.any():
                k = np.unravel_index(np.abs(part).argmax(), part.shape)
                part[k] *= 1 + 1e-9
            else:
                part[(0,) * part.ndim] = 1e-30
            wrong[place] = part
            assert error(d, wrong, values) > LIMIT
    broken = K.copy()
    broken[0, -1] = np.nan
    assert error(d, broken, K) == np.inf


@pytest.mark.parametrize(
    ("family", "forgotten"),
    [
        ("solid_fbar", "a"),
        ("film", "h"),
        ("film", "ring"),
        ("film", "eta"),
        ("film_upwind", "delta"),
        ("film_upwind", "h_m"),
        ("film_upwind", "W"),
        ("film_upwind", "z_xi"),
        ("film_facet", "h"),
        ("film_facet", "z_xi_minus"),
        ("film_facet", "eta_plus"),
        ("film_facet", "jump"),
        ("contact", "gap"),
    ],
)
def test_a_kernel_that_forgets_a_dependence_is_refused(
    family: str, forgotten: str, tmp_path: Path
) -> None:
    """Compiled from the real page, with the derivative of one intermediate declared to be none."""
    d = definition(family)
    (node,) = (n for n in reachable([d.potential]) if n.op is Op.NAME and n.payload == forgotten)
    kernel = compiled(replace(d, given={**d.given, node: {}}), tmp_path)
    name = next(n for n, c in CASES.items() if c.family == family)
    R, K = exact(name)
    found_R, found_K = called(CASES[name], kernel)
    assert error(d, found_R, R) <= LIMIT, "the residual freezes this intermediate anyway"
    assert error(d, found_K, K) > 1e6 * LIMIT
