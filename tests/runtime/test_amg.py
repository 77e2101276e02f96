"""The linear solver of one process by size: multigrid, factors, factors that are kept."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array

import softehl
from softehl.runtime.arrays import Array, Flags
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.parallel import linear_solver_choice
from softehl.runtime.solve.eigen import Pivots
from softehl.runtime.solve.linear import amg
from softehl.runtime.solve.solution import NotConverged
from tests.runtime.field_pages import rubber


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
