"""Every shipped kernel against the oracle that walks the unoptimised model in 90 digits.

The residual is compared along a random vector of each kind of unknowns (displacements of one
direction, multiplier, pressures), the tangent between each pair of them, relative to what its
entries could contribute: a film's force and flux entries are many orders of magnitude apart.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.codegen.graph.evaluation import Walk
from softehl.codegen.graph.graph import Node, Op
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition
from softehl.codegen.models import ALL
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.element_states import Case, all_cases
from tests.codegen.workshop import compiled
from tests.shipped import ENERGIES, FIELDS

LIMIT = 1e-12
CASES: dict[str, list[Case]] = {}
for _case in all_cases():
    CASES.setdefault(_case.family, []).append(_case)

EMPTY = ("no pressure", "open", "beyond", "missed-right", "missed-left")
"""Cases whose tangent may be zero."""
MEETINGS = ("sticking", "slipping", "slipping-back", "frictionless", *EMPTY[1:])
CHOSEN = {
    **{f"mortar_{a}{b}": MEETINGS for a in (2, 3) for b in (2, 3)},
    "touch": ("sticking", "slipping", "open", "beyond", "frictionless"),
    "rigid_link_2": ("finite", "small"),
    "rigid_link_3": ("finite", "small"),
    "rigid_moment": ("turned", "at rest"),
    **dict.fromkeys(("rigid_touch_2", "rigid_touch_3"), (*MEETINGS[:5], "beyond", "plane")),
    "contact": ("closed", "open"),
    "contact_corner": (
        *("in the wall", "in the fillet", "in the lip", "before the wall, open"),
        *("deep behind the wall", "deep above the lip"),
    ),
    "contact_friction": ("open", "sticking", "slipping", "slipping back"),
    "film": ("m_p=2 gauss pressed", "m_p=2 gauss mixed"),
    "film_upwind": ("m_p=2 gauss pressed", "m_p=2 gauss cavitated"),
    "film_facet": ("m_p=2 out",),
    "film_rough": ("m1-deep", "m1-light", "m1-far"),
    "film_conserving": ("m1-far",),
    "film_upwind_rough": ("m3-deep", "m3-bent"),
    "film_void": ("full", "below"),
    "film_eyring": ("m1-gauss-in-crossing", "m1-gauss-out-pressed"),
    "film_conserving_eyring": ("m1-far", "m1-light"),
}
"""The cases that are compared in every run: as few as take both sides of every branch; the first
case of any other family."""

DEAR = ("mortar_23", "mortar_32", "mortar_33", "touch_side_8", "touch_side_9")
EVERY = [
    *(pytest.param(f, marks=[pytest.mark.slow] * (f in DEAR)) for f in ALL),
    *(pytest.param(f"{f}, everywhere", marks=pytest.mark.slow) for f in ALL),
]
"""Families with their chosen cases, and with all."""


def cases(which: str) -> list[Case]:
    """The chosen cases of a family, or all of them."""
    family, _, everywhere = which.partition(", ")
    every = CASES[family]
    chosen = CHOSEN.get(family, (every[0].label,))
    return every if everywhere else [c for c in every if c.label in chosen]


@cache
def definition(family: str) -> Definition:
    return ALL[family]()


@cache
def vectors(family: str, ndof: int) -> Array:
    """Random numbers without zeros, a row for each kind of unknowns, (kinds, ndof).

    A kind is a name without the number of its node, or the interpolated field.
    """
    names = [n.rstrip("1234") for n in definition(family).unknowns]
    names += ["interpolated"] * (ndof - len(names))
    kinds = np.array(names)[None, :] == np.array(list(dict.fromkeys(names)))[:, None]
    rng = np.random.default_rng(1996)
    found: Array = kinds * rng.uniform(0.5, 1.0, ndof) * rng.choice([-1.0, 1.0], ndof)
    return found


@cache
def exact(family: str, label: str) -> tuple[Array, Array]:
    """Residual (kinds,) and tangent (kinds, kinds) of the oracle along and between `vectors`."""
    (case,) = (c for c in CASES[family] if c.label == label)
    oracle, state = Oracle(definition(family)), case.exact()
    rows = vectors(family, len(state.dofs)).tolist()
    K = [oracle.product(state, v, rows) for v in rows]
    return rounded(oracle.residual(state, rows)), rounded(K).T


def rounded(values: Any) -> Array:
    """Doubles; differences of equal numbers leave 1e-60 where the exact value is zero."""
    array = np.array(values, dtype=object).astype(np.float64)
    return np.where(np.abs(array) < 1e-35 * np.abs(array).max(), 0.0, array)


def between(v: Array, values: Array) -> Array:
    """A residual along vectors, a tangent between them."""
    return v @ values if values.ndim == 1 else v @ values @ v.T


def error(family: str, found: Array, expected: Array) -> float:
    """Largest error of what is `between` the vectors relative to what its entries could give."""
    v = vectors(family, len(found))
    size = between(abs(v), abs(found))
    off = np.abs(between(v, found) - expected)
    return float(np.where(off == 0.0, 0.0, off / np.maximum(size, 1e-300)).max())


def called(case: Case, kernel: Kernel | None = None) -> tuple[Array, Array]:
    positional, named = case.arguments()
    R, K = (kernel or load_kernel(case.family)).tangent(*positional, **named)
    return R[0], K[0]


# --------------------------------------------------------------------------------- the comparisons


@pytest.mark.parametrize("which", EVERY)
def test_residual_and_tangent(which: str) -> None:
    for case in cases(which):
        f, (R, K) = case.family, exact(case.family, case.label)
        found_R, found_K = called(case)
        assert error(f, found_R, R) <= LIMIT, case.label
        assert error(f, found_K, K) <= LIMIT, case.label
        positional, named = case.arguments()
        alone = load_kernel(f).residual(*positional, **named)[0]
        assert error(f, alone, R) <= LIMIT, case.label
        assert K.any() or case.label in EMPTY


@pytest.mark.parametrize("which", EVERY)
def test_energy_and_fields(which: str) -> None:
    for case in cases(which):
        (positional, named), kernel = case.arguments(), load_kernel(case.family)
        oracle, state = Oracle(definition(case.family)), case.exact()
        if case.family in ENERGIES:
            energy, exactly = (
                kernel.energy(*positional, **named)[0],
                float(oracle.potential(state)),
            )
            assert exactly != 0
            assert abs(energy - exactly) <= LIMIT * abs(exactly), case.label
        if case.family in FIELDS:
            found, expected = (
                kernel.fields_at(*positional, **named)[0],
                rounded(oracle.fields(state)),
            )
            assert found.shape == expected.shape
            scale = np.abs(expected).max(axis=0)  # a field that is zero must be found zero
            assert scale.any()
            assert (np.abs(found - expected) <= LIMIT * scale).all(), case.label


SMOOTH = ("p_a", "tau_a")
"""Fields of asperities, zero on the page of a smooth film."""


def test_no_field_is_zero_in_every_case() -> None:
    for family in FIELDS:
        kernel, largest = load_kernel(family), []
        for case in CASES[family]:
            positional, named = case.arguments()
            largest.append(np.abs(kernel.fields_at(*positional, **named)[0]).max(axis=0))
        zero = np.array(kernel.fields)[np.max(largest, axis=0) == 0.0]
        assert tuple(zero) == (SMOOTH if family.startswith("film_conserving") else ())


# ------------------------------------------------------------------------------------- what is met


def test_cases_meet_every_family_and_every_branch() -> None:
    assert set(CASES) == set(ALL)
    for family in set(ALL) - {
        "contact",
        "contact_corner",
        "contact_friction",
        "film",
        "film_upwind",
    }:
        for branch in branches(definition(family)):
            assert outcomes(family, branch) == {True, False}, f"{family}: a branch is never taken"
    closed = {bool(called(c)[0][:2].any()) for c in cases("contact")}
    assert closed == {True, False}
    widens = set()
    for case in cases("film_upwind"):  # h rises with the radius, downstream is along U
        rise = (case.coordinates + case.dofs[:4])[[3, 1]] @ (1.0, -1.0)
        widens.add(bool(case.parameters[1] * rise > 0.0))
    assert widens == {True, False}
    signs = set()
    for case in CASES["film"]:
        positional, named = case.arguments()
        kernel = load_kernel("film")
        p = kernel.fields_at(*positional, **named)[0, :, kernel.fields.index("p")]
        signs.add((bool(p.min() > 0), bool(p.max() < 0), bool(case.parameters[1] > 0)))
    assert signs == {(True, False, True), (False, True, True), (False, False, False)}
    offered = {f: load_kernel(f).tasks for f in ALL}
    assert [f for f in offered if "energy" in offered[f]] == list(ENERGIES)
    assert [f for f in offered if "fields" in offered[f]] == list(FIELDS)


def outcomes(family: str, branch: Node) -> set[bool]:
    """What the condition of a branch is at the points of the chosen cases of a family."""
    found: set[bool] = set()
    for state in [c.exact() for c in cases(family)]:
        walk = Walk(state, {})
        points = range(len(state.rule) if branch.args[0].varying else 1)
        found |= {bool(walk.at(branch.args[0], q)) for q in points}
    return found


def branches(d: Definition) -> list[Node]:
    """Those of a potential but for `x == x`, which asks for not-a-number."""
    found = [n for n in reachable([d.potential]) if n.op is Op.BRANCH]
    return [n for n in found if not asks_for_a_number(n.args[0])]


def asks_for_a_number(n: Node) -> bool:
    """Whether a condition is `x == x`, or several of them."""
    if n.op is Op.AND:
        return all(map(asks_for_a_number, n.args))
    return n.op is Op.EQ and len(set(n.args)) == 1


# --------------------------------------------------------------------------- what must be refused


@pytest.mark.parametrize("which", ["residual", "tangent"])
def test_one_entry_wrong_by_1e9_is_refused(which: str) -> None:
    """In every block of every kernel its largest entry, a zero that is not, and not-a-number."""
    for family, (case, *_) in CASES.items():
        values = called(case)[which == "tangent"]
        v = vectors(family, len(values))
        right = between(v, values)
        assert error(family, values, right) == 0
        kinds = abs(v) > 0
        blocks = kinds if values.ndim == 1 else [np.outer(a, b) for a in kinds for b in kinds]
        for here in blocks:
            wrong = values.copy()
            place = np.argmax(np.where(here, abs(values), -1.0))
            wrong.flat[place] = wrong.flat[place] * (1 + 1e-9) or 1e-30
            assert not error(family, wrong, right) <= LIMIT
        broken = values.copy()
        broken.flat[-1] = np.nan
        assert not error(family, broken, right) <= LIMIT


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
    kernel = compiled(replace(d, prescribed={**d.prescribed, node: {}}), tmp_path)
    case = cases(family)[0]
    R, K = exact(family, case.label)
    found_R, found_K = called(case, kernel)
    assert error(family, found_R, R) <= LIMIT, "the residual freezes this intermediate anyway"
    assert error(family, found_K, K) > 1e6 * LIMIT
