"""Correctors of films: modified Newton on a Schur complement, dissection, lagged pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.cases.seal.correctors.chord_newton import ModifiedNewton, solved
from softehl.cases.seal.correctors.layer_split import Cut, Parts
from softehl.cases.seal.correctors.nested_dissection import Elimination
from softehl.cases.seal.correctors.perturbed_lagrangian import LaggedPressure, element_pressures
from softehl.cases.seal.correctors.schur_corrector import SchurCorrector, StaleTangent
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.solve.contact_stages import contact_problem
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.linear import pardiso
from softehl.runtime.solve.linear.linear_solver import Condenser, SingularMatrix
from softehl.runtime.solve.linear.pardiso import Pardiso
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Status
from tests.cases.oring_cases import oring

# --- Modified Newton on a Schur complement: an elastic chain with an exponential layer ------------


N, M, K = 30, 4, 5
SHARED, OWN = np.arange(10, 10 + M), np.arange(N - K, N)
BOTH = np.concatenate([SHARED, OWN])
SOLVERS: Sequence[Any] = [
    SuperLU(),
    pytest.param(
        Pardiso(), marks=pytest.mark.skipif(not pardiso.available(), reason="not installed")
    ),
]


def answer(load: float) -> Array:
    """The solution at a load."""
    return load * np.sin(1.0 + np.arange(float(N)))


@dataclass(frozen=True)
class Chain:
    """Body: a chain of springs with a cubic part; layer: exp of the shared and interior unknowns.

    softening: size of the cubic part, by which the body differs from its stale tangent.
    """

    load: float = 1.0
    softening: float = 0.1
    asked: list[str] = field(default_factory=list)
    shared: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: SHARED)
    interior: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: OWN)

    def _springs(self) -> Array:
        A = 3.0 * np.eye(N) - np.eye(N, k=1) - 0.8 * np.eye(N, k=-1)
        A[OWN], A[:, OWN] = 0.0, 0.0
        return A

    def _body(self, x: Array) -> Array:
        r = self._springs() @ x + self.softening * x**3
        r[OWN] = 0.0
        return np.asarray(r)

    def _layer(self, x: Array) -> tuple[Array, Array]:
        a, p = x[SHARED], x[OWN]
        couple = np.ones((M, K)) / K
        r = np.concatenate([np.exp(2.0 * a) + 0.3 * couple @ p, 2.0 * p + p**3 - couple.T @ a])
        A = np.zeros((M + K, M + K))
        A[:M, :M] = np.diag(2.0 * np.exp(2.0 * a))
        A[:M, M:], A[M:, :M] = 0.3 * couple, -couple.T
        A[M:, M:] = np.diag(2.0 + 3.0 * p**2)
        return r, A

    def _sources(self) -> tuple[Array, Array]:
        x = answer(self.load)
        return self._body(x), self._layer(x)[0]

    def admissible(self, x: Array) -> Array:
        return x.copy()

    def residual(self, x: Array) -> Array:
        self.asked.append("residual")
        r = self._body(x) - self._sources()[0]
        r[BOTH] += self.layer_residual(x)
        return r

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        A = self.body(x).toarray()
        A[OWN, OWN] = 0.0
        A[np.ix_(BOTH, BOTH)] += self._layer(x)[1]
        return self.residual(x), csc_array(A)

    def body(self, x: Array) -> csc_array[np.float64]:
        A = self._springs() + np.diag(3.0 * self.softening * x**2)
        A[OWN] = 0.0
        A[OWN, OWN] = 1.0
        return csc_array(A)

    def layer_residual(self, x: Array) -> Array:
        return np.asarray(self._layer(x)[0] - self._sources()[1])

    def layer_linearise(self, x: Array) -> tuple[Array, Parts]:
        return self.layer_residual(x), Parts.of(csc_array(self._layer(x)[1]), M)

    def scaled(self, r: Array) -> Array:
        return r

    def norm(self, r: Array) -> float:
        return float(np.linalg.norm(self.scaled(r)))

    def step_limit(self, x: Array, dx: Array) -> float:
        return 1.0

    def layer_limit(self, x: Array, dx: Array) -> float:
        return 1.0


def condensed(linear: Condenser, problem: Chain, x: Array) -> Any:
    return linear.condense(problem.body(x), SHARED)


@pytest.mark.parametrize("linear", SOLVERS)
def test_condensation_against_dense_elimination(
    linear: Condenser, rng: np.random.Generator
) -> None:
    A = Chain().body(rng.normal(size=N))
    interior = np.setdiff1d(np.arange(N), SHARED)
    dense = A.toarray()
    inverse = np.linalg.inv(dense[np.ix_(interior, interior)])
    C, D = dense[np.ix_(SHARED, interior)], dense[np.ix_(interior, SHARED)]
    c = linear.condense(A, SHARED)
    schur = dense[np.ix_(SHARED, SHARED)] - C @ inverse @ D
    assert c.schur == pytest.approx(schur, rel=1e-12, abs=1e-13)
    r, x = rng.normal(size=N), rng.normal(size=M)
    g, reduced = c.reduce(r)
    assert g == pytest.approx(r[SHARED] - C @ inverse @ r[interior], rel=1e-11)
    full = c.extend(reduced, x)
    assert full[SHARED] == pytest.approx(x)
    assert full[interior] == pytest.approx(inverse @ (r[interior] - D @ x), rel=1e-10)
    # with the solution of the condensed system it solves the whole
    shared: Array = np.asarray(np.linalg.solve(c.schur, g), dtype=np.float64)
    assert dense @ c.extend(reduced, shared) == pytest.approx(r, abs=1e-11)


@pytest.mark.parametrize("linear", SOLVERS)
def test_a_singular_interior_is_refused(linear: Condenser) -> None:
    A = Chain().body(np.zeros(N)).toarray()
    A[3] = 0.0
    with pytest.raises(SingularMatrix):
        linear.condense(csc_array(A), SHARED)


@pytest.mark.parametrize("linear", SOLVERS)
def test_the_chosen_solution_is_found(linear: Condenser) -> None:
    problem = Chain()
    solution = ModifiedNewton().solve(problem, condensed(linear, problem, np.zeros(N)), np.zeros(N))
    assert solution.converged, solution.message
    assert solution.x == pytest.approx(answer(1.0), abs=1e-9)
    assert problem.norm(problem.residual(solution.x)) == solution.residual_norms[-1] <= 1e-9
    assert solution.factorisations == 0


def test_a_layer_that_contradicts_the_residual_never_converges() -> None:
    class Forged(Chain):
        def layer_residual(self, x: Array) -> Array:
            return super().layer_residual(x) + 0.1

        def residual(self, x: Array) -> Array:
            r = super().residual(x)
            r[BOTH] -= 0.1
            r[BOTH[0]] += 0.01
            return r

    solution = ModifiedNewton().solve(
        Forged(), condensed(SuperLU(), Chain(), answer(1.0)), np.zeros(N)
    )
    assert solution.x != pytest.approx(answer(1.0), abs=1e-6)


@pytest.mark.parametrize(
    ("iteration", "status"),
    [
        (ModifiedNewton(max_outer=2), Status.MAX_ITERATIONS),
        (ModifiedNewton(contraction=1e-4, window=1), Status.MAX_ITERATIONS),
        (ModifiedNewton(max_inner=1, stagnation=1.0), Status.DIVERGED),
    ],
)
def test_failure_is_a_status(iteration: ModifiedNewton, status: Status) -> None:
    problem = Chain()
    solution = iteration.solve(problem, condensed(SuperLU(), problem, np.zeros(N)), np.zeros(N))
    assert solution.status is status


def test_a_start_that_is_not_finite_is_named() -> None:
    problem = Chain()
    c = condensed(SuperLU(), problem, np.zeros(N))
    assert ModifiedNewton().solve(problem, c, np.full(N, 1e200)).status is Status.NOT_FINITE


# --- the corrector -----------------------------------------------------------------------------


def test_one_condensation_serves_a_path() -> None:
    points: list[float] = []
    corrector = SchurCorrector(SuperLU(), stale=0.9)
    branch = Continuation(corrector, StepRule(0.2, 0.01, 0.2, target_iterations=20)).follow(
        lambda load: Chain(load),
        0.2,
        1.0,
        np.zeros(N),
        on_point=lambda point: points.append(point.parameter),
    )
    assert branch.converged
    assert branch.factorisations == 1
    assert points[-1] == 1.0
    assert branch.last.x == pytest.approx(answer(1.0), abs=1e-9)


def test_a_residual_held_up_by_rounding_is_finished_by_newton() -> None:
    # a useless condensation makes it so slow that rounding seems to be reached
    iteration = ModifiedNewton(
        tolerance=1e-10, stagnation=1e8, depth=0, contraction=0.999, max_outer=99
    )
    tangent = {"condensed": condensed(SuperLU(), Chain(), np.full(N, 6.0)), "accepted": np.zeros(N)}
    finish = Newton(tolerance=1e-12, max_iterations=6)
    held, closed = (
        SchurCorrector(SuperLU(), iteration, finish=newton, tangent=StaleTangent(**tangent)).solve(
            Chain(), np.zeros(N)
        )
        for newton in (None, finish)
    )
    assert held.converged
    assert closed.residual_norms[-1] <= 1e-12 < held.residual_norms[-1]
    assert closed.factorisations > held.factorisations


class Rough(Chain):
    """A chain whose residual has an error as large as rounding makes it on a fine mesh."""

    error = 1e-8

    def residual(self, x: Array) -> Array:
        noise = np.sin(1e12 * x)
        noise[BOTH] = 0.0
        return np.asarray(super().residual(x) + self.error * noise)


@pytest.mark.parametrize(("error", "converged"), [(1e-8, True), (1e-4, False)])
def test_newton_ends_what_rounding_holds_up(error: float, converged: bool) -> None:
    problem, finish = Rough(), Newton(max_iterations=1)
    object.__setattr__(problem, "error", error)
    iteration = ModifiedNewton(contraction=1e-3, window=1)  # slow as soon as nothing is gained
    without, solution = (
        SchurCorrector(SuperLU(), iteration, threshold=1e3, finish=newton).solve(
            problem, 0.99 * answer(1.0)
        )
        for newton in (None, finish)
    )
    assert not without.converged
    assert solution.converged is converged
    assert solution.factorisations > 1
    if converged:
        assert solution.x == pytest.approx(answer(1.0), abs=1e-6)
        assert solution.residual_norms[-1] <= 1e-7


class Walled(Chain):
    """A chain with a stiff wall at a node of its body, which no condensation has seen."""

    stiffness, node = 50.0, 3

    def residual(self, x: Array) -> Array:
        r = super().residual(x)
        r[self.node] += self.stiffness * (max(x[self.node], 0.0) - max(self._place(), 0.0))
        return r

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        r, A = super().linearise(x)
        wall = np.zeros(N)
        wall[self.node] = self.stiffness * (x[self.node] > 0.0)
        return r, csc_array(A + csc_array(np.diag(wall)))

    def _place(self) -> float:
        return float(answer(self.load)[self.node])


@pytest.mark.parametrize(("stalled", "converged"), [(0.0, False), (1e-9, False), (1e2, True)])
def test_newton_goes_on_where_a_wall_of_the_body_stalls_the_iteration(
    stalled: float, converged: bool
) -> None:
    problem = Walled(-1.0)  # the node touches the wall at the answer
    assert answer(-1.0)[Walled.node] > 0.0
    finish = Newton(max_iterations=1)
    solution = SchurCorrector(SuperLU(), threshold=1e3, finish=finish, stalled=stalled).solve(
        problem, 0.9 * answer(-1.0)
    )
    assert solution.converged is converged
    if converged:
        assert solution.x == pytest.approx(answer(-1.0), abs=1e-8)
        assert solution.factorisations > 3  # with those of what stalled


def test_a_singular_body_is_a_status() -> None:
    class Loose(Chain):
        def body(self, x: Array) -> csc_array[np.float64]:
            A = super().body(x).toarray()
            A[3] = 0.0
            return csc_array(A)

    assert SchurCorrector(SuperLU()).solve(Loose(), np.zeros(N)).status is Status.SINGULAR


def test_a_tangent_is_cut_from_a_larger_one() -> None:
    rng = np.random.default_rng(3)
    A = np.where(rng.random((9, 9)) < 0.7, rng.random((9, 9)), 0.0)
    K = csc_array(A)
    parts = Cut.of(K.indptr, K.indices, 4, 7).parts(K.data)
    assert (parts.matrix.toarray() == A[:7, :7]).all()
    assert (parts.shared.toarray() == A[:7, :4]).all()


def test_entries_are_added_where_the_tangent_has_some() -> None:
    A = np.triu(np.ones((5, 5)))
    parts = Parts.of(csc_array(A), 2)
    rows, columns = np.array([1, 0, 1]), np.array([1, 4, 1])
    more = parts.cut.placed(rows, columns, np.array([2.0, 3.0, 4.0]))
    A[1, 1], A[0, 4] = 7.0, 4.0
    assert (replace(parts, data=parts.data + more).matrix.toarray() == A).all()
    with pytest.raises(ValueError, match="no entry in row 4, column 0"):
        parts.cut.placed(rows + 3, columns - 1, np.ones(3))


# --- Chains that are eliminated piece by piece: as a dense solve, and left whole where that -------


SEGMENTS, OF_LAYER = 23, 26


def chain(order: int, fields: int, *, ends: bool, seed: int = 1) -> np.ndarray:
    """A matrix of elements along a chain, of so many nodes each, with or without its ends.

    Each element knows two of the first unknowns, which it shares with others.
    """
    rng, n = np.random.default_rng(seed), (SEGMENTS * order + 1) * fields
    A = np.zeros((OF_LAYER + n, OF_LAYER + n))
    for element in range(SEGMENTS):
        first = OF_LAYER + element * order * fields
        part = np.append([element, element + 3], first + np.arange((order + 1) * fields))
        A[np.ix_(part, part)] += rng.normal(size=(len(part),) * 2) + 4.0 * np.eye(len(part))
    if ends:
        return A
    inside = np.r_[:OF_LAYER, OF_LAYER + fields : OF_LAYER + n - fields]
    return np.asarray(A[np.ix_(inside, inside)])


def band(width: int, n: int = 80) -> np.ndarray:
    return sum(np.eye(n, k=k) for k in range(-width, width + 1)) + 3.0 * np.eye(n)


def elimination(A: np.ndarray, m: int) -> Elimination:
    K = csc_array(A)
    return Cut.of(K.indptr, K.indices, m, len(A)).elimination


def check(A: np.ndarray, m: int) -> None:
    rng = np.random.default_rng(2)
    S, r = rng.normal(size=(m, m)), rng.normal(size=len(A))
    whole = A.copy()
    whole[:m, :m] += S
    found = solved(S, Parts.of(csc_array(A), m), r)
    assert found == pytest.approx(np.linalg.solve(whole, r), rel=1e-9, abs=1e-11)


@pytest.mark.parametrize("ends", [True, False])
@pytest.mark.parametrize(("order", "fields"), [(2, 2), (2, 1), (4, 1), (4, 2), (8, 1)])
def test_pieces_are_solved_like_the_whole(order: int, fields: int, ends: bool) -> None:
    A = chain(order, fields, ends=ends)
    check(A, OF_LAYER)
    assert len(elimination(A, OF_LAYER).remaining) < 0.5 * (len(A) - OF_LAYER) + OF_LAYER


@pytest.mark.parametrize("width", [0, 1, 2, 5, 79])
def test_a_band_of_any_width_is_solved(width: int) -> None:
    check(band(width), 0)


def test_pieces_end_where_few_unknowns_are_between_them() -> None:
    first, *_ = elimination(chain(4, 2, ends=False), OF_LAYER).levels
    assert first.inner.shape == (SEGMENTS, 6)
    assert first.boundary.shape == (SEGMENTS, 2 + 4)


def test_a_singular_piece_is_left_to_the_whole() -> None:
    A = chain(4, 1, ends=True)
    piece = elimination(A, OF_LAYER).levels[0].inner[1]
    piece = piece[piece < len(A)]
    A[np.ix_(piece, piece)] = 1.0  # no entry is left out, and each of its pivots is exact
    check(A, OF_LAYER)


@pytest.mark.parametrize("row", [3, OF_LAYER + 12])
def test_a_singular_whole_is_refused(row: int) -> None:
    A = chain(4, 1, ends=True)
    A[row] = 0.0
    with pytest.raises(SingularMatrix):
        solved(
            np.zeros((OF_LAYER, OF_LAYER)),
            Parts.of(csc_array(A), OF_LAYER),
            np.ones(len(A)),
        )


# --- The tangent with a lagged element pressure: consistency, the volume's derivatives, -----------


KAPPA = 500.0


@pytest.fixture(scope="module")
def system() -> SealSystem:
    return build_system(oring(density=1))


@pytest.fixture(scope="module")
def problem(system: SealSystem) -> Problem:
    return contact_problem(system, 1.0)


@pytest.fixture
def state(system: SealSystem, rng: np.random.Generator) -> Array:
    x = system.at_rest()
    u = 0.02 * (system.mesh.points - system.mesh.points.mean(axis=0))
    system.displacements(x)[:] = u + (1e-4 * rng.normal(size=u.size)).reshape(u.shape)
    return x


def lagged(problem: Problem, pressures: Array) -> LaggedPressure:
    return LaggedPressure.of(
        problem, ("solid",), load_kernel("follower_pressure"), pressures, KAPPA
    )


def volumes(system: SealSystem, x: Array) -> Array:
    """Volumes of the rings by Pappus: area times the path of the centroid, in closed form."""
    a = system.deformed(x)[system.mesh.quads]
    b = np.roll(a, -1, axis=1)
    cross = a[..., 0] * b[..., 1] - b[..., 0] * a[..., 1]
    return np.asarray(2.0 * np.pi * ((a[..., 1] + b[..., 1]) * cross).sum(axis=1) / 6.0)


def test_with_the_true_pressures_the_tangent_is_the_problem_s(
    problem: Problem, state: Array
) -> None:
    own = lagged(problem, element_pressures(problem, ("solid",), state))
    r, K = own.linearise(state)
    r0, K0 = problem.linearise(state)
    assert np.array_equal(r, r0)
    assert np.array_equal(r, own.residual(state)) or r == pytest.approx(own.residual(state))
    assert K.data == pytest.approx(K0.data, rel=1e-12, abs=1e-9)


def test_an_excess_pressure_adds_the_second_derivative_of_the_volume(
    system: SealSystem, problem: Problem, state: Array, rng: np.random.Generator
) -> None:
    excess = rng.normal(size=len(system.mesh.quads))
    pressures = element_pressures(problem, ("solid",), state)
    dx = np.zeros_like(state)
    moved = system.displacements(dx)
    moved[:] = rng.normal(size=moved.shape)
    added = lagged(problem, pressures + excess).linearise(state)[1] @ dx
    added = added - problem.linearise(state)[1] @ dx
    h = 1e-3
    second = volumes(system, state + h * dx) - 2 * volumes(system, state)
    second = (second + volumes(system, state - h * dx)) / h**2
    assert dx @ added == pytest.approx(excess @ second, rel=1e-6)


def test_pressures_follow_the_linearised_volume(
    system: SealSystem, problem: Problem, state: Array, rng: np.random.Generator
) -> None:
    start = lagged(problem, np.zeros(len(system.mesh.quads)))
    assert start.volumes == pytest.approx(volumes(system, system.at_rest()), rel=1e-3)
    dx = np.zeros_like(state)
    moved = system.displacements(dx)
    moved[:] = 1e-7 * rng.normal(size=moved.shape)
    change = KAPPA * (volumes(system, state + dx) - volumes(system, state)) / start.volumes
    pressures = start.after(state, state + dx).pressures
    before = element_pressures(problem, ("solid",), state)
    assert pressures - before == pytest.approx(change, rel=1e-4, abs=1e-8)
    assert np.abs(change).max() > 1e-5  # there was something to see
