"""Studies that are solved without matrices, against factors of assembled tangents."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.sparse import csr_array, diags_array

import softehl
from softehl import Mesh, Study
from softehl.codegen.language.fields import Fields
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.parallel.matrix_free import MatrixFree
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity import linearised_step
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.krylov import conjugate_gradients, minimal_residuals
from softehl.runtime.solve.linear.multigrid import MultigridCycle, MultigridLevel
from softehl.runtime.solve.solution import NotConverged


@softehl.page
def solid(m: Fields) -> None:
    """Compressible neo-Hooke with products."""
    u = m.vector("u")
    mu, lam = m.parameters(mu="shear modulus [MPa]", lam="Lame's constant [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3) - mu * sp.log(J))
    m.minimise(lam / 4 * (J**2 - 1 - 2 * sp.log(J)))
    m.offer(product=True)


@softehl.page
def carried(m: Fields) -> None:
    """Heat that is carried along x: the tangent is not symmetric."""
    T = m.scalar("T")
    (k,) = m.parameters(k="conductivity")
    slopes = m.grad(T)
    m.weak(k * slopes, slopes)
    m.weak(slopes[0] - 1, T)
    m.offer(product=True)


def block(order: int, nu: float, cells: tuple[int, int, int] = (3, 3, 3)) -> Study:
    """A block of rubber that is held below, pushed, pressed and on springs."""
    mesh = Mesh.box((1, 1, 1), cells=cells, order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(3 * x[:, ::-1])))
    study.add("body", solid, mu=1.0, lam=2 * nu / (1 - 2 * nu))
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_z=-0.02)
    study.load("top", u_x=0.02)
    study.pressure("right", 0.01)
    study.spring("back", u_y=0.1)
    return study


def apart(a: Result, b: Result, names: tuple[str, ...]) -> float:
    """Largest difference of unknowns, relative to the largest of them."""
    pairs = [(a.values(n), b.values(n)) for n in names]
    size = max(float(np.abs(x).max()) for x, _ in pairs)
    return max(float(np.abs(x - y).max()) for x, y in pairs) / size


SOLVED = [
    *((1, 0.3), (2, 0.499)),
    *(pytest.param(*case, marks=pytest.mark.slow) for case in ((2, 0.3), (3, 0.45), (4, 0.3))),
]


@pytest.mark.parametrize(("order", "nu"), SOLVED)
def test_the_same_solution_as_with_factors(order: int, nu: float) -> None:
    study = block(order, nu, (3, 3, 3) if order < 3 else (2, 1, 2))
    names = ("u_x", "u_y", "u_z")
    wanted, found = study.solve(), study.solve(linear="matrix-free")
    assert apart(wanted, found, names) < 1e-8
    other = block(order, nu + 1e-4, (3, 3, 3) if order < 3 else (2, 1, 2)).solve()
    assert apart(wanted, other, names) > 1e-7


def periodic(order: int, wide: float = 0.03) -> Study:
    """A block between plates that repeats along x, and has a chain of ties beside."""
    mesh = Mesh.box((1, 1, 1), cells=(2, 1, 2), order=order)
    study = Study(mesh)
    study.add("body", solid, mu=1.0, lam=2.0)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_x=0.05)
    study.tie(
        "right", "left", "u_x", "u_y", "u_z", offset=lambda x, t: t * wide * x[:, 2] * (1 - x[:, 2])
    )
    study.tie((0, 1, 1), (0, 0, 1), "u_z")
    study.tie((0.25, 0, 0.5), (0.5, 1, 1), "u_z", offset=0.01)  # no corner, and one
    study.fix((0, 0, 1), u_z=-0.02)
    study.load("top", u_y=0.02)
    return study


@pytest.mark.parametrize("order", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_ties_as_with_factors(order: int) -> None:
    study, engine = periodic(order), MatrixFree(tolerance=1e-8)
    wanted, found = study.solve(), study.solve(engine=engine)
    assert apart(wanted, found, ("u_x", "u_y", "u_z")) < 1e-10
    assert max(engine.iterations) < 20
    for side in ("left", "right", "bottom"):
        assert found.reaction(side) == pytest.approx(wanted.reaction(side), abs=1e-10)
    other = periodic(order, 0.0301).solve()
    assert apart(wanted, other, ("u_x", "u_y", "u_z")) > 1e-6


@pytest.mark.parametrize("linear", ["matrix-free", "auto"])
def test_ties_in_a_circle_are_refused(linear: Any) -> None:
    """With factors the tangent is singular, with or without contacts."""
    study = block(2, 0.3, (1, 1, 1))
    study.tie("right", "left", "u_y")
    study.tie("back", "front", "u_y")
    message = r"tie 5: tie\('back', u_y\): the node at \(1.02, 1.003, .*\) is tied in a circle"
    with pytest.raises(StudyError, match=f"{message}.*: leave one of them out"):
        study.solve(linear=linear)


def test_two_bodies_in_the_plane_and_several_threads() -> None:
    mesh = Mesh.rectangle(2, 1, cells=(6, 9), order=3)
    mesh = mesh.with_group("a", lambda x: x[:, 0] < 1).with_group("b", lambda x: x[:, 0] > 1)
    study = Study(mesh)
    study.add("soft", solid, cells="a", mu=1.0, lam=2.0)
    study.add("hard", solid, cells="b", mu=9.0, lam=9.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=0.01)
    engine = MatrixFree(threads=2)
    assert apart(study.solve(), study.solve(engine=engine), ("u_x", "u_y")) < 1e-8
    assert max(engine.iterations) < 30


def test_a_tangent_that_is_not_symmetric() -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(4, 4), order=4))
    study.add("body", carried, k=0.1)
    study.fix("boundary", T=0)
    assert apart(study.solve(), study.solve(linear="matrix-free"), ("T",)) < 1e-8


def test_what_it_cannot_solve_is_refused() -> None:
    study = block(2, 0.3)
    with pytest.raises(StudyError, match="linear = 'gamg': allowed are"):
        study.solve(linear="gamg")  # type: ignore[arg-type]
    with pytest.raises(StudyError, match="is allowed, or leave engine out"):
        study.solve(linear="matrix-free", engine="serial")
    mass = {"body": {"rho": 1}}
    with pytest.raises(StudyError, match="inertia has no such products; leave linear out"):
        list(study.march(dt=1, until=1, method="newmark", mass=mass, linear="matrix-free"))
    triangles = Study(Mesh.rectangle(1, 1, cells=(2, 2), shape="triangle"))
    triangles.add("body", solid, mu=1, lam=1)
    with pytest.raises(StudyError, match="on quadrilaterals and hexahedra"):
        triangles.solve(linear="matrix-free")


def test_too_few_iterations_are_said() -> None:
    with pytest.raises(NotConverged, match="no linear solution after 2 iterations"):
        block(2, 0.3).solve(engine=MatrixFree(most=2))
    with pytest.raises(StudyError, match="allowed are 0 < tolerance < 1, most >= 1"):
        MatrixFree(tolerance=-1.0)


# ---------------------------------------------------------------------------------- by themselves


def laplacian(n: int) -> csr_array:
    """Second differences with scaled rows and columns, positive definite."""
    scale = diags_array(np.linspace(1.0, 2.0, n))
    ones = np.ones(n - 1)
    A = diags_array(2 * np.ones(n)) - diags_array(ones, offsets=1) - diags_array(ones, offsets=-1)
    return csr_array(scale @ A @ scale)


def cycle_of(A: csr_array) -> MultigridCycle:
    """Two levels with linear interpolation."""
    n = A.shape[0]
    P = np.zeros((n, n // 2))
    for k in range(n // 2):
        P[2 * k + 1, k] = 1.0
        P[[2 * k, min(2 * k + 2, n - 1)], k] = 0.5
    lower = np.linalg.inv(P.T @ A.toarray() @ P)
    level = MultigridLevel.of(A.__matmul__, A.diagonal(), csr_array(P))
    return MultigridCycle([level], lower.__matmul__)


def test_a_cycle_is_symmetric_and_positive(rng: np.random.Generator) -> None:
    A = laplacian(31)
    M = np.stack([cycle_of(A)(e) for e in np.eye(31)])
    assert np.abs(M - M.T).max() < 1e-12 * np.abs(M).max()
    assert np.linalg.eigvalsh(M).min() > 0.0
    assert np.abs(np.linalg.eigvals(np.eye(31) - M @ A.toarray())).max() < 0.2


def test_krylov_methods(rng: np.random.Generator) -> None:
    A, b = laplacian(31), rng.uniform(-1, 1, 31)
    found = conjugate_gradients(A.__matmul__, cycle_of(A), b, 1e-12, 30)
    assert found.converged
    assert found.iterations < 15
    np.testing.assert_allclose(A @ found.x, b, atol=1e-10)
    slow = conjugate_gradients(A.__matmul__, lambda r: r, b, 1e-12, 30)
    assert not slow.converged
    turned = csr_array(A + diags_array(np.ones(30), offsets=1))
    found = minimal_residuals(turned.__matmul__, cycle_of(A), b, 1e-12, 200)
    assert found.converged
    np.testing.assert_allclose(turned @ found.x, b, atol=1e-9)


def test_negative_curvature_ends_conjugate_gradients(rng: np.random.Generator) -> None:
    A = laplacian(9)
    b: Array = rng.uniform(-1, 1, 9)
    shifted = csr_array(A - 1.0 * diags_array(np.ones(9)))
    found = conjugate_gradients(shifted.__matmul__, lambda r: r, b, 1e-12, 30)
    assert found.negative
    assert found.x @ b > 0.0


@pytest.mark.slow
def test_derivatives_need_no_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """By an adjoint and directly, at a place and of a reaction."""

    def pushed() -> Study:
        study = Study(Mesh.box((1, 1, 1), cells=(2, 2, 2), order=2))
        study.add("body", solid, mu=1.0, lam=1.5)
        study.fix("bottom", u_x=0, u_y=0, u_z=0)
        study.fix("top", u_z=-0.02)
        study.load("top", u_x=0.02)
        study.spring("back", u_y=0.1)
        return study

    by = {"body": ["mu", "lam"], "load:top": ["u_x"], "fix:top": ["u_z"], "nodes": ["x"]}
    wanted, whole = pushed().solve(), pushed().solve().derivative(by={"body": ["mu"]})
    monkeypatch.setattr(linearised_step, "direct_solver", None)
    found = pushed().solve(linear="matrix-free")
    asked: tuple[dict[str, Any], ...] = ({"at": (1, 1, 0.5)}, {"reaction": "bottom"})
    for where in asked:
        slopes = found.sensitivity("u_x", by=by, **where)
        with monkeypatch.context() as with_factors:
            with_factors.setattr(linearised_step, "direct_solver", direct_solver)
            expected = wanted.sensitivity("u_x", by=by, **where)
        for key, slope in expected.items():
            np.testing.assert_allclose(slopes[key], slope, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.derivative(by={"body": ["mu"]}), whole, atol=1e-10)


def test_adjoints_of_what_is_not_symmetric_are_refused() -> None:
    result = block(1, 0.3).solve(linear="matrix-free")
    with pytest.raises(StudyError, match=r'need a symmetric tangent, this one is not: .*"amg"'):
        result.sensitivity("u_x", at=(1, 1, 1), by={"body": ["mu", "lam"], "nodes": ["x"]})
