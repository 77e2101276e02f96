"""Every element in a study: linear fields exactly on distorted meshes, orders of convergence."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl import Definition, Mesh, Model, Study, element, kinematics
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import CELLS

SHAPES: dict[str, dict[str, Any]] = {
    "line2": {},
    "line3": {"order": 2},
    "tri3": {"shape": "triangle"},
    "tri6": {"shape": "triangle", "order": 2},
    "quad4": {"shape": "quad"},
    "quad8": {"shape": "serendipity", "order": 2},
    "quad9": {"shape": "quad", "order": 2},
    "tet4": {"shape": "tetrahedron"},
    "tet10": {"shape": "tetrahedron", "order": 2},
    "wedge6": {"shape": "wedge"},
    "wedge15": {"shape": "wedge", "order": 2},
    "pyramid5": {"shape": "pyramid"},
    "hex8": {"shape": "hex"},
    "hex20": {"shape": "serendipity", "order": 2},
    "hex27": {"shape": "hex", "order": 2},
}
ORDER = {name: int(CELLS[name].nodes.shape[0] > CELLS[name].corners) + 1 for name in SHAPES}


def unit_mesh(name: str, n: int) -> Mesh:
    """[0, 1]^d with n cells along each side."""
    given = SHAPES[name]
    dimension = CELLS[name].dimension
    if dimension == 1:
        return Mesh.line(1.0, cells=n, **given)
    if dimension == 2:
        return Mesh.rectangle(1.0, 1.0, cells=(n, n), **given)
    return Mesh.box((1.0, 1.0, 1.0), cells=(n, n, n), **given)


def bent(x: Array) -> Array:
    """Places of the nodes of a mesh whose inner nodes are moved, mildly and smoothly."""
    bump = np.prod(x * (1.0 - x), axis=1, keepdims=True) * 4.0 ** (x.shape[1] - 1)
    return np.asarray(x + 0.08 * bump * np.sin(3.0 * x + np.arange(x.shape[1])))


@cache
def poisson(name: str) -> Definition:
    """-k div(grad u) = (k - 1) f with f = d pi^2 prod sin(pi x): no source for k = 1."""
    kind = element(name)
    m = Model(f"poisson_{name}", nodes=len(kind.nodes), rule=kind.rule)
    X = m.coordinates(*"XYZ"[: kind.dimension])
    (u,) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="conductivity")
    point = m.point()
    e = kinematics.isoparametric(m, X, kind.gradient(*point))
    slopes = [sum(d[c] * v for d, v in zip(e.dN, u, strict=True)) for c in range(kind.dimension)]
    x = [
        sum(N * v for N, v in zip(kind.shape(*point), X[c], strict=True))
        for c in range(kind.dimension)
    ]
    value = sum(N * v for N, v in zip(kind.shape(*point), u, strict=True))
    source = kind.dimension * sp.pi**2 * sp.prod([sp.sin(sp.pi * c) for c in x])
    density = k * sum(s**2 for s in slopes) / 2 - (k - 1) * source * value
    m.potential(m.integral("Pi", density * e.detJ))
    m.fields(u=value, **{f"x_{c}": v for c, v in enumerate(x)}, detJ=e.detJ)
    m.offer(tasks=["residual", "tangent", "fields"])
    return m.finish()


def straightened(mesh: Mesh, name: str) -> Mesh:
    """The mesh with the middle nodes of its tetrahedra half-way between corners.

    With curved edges four points are no longer exact.
    """
    points, cell = mesh.points.copy(), CELLS[name]
    flat = CELLS["tet4"].shape(cell.nodes)
    for nodes in mesh.cells[name]:
        points[nodes] = flat @ mesh.points[nodes[:4]]
    return mesh.map(lambda _: points)


EVERY = [
    pytest.param(name, marks=[pytest.mark.slow] if name in ("hex20", "hex27", "wedge15") else [])
    for name in SHAPES
]


@pytest.mark.parametrize("name", EVERY)
def test_order_of_convergence(name: str) -> None:
    """-div(grad u) = d pi^2 prod sin(pi x), k = 2: the error in L2 falls with order + 1."""
    errors = []
    sizes = (8, 16) if CELLS[name].dimension < 3 else (4, 8)
    sizes = (3, 6) if name in ("hex27", "hex20", "tet10", "wedge15") else sizes
    for n in sizes:
        mesh = unit_mesh(name, n)
        study = Study(mesh)
        study.add("body", poisson(name), k=2.0)
        study.fix("left" if mesh.dimension == 1 else "boundary", u=0.0)
        if mesh.dimension == 1:
            study.fix("right", u=0.0)
        result = study.solve()
        fields = result.fields("body")
        places = np.stack([fields[f"x_{c}"] for c in range(mesh.dimension)], axis=2)
        exact = 0.5 * np.prod(np.sin(np.pi * places), axis=2)
        # the mean over the page's own points stands for the integral
        errors.append(np.sqrt(float(((fields["u"] - exact) ** 2 * fields["detJ"]).mean())))
    order = np.log2(errors[0] / errors[1])
    assert order > ORDER[name] + 1 - 0.35
