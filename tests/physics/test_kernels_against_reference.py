"""Every generated kernel against its independent 50-digit reference, entry by entry.

Agreement is measured block by block (displacements, pressures, multipliers and their couplings)
relative to the largest exact entry of the block; the limit is 1e-12.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softehl.runtime.kernels import load_kernel
from tests.reference import film, material, oracles, rules, sheet, solids, upwind
from tests.reference.calling import call, rule_of
from tests.reference.differentiate import PI, Matrix, Vector, hessian, jacobian, numbers
from tests.reference.states import SOLIDS, State, all_states, thin_film_states

STATES = all_states()
FIRST = list({state.family: state for state in reversed(STATES)}.values())
THIN = list(thin_film_states())


def doubles(values: object) -> np.ndarray:
    """Rounded exact numbers: what a perfect kernel would return."""
    rounded = np.array(values, dtype=object).astype(float)
    # differences of differences leave 1e-60 where the exact entry is zero
    return np.where(np.abs(rounded) < 1e-35 * np.abs(rounded).max(), 0.0, rounded)


def pick(family: str, *words: str) -> State:
    """The first state of a family whose label holds all the words."""
    return next(s for s in STATES if s.family == family and all(w in s.label for w in words))


@pytest.mark.parametrize("state", STATES, ids=lambda s: s.id)
def test_tangent_and_residual_agree_with_the_reference(state: State) -> None:
    residual, tangent = (values[0] for values in call("tangent", state))
    alone = call("residual", state)[0]
    for values in (residual, alone):
        errors = oracles.residual_errors(values, oracles.residual(state), state.family)
        assert oracles.agrees(errors), errors
    errors = oracles.tangent_errors(tangent, oracles.tangent(state), state.family)
    assert oracles.agrees(errors), errors


@pytest.mark.parametrize(
    "state", [s for s in STATES if s.family in oracles.ENERGIES], ids=lambda s: s.id
)
def test_energy_agrees_with_the_reference(state: State) -> None:
    """W_v near J = 1 is a small difference of terms of the size of kappa: that is the scale."""
    exact = float(oracles.energy(state))
    scale = abs(exact)
    if state.family.startswith("solid_"):
        X = numbers(state.coordinates)
        scale += (
            1e-3 * state.parameters[-1] * float(sum(at.volume for at in solids.gauss_points(X)))
        )
    assert abs(call("energy", state)[0] - exact) <= 1e-12 * scale


@pytest.mark.parametrize(
    "state", [s for s in STATES if s.family.startswith("sheet_")], ids=lambda s: s.id
)
def test_stresses_by_parameters_agree_with_the_reference(state: State) -> None:
    law = material.LAWS[state.family.removeprefix("sheet_")]
    e, own = numbers(state.dofs), numbers(state.parameters)
    exact = doubles(jacobian(lambda v: sheet.residual(e, v, law), own))
    kernel = load_kernel(state.family)
    X, dofs = np.array([state.coordinates]), np.array([state.dofs])
    for name, column in zip(kernel.parameters, exact.T, strict=True):
        found = kernel.derivative(name, X, dofs, parameters=np.array(state.parameters))[0]
        assert np.abs(found - column).max() <= 1e-12 * max(np.abs(column).max(), 1e-3)
        assert not column.any() or np.abs(1.001 * found - column).max() > 1e-5 * abs(column).max()


@pytest.mark.parametrize(
    "state", [s for s in STATES if s.family in oracles.FIELDS], ids=lambda s: s.id
)
def test_fields_agree_with_the_reference(state: State) -> None:
    values, exact = call("fields_at", state)[0], doubles(oracles.fields(state))
    assert values.shape == exact.shape
    # the order of the points is the kernel's own: match them by place
    values, exact = (rows[np.lexsort(rows[:, 1::-1].round(9).T)] for rows in (values, exact))
    scale = np.abs(exact).max(axis=0)
    assert np.all(np.abs(values - exact) <= 1e-12 * scale), np.abs(values - exact).max(0) / scale


@pytest.mark.parametrize("state", THIN, ids=lambda s: s.id)
def test_submicrometre_film_at_large_radius_keeps_its_digits(state: State) -> None:
    """h of 0.3 um is 1e-5 of r: (R + u) - R_rod would lose five digits, (R - R_rod) + u none."""
    residual, tangent = (values[0] for values in call("tangent", state))
    errors = oracles.residual_errors(residual, oracles.residual(state), state.family)
    assert oracles.agrees(errors), errors
    errors = oracles.tangent_errors(tangent, oracles.tangent(state), state.family)
    assert oracles.agrees(errors), errors
    h, rounded = 25.4 + state.dofs[1] - 25.0, (25.4 - 25.0) + state.dofs[1]
    assert abs(h / rounded - 1) > 1e-12  # the other order of summation would be noticed


@pytest.mark.parametrize("state", FIRST, ids=lambda s: s.family)
def test_batches_of_every_size_repeat_the_single_element(state: State) -> None:
    """Batches that do and do not fill a vector register; the last element differs from the rest."""
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
                values, expected, rtol=0, atol=1e-13 * np.abs(expected).max()
            )


# ------------------------------------------------------------------ the checker itself is tested


def rejects(tangent: np.ndarray, state: State) -> bool:
    return not oracles.agrees(oracles.tangent_errors(tangent, oracles.tangent(state), state.family))


@pytest.mark.parametrize("state", FIRST, ids=lambda s: s.family)
def test_checker_accepts_rounding_and_rejects_one_entry_wrong_by_1e9(state: State) -> None:
    good = doubles(oracles.tangent(state))
    assert not rejects(good, state)
    for _, rows in oracles.blocks(state.family, len(state.dofs)):
        for _, columns in oracles.blocks(state.family, len(state.dofs)):
            part = good[rows, columns]
            if not part.any():
                continue
            place = np.unravel_index(np.abs(part).argmax(), part.shape)
            wrong = good.copy()
            wrong[rows, columns][place] *= 1 + 1e-9
            assert rejects(wrong, state)
    residual = doubles(oracles.residual(state))
    check = oracles.residual_errors
    assert oracles.agrees(check(residual, oracles.residual(state), state.family))
    residual[np.abs(residual).argmax()] *= 1 + 1e-9
    assert not oracles.agrees(check(residual, oracles.residual(state), state.family))


@pytest.mark.parametrize("state", FIRST, ids=lambda s: s.family)
def test_checker_rejects_nan_a_transposed_tangent_and_a_filled_empty_block(state: State) -> None:
    good = doubles(oracles.tangent(state))
    broken = good.copy()
    broken[-1, -1] = np.nan
    assert rejects(broken, state)
    if np.abs(good - good.T).max() > 1e-6 * np.abs(good).max():
        assert rejects(good.T, state)
    for _, rows in oracles.blocks(state.family, len(state.dofs)):
        for _, columns in oracles.blocks(state.family, len(state.dofs)):
            if not good[rows, columns].any():
                filled = good.copy()
                filled[rows, columns] = 1e-18
                assert rejects(filled, state)


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


def exact_arguments(state: State) -> tuple[Vector, Vector, Vector]:
    return numbers(state.coordinates), numbers(state.dofs), numbers(state.parameters)


def fbar_with_frozen_centroid(state: State) -> Matrix:
    """Tangent with J0 held constant: symmetric-looking and wrong."""
    X, u, parameters = exact_arguments(state)
    centre = solids.point(X, numbers([0])[0], numbers([0])[0])
    J0 = material.determinant(centre.deformation(u))

    def residual(v: Vector) -> Vector:
        total = [0] * 8
        for at in solids.gauss_points(X):
            F = at.deformation(v)
            ratio = material.determinant(F) / J0
            Fbar = [entry / ratio ** (numbers([1])[0] / 3) for entry in F]
            P = material.first_piola(Fbar, *parameters)
            factor = at.volume * ratio ** (numbers([2])[0] / 3)
            total = [t + factor * f for t, f in zip(total, at.work(P), strict=True)]
        return total

    return jacobian(residual, u)


def q4_without_hoop(state: State) -> Matrix:
    """Plane strain in disguise: u_r / R left out of F_tt."""
    X, u, parameters = exact_arguments(state)
    points = [replace(at, shapes=numbers([0] * 4)) for at in solids.gauss_points(X)]
    return hessian(lambda v: solids._energy_q4(points, v, parameters), u)


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
    X, u, parameters = exact_arguments(state)
    factor = parameters[4] * parameters[5] * upwind.share(X, u, parameters) / 2

    def residual(v: Vector) -> Vector:
        moved = factor * upwind.bubble_load(X, v, v[4:])
        return [0, -moved, 0, moved] + [0] * (len(v) - 4)

    return jacobian(residual, u)


def upwinding_of_the_whole_pressure(state: State) -> Matrix:
    """The linear part of the pressure left in the load that is moved."""
    X, u, parameters = exact_arguments(state)

    def residual(v: Vector) -> Vector:
        z1, r1, z2, r2 = (X[i] + v[i] for i in range(4))
        interpolant = (v[4] * (2 * r1 + r2) + v[-1] * (r1 + 2 * r2)) / 6 * (z2 - z1)
        load = upwind.bubble_load(X, v, v[4:]) - 2 * PI * interpolant
        moved = parameters[4] * parameters[5] * upwind.share(X, v, parameters) / 2 * load
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
    X, u, parameters = exact_arguments(state)
    by_residual = np.array(
        jacobian(lambda v: solids.residual_q4(X, v, parameters), u), dtype=object
    )
    by_energy = np.array(oracles.tangent(state), dtype=object)
    assert np.abs(by_residual - by_energy).max() < 1e-40 * np.abs(by_energy).max()


def test_states_cover_every_branch() -> None:
    """Cavitated, pressed and crossing films; open and closed contact; both signs of U."""
    signs = set()
    for state in (s for s in STATES if s.family == "film"):
        values = [at.p for at in film.film_points(*exact_arguments(state), state.kind, state.count)]
        signs.add((min(values) > 0, max(values) < 0, state.parameters[1] > 0))
    assert signs == {(True, False, True), (False, True, True), (False, False, False)}
    gaps = {oracles.residual(s)[0] == 0 for s in STATES if s.family == "contact"}
    assert gaps == {True, False}
    rubbing = [s for s in STATES if s.family == "contact_friction"]
    closed = [s for s in rubbing if oracles.residual(s)[0] != 0]
    sticking = [s for s in closed if oracles.tangent(s)[3][3] == 0]
    assert len(rubbing) > len(closed) > len(sticking) > 0
    assert {s.family for s in STATES} == set(oracles.RESIDUALS)
    assert set(SOLIDS) < {s.family for s in STATES}
