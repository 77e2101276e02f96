"""Fields at nodes: exact where they are polynomials, convergent on all cells, apart by material."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from softehl import Mesh, Study, element, page
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Rule
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.interior_facets import split
from softehl.runtime.results.recovery import projection, recover_by_patches
from softehl.runtime.results.result import Result
from softehl.runtime.study import StudyError

MESHES: dict[str, dict[str, Any]] = {
    **{"tri3": {"shape": "triangle"}, "tri6": {"shape": "triangle", "order": 2}},
    **{"quad4": {}, "quad8": {"shape": "serendipity", "order": 2}, "quad9": {"order": 2}},
    **{"quad16": {"order": 3}, "quad25": {"order": 4}, "quad36": {"order": 5}},
    "quad49": {"order": 6},
    **{"tet4": {"shape": "tetrahedron"}, "tet10": {"shape": "tetrahedron", "order": 2}},
    **{"hex8": {}, "hex20": {"shape": "serendipity", "order": 2}, "hex27": {"order": 2}},
    **{"hex64": {"order": 3}, "hex125": {"order": 4}, "wedge6": {"shape": "wedge"}},
}


def rule_of(kind: str) -> Rule:
    """The quadrature that pages have on a kind of cell."""
    rows = np.array(element(kind).rule.rows(), dtype=float)
    return Rule(rows[:, :-1].copy(), rows[:, -1].copy())


def meshed(kind: str, n: int) -> Mesh:
    """A unit square or cube with cells that are not alike, their sides bent."""

    def bent(x: Array) -> Array:
        wave = np.sin(2.0 * x + np.arange(x.shape[1]))
        return np.asarray(x + 0.15 * np.prod(4 * x * (1 - x), axis=1, keepdims=True) * wave)

    if CELLS[kind].dimension == 2:
        return Mesh.rectangle(1.0, 1.0, cells=(n, n), **MESHES[kind]).map(bent)
    return Mesh.box((1.0, 1.0, 1.0), cells=(n, n, n), **MESHES[kind]).map(bent)


def wave(x: Array) -> Array:
    return np.sin(1.5 * x[:, 0] + x[:, 1]) * np.exp(0.5 * x[:, -1])


def slope(x: Array) -> Array:
    """Of the wave along x."""
    return 1.5 * np.cos(1.5 * x[:, 0] + x[:, 1]) * np.exp(0.5 * x[:, -1])


def slopes(kind: str, n: int) -> tuple[Mesh, Array]:
    """Slope of the interpolated wave at the points of a bent mesh, (cells, points)."""
    mesh, cell, rule = meshed(kind, n), CELLS[kind], rule_of(kind)
    nodes = mesh.cells[kind]
    at = cell.gradient(rule.points)
    J = np.einsum("qkd,nkc->nqcd", at, mesh.points[nodes])
    along = np.einsum("qkd,nk->nqd", at, wave(mesh.points)[nodes])
    return mesh, np.linalg.solve(np.swapaxes(J, 2, 3), along[..., None])[:, :, 0, 0]


def recovered(kind: str, n: int) -> float:
    """Largest error of its projection at nodes."""
    mesh, values = slopes(kind, n)
    cell, rule, nodes = CELLS[kind], rule_of(kind), mesh.cells[kind]
    there = values @ projection(cell, rule, max(cell.order - 1, 1)).T
    count = np.bincount(nodes.ravel())
    mean = np.bincount(nodes.ravel(), there.ravel()) / count
    return float(np.abs(mean - slope(mesh.points)).max())


@pytest.mark.parametrize("kind", [k for k in MESHES if k != "hex125"])
def test_recovered_slopes_converge_with_the_order_of_the_cell(kind: str) -> None:
    order, flat = CELLS[kind].order, CELLS[kind].dimension == 2
    n = {1: 16, 2: 8}.get(order, 4) if flat else {1: 5, 2: 3}.get(order, 2)
    fitted = np.log2(recovered(kind, n) / recovered(kind, 2 * n))
    assert fitted > order - 0.35, fitted


def recovered_by_patches(kind: str, n: int) -> float:
    """Root mean square error of the patches at nodes."""
    mesh, values = slopes(kind, n)
    cell, rule, nodes = CELLS[kind], rule_of(kind), mesh.cells[kind]
    found = recover_by_patches(cell, rule, nodes, mesh.points, values[..., None])[:, 0]
    return float(np.sqrt(np.mean((found - slope(mesh.points)) ** 2)))


@pytest.mark.parametrize(
    "kind",
    [
        *("tri3", "quad4", "quad9", "wedge6", "tet4"),
        *(pytest.param(k, marks=pytest.mark.slow) for k in ("tri6", "quad8", "quad16", "quad25")),
        *(pytest.param(k, marks=pytest.mark.slow) for k in ("hex8", "hex20", "hex27", "hex64")),
    ],
)
def test_patches_have_one_order_more(kind: str) -> None:
    order, flat = CELLS[kind].order, CELLS[kind].dimension == 2
    n = {1: 16, 2: 8}.get(order, 4) if flat else {1: 5, 2: 3}.get(order, 2)
    fitted = np.log2(recovered_by_patches(kind, n) / recovered_by_patches(kind, 2 * n))
    assert fitted > order + (0.3 if kind == "tri6" else 0.85), fitted


def test_polynomials_of_the_degree_of_the_cell_are_exact_by_patches() -> None:
    """Also in corners, at boundaries, and in bodies of one cell, where the degree is lower."""
    cases = [("quad9", 4, 2), ("tri3", 3, 1), ("hex8", 3, 1), ("quad9", 1, 1), ("hex27", 1, 1)]
    for kind, n, degree in cases:
        cell, rule, d = CELLS[kind], rule_of(kind), CELLS[kind].dimension
        flat = Mesh.rectangle(1.0, 1.0, cells=(n, n), **MESHES[kind]) if d == 2 else None
        mesh = flat or Mesh.box((1.0, 1.0, 1.0), cells=(n, n, n), **MESHES[kind])
        sheared = 0.01 * (np.eye(d) + 0.3 * np.eye(d, k=1))
        mesh = Mesh(mesh.points @ sheared, mesh.cells)
        nodes, power = mesh.cells[kind], 100 * (np.arange(d) + 1.0)
        places = np.einsum("qk,nkd->nqd", cell.shape(rule.points), mesh.points[nodes])
        values = (places @ power + 1.0)[..., None] ** degree
        found = recover_by_patches(cell, rule, nodes, mesh.points, values)[:, 0]
        exact = (mesh.points @ power + 1.0) ** degree
        np.testing.assert_allclose(found, exact, rtol=1e-10, err_msg=f"{kind} {n}")


def test_polynomials_one_degree_below_the_cell_are_exact_at_its_nodes() -> None:
    for kind in (*MESHES, "line3", "line4", "line7", "hex216"):
        cell, rule = CELLS[kind], rule_of(kind)
        p = cell.order - 1
        power = np.arange(cell.dimension) + 1.0
        for degree in (0, p):
            exact = (cell.nodes @ power + 2.0) ** degree
            values = (rule.points @ power + 2.0) ** degree
            found = projection(cell, rule, max(p, 1)) @ values
            np.testing.assert_allclose(found, exact, rtol=1e-9, atol=1e-9, err_msg=kind)


def test_reduced_and_odd_quadratures_have_what_their_points_determine() -> None:
    cell = CELLS["quad9"]
    x, w = np.array([-1.0, 1.0]) / np.sqrt(3), np.ones(2)
    four = Rule(np.array([(a, b) for a in x for b in x]), np.outer(w, w).ravel())
    linear = cell.nodes @ [1.0, 2.0] + 3.0
    np.testing.assert_allclose(
        projection(cell, four, 1) @ (four.points @ [1.0, 2.0] + 3.0), linear, atol=1e-12
    )
    one = Rule(np.zeros((1, 2)), np.array([4.0]))
    np.testing.assert_allclose(projection(cell, one, 1), np.ones((9, 1)))
    ends = Rule(np.array([[-1.0], [0.0], [1.0]]), np.array([0.0, 2.0, 0.0]))
    np.testing.assert_allclose(projection(CELLS["line2"], ends, 1) @ [1.0, 2.0, 3.0], [1.0, 3.0])


def beam(cells: Any = (6, 1), **given: Any) -> Result:
    """Pure bending, sigma_xx = 0.6 (2 y - 1): exact with quadratic cells."""
    study = Study(Mesh.rectangle(6.0, 1.0, cells=cells, **given))
    study.add("beam", material="hooke", E=100.0, nu=0.0)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.5), u_y=0)
    study.load("right", u_x=lambda x, t: 0.6 * t * (2 * x[:, 1] - 1))
    return study.solve()


@pytest.mark.parametrize(
    "given",
    [
        {"order": 2},
        pytest.param({"order": 2, "shape": "serendipity"}, marks=pytest.mark.slow),
        pytest.param({"order": 2, "shape": "triangle"}, marks=pytest.mark.slow),
    ],
)
def test_bending_of_one_cell_through_the_thickness(given: Any, tmp_path: Path) -> None:
    result = beam(**given)
    y = result.system.mesh.points[:, 1]
    exact = 0.6 * (2 * y - 1)
    np.testing.assert_allclose(result.at_nodes("beam")["sigma_xx"], exact, atol=1e-12)
    mean = result.at_nodes("beam", recovery="mean")["sigma_xx"]
    if "shape" not in given:
        np.testing.assert_allclose(mean, 0.0, atol=1e-12)
    result.write(tmp_path / "beam.vtu")
    read = meshio.read(tmp_path / "beam.vtu")
    np.testing.assert_allclose(read.point_data["beam.sigma_xx"], exact, atol=1e-12)
    assert read.cell_data["beam.sigma_xx"][0].shape == (len(read.cells[0].data),)
    assert result.at((2.2, 0.9), block="beam")["sigma_xx"] == pytest.approx(0.48)
    line = result.along((3.1, 0.0), (3.1, 1.0), 5, block="beam")
    np.testing.assert_allclose(line["sigma_xx"], 0.6 * (2 * line["s"] - 1), atol=1e-12)
    assert "u_x" not in line
    with pytest.raises(KeyError, match=r"no block 'beem'.*did you mean 'beam'"):
        result.at_nodes("beem")
    spr = result.at_nodes("beam", recovery="spr")["sigma_xx"]
    np.testing.assert_allclose(spr, exact, atol=1e-10)  # one cell through the thickness
    with pytest.raises(StudyError, match="recovery = 'zz': allowed are 'projection', 'mean', 'spr"):
        result.at_nodes("beam", recovery="zz")


def kirsch(x: Array) -> tuple[Array, Array, Array]:
    """Stresses in an infinite plate with a hole of radius 1, pulled by 1 along x."""
    a, th = 1.0 / (x**2).sum(axis=1), np.arctan2(x[:, 1], x[:, 0])
    c2, c4, s2, s4 = np.cos(2 * th), np.cos(4 * th), np.sin(2 * th), np.sin(4 * th)
    b = 1.5 * a**2
    return (
        1 - a * (1.5 * c2 + c4) + b * c4,
        -a * (0.5 * c2 - c4) - b * c4,
        -a * (0.5 * s2 + s4) + b * s4,
    )


def hole(n: int) -> Result:
    """A quarter of a ring of radii 1 and 4 with the tractions of the infinite plate."""

    def ring(x: Array) -> Array:
        r, th = 1.0 + 3.0 * x[:, 0], 0.5 * np.pi * x[:, 1]
        return np.column_stack([r * np.cos(th), r * np.sin(th)])

    def traction(k: int) -> Any:
        def f(x: Array, t: float) -> Array:
            xx, yy, xy = kirsch(x)
            n = x / np.linalg.norm(x, axis=1, keepdims=True)
            components = [xx, xy] if k == 0 else [xy, yy]
            return np.asarray(t * (np.stack(components, axis=1) * n).sum(axis=1))

        return f

    study = Study(Mesh.rectangle(1.0, 1.0, cells=(2 * n, n), order=2).map(ring))
    study.add("plate", material="hooke", E=1.0, nu=0.3)
    study.fix("bottom", u_y=0)
    study.fix("top", u_x=0)
    study.load("right", u_x=traction(0), u_y=traction(1))
    return study.solve()


def test_stress_at_a_hole() -> None:
    result = hole(8)
    top = result.system.mesh.node_at(np.array([0.0, 1.0]))
    found = result.at_nodes("plate")["sigma_xx"][top]
    assert found == pytest.approx(3.0, rel=0.01)
    assert result.at_nodes("plate", recovery="mean")["sigma_xx"][top] < 2.7
    spr = result.at_nodes("plate", recovery="spr")
    assert spr["sigma_xx"][top] == pytest.approx(3.0, rel=0.01)
    inside = np.linalg.norm(result.system.mesh.points, axis=1) > 1.5
    projected, exact = result.at_nodes("plate"), kirsch(result.system.mesh.points)[0]
    error = [abs(f["sigma_xx"] - exact)[inside].max() for f in (spr, projected)]
    assert error[0] < 0.7 * error[1]


def test_nodes_of_two_materials_have_the_values_of_each() -> None:
    """Layers in series: the strain jumps, each block has its own at the common nodes."""
    mesh = Mesh.rectangle(2.0, 1.0, cells=(2, 1), order=2)
    mesh = mesh.with_group("soft", lambda x: x[:, 0] < 1).with_group("hard", lambda x: x[:, 0] > 1)
    study = Study(mesh)

    for name, k in (("soft", 1.0), ("hard", 4.0)):
        study.add(name, conduction, cells=name, k=k)
    study.fix("left", T=0)
    study.load("right", T=1.0)
    result = study.solve()
    x = mesh.points[:, 0]
    for name, want, there in (("soft", 1.0, x <= 1), ("hard", 0.25, x >= 1)):
        found = result.at_nodes(name)["slope"]
        np.testing.assert_allclose(found[there], want, rtol=1e-12)
        assert np.isnan(found[~there]).all()
        assert result.at((1.0, 0.3), block=name)["slope"] == pytest.approx(want)
        assert result.at((1.0, 0.0), block=name)["slope"] == pytest.approx(want)
    assert np.isnan(result.at((0.5, 0.5), block="hard")["slope"])


@page
def conduction(m: Any) -> None:
    T = m.scalar("T")
    (k,) = m.parameters(k="conductivity")
    m.minimise(k / 2 * m.grad(T).dot(m.grad(T)))
    m.fields(slope=m.grad(T)[0])


@page
def across(m: Any) -> None:
    """Discontinuous heat with a penalty, and the place of its points."""
    T = m.scalar("T")
    m.minimise(10.0 / m.size * m.jump(T) ** 2 / 2)
    m.fields(x=m.position[0], y=m.position[1])


def test_facets_have_values_at_the_nodes_of_both_cells() -> None:
    mesh = split(Mesh.rectangle(2.0, 2.0, cells=(2, 2), order=2))
    study = Study(mesh)
    study.add("body", conduction, k=1.0)
    study.add("jumps", across, on="interior")
    study.fix("left", T=0)
    study.load("right", T=1.0)
    nodal = study.solve().at_nodes("jumps")
    x, y = mesh.points.T
    there = (x == 1.0) | (y == 1.0)
    middle = (x == 1.0) & (y == 1.0)
    np.testing.assert_allclose(nodal["x"][there], x[there], atol=1e-12)
    np.testing.assert_allclose(nodal["y"][there], y[there], atol=1e-12)
    assert np.isnan(nodal["x"][~there]).all()
    assert middle.sum() == 4
