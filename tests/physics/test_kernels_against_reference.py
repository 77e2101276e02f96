"""Kernels, their pseudo-loads and rates of fields against the references of 50 digits."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from softehl.runtime.kernels.kernel import ArgumentError, load_kernel
from tests.reference import film, material, oracles, rules, solids, upwind
from tests.reference.calling import call, rule_of
from tests.reference.differentiate import (
    PI,
    STEP,
    Arguments,
    Matrix,
    Vector,
    gradient,
    hessian,
    jacobian,
    mpf,
    numbers,
)
from tests.reference.states import SOLIDS, State, all_states, thin_film_states

# --- Every generated kernel against its independent 50-digit reference, entry by entry ------------


THIN = list(thin_film_states())
STATES: dict[str, list[State]] = {}
for _state in all_states():
    STATES.setdefault(_state.family, []).append(_state)

CHOSEN = {
    "film": ("m2-lobatto-out-pressed", "m3-gauss-in-crossing"),
    "film_upwind": ("m2-gauss-out-pressed", "m2-gauss-in-crossing", "m2-gauss-out-cavitated"),
    "film_facet": ("m2-out", "m2-thin"),
    "film_rough": ("m1-deep", "m1-light", "m1-far"),
    "film_upwind_rough": ("m2-deep", "m2-bent"),
    "film_conserving": ("m1-light", "m1-far"),
}
"""States of the large families that are compared in every run: as few as take every branch."""
CHEAP = ("contact", "sheet", "follower", "film_void")
"""Beginnings of families all of whose states are; of any other family it is the first."""

EVERY = [
    *STATES,
    *(pytest.param(f"{f}, everywhere", marks=pytest.mark.slow) for f in STATES),
]
"""Families with their chosen states, and with all."""


def states(which: str) -> list[State]:
    """The chosen states of a family, or all of them."""
    family, _, everywhere = which.partition(", ")
    every = STATES[family]
    if everywhere or family.startswith(CHEAP):
        return every
    chosen = CHOSEN.get(family, (every[0].label,))
    return [state for state in every if state.label in chosen]


def doubles(values: object) -> np.ndarray:
    """Rounded exact numbers: what a perfect kernel would return."""
    rounded = np.array(values, dtype=object).astype(float)
    # differences of differences leave 1e-60 where the exact entry is zero
    return np.where(np.abs(rounded) < 1e-35 * np.abs(rounded).max(), 0.0, rounded)


def pick(family: str, *words: str) -> State:
    """The first state of a family whose label holds all the words."""
    return next(s for s in STATES[family] if all(w in s.label for w in words))


@pytest.mark.parametrize("which", EVERY)
def test_tangent_and_residual_agree_with_the_reference(which: str) -> None:
    for state in states(which):
        residual, tangent = (values[0] for values in call("tangent", state))
        alone = call("residual", state)[0]
        for values in (residual, alone):
            errors = oracles.residual_errors(values, oracles.residual(state), state.family)
            assert oracles.agrees(errors), (state.id, errors)
        errors = oracles.tangent_errors(tangent, oracles.tangent(state), state.family)
        assert oracles.agrees(errors), (state.id, errors)


@pytest.mark.parametrize("which", EVERY)
def test_energy_and_fields_agree_with_the_reference(which: str) -> None:
    for state in states(which):
        if state.family in oracles.ENERGIES:
            check_energy(state)
        if state.family in oracles.FIELDS:
            check_fields(state)


def check_energy(state: State) -> None:
    """W_v near J = 1 is a small difference of terms of the size of kappa: that is the scale."""
    exact = float(oracles.energy(state))
    scale = abs(exact)
    if state.family.startswith("solid_"):
        X = numbers(state.coordinates)
        scale += (
            1e-3 * state.parameters[-1] * float(sum(at.volume for at in solids.gauss_points(X)))
        )
    assert abs(call("energy", state)[0] - exact) <= 1e-12 * scale, state.id


def check_fields(state: State) -> None:
    values, exact = call("fields_at", state)[0], doubles(oracles.fields(state))
    assert values.shape == exact.shape
    # the order of the points is the kernel's own: match them by place
    values, exact = (rows[np.lexsort(rows[:, 1::-1].round(9).T)] for rows in (values, exact))
    scale = np.abs(exact).max(axis=0)
    off = np.abs(values - exact)
    assert np.all(off <= 1e-12 * scale), (state.id, off.max(0) / scale)


def sheet_stresses(family: str, e: Vector, parameters: Vector) -> Vector:
    return gradient(oracles.ENERGIES[family](Arguments([], parameters, [])), e)


@pytest.mark.parametrize("family", [f for f in STATES if f.startswith("sheet_")])
def test_stresses_by_parameters_agree_with_the_reference(family: str) -> None:
    kernel = load_kernel(family)
    for state in STATES[family]:
        e, own = numbers(state.dofs), numbers(state.parameters)
        exact = doubles(jacobian(partial(sheet_stresses, family, e), own))
        X, dofs = np.array([state.coordinates]), np.array([state.dofs])
        for name, column in zip(kernel.parameters, exact.T, strict=True):
            found = kernel.derivative(name, X, dofs, parameters=np.array(state.parameters))[0]
            assert np.abs(found - column).max() <= 1e-12 * max(np.abs(column).max(), 1e-3)
            wrong = np.abs(1.001 * found - column).max()
            assert not column.any() or wrong > 1e-5 * abs(column).max()


@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=[pytest.mark.slow] * (k > 0)) for k in range(len(THIN))]
)
def test_submicrometre_film_at_large_radius_keeps_its_digits(number: int) -> None:
    """h of 0.3 um is 1e-5 of r: (R + u) - R_rod would lose five digits, (R - R_rod) + u none."""
    state = THIN[number]
    residual, tangent = (values[0] for values in call("tangent", state))
    errors = oracles.residual_errors(residual, oracles.residual(state), state.family)
    assert oracles.agrees(errors), errors
    errors = oracles.tangent_errors(tangent, oracles.tangent(state), state.family)
    assert oracles.agrees(errors), errors
    h, rounded = 25.4 + state.dofs[1] - 25.0, (25.4 - 25.0) + state.dofs[1]
    assert abs(h / rounded - 1) > 1e-12  # the other order of summation would be noticed


def test_batches_of_every_size_repeat_the_single_element() -> None:
    """Batches that do and do not fill a vector register; the last element differs from the rest."""
    for state, *_ in STATES.values():
        kernel, rng = load_kernel(state.family), np.random.default_rng(5)
        single = call("tangent", state)
        for size in (2, 3, 4, 5, 9):
            scatter = 1e-3 * rng.uniform(-1, 1, (size, len(state.dofs)))
            scatter[-1] = 0.0
            data = np.array([state.data] * size) if state.data else None
            points = np.array([state.point_data] * size)[:, :, None] if state.point_data else None
            residual, tangent = kernel.tangent(
                np.array([state.coordinates] * size),
                np.array(state.dofs) + scatter,
                data=data,
                parameters=np.array(state.parameters),
                point_data=points,
                rule=rule_of(state),
            )
            for values, expected in ((residual[-1], single[0][0]), (tangent[-1], single[1][0])):
                np.testing.assert_allclose(
                    values, expected, rtol=0, atol=1e-13 * np.abs(expected).max(), err_msg=state.id
                )


# ------------------------------------------------------------------ the checker itself is tested


def rejects(tangent: np.ndarray, exact: Matrix, family: str) -> bool:
    return not oracles.agrees(oracles.tangent_errors(tangent, exact, family))


def test_checker_accepts_rounding_and_rejects_one_entry_wrong_by_1e9() -> None:
    """What is compared with is the kernel's own: only the checker is asked here."""
    for state, *_ in STATES.values():
        family, (R, K) = state.family, call("tangent", state)
        residual, good = R[0], K[0]
        exact = [numbers(row) for row in good]
        assert not rejects(good * (1 + 1e-15), exact, family)
        for _, rows in oracles.blocks(family, len(state.dofs)):
            for _, columns in oracles.blocks(family, len(state.dofs)):
                part = good[rows, columns]
                if not part.any():
                    continue
                place = np.unravel_index(np.abs(part).argmax(), part.shape)
                wrong = good.copy()
                wrong[rows, columns][place] *= 1 + 1e-9
                assert rejects(wrong, exact, family)
        wrong = residual.copy()
        wrong[np.abs(residual).argmax()] *= 1 + 1e-9
        for values, right in ((residual, True), (wrong, False)):
            errors = oracles.residual_errors(values, numbers(residual), family)
            assert oracles.agrees(errors) is right


def test_checker_rejects_nan_a_transposed_tangent_and_a_filled_empty_block() -> None:
    for state, *_ in STATES.values():
        family, good = state.family, call("tangent", state)[1][0]
        exact = [numbers(row) for row in good]
        broken = good.copy()
        broken[-1, -1] = np.nan
        assert rejects(broken, exact, family)
        if np.abs(good - good.T).max() > 1e-6 * np.abs(good).max():
            assert rejects(good.T, exact, family)
        for _, rows in oracles.blocks(family, len(state.dofs)):
            for _, columns in oracles.blocks(family, len(state.dofs)):
                if not good[rows, columns].any():
                    filled = good.copy()
                    filled[rows, columns] = 1e-18
                    assert rejects(filled, exact, family)


def test_tangent_without_a_term_is_rejected() -> None:
    """Classic omissions, made in the reference and compared with the real kernels' tangents."""
    for state, dropped in (
        (pick("solid_fbar", "paper"), fbar_with_frozen_centroid),
        (pick("solid_q4", "inner"), q4_without_hoop),
        (pick("film", "m4-gauss-out-pressed"), film_without_shear),
        (pick("film", "m3-gauss-out-pressed"), film_on_a_fixed_domain),
        (pick("film", "m4-gauss-in-crossing"), film_without_penalty),
        (pick("film", "m2-lobatto-out-pressed"), film_without_barus),
        (pick("film_facet", "m3-out"), facet_on_a_fixed_domain),
        (pick("film_facet", "m3-out"), facet_with_the_printed_signs),
        (pick("film_facet", "m4-thin"), facet_without_barus),
        (pick("film_upwind", "m3-gauss-out-pressed"), upwinding_with_frozen_delta),
        (pick("film_upwind", "m2-lobatto-in-crossing"), upwinding_of_the_whole_pressure),
    ):
        kernel = call("tangent", state)[1][0]
        errors = oracles.tangent_errors(kernel, dropped(state), state.family)
        assert not oracles.agrees(errors), (state.id, errors)


def fbar_with_frozen_centroid(state: State) -> Matrix:
    """Tangent with J0 held constant: symmetric-looking and wrong."""
    a, u = oracles.exact(state)
    centre = solids.point(a.X, numbers([0])[0], numbers([0])[0])
    J0 = material.determinant(centre.deformation(u))

    def residual(v: Vector) -> Vector:
        total = [0] * 8
        for at in solids.gauss_points(a.X):
            F = at.deformation(v)
            ratio = material.determinant(F) / J0
            Fbar = [entry / ratio ** (numbers([1])[0] / 3) for entry in F]
            P = material.first_piola(Fbar, *a.parameters)
            factor = at.volume * ratio ** (numbers([2])[0] / 3)
            total = [t + factor * f for t, f in zip(total, at.work(P), strict=True)]
        return total

    return jacobian(residual, u)


def q4_without_hoop(state: State) -> Matrix:
    """Plane strain in disguise: u_r / R left out of F_tt."""
    a, u = oracles.exact(state)
    points = [replace(at, shapes=numbers([0] * 4)) for at in solids.gauss_points(a.X)]
    return hessian(lambda v: solids.plain_energy(points, v, a.parameters), u)


def film_variant(state: State, **changes: float) -> Matrix:
    names = load_kernel("film").parameters
    values = [changes.get(name, v) for name, v in zip(names, state.parameters, strict=True)]
    return oracles.tangent(replace(state, parameters=tuple(values)))


def film_without_shear(state: State) -> Matrix:
    return film_variant(state, shear_weight=0.0)


def film_on_a_fixed_domain(state: State) -> Matrix:
    """The domain's motion (axial displacements) left out of the Reynolds rows."""
    exact = [list(row) for row in oracles.tangent(state)]
    for row in exact[4:]:
        row[0] = row[2] = numbers([0])[0]
    return exact


def film_without_penalty(state: State) -> Matrix:
    return film_variant(state, cavitation_penalty=0.0)


def film_without_barus(state: State) -> Matrix:
    return film_variant(state, pressure_viscosity=0.0)


def facet_on_a_fixed_domain(state: State) -> Matrix:
    exact = [list(row) for row in oracles.tangent(state)]
    for row in exact[6:]:
        row[0] = row[2] = row[4] = numbers([0])[0]
    return exact


def facet_with_the_printed_signs(state: State) -> Matrix:
    return [[-entry for entry in row] for row in oracles.tangent(state)]


def facet_without_barus(state: State) -> Matrix:
    return oracles.tangent(replace(state, parameters=(*state.parameters[:3], 0.0)))


def upwinding_with_frozen_delta(state: State) -> Matrix:
    """Only the bubble load differentiated, at a constant share of it."""
    a, u = oracles.exact(state)
    factor = a.parameters[4] * a.parameters[5] * upwind.share(a.X, u, a.parameters) / 2

    def residual(v: Vector) -> Vector:
        moved = factor * upwind.bubble_load(a.X, v, v[4:])
        return [0, -moved, 0, moved] + [0] * (len(v) - 4)

    return jacobian(residual, u)


def upwinding_of_the_whole_pressure(state: State) -> Matrix:
    """The linear part of the pressure left in the load that is moved."""
    a, u = oracles.exact(state)

    def residual(v: Vector) -> Vector:
        z1, r1, z2, r2 = (a.X[i] + v[i] for i in range(4))
        interpolant = (v[4] * (2 * r1 + r2) + v[-1] * (r1 + 2 * r2)) / 6 * (z2 - z1)
        load = upwind.bubble_load(a.X, v, v[4:]) - 2 * PI * interpolant
        strength = a.parameters[4] * a.parameters[5]
        moved = strength * upwind.share(a.X, v, a.parameters) / 2 * load
        return [0, -moved, 0, moved] + [0] * (len(v) - 4)

    return jacobian(residual, u)


# ------------------------------------------------------------- the references are tested on theory


def test_reference_rules_integrate_polynomials_exactly_and_no_further() -> None:
    for kind, degree in (("gauss", 2 * 6 - 1), ("lobatto", 2 * 6 - 3)):
        points, weights = (list(values) for values in rules.rule(kind, 6))

        def error(power: int, points: Vector, weights: Vector) -> float:
            exact = numbers([2])[0] / (power + 1) if power % 2 == 0 else 0
            return float(
                abs(sum(w * x**power for x, w in zip(points, weights, strict=True)) - exact)
            )

        assert max(error(power, points, weights) for power in range(degree + 1)) < 1e-100
        assert error(degree + 1, points, weights) > 1e-4


def test_reference_symmetry_of_the_solids() -> None:
    """Potentials give symmetric tangents, F-bar does not; nested differences hold 40 digits."""
    exact = np.array(oracles.tangent(pick("solid_fbar", "paper")), dtype=object)
    assert np.abs(exact - exact.T).max() > 1e-3 * np.abs(exact).max()
    state = pick("solid_q4", "paper")
    a, u = oracles.exact(state)
    by_residual = np.array(jacobian(partial(gradient, solids.plain(a)), u), dtype=object)
    by_energy = np.array(oracles.tangent(state), dtype=object)
    assert np.abs(by_residual - by_energy).max() < 1e-40 * np.abs(by_energy).max()


def test_states_cover_every_branch() -> None:
    """Cavitated, pressed and crossing films; open and closed contact; both signs of U."""
    signs = set()
    for state in STATES["film"]:
        values = [at.p for at in film.film_points(*oracles.exact(state))]
        signs.add((min(values) > 0, max(values) < 0, state.parameters[1] > 0))
    assert signs == {(True, False, True), (False, True, True), (False, False, False)}
    gaps = {oracles.residual(s)[0] == 0 for s in STATES["contact"]}
    assert gaps == {True, False}
    rubbing = STATES["contact_friction"]
    closed = [s for s in rubbing if oracles.residual(s)[0] != 0]
    sticking = [s for s in closed if oracles.tangent(s)[3][3] == 0]
    assert len(rubbing) > len(closed) > len(sticking) > 0
    assert set(STATES) == {*oracles.ENERGIES, *oracles.WEAK}
    assert set(SOLIDS) < set(STATES)


# --- Pseudo-loads and rates of fields of the generated kernels against the 50-digit references ----


FAMILIES = [s for s in all_states() if "pseudo_load" in load_kernel(s.family).tasks]
VARIED = [
    *{s.family: s for s in reversed(FAMILIES)}.values(),
    *(s for s in FAMILIES if s.family == "contact"),
    *(s for s in FAMILIES if s.family.startswith("film") and "m4" in s.label),
    *(s for s in FAMILIES if s.family.startswith("solid") and "inner" in s.label),
]
RATED = [s for s in VARIED if "fields_rate" in load_kernel(s.family).tasks]


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
    for state in VARIED:
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
    for state in VARIED[:9]:
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
    state = next(s for s in VARIED if s.family == "film")
    with pytest.raises(ArgumentError, match=r"direction has shape \(1, 3\), must be \(1, 11\)"):
        called("pseudo_load", state, [0.0, 1.0, 0.0])
    with pytest.raises(ArgumentError, match=r"mean_rotation offers .*, not fields_rate"):
        called(
            "fields_rate",
            next(s for s in VARIED if s.family == "mean_rotation"),
            [],
        )
