"""Quadrilaterals and hexahedra of order 3 to 6: meshes, patches, orders of convergence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.polynomial import legendre
from scipy.interpolate import BarycentricInterpolator

from softehl import Mesh, Study, element, page
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import MeshError

KINDS = [
    *(f"{shape}{(p + 1) ** d}" for d, shape in ((1, "line"), (2, "quad")) for p in range(3, 7)),
    "hex64",
    "hex125",
]


def lobatto(order: int) -> Array:
    """Ends and extremes of Legendre's polynomial."""
    inner = legendre.legroots(legendre.legder([0.0] * order + [1.0]))
    return np.concatenate([[-1.0], np.sort(inner.real), [1.0]])


@pytest.mark.parametrize("kind", KINDS)
def test_shape_functions_are_products_of_interpolating_polynomials(kind: str) -> None:
    cell = CELLS[kind]
    order = cell.order
    grid = lobatto(order)
    at = np.random.default_rng(3).uniform(-1, 1, (5, cell.dimension))
    values, slopes = np.ones((5, len(cell.nodes))), np.ones((5, len(cell.nodes), cell.dimension))
    for a, place in enumerate(cell.nodes):
        for d, c in enumerate(place):
            number = int(np.abs(grid - c).argmin())
            assert abs(grid[number] - c) < 1e-14
            line = BarycentricInterpolator(grid, np.eye(order + 1)[number])
            values[:, a] *= line(at[:, d])
            for by in range(cell.dimension):
                slopes[:, a, by] *= line.derivative(at[:, d]) if by == d else line(at[:, d])
    np.testing.assert_allclose(cell.shape(at), values, atol=1e-13)
    np.testing.assert_allclose(cell.gradient(at), slopes, atol=1e-12)
    written = element(kind.rstrip("0123456789"), order=order)
    assert written.name == kind
    np.testing.assert_allclose(np.array(written.nodes, dtype=float), cell.nodes, atol=1e-15)
    if cell.dimension < 3:
        point = [sp.Rational(float(x)) for x in at[0]]
        found = np.array([float(v) for v in written.shape(*point)])
        np.testing.assert_allclose(found, values[0], atol=1e-13)


def test_orders_that_there_are_not_are_refused() -> None:
    with pytest.raises(ValueError, match="order = 7 of hex: allowed is 1 to 6"):
        element("hex", order=7)
    with pytest.raises(ValueError, match="no shape 'cube' of elements; there are line, quad, hex"):
        element("cube", order=2)
    with pytest.raises(MeshError, match="order = 7: quad cells have order 1 to 6"):
        Mesh.rectangle(1, 1, cells=(1, 1), order=7)
    with pytest.raises(MeshError, match="order = 3: triangle cells have order 1 or 2"):
        Mesh.rectangle(1, 1, cells=(1, 1), order=3, shape="triangle")


@page
def poisson(m: Any) -> None:
    """-div(grad u) = f with f = d pi^2 prod sin(pi x) for k = 1, no source for k = 0."""
    u = m.scalar("u")
    (k,) = m.parameters(k="whether there is a source")
    x = list(m.position)
    source = len(x) * sp.pi**2 * sp.prod([sp.sin(sp.pi * c) for c in x])
    slopes = m.grad(u)
    m.minimise(slopes.dot(slopes) / 2 - k * source * u)
    m.fields(error=u - source / (len(x) * sp.pi**2))


def bent(x: Array) -> Array:
    """Places of nodes of a mesh whose inner nodes are moved, smoothly."""
    bump = np.prod(x * (1.0 - x), axis=1, keepdims=True) * 4.0 ** (x.shape[1] - 1)
    return np.asarray(x + 0.08 * bump * np.sin(3.0 * x + np.arange(x.shape[1])))


def unit(kind: str, n: int) -> Mesh:
    """[0, 1]^d with n cells along each side."""
    cell = CELLS[kind]
    if cell.dimension == 1:
        return Mesh.line(1.0, cells=n, order=cell.order)
    if cell.dimension == 2:
        return Mesh.rectangle(1.0, 1.0, cells=(n, n), order=cell.order)
    return Mesh.box((1.0, 1.0, 1.0), cells=(n, n, n), order=cell.order)


def solved(mesh: Mesh, k: float, given: Any) -> Array:
    """The unknowns at the nodes."""
    study = Study(mesh)
    study.add("body", poisson, k=k)
    for side in ("left", "right") if mesh.dimension == 1 else ("boundary",):
        study.fix(side, u=given)
    return study.solve().values("u")


@pytest.mark.parametrize(
    "kind", ["line5", "quad16", "quad49", pytest.param("hex64", marks=pytest.mark.slow)]
)
def test_patch(kind: str) -> None:
    mesh = unit(kind, 2).map(bent)
    slope = np.array([1.0, -2.0, 0.5])[: mesh.dimension]
    found = solved(mesh, 0.0, lambda x, t: t * x @ slope)
    np.testing.assert_allclose(found, mesh.points @ slope, atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "sizes"),
    [
        *(("quad16", (3, 6)), ("quad25", (2, 4))),
        pytest.param("quad36", (1, 2), marks=pytest.mark.slow),
        pytest.param("hex64", (2, 4), marks=pytest.mark.slow),
    ],
)
def test_order_of_convergence(kind: str, sizes: tuple[int, int]) -> None:
    """The error at the points of the quadrature falls with order + 1."""
    errors = []
    for n in sizes:
        mesh = unit(kind, n)
        study = Study(mesh)
        study.add("body", poisson, k=1.0)
        study.fix("boundary", u=0.0)
        error = study.solve().fields("body")["error"]
        errors.append(float(np.sqrt((error**2).mean())))
    assert np.log2(errors[0] / errors[1]) > CELLS[kind].order + 1 - 0.5


def test_high_orders_have_no_file_format(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="quad16: cells of order 3 and more cannot be written"):
        unit("quad16", 1).write(tmp_path / "mesh.msh")
