"""Cells for DOLFINx by UFCx, and the order of their vertices."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from softehl.codegen import pipeline
from softehl.codegen.abi import VERTEX_ORDER, Target, TargetError
from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.elements.element import Element
from softehl.codegen.emit import ufcx as emit_ufcx
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import ALL
from softehl.codegen.verify import random_states
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.kernels.kernel import load_kernel
from tests.codegen.cell_kernels import TENSOR, CellKernels, Plane, cell_kernels, distorted
from tests.codegen.element_states import MATERIALS, Case, all_cases
from tests.codegen.hosts.random_pages import FEW, pages
from tests.codegen.pages.maxwell import maxwell
from tests.codegen.workshop import compiled
from tests.shipped import SHIPPED

# --- Target `ufcx`: called cell by cell as DOLFINx does it, against the batched kernels -----------


LIMIT = 1e-12
FAMILIES = (
    *("solid_fbar", "solid_q4", "follower_pressure", "contact", "contact_friction"),
    *("contact_corner", "film_void", "mean_rotation", "sheet_ogden"),
)
"""Of every kind one: nodes, data, branches, unknowns beside those of the nodes, none of them."""
CASES = {f"{c.family}: {c.label}": c for c in all_cases() if c.family in FAMILIES}
QUADS = tuple(name for name, shipped in SHIPPED.items() if shipped.nodes == 4)


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> dict[str, CellKernels]:
    directory = tmp_path_factory.mktemp("ufcx")
    return {name: cell_kernels(ALL[name](), directory) for name in FAMILIES}


def order(case: Case) -> list[int]:
    """Place in DOLFINx's cell of each unknown of ours."""
    nodes = TENSOR if case.family in QUADS else range(len(case.coordinates) // 2)
    nodal = [2 * v + c for v in nodes for c in (0, 1)]
    return [*nodal, *range(len(nodal), len(case.dofs))]


def called(kernels: CellKernels, case: Case, task: str, start: float = 0.0) -> Array:
    """One cell in DOLFINx's order, its result in ours."""
    ndof, at = len(case.dofs), order(case)
    X = case.coordinates.reshape(-1, 2)
    vertices = np.full((len(X), 3), np.nan)
    vertices[[p // 2 for p in at[: 2 * len(X) : 2]], :2] = X
    w = np.empty(ndof)
    w[at] = case.dofs
    A = np.full(ndof if task == "residual" else (ndof, ndof), start)
    kernels.add(task, A, [*w, *case.data], case.parameters, vertices)
    return A[at] if task == "residual" else A[np.ix_(at, at)]


def close(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= LIMIT * np.abs(b).max())


def test_a_cell_is_the_element_in_another_order(cells: dict[str, CellKernels]) -> None:
    for name, case in CASES.items():
        positional, named = case.arguments()
        R, K = load_kernel(case.family).tangent(*positional, **named)
        kernels = cells[case.family]
        assert close(called(kernels, case, "residual"), R[0]), name
        assert close(called(kernels, case, "tangent"), K[0]), name


def test_cells_are_added_to_what_is_there(cells: dict[str, CellKernels]) -> None:
    case = CASES["solid_q4: ring"]
    for task in ("residual", "tangent"):
        once, above = (called(cells["solid_q4"], case, task, s) for s in (0.0, 1e3))
        np.testing.assert_allclose(above - 1e3, once, atol=1e-12 * 1e3)
        assert once.all()


def assembled(kernels: CellKernels, plane: Plane, vertex: tuple[int, ...]) -> tuple[Array, Array]:
    """Loop over cells in the manner of DOLFINx: gather, call with cleared A, scatter."""
    size, numbers = plane.points.size, np.empty(4, dtype=np.int64)
    R, K = np.zeros(size), np.zeros((size, size))
    u = plane.motion
    for cell in plane.cells:
        numbers[list(vertex)] = cell
        geometry = np.column_stack([plane.points[numbers], np.zeros(4)])
        dofs = (2 * numbers[:, None] + np.arange(2)).ravel()
        b, A = np.zeros(8), np.zeros((8, 8))
        kernels.add("residual", b, u[numbers], MATERIALS[0], geometry)
        kernels.add("tangent", A, u[numbers], MATERIALS[0], geometry)
        R[dofs] += b
        K[np.ix_(dofs, dofs)] += A
    return R, K


def ours(plane: Plane, family: str) -> tuple[Array, Array]:
    """Residual and tangent of the project's own assembly."""
    block = ElementBlock(
        "solid", load_kernel(family), plane.points[plane.cells].reshape(-1, 8), plane.dofs
    )
    assembler = Assembler.build(plane.points.size, [block])
    R, K = assembler.linearise(plane.motion.ravel(), {"solid": np.array(MATERIALS[0])})
    return R, K.toarray()


@pytest.mark.parametrize("family", ["solid_q4", "solid_fbar"])
def test_a_loop_over_cells_gives_our_assembly(
    family: str, cells: dict[str, CellKernels], rng: np.random.Generator
) -> None:
    plane = distorted(rng)
    R, K = assembled(cells[family], plane, TENSOR)
    expected_R, expected_K = ours(plane, family)
    assert close(R, expected_R)
    assert close(K, expected_K)


def test_the_comparison_sees_a_wrong_order_of_vertices(
    cells: dict[str, CellKernels], rng: np.random.Generator
) -> None:
    plane = distorted(rng)
    R, K = assembled(cells["solid_q4"], plane, (0, 1, 2, 3))
    expected_R, expected_K = ours(plane, "solid_q4")
    assert not close(R, expected_R)
    assert not close(K, expected_K)


# -------------------------------------------------------------- what the shipped ones do not have


def test_an_interpolated_field_is_refused() -> None:
    with pytest.raises(TargetError, match=r"film interpolates p .* use simd or scalar"):
        pipeline.compile_model(ALL["film"](), Target.UFCX)


def test_products_and_sensitivities_are_not_offered() -> None:
    tasks = pipeline.compile_model(ALL["solid_q4"](), Target.UFCX).functions
    assert list(tasks) == ["energy", "residual", "tangent", "fields"]


def test_local_unknowns_and_data_of_points(tmp_path: Path) -> None:
    """Viscous strains are found in the cell; their old values are coefficients."""
    d = maxwell()
    kernels, batch = cell_kernels(d, tmp_path), compiled(d, tmp_path)
    rng = np.random.default_rng(3)
    plane = distorted(rng)
    X = plane.points[plane.cells[:1]].reshape(1, 8)
    u, p = 0.02 * rng.uniform(-1, 1, (1, 8)), [0.4, 2.0, 0.3, 1.5, 0.2]
    old = 1 + 0.02 * rng.uniform(-1, 1, (1, 4, 4)) * [1, 1, 1, 0] - [0, 0, 0, 1]
    given: dict[str, Any] = {"point_data": old, "parameters": p}
    at = (2 * np.array(TENSOR)[:, None] + np.arange(2)).ravel()
    w, vertices = np.empty(8), np.zeros((4, 3))
    w[at], vertices[list(TENSOR), :2] = u[0], X.reshape(4, 2)
    R, K = batch.tangent(X, u, **given)
    A, b, fields = np.zeros((8, 8)), np.zeros(8), np.zeros((4, 4))
    for task, out in (("tangent", A), ("residual", b), ("fields", fields)):
        kernels.add(task, out, [*w, *old.ravel()], p, vertices)
    assert close(A[np.ix_(at, at)], K[0])
    assert close(b[at], R[0])
    assert close(fields, batch.fields_at(X, u, **given)[0])


@pytest.mark.slow
@FEW
@given(d=pages())
def test_random_pages(d: Definition, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Cells of two mixed fields with data and history, against the batched kernel."""
    place = tmp_path_factory.mktemp("random")
    kernels, batch = cell_kernels(d, place), compiled(d, place)
    (s,) = random_states.admissible_states(d, 1)
    at, dim = emit_ufcx.vertex_positions(d), len(d.coordinates)
    w, vertices = np.empty(len(at)), np.zeros((d.nodes, 3))
    w[at] = s.dofs
    vertices[list(emit_ufcx.vertices(d)), :dim] = np.reshape(s.coordinates, (d.nodes, dim))
    X, u, old = (np.array([v], dtype=float) for v in (s.coordinates, s.dofs, s.point_data))
    known: dict[str, Any] = {"data": np.array([s.data]), "point_data": old}
    known["parameters"] = np.array(s.parameters)
    _, K = batch.tangent(X, u, **known)
    expected = batch.fields_at(X, u, **known)[0]
    A, fields = np.zeros(K.shape[1:]), np.zeros(expected.shape)
    for task, out in (("tangent", A), ("fields", fields)):
        kernels.add(task, out, [*w, *s.data, *old.ravel()], s.parameters, vertices)
    np.testing.assert_allclose(A[np.ix_(at, at)], K[0], rtol=0, atol=1e-13 * np.abs(K).max())
    np.testing.assert_allclose(fields, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_a_cell_without_a_solution_is_not_a_number(tmp_path: Path) -> None:
    kernels = cell_kernels(maxwell(), tmp_path)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float)
    A = np.zeros((8, 8))
    kernels.add("tangent", A, [*np.zeros(8), *np.full(16, -1e3)], [0.4, 2, 0.3, 1.5, 0.2], vertices)
    assert np.isnan(A).all()


# --- Orders of nodes for target `ufcx`: every element against basix, what basix has not is --------


NOT_NODAL = ("quad8", "hex20", "wedge15", "pyramid5")
NODAL = [name for name in ELEMENTS if ELEMENTS[name].lines is None and name not in NOT_NODAL]
KINDS = {
    "line": "interval",
    "tri": "triangle",
    "quad": "quadrilateral",
    "tet": "tetrahedron",
    "hex": "hexahedron",
    "wedge": "prism",
}


def laplace(e: Element) -> Definition:
    """Any potential that uses every node of an element."""
    m = Model("laplace", nodes=len(e.nodes), rule=e.rule)
    X = m.coordinates(*"XYZ"[: e.dimension])
    (u,) = m.nodal_unknowns("u")
    m.potential(sum(a * b**3 for x in X for a, b in zip(x, u, strict=True)))
    return m.finish()


def on_unit_cell(e: Element) -> Any:
    """Nodes (n, d) where basix has its cells: on [0, 1]."""
    places = np.array(e.nodes, dtype=np.float64)
    kind = e.name.rstrip("0123456789")
    if kind in ("line", "quad", "hex"):
        return (places + 1) / 2
    if kind == "wedge":
        places[:, 2] = (places[:, 2] + 1) / 2
    return places


def key(name: str) -> tuple[int, int]:
    return len(ELEMENTS[name].nodes), ELEMENTS[name].dimension


@pytest.mark.parametrize("name", NODAL)
def test_orders_are_those_of_basix(name: str) -> None:
    basix = pytest.importorskip("basix")
    cell = getattr(basix.CellType, KINDS[name.rstrip("0123456789")])
    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.equispaced
    elements = [basix.create_element(family, cell, degree, variant) for degree in (1, 2)]
    (theirs,) = (e.points for e in elements if len(e.points) == len(ELEMENTS[name].nodes))
    found = theirs[list(VERTEX_ORDER[key(name)])]
    np.testing.assert_allclose(found, on_unit_cell(ELEMENTS[name]), atol=1e-14)


@pytest.mark.parametrize("name", ["line2", "quad4", "hex8"])
def test_corners_are_in_tensor_order(name: str) -> None:
    """Without basix: the first coordinate runs fastest."""
    e = ELEMENTS[name]
    corners = np.array([p[::-1] for p in product((0, 1), repeat=e.dimension)])
    np.testing.assert_array_equal(corners[list(VERTEX_ORDER[key(name)])], on_unit_cell(e))


def test_every_element_is_ordered_or_refused() -> None:
    assert {key(n) for n in NODAL} | {(1, 0), (2, 0)} == set(VERTEX_ORDER)
    assert len({key(n) for n in ELEMENTS}) == len(ELEMENTS)
    for (count, _), order in VERTEX_ORDER.items():
        assert sorted(order) == list(range(count))


@pytest.mark.parametrize("name", ["tri6", "quad9", "tet10"])
def test_unknowns_and_coordinates_are_permuted(name: str) -> None:
    d = laplace(ELEMENTS[name])
    text = pipeline.compile_model(d, Target.UFCX).text
    for node, vertex in enumerate(VERTEX_ORDER[key(name)]):
        assert f" * w[{vertex}]  u{node + 1}\n" in text
    assert f"{node + 1} at {vertex}" in text


@pytest.mark.parametrize("name", NOT_NODAL)
def test_elements_without_a_counterpart_are_refused(name: str) -> None:
    count, dimension = key(name)
    with pytest.raises(TargetError, match=rf"{count} nodes and a rule in {dimension}-D; DOLFINx"):
        pipeline.compile_model(laplace(ELEMENTS[name]), Target.UFCX)
