"""Two scales: a unit cell at every point beside a body of one law, and beside a laminate."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl import (
    Mesh,
    Newton,
    NotConverged,
    Result,
    SoftehlError,
    SolverOptions,
    Study,
    StudyError,
)
from softehl.runtime.analyses.homogenisation import Cell
from softehl.runtime.arrays import Array
from tests.runtime.test_periodic import laminate, layers

RUBBER: dict[str, Any] = {"material": "neo_hooke", "mu": 0.4, "kappa": 0.9}
METAL: dict[str, Any] = {
    "material": "j2",
    "E": 100.0,
    "nu": 0.3,
    "sy": 0.1,
    "H": 5.0,
    "H_kin": 2.0,
}
PRONY: dict[str, Any] = {
    "material": str(Path(__file__).parents[2] / "docs" / "models" / "prony.py"),
    **{"mu": 0.4, "K": 0.9, "G": [0.2, 0.1], "tau": [0.1, 1.0]},
}
PAIRS = (("left", "right"), ("bottom", "top"), ("front", "back"))


def unit_cell(law: dict[str, Any], dimension: int = 2, cells: int = 2) -> Cell:
    """A cell of one law."""
    if dimension == 2:
        study = Study(Mesh.rectangle(1, 1, cells=(cells, cells)))
    else:
        study = Study(Mesh.box((1, 1, 1), cells=(cells, 1, 1)))
    study.add("body", **law)
    return study.periodic(*PAIRS[:dimension])


def voided(cells: int = 4, **changes: Any) -> Cell:
    """A metal with a square hole."""
    mesh = Mesh.rectangle(1, 1, cells=(cells, cells))
    middle = mesh.points[mesh.cells["quad4"]].mean(axis=1)
    rows = np.abs(middle - 0.5).max(axis=1) > 0.25
    study = Study(Mesh(mesh.points, {"quad4": mesh.cells["quad4"][rows]}, sides=mesh.sides))
    study.add("metal", **{**METAL, **changes})
    return study.periodic(*PAIRS[:2])


def bent(mesh: Mesh, size: float, **body: Any) -> Study:
    """A block held on the left and bent on the right."""
    study = Study(mesh)
    study.add("body", **body)
    study.fix("left", **dict.fromkeys(("u_x", "u_y", "u_z")[: mesh.dimension], 0.0))
    study.fix("right", u_y=size)
    return study


def norms(result: Result) -> Array:
    """Residuals of Newton's method in the last step."""
    return np.array(result.point.solution.residual_norms)


MESHES = {
    "quad4": Mesh.rectangle(2, 1, cells=(2, 1)),
    "quad8": Mesh.rectangle(2, 1, cells=(1, 1), order=2, shape="serendipity"),
    "tri6": Mesh.rectangle(2, 1, cells=(1, 1), order=2, shape="triangle"),
    "hex8": Mesh.box((2, 1, 1), cells=(1, 1, 1)),
    "tet10": Mesh.box((2, 1, 1), cells=(1, 1, 1), order=2, shape="tetrahedron"),
    "wedge6": Mesh.box((2, 1, 1), cells=(1, 1, 1), shape="wedge"),
    "pyramid5": Mesh.box((2, 1, 1), cells=(1, 1, 1), shape="pyramid"),
    "hex27": Mesh.box((2, 1, 1), cells=(1, 1, 1), order=2),
}


def _slow(kind: str, law: dict[str, Any]) -> Any:
    return pytest.param(kind, law, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("kind", "law"),
    [
        ("quad4", RUBBER),
        ("tri6", METAL),
        _slow("quad8", METAL),
        _slow("hex8", RUBBER),
        _slow("tet10", METAL),
        _slow("wedge6", RUBBER),
        _slow("pyramid5", METAL),
        _slow("hex27", METAL),
    ],
)
def test_cells_of_one_law_are_the_body_itself(kind: str, law: dict[str, Any]) -> None:
    """Unknowns and every residual of Newton's method are the same: the tangent is consistent."""
    mesh, size = MESHES[kind], 0.4 if law is RUBBER else 0.008
    direct = bent(mesh, size, **law).solve(steps=2)
    result = bent(mesh, size, cell=unit_cell(law, mesh.dimension)).solve(steps=2)
    scale = np.abs(direct.x).max()
    assert np.abs(result.x - direct.x).max() < 1e-12 * scale
    assert np.allclose(norms(result), norms(direct), rtol=1e-3, atol=1e-12)
    other = {**law, "mu": 0.41} if law is RUBBER else {**law, "H": 5.1}
    wrong = bent(mesh, size, cell=unit_cell(other, mesh.dimension)).solve(steps=2)
    assert np.abs(wrong.x - direct.x).max() > 1e-6 * scale


def test_a_laminate_under_a_uniform_gradient_has_the_stress_of_its_layers() -> None:
    mesh = Mesh.rectangle(1, 1, cells=(2, 2)).map(lambda x: x + 0.1 * x * (1 - x))
    F = np.array([[1.15, 0.2], [-0.05, 0.9]])
    study = Study(mesh)
    study.add("macro", cell=laminate())
    for side in ("left", "right", "bottom", "top"):
        study.fix(
            side,
            u_x=lambda x, t: t * (x @ (F - np.eye(2))[0]),
            u_y=lambda x, t: t * (x @ (F - np.eye(2))[1]),
        )
    fields = study.solve().fields("macro")
    P = np.array([[fields[f"P_{i}{j}"] for j in "xy"] for i in "xy"])
    assert np.abs(P - layers(F)[:, :, None, None]).max() < 1e-10


def test_convergence_is_quadratic_with_voids_and_plasticity() -> None:
    result = bent(MESHES["quad4"], 0.01, cell=voided()).solve(steps=2)
    assert result.unit_cell("body", 0, 0).result.fields("metal")["plastic_strain"].max() > 1e-3
    r = norms(result)
    r = r[r > 1e-12]
    assert len(norms(result)) <= 6
    assert (r[2:] < 30.0 * r[1:-1] ** 2 + 1e-12).all()


def test_cuts_of_the_steps_take_all_histories_back() -> None:
    """Newton's method with few iterations cuts the step of both studies at the same place."""
    newton, mesh = Newton(max_iterations=3), MESHES["quad4"]
    results = [
        bent(mesh, 0.02, **body).solve(newton=newton)
        for body in (METAL, {"cell": unit_cell(METAL)})
    ]
    assert results[0].iterations == results[1].iterations
    assert np.abs(results[1].x - results[0].x).max() < 1e-11 * np.abs(results[0].x).max()
    uncut = bent(mesh, 0.02, **METAL).solve()
    assert np.abs(uncut.x - results[0].x).max() > 1e-6 * np.abs(uncut.x).max()


def test_a_march_restarts_to_the_last_bit(tmp_path: Path) -> None:
    study = bent(MESHES["quad4"], 0.006, cell=voided())
    file = tmp_path / "state.npz"
    *_, whole = study.march(dt=0.25, until=1.0)
    for _ in study.march(dt=0.25, until=0.5, checkpoint=file):
        pass
    *_, last = study.march(dt=0.25, until=1.0, restart=file)
    np.testing.assert_array_equal(last.x, whole.x)
    np.testing.assert_array_equal(last.state["body"], whole.state["body"])
    other = bent(MESHES["quad4"], 0.006, cell=voided(6))
    with pytest.raises(StudyError, match="of another study"):
        list(other.march(dt=0.25, until=1.0, restart=file))
    half = study.solve(until=0.5)
    with pytest.raises(StudyError, match="'body' has other unit cells in the result"):
        other.solve(start=half)
    whole_path, continued = study.solve(steps=2), study.solve(start=half)
    assert np.abs(continued.x - whole_path.x).max() < 1e-12


def test_cells_know_time_and_its_steps() -> None:
    """A viscoelastic law in a cell is the law itself, with steps that adapt."""
    marches = [
        [r.x for r in bent(MESHES["quad4"], 0.2, **body).march(dt=0.2, until=0.6)]
        for body in (PRONY, {"cell": unit_cell(PRONY)})
    ]
    assert np.abs(marches[0][-1] - marches[1][-1]).max() < 1e-12
    with pytest.raises(StudyError, match="has dt, the length of a step in time"):
        bent(MESHES["quad4"], 0.2, cell=unit_cell(PRONY)).solve()


@pytest.mark.slow
def test_processes_share_the_cells() -> None:
    cell = voided()
    results = [bent(MESHES["quad4"], 0.006, cell=cell, processes=n).solve() for n in (1, 3)]
    np.testing.assert_array_equal(results[0].x, results[1].x)
    np.testing.assert_array_equal(results[0].state["body"], results[1].state["body"])
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    study.add("body", material="neo_hooke", mu=lambda t: 0.4, kappa=0.9)
    timed = study.periodic(*PAIRS[:2])
    with pytest.raises(SoftehlError, match="mu: <lambda> cannot be pickled"):
        bent(MESHES["quad4"], 0.2, cell=timed, processes=2).solve()


def test_a_result_has_the_cells_of_its_points() -> None:
    result = bent(MESHES["quad4"], 0.006, cell=voided()).solve()
    fields = result.fields("body")
    state = result.unit_cell("body", 1, 2)
    for name in ("P", "F"):
        known = [[fields[f"{name}_{i}{j}"][1, 2] for j in "xy"] for i in "xy"]
        np.testing.assert_allclose(getattr(state, name), known, atol=1e-14)
    assert result.unit_cell("body", 0).result.fields("metal")["plastic_strain"].max() > 0.0
    again = pickle.loads(pickle.dumps(result)).unit_cell("body", 1, 2)
    np.testing.assert_array_equal(again.P, state.P)
    with pytest.raises(StudyError, match="element 2, point 0: 'body' has 2 elements of 4 points"):
        result.unit_cell("body", 2)
    with pytest.raises(StudyError, match="'body' has none: it was not added with cell"):
        bent(MESHES["quad4"], 0.006, **METAL).solve().unit_cell("body", 0)
    with pytest.raises(StudyError, match="derivatives, fits and gradients: 'body' has unit cells"):
        result.sensitivity("u_y", at=(2.0, 1.0), by={"body": ["t"]})


def test_a_cell_without_equilibrium_is_named() -> None:
    study = bent(MESHES["quad4"], 0.0, cell=unit_cell(RUBBER))
    study.fix("right", u_x=-2.5)
    with pytest.raises(NotConverged, match=r"its unit cell at point \d is not in equilibrium"):
        study.solve(newton=Newton(max_iterations=8))


def test_what_is_no_unit_cell_is_refused() -> None:
    study = Study(MESHES["quad4"])
    refusals: list[tuple[str, dict[str, Any]]] = [
        ("cell is a Study: a periodic cell is needed", {"cell": Study(MESHES["quad4"])}),
        ("unit cell is in 3-D, the mesh in 2-D", {"cell": unit_cell(RUBBER, 3)}),
        ("on = 'left': unit cells are at", {"cell": unit_cell(RUBBER), "on": "left"}),
        ("leave page, material, element", {"cell": unit_cell(RUBBER), "material": "neo_hooke"}),
        ("processes = 0: a whole number", {"cell": unit_cell(RUBBER), "processes": 0}),
        ("threads: .* processes=2", {"cell": unit_cell(RUBBER), "threads": 2}),
        ("constant are not for unit cells", {"cell": unit_cell(RUBBER), "constant": True}),
    ]
    for message, arguments in refusals:
        with pytest.raises(StudyError, match=message):
            study.add("macro", **arguments)
    ring = Study(Mesh.rectangle(2, 1, cells=(2, 1)), geometry="axisymmetric")
    with pytest.raises(StudyError, match="geometry = 'axisymmetric': unit cells are at"):
        ring.add("macro", cell=unit_cell(RUBBER))
    loaded = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    loaded.add("body", **RUBBER)
    loaded.load("top", u_y=1.0)
    with pytest.raises(StudyError, match="has loads, springs, ties or contacts"):
        study.add("macro", cell=loaded.periodic(*PAIRS[:2]))
    study.add("macro", cell=unit_cell(RUBBER))
    study.fix("left", u_x=0, u_y=0)
    with pytest.raises(StudyError, match="which MatrixFree does not solve"):
        study.solve(options=SolverOptions(linear="matrix-free"))


@pytest.mark.parametrize("method", ["explicit", "newmark"])
def test_a_body_with_cells_moves_as_the_body_itself(method: Any) -> None:
    states = []
    for body in (RUBBER, {"cell": unit_cell(RUBBER)}):
        study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
        study.add("body", **body)
        study.fix("left", u_x=0, u_y=0)
        study.load("right", u_y=0.02)
        path = study.march(dt=0.2, until=0.4, method=method, mass={"body": {"rho": 1e-3}})
        states.append([r.x for r in path][-1])
    assert np.abs(states[0] - states[1]).max() < 1e-12 * np.abs(states[0]).max()
