"""Pages on facets: patch tests, order of interior penalty, and digits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import softehl
from softehl import Mesh, Study, load_kernel
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.mesh.cells import CELLS, jacobians
from softehl.runtime.mesh.interior_facets import turns
from softehl.runtime.mesh.mesh import MeshError
from tests.codegen.test_fields import differences

PAGE = Path(__file__).parents[2] / "docs" / "models" / "interior_penalty.py"


@softehl.page
def laplace(m: Any) -> None:
    """Grad u . grad u / 2."""
    u = m.scalar("u")
    m.minimise(m.grad(u).dot(m.grad(u)) / 2)


@softehl.page
def nitsche(m: Any) -> None:
    """u = 1 + 2 x - 3 y by Nitsche's method."""
    u, place = m.scalar("u"), m.position
    gap = u - 1 - 2 * place[0] + 3 * place[1]
    m.minimise(15 / m.size * gap**2 - m.grad(u).dot(m.normal) * gap)


def penalised(mesh: Mesh, gamma: float) -> Study:
    study = Study(mesh)
    study.add("jumps", PAGE, on="interior", model="facets", gamma=gamma)
    return study


@pytest.mark.parametrize(
    ("shape", "order", "cells"),
    [
        ("quad", 1, (3, 2)),
        ("triangle", 2, (3, 2)),
        pytest.param("hex", 1, (2, 2, 2), marks=pytest.mark.slow),
        ("tetrahedron", 1, (2, 1, 2)),
    ],
)
def test_a_linear_field_is_found_to_rounding(shape: Any, order: int, cells: Any) -> None:
    """On distorted cells that share no node, held at the boundary by Nitsche's method alone."""
    make = Mesh.rectangle if len(cells) == 2 else Mesh.box
    size: Any = (1.0, 1.0) if len(cells) == 2 else ((1.0, 1.0, 1.0),)
    mesh = make(*size, cells=cells, shape=shape, order=order)
    mesh = mesh.map(lambda x: x + 0.05 * np.sin(3 * np.roll(x, 1, axis=1))).split()
    assert len(mesh.points) == sum(nodes.size for nodes in mesh.cells.values())
    study = penalised(mesh, 30.0)
    study.add("body", laplace)
    study.add("held", nitsche, on="boundary")
    found = study.solve().values("u")
    np.testing.assert_allclose(found, 1 + 2 * mesh.points[:, 0] - 3 * mesh.points[:, 1], atol=2e-13)


@pytest.mark.parametrize("shape", ["quad", pytest.param("triangle", marks=pytest.mark.slow)])
def test_interior_penalty_has_order_two(shape: Any) -> None:
    errors = []
    for n in (4, 8, 16):
        mesh = Mesh.rectangle(1.0, 1.0, cells=(n, n), shape=shape).split()
        study = penalised(mesh, 10.0)
        study.add("body", PAGE, model="poisson")
        study.add("sides", PAGE, on="boundary", model="facets", gamma=10.0)
        errors.append(error(mesh, study.solve().values("u")))
    assert np.log2(errors[1] / errors[2]) > 1.9
    assert errors[2] < 5e-3


def error(mesh: Mesh, u: Array) -> float:
    """L2 norm of u less the product of sin(pi x) of all coordinates."""
    ((kind, cells),) = mesh.cells.items()
    at, weights = CELLS[kind].rule(8)
    N, places = CELLS[kind].shape(at), mesh.points[cells]
    X, found = np.einsum("qa,nad->dnq", N, places), np.einsum("qa,na->nq", N, u[cells])
    gap = found - np.sin(np.pi * X).prod(axis=0)
    return float(np.sqrt(np.sum(gap**2 * weights * jacobians(CELLS[kind], places, at))))


TRIANGLES = [(0.0, 0.0), (1.0, 0.2), (0.3, 0.9), (1.0, 0.2), (0.0, 0.0), (0.4, -0.8)]


def energy(u: Any, gamma: Any) -> Any:
    """Closed form of the page on the edge of two triangles: both jumps are linear along it."""
    X = [[mpmath.mpf(str(c)) for c in x] for x in TRIANGLES]
    slopes, areas = [], []
    for first in (0, 3):
        A = mpmath.matrix([[1, *X[first + k]] for k in range(3)])
        slopes.append(mpmath.lu_solve(A, mpmath.matrix(u[first : first + 3])))
        areas.append(mpmath.det(A) / 2)
    edge = [X[1][0] - X[0][0], X[1][1] - X[0][1]]
    length = mpmath.sqrt(edge[0] ** 2 + edge[1] ** 2)
    normal = [edge[1] / length, -edge[0] / length]
    flux = sum(
        n * (a + b) / 2 for n, a, b in zip(normal, slopes[0][1:], slopes[1][1:], strict=True)
    )
    a, b = u[0] - u[4], u[1] - u[3]
    size = (areas[0] + areas[1]) / 2 / length
    squares = length * (a * a + a * b + b * b) / 3
    return gamma / (2 * size) * squares - flux * length * (a + b) / 2


def test_residual_and_tangent_are_differences_of_a_closed_form_in_50_digits() -> None:
    kernel = load_kernel(PAGE, "facets", cell="tri3_interior")
    u = np.random.default_rng(4).uniform(-1, 1, 6)
    r, K = kernel.tangent(np.ravel(TRIANGLES)[None], u[None], parameters={"gamma": 3.0})
    with mpmath.workdps(50):
        at = [mpmath.mpf(v) for v in u]
        slope, curvature = differences(lambda v: energy(v, mpmath.mpf(3)), at)
        _, wrong = differences(lambda v: energy(v, mpmath.mpf(3) * (1 + mpmath.mpf(10) ** -9)), at)
    np.testing.assert_allclose(r[0], slope, atol=1e-13)
    np.testing.assert_allclose(K[0], curvature, atol=1e-13)
    assert np.abs(K[0] - wrong).max() > 1e-10


@pytest.mark.slow
def test_order_three_has_the_errors_of_step_74_of_deal_ii() -> None:
    """The table of its results, penalty p (p + 1) / h; the square is twice as wide here."""
    errors = []
    for n in (4, 8):
        mesh = Mesh.rectangle(2.0, 2.0, cells=(n, n), order=3).split()
        study = penalised(mesh, 12.0)
        study.add("body", PAGE, model="poisson")
        study.add("sides", PAGE, on="boundary", model="facets", gamma=12.0)
        errors.append(error(mesh, study.solve().values("u")) / 2)  # of the area
    np.testing.assert_allclose(errors, [0.00193285, 9.60497e-05], rtol=3e-6)


def test_what_has_no_facets_says_so() -> None:
    mesh = Mesh.rectangle(1.0, 1.0, cells=(1, 1))
    with pytest.raises(MeshError, match="no facet between two cells"):
        penalised(mesh, 1.0)
    with pytest.raises(MeshError, match="facets of wedge6"):
        turns("wedge6")
    with pytest.raises(ValueError, match="quadrilaterals of order 1 to 4"):
        load_kernel(laplace, cell="hex64_side")
    with pytest.raises(ValueError, match=r"m.size: quad4 is a cell here"):
        Study(mesh).add("body", nitsche)
    with pytest.raises(ValueError, match=r"laplace.* has m.jump or m.average"):
        load_kernel(laplace, cell="quad4_interior")
    with pytest.raises(StudyError, match='on="interior" or on=a side'):
        Study(mesh).add("body", load_kernel(PAGE, "facets", cell="quad4_interior"), gamma=1.0)
