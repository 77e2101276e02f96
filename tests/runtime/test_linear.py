"""Linear solvers: SuperLU, PARDISO, algebraic multigrid, Schur complements."""

from __future__ import annotations

import gc
import math
import resource
import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, random_array

import softehl
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.parallel import linear_solver_choice
from softehl.runtime.solve.eigen import Pivots
from softehl.runtime.solve.linear import amg, pardiso, superlu
from softehl.runtime.solve.linear.direct import MissingBackend, direct_solver
from softehl.runtime.solve.linear.linear_solver import (
    Factorisation,
    LinearSolver,
    SingularMatrix,
    SparseMatrix,
)
from softehl.runtime.solve.linear.pardiso import Idle, Pardiso
from softehl.runtime.solve.linear.schur_complement import SchurByFactors, SchurBySolves
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Status
from tests.runtime.field_pages import rubber


def laplacian(n: int) -> Array:
    """Second differences on n inner points of (0, 1), dense."""
    return (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) * (n + 1.0) ** 2


def grid(n: int) -> SparseMatrix:
    """Five-point Laplacian on n x n points, made unsymmetric in value by convection."""
    convected = laplacian(n) + (n + 1.0) * np.eye(n, k=1)
    return csc_array(np.kron(convected, np.eye(n)) + np.kron(np.eye(n), laplacian(n)))


def test_multiplier_rows_with_zero_diagonal_are_solved() -> None:
    # min |x|^2 / 2 - b.x with sum x = 0: x = b - mean b, multiplier mean b.
    b = np.arange(5.0) ** 2
    K = np.pad(np.eye(5), (0, 1), constant_values=1.0)
    K[5, 5] = 0.0
    solution = SuperLU().factorise(csc_array(K)).solve(np.append(b, 0.0))
    assert solution == pytest.approx([*(b - b.mean()), b.mean()], rel=1e-14)


def test_refinement_gives_back_the_digits_of_weak_pivots() -> None:
    # [[e, 1], [1, 1]] x = (1, 2): x = (1 / (1 - e), (1 - 2 e) / (1 - e)); pivot e loses 1/e.
    e = 1e-9
    K = csc_array(np.array([[e, 1.0], [1.0, 1.0]]))
    exact, b = np.array([1.0, 1.0 - 2.0 * e]) / (1.0 - e), np.array([1.0, 2.0])
    errors = [
        np.abs(SuperLU("NATURAL", True, 0.0, refinement).factorise(K).solve(b) - exact).max()
        for refinement in (0, 1)
    ]
    assert errors[0] > 1e-9
    assert errors[1] < 1e-14


def test_units_of_unknowns_change_nothing() -> None:
    """Springs that a multiplier in small units holds; also by the factors of the transpose."""
    a, b, c, unit = 0.1, 0.3, 0.7, 2.0**-60
    K = np.zeros((5, 5))
    for i, k in enumerate((a, b, c)):
        K[i : i + 2, i : i + 2] += [[k, -k], [-k, k]]
    K[0, 4] = K[4, 0] = unit
    factors = SuperLU("NATURAL").factorise(csc_array(K))
    turned = factors.transposed()
    assert factors.units is not None
    assert turned is not None
    pulled = [0.0, 1 / a, 1 / a + 1 / b, 1 / a + 1 / b + 1 / c, 1 / unit]
    for one in (factors, turned):
        assert one.solve(np.array([0.0, 0, 0, 1, 0])) == pytest.approx(pulled, rel=1e-14)


def test_solution_ruined_by_weak_pivots_is_refused() -> None:
    K = csc_array(np.array([[1e-20, 1.0], [1.0, 1.0]]))
    solver = SuperLU("NATURAL", pivot_threshold=0.0, refinement=0)
    factors = solver.factorise(K)
    with pytest.raises(SingularMatrix, match="backward error"):
        factors.solve(np.array([1.0, 2.0]))
    good = SuperLU().factorise(K).solve(np.array([1.0, 2.0]))
    assert good == pytest.approx([1.0, 1.0], rel=1e-14)


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([[1.0, 2.0], [0.0, 0.0]], "row 1 of the matrix is zero"),
        ([[0.0, 2.0], [0.0, 1.0]], "no LU factors"),
        ([[2.0, 1.0], [1.0, 0.5]], "no LU factors"),
        ([[1.0, math.nan], [0.0, 1.0]], "entries that are not finite"),
        ([[1.0, math.inf], [0.0, 1.0]], "entries that are not finite"),
    ],
)
def test_singular_or_not_finite_is_refused(rows: list[list[float]], reason: str) -> None:
    with pytest.raises(SingularMatrix, match=reason):
        SuperLU().factorise(csc_array(np.array(rows)))


def test_right_side_that_is_not_finite_is_refused() -> None:
    factors = SuperLU().factorise(csc_array(laplacian(3)))
    with pytest.raises(SingularMatrix, match="not finite"):
        factors.solve(np.array([1.0, math.nan, 1.0]))


def fill(K: SparseMatrix, solver: SuperLU) -> int:
    return int(solver.factors(K).nnz)


def test_factors_do_not_depend_on_what_was_factorised_before() -> None:
    used, b = SuperLU(), np.cos(np.arange(400.0))
    for K in (grid(20), 2.0 * grid(20), grid(20)):
        now = used.factorise(csc_array(K)).solve(b)
        assert np.array_equal(now, SuperLU().factorise(csc_array(K)).solve(b))
    assert len(used.orders.orders) == 1


def test_default_ordering_makes_less_fill_than_colamd_and_solves_as_well() -> None:
    K = grid(40)
    colamd = SuperLU("COLAMD", symmetric_mode=False, pivot_threshold=1.0)
    assert fill(K, SuperLU()) < 0.8 * fill(K, colamd)
    x = np.cos(np.arange(1600.0))
    assert SuperLU().factorise(K).solve(K @ x) == pytest.approx(x, abs=1e-11)


# --- PARDISO against closed forms, singular matrices, other matrices of a pattern, its memory -----


installed = pytest.mark.skipif(not pardiso.available(), reason="the extra `fast` is not installed")
GENERAL, SYMMETRIC = 11, 1


def kind(factors: Factorisation) -> int:
    """Matrix type that was chosen."""
    return int(factors.factors.handle.structure.kind)


def test_auto_is_superlu_where_pardiso_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pardiso, "available", lambda: False)
    assert direct_solver("auto") == direct_solver("superlu") == SuperLU()
    with pytest.raises(MissingBackend, match=r'allowed here: "auto" or "superlu"'):
        direct_solver("pardiso")


@installed
def test_auto_is_pardiso_where_it_is_installed() -> None:
    assert direct_solver("auto").name == direct_solver("pardiso").name == "pardiso"
    assert direct_solver("superlu").name == "superlu"


@installed
def test_second_differences_reproduce_the_parabola() -> None:
    x = np.linspace(0.0, 1.0, 101)[1:-1]
    factors = Pardiso().factorise(csc_array(laplacian(99)))
    assert kind(factors) == SYMMETRIC
    assert factors.solve(np.ones(99)) == pytest.approx(x * (1.0 - x) / 2.0, rel=1e-11)


@installed
def test_patterns_that_are_not_symmetric_are_solved_as_general_ones() -> None:
    upper = csc_array(np.triu(np.ones((6, 6))))
    factors = Pardiso().factorise(upper)
    assert kind(factors) == GENERAL
    assert factors.solve(np.ones(6)) == pytest.approx([0, 0, 0, 0, 0, 1], abs=1e-14)
    no_diagonal = csc_array(np.array([[0.0, 2.0], [4.0, 0.0]]))
    assert Pardiso().factorise(no_diagonal).solve(np.array([2.0, 4.0])) == pytest.approx([1.0, 1.0])


@installed
def test_agrees_with_superlu(rng: np.random.Generator) -> None:
    K = csc_array(random_array((300, 300), density=0.02, rng=rng) + 5.0 * np.eye(300))
    b = rng.normal(size=300)
    x = Pardiso().factorise(K).solve(b)
    assert x == pytest.approx(SuperLU().factorise(K).solve(b), rel=1e-10)
    assert b == pytest.approx(K @ x, abs=1e-11)


@installed
@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([[1.0, 2.0], [0.0, 0.0]], "row 1 of the matrix is zero"),
        ([[0.0, 2.0], [0.0, 1.0]], "singular"),
        ([[2.0, 1.0], [1.0, 0.5]], "singular"),
        ([[1.0, math.nan], [0.0, 1.0]], "entries that are not finite"),
    ],
)
def test_singular_or_not_finite_is_refused_by_pardiso(rows: list[list[float]], reason: str) -> None:
    with pytest.raises(SingularMatrix, match=reason):
        Pardiso().factorise(csc_array(np.array(rows))).solve(np.array([1.0, 2.3]))


@installed
def test_a_pattern_is_analysed_once_and_factors_in_use_are_left_alone() -> None:
    solver, K, b = Pardiso(), grid(8), np.ones(64)
    first = solver.factorise(K)
    second = solver.factorise(csc_array(2.0 * K))
    assert first.factors.handle is not second.factors.handle
    assert first.solve(b) == pytest.approx(2.0 * second.solve(b), rel=1e-12)
    handle = first.factors.handle
    del first
    third = solver.factorise(csc_array(4.0 * K))
    assert third.factors.handle is handle  # nobody used it any more
    assert second.solve(b) == pytest.approx(2.0 * third.solve(b), rel=1e-12)
    other = solver.factorise(grid(7))
    assert other.factors.handle not in (handle, second.factors.handle)


@installed
def test_memory_of_forgotten_factors_is_freed() -> None:
    def megabytes() -> float:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    solver = Pardiso(idle=Idle(keep=1))
    shapes = [25 + k % 3 for k in range(60)]  # patterns take turns: none is idle when it is needed
    grids = {n: grid(n) for n in set(shapes)}
    for n in shapes[:6]:
        solver.factorise(grids[n]).solve(np.ones(n * n))
    before = megabytes()
    for n in shapes:
        solver.factorise(grids[n]).solve(np.ones(n * n))
    gc.collect()
    assert megabytes() < before + 10.0
    assert len(solver.idle.handles) == 1


@installed
def test_the_wrong_factors_are_noticed() -> None:
    """The check of the solution must fail where the factors belong to another matrix."""
    solver = Pardiso()
    factors = solver.factorise(grid(8))
    factors.factors.handle.factorise(csc_array(3.0 * grid(8)), np.empty(0))
    with pytest.raises(SingularMatrix):
        factors.solve(np.ones(64))


class Cubic:
    """x_i^3 - x_(i+1) = c, cyclic, with the solution x = 2 everywhere for c = 6."""

    def residual(self, x: Array) -> Array:
        return x**3 - np.roll(x, -1) - 6.0

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        K = np.diag(3.0 * x**2) - np.roll(np.eye(len(x)), 1, axis=1)
        return self.residual(x), csc_array(K)

    def norm(self, r: Array) -> float:
        return float(np.abs(r).max())

    def step_limit(self, x: Array, dx: Array) -> float:
        return 1.0


@installed
@pytest.mark.parametrize("linear", [Pardiso(), SuperLU()], ids=["pardiso", "superlu"])
def test_newton_takes_either_solver(linear: LinearSolver) -> None:
    solution = Newton(linear=linear).solve(Cubic(), np.full(5, 3.0))
    assert solution.x == pytest.approx(np.full(5, 2.0), rel=1e-12)
    singular = Newton(linear=linear).solve(Cubic(), np.zeros(5) + math.sqrt(1.0 / 3.0))
    assert singular.status is Status.SINGULAR


# --- The linear solver of one process by size: multigrid, factors, factors that are kept ----------


@softehl.page
def wind(m: Any) -> None:
    """Conduction in a stream: its tangent is not symmetric."""
    T = m.scalar("T")
    g = m.grad(T)
    m.weak(g, g)
    m.weak(20 * g[0] - 1, T)


def cube(K: float = 2.0) -> softehl.Study:
    study = softehl.Study(softehl.Mesh.box((1, 1, 1), cells=(6, 6, 6)))
    study.add("rubber", rubber, mu=0.4, K=K)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.fix("right", u_x=0.1)
    return study


def stream() -> softehl.Study:
    study = softehl.Study(softehl.Mesh.rectangle(1, 1, cells=(24, 24)))
    study.add("air", wind)
    study.fix("left", T=0)
    return study


@pytest.mark.parametrize("make", [cube, stream])
def test_multigrid_finds_what_factors_find(make: Any) -> None:
    x, y = (make().solve(linear=linear).x for linear in ("amg", "direct"))
    assert np.abs(x - y).max() < 1e-7 * np.abs(y).max()


def iterations(study: softehl.Study, motions: int = 6) -> int:
    """Of conjugate gradients at rest, with multigrid that is told so many rigid motions."""
    system = study.system()
    problem = system.problem(system.quasi_static_step(1.0, system.at_rest(), {}))
    r, K = problem.linearise(system.at_rest())
    modes = linear_solver_choice.near_nullspace(system)
    assert modes is not None
    told = amg.NearNullspace(modes.order, 3, modes.modes[:, :motions])
    factors = amg.AlgebraicMultigrid(told).factorise(K)
    return factors._solved("cg", factors.grids.scale * -r[modes.order])[1]


def test_multigrid_keeps_rigid_motions() -> None:
    """Without rotations it needs far more iterations."""
    study = softehl.Study(softehl.Mesh.box((10, 1, 1), cells=(30, 3, 3)))
    study.add("beam", rubber, mu=0.4, K=2.0)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.load("right", u_y=1e-3)
    assert iterations(study) < 0.8 * iterations(study, motions=3)


def test_stiff_and_soft_parts_take_hardly_more_iterations_than_one() -> None:
    """By scaling: without it, 1 to 1000 takes ten times as many."""

    def core(x: Array) -> Flags:
        return np.asarray(np.abs(x - 0.5).max(axis=1) < 0.25)

    def parts(stiff: float) -> softehl.Study:
        mesh = softehl.Mesh.box((1, 1, 1), cells=(8, 8, 8))
        mesh = mesh.with_group("core", core)
        mesh = mesh.with_group("shell", lambda x: ~core(x))
        study = softehl.Study(mesh)
        study.add("shell", rubber, cells="shell", mu=0.4, K=2.0)
        study.add("core", rubber, cells="core", mu=0.4 * stiff, K=2.0 * stiff)
        study.fix("left", u_x=0, u_y=0, u_z=0)
        study.load("right", u_y=1e-3)
        return study

    assert iterations(parts(1e3)) < 2 * iterations(parts(1.0))


def test_grids_serve_the_tangents_of_a_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the first serve all, which are alike; other matrices get grids of their own."""
    made, plain = list[int](), amg.hierarchy

    def counted(A: Any, *given: Any) -> Any:
        made.append(A.shape[0])
        return plain(A, *given)

    monkeypatch.setattr(amg, "hierarchy", counted)
    assert cube().solve(linear="amg").iterations > 2
    assert len(made) == 1
    system = cube().system()
    problem = system.problem(system.quasi_static_step(1.0, system.at_rest(), {}))
    r, K = problem.linearise(system.at_rest())
    modes = linear_solver_choice.near_nullspace(system)
    assert modes is not None
    solver, half = amg.AlgebraicMultigrid(modes), np.arange(len(r)) % 2
    held = csc_array(K + diags_array(1e4 * half))
    for matrix in (K, held, K):
        x = solver.factorise(matrix).solve(r)
        assert np.linalg.norm(matrix @ x - r) < 1e-4 * np.linalg.norm(r)
    assert len(made) > 2


def test_size_decides_and_progress_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(linear_solver_choice.FACTORS_UP_TO, 3, 100)
    cube().solve(progress=True)
    assert "(multigrid, because of 1029 unknowns in 3-D)" in capsys.readouterr().err
    monkeypatch.setattr(amg, "available", lambda: False)
    cube().solve(progress=True)
    assert "in spite of 1029 unknowns in 3-D: pyamg is not installed" in capsys.readouterr().err


def test_factors_stand_in_where_multigrid_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(linear_solver_choice.FACTORS_UP_TO, 3, 100)
    monkeypatch.setattr(
        linear_solver_choice,
        "AlgebraicMultigrid",
        partial(amg.AlgebraicMultigrid, max_iterations=3),
    )
    study, reference = cube(), cube().solve(linear="direct")
    found = study.solve(progress=True)
    assert "superlu after multigrid failed, because of 1029" in capsys.readouterr().err
    assert np.abs(found.x - reference.x).max() < 1e-9
    monkeypatch.setitem(linear_solver_choice.FALL_BACK_UP_TO, 3, 100)
    with pytest.raises(NotConverged, match=r'multigrid left .* Use linear = "direct"'):
        study.solve()


def test_what_multigrid_cannot_take_is_refused() -> None:
    with pytest.raises(StudyError, match="linear = 'amgx': allowed are auto, direct, superlu"):
        cube().solve(linear="amgx")  # type: ignore[arg-type]
    study = cube()
    study.tie("bottom", "top", "u_y")
    with pytest.raises(StudyError, match="components of one vector, or one scalar, as the only"):
        study.solve(linear="amg")
    with pytest.raises(StudyError, match="newton and linear: give one of them"):
        study.solve(linear="amg", newton=softehl.Newton())


@pytest.mark.parametrize("pressed", [0.2, 0.4])
def test_multigrid_tells_a_state_that_is_unstable(pressed: float) -> None:
    """A column held at both ends, before and beyond its first load."""
    study = softehl.Study(softehl.Mesh.box((10, 1, 1), cells=(20, 3, 3)))
    study.add("column", material="saint_venant", E=2000, nu=0)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    study.fix("right", u_x=-pressed, u_y=0, u_z=0)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        unstable = study.solve(linear="amg").unstable
    words = [str(warning.message) for warning in told]
    if pressed < 0.3:
        assert unstable == 0
        assert not words
    else:
        assert unstable == 2
        assert len(words) == 1  # nothing of pyamg's own
        assert "its energy falls along one direction at least (" in words[0]


def test_modes_by_multigrid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that factors find, equal ones as well, without any; a spring and a load are in them."""
    study, mass = cube(), {"rubber": {"rho": 2.0}}
    study.spring("right", u_y=0.01)
    wanted = study.solve(linear="direct").modes(6, mass=mass)
    state = study.solve(linear="amg")
    monkeypatch.setattr(Pivots, "of", None)
    found = state.modes(6, mass=mass)
    np.testing.assert_allclose(found.squares, wanted.squares, rtol=1e-8)
    for one, other in zip(found, wanted, strict=True):
        assert one.norm() == pytest.approx(other.norm(), rel=1e-4)
    assert np.abs(found[0].x - wanted[0].x).max() < 1e-4 * np.abs(wanted[0].x).max()


# --- Condensation by one factorisation with the boundary last, against that by solves -------------


SIDE, HELD = 9, 4
N = SIDE * SIDE + HELD
"""A square of unknowns, and multipliers that hold some of its first ones."""

BOUNDARY: Integers = np.array([40, 3, 72, N - 1])
"""Inside, at a held unknown, at the edge, and a multiplier; in no order."""


def body(rng: np.random.Generator, *, floating: bool = False) -> csc_array[np.float64]:
    """Unsymmetric in value, symmetric in pattern, with zeros on the diagonal of multipliers."""
    A = np.zeros((N, N))
    for k in range(SIDE * SIDE):
        for j in (k + 1, k + SIDE):
            if j < SIDE * SIDE and (j != k + 1 or j % SIDE):
                A[k, j], A[j, k] = -1.0, -1.0 if floating else -rng.uniform(0.5, 1.5)
    A -= np.diag(A.sum(axis=1) - (0.0 if floating else 0.1))
    for k in range(HELD):
        m = SIDE * SIDE + k
        A[m, k] = A[k, m] = 0.0 if floating else 1e3
        A[m, m] = 1.0 if floating else 0.0
    A[np.arange(N), np.arange(N)] += 0.0
    pattern = A != 0.0
    np.fill_diagonal(pattern, val=True)
    columns, rows = np.nonzero(pattern.T)
    starts = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
    return csc_array((A[rows, columns], rows, starts), shape=(N, N))


def compare(A: Any, rng: np.random.Generator, tolerance: float) -> None:
    solver = SuperLU()
    c, reference = solver.condense(A, BOUNDARY), SchurBySolves.of(A, BOUNDARY, solver.factors)
    assert isinstance(c, SchurByFactors)
    assert c.schur == pytest.approx(reference.schur, rel=tolerance, abs=tolerance)
    r, x = rng.normal(size=N), rng.normal(size=len(BOUNDARY))
    (g, reduced), (wanted, other) = c.reduce(r), reference.reduce(r)
    assert g == pytest.approx(wanted, rel=tolerance, abs=tolerance)
    extended = reference.extend(other, x)
    assert c.extend(reduced, x) == pytest.approx(extended, rel=tolerance, abs=tolerance)


def test_it_is_that_of_solves(rng: np.random.Generator) -> None:
    compare(body(rng), rng, 1e-11)


def test_a_body_that_floats_is_condensed_too(rng: np.random.Generator) -> None:
    A = body(rng, floating=True)
    assert np.linalg.matrix_rank(A.toarray()) == N - 1
    compare(A, rng, 1e-9)


def test_an_order_serves_all_matrices_of_a_pattern(rng: np.random.Generator) -> None:
    solver, first, second = SuperLU(), body(rng), body(rng)
    b = rng.normal(size=N)
    for A in (first, second, first):
        x = solver.factorise(A).solve(b)
        assert A @ x == pytest.approx(b, abs=1e-10)
        assert len(solver.orders.orders) == 1
        assert SuperLU().factorise(A).solve(b) == pytest.approx(x, rel=1e-9)
    for A in (first, second):
        solver.condense(A, BOUNDARY)
        assert len(solver.orders.orders) == 2
    for k in range(10):
        solver.condense(first, BOUNDARY[k % 4 :])
        assert len(solver.orders.orders) <= solver.orders.max_orders


def test_what_is_too_large_goes_by_solves(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(superlu, "MOST_COPIED", 10)
    assert isinstance(SuperLU().condense(body(rng), BOUNDARY), SchurBySolves)
