"""Integrals outside pages on cells of every order: mass, loads, pressures, orientation, contact."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.special import eval_legendre

from softehl import Mesh, Model, Study, page, quadrature
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.loads import DeadLoad, Pressure
from softehl.runtime.discretisation.mass import lumped, mass_matrices
from softehl.runtime.equations.mass_matrix import mass_matrix
from softehl.runtime.mesh.cells import CELLS, Cell, lobatto
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.study import StudyError

LARGE = ("hex125", "hex216", "hex343")
KINDS = [k for k, c in CELLS.items() if c.dimension and k not in LARGE]
FACES = [k for k in KINDS if CELLS[k].dimension < 3]


def fine(cell: Cell) -> tuple[Array, Array]:
    """A rule far finer than any integrand here: Gauss, simplices by collapsed squares and cubes."""
    n = 20 if cell.dimension < 3 else 12
    x, w = leggauss(n)
    points = np.array(list(product(x, repeat=cell.dimension)))
    weights = np.prod(np.array(list(product(w, repeat=cell.dimension))), axis=1)
    flat = {3: 2, 4: 3, 6: 2}.get(cell.corners, 0) if cell.corners != 2**cell.dimension else 0
    if cell.corners == 5:
        points[:, 2], weights = (points[:, 2] + 1) / 2, weights / 2
        depth = 1 - points[:, 2]
        points[:, :2] *= depth[:, None]
        return points, weights * depth**2
    for d in range(flat):
        points[:, d], weights = (points[:, d] + 1) / 2, weights / 2
    for d in range(1, flat):
        for e in range(d):
            weights = weights * (1 - points[:, d])
            points[:, e] *= 1 - points[:, d]
    return points, weights


def curved(cell: Cell, dimension: int, seed: int = 3) -> Array:
    """Places (2, k, dimension) of the nodes of two bent cells, away from the axis y = 0."""
    rng = np.random.default_rng(seed)
    flat = np.pad(cell.nodes, ((0, 0), (0, dimension - cell.dimension)))
    size = 0.1 / cell.order**2
    places = flat[None] + size * rng.uniform(-1, 1, (2, *flat.shape))
    if dimension > 1:
        places[:, :, 1] += 3.0
    return np.asarray(places)


def measure(cell: Cell, places: Array, at: Array) -> Array:
    """Length, area or volume per parent one, (n, q)."""
    J = np.einsum("qkd,nkc->nqcd", cell.gradient(at), places)
    return np.asarray(np.sqrt(np.linalg.det(np.swapaxes(J, 2, 3) @ J)))


@pytest.mark.parametrize("ring", [False, True])
def test_mass_of_bent_cells_of_every_kind_is_exact(ring: bool) -> None:
    for kind in KINDS:
        cell = CELLS[kind]
        if ring and cell.dimension != 2:
            continue
        places = curved(cell, cell.dimension)
        at, weights = fine(cell)
        N = cell.shape(at)
        volume = measure(cell, places, at) * weights
        if ring:
            volume = volume * 2 * np.pi * (places[:, :, 1] @ N.T)
        want = np.einsum("nq,qa,qb->nab", volume, N, N, optimize=True)
        found = mass_matrices(cell, places, np.ones(2), ring=ring)
        assert np.abs(found - want).max() < 1e-12 * np.abs(want).max(), kind


def test_lumped_masses_of_lobatto_nodes_are_the_weights_of_their_rule() -> None:
    """2 / (p (p + 1) P_p(x)^2): explicit motions are then those of spectral elements."""
    for kind in ("line2", "line5", "quad9", "quad16", "quad49", "hex64"):
        cell = CELLS[kind]
        p = cell.order
        legendre = np.polynomial.Legendre.basis(p)
        places = np.round(cell.nodes, 12)
        want = np.prod(2 / (p * (p + 1) * legendre(places) ** 2), axis=1)
        mass = mass_matrices(cell, cell.nodes[None], np.ones(1), ring=False)
        np.testing.assert_allclose(lumped(mass)[0], want, rtol=1e-9)


def polynomial(degree: int) -> Any:
    """A function of places, of a degree in each coordinate, times t."""
    return lambda x, t: t * (1 + x[:, 0] ** degree - 0.5 * x[:, -1] ** degree)


@pytest.mark.parametrize("ring", [False, True])
def test_loads_of_the_order_of_the_face_have_exact_nodal_forces(ring: bool) -> None:
    for kind in FACES:
        face = CELLS[kind]
        if ring and face.dimension != 1:
            continue
        space = face.dimension + 1
        turn = np.linalg.qr(np.arange(space**2).reshape(space, space) % 5 + np.eye(space))[0]
        flat = np.pad(face.nodes, ((0, 0), (0, 1)))
        places = (flat @ turn.T + 3.0)[None]
        at, weights = fine(face)
        N = face.shape(at)
        x = np.einsum("qk,nkc->nqc", N, places)
        load = polynomial(face.order)(x[0], 0.7)
        area = measure(face, places, at)[0] * weights * (2 * np.pi * x[0, :, 1] if ring else 1)
        want = (load * area) @ N
        kernel = DeadLoad(face, polynomial(face.order), ring)
        given = {"parameters": np.array([0.7, 1.0])}
        found = -kernel.residual(places.reshape(1, -1), np.zeros((1, len(N[0]))), **given)[0]
        assert np.abs(found - want).max() < 1e-12 * np.abs(want).max(), kind


@pytest.mark.parametrize("ring", [False, True])
def test_pressures_of_the_order_of_the_face_have_exact_nodal_forces(ring: bool) -> None:
    """On faces that are straight at rest and bent now."""
    for kind in FACES:
        face = CELLS[kind]
        if ring and face.dimension != 1:
            continue
        space = face.dimension + 1
        X = np.pad(face.nodes, ((0, 0), (0, 1)))[None] + 2.0
        u = curved(face, space)[:1] - np.pad(face.nodes, ((0, 0), (0, 1))) + 0.3
        at, weights = fine(face)
        N = face.shape(at)
        load = polynomial(face.order)((N @ X[0]), 0.7)
        a = np.einsum("qkd,kc->qcd", face.gradient(at), (X + u)[0])
        if space == 2:
            normal = np.stack([a[:, 1, 0], -a[:, 0, 0]], axis=1)
        else:
            normal = np.cross(a[:, :, 0], a[:, :, 1])
        around = 2 * np.pi * (N @ (X + u)[0, :, 1]) if ring else 1.0
        want = np.einsum("q,qk,qc->kc", load * weights * around, N, normal).ravel()
        kernel = Pressure(face, polynomial(face.order), ring)
        given = {"parameters": np.array([0.7, 1.0])}
        found = kernel.residual(X.reshape(1, -1), u.reshape(1, -1), **given)[0]
        assert np.abs(found - want).max() < 1e-12 * np.abs(want).max(), kind


@page
def membrane(m: Any) -> None:
    """d2u/dt2 = div grad u."""
    u = m.scalar("u")
    m.weak(m.rate(u, order=2), u)
    m.weak(m.grad(u), m.grad(u))


def harmonic(n: int, x: Array, *, ring: bool) -> tuple[Array, Array, Array]:
    """A polynomial of degree n without sources, and its slopes along x and y: the real part of
    (x + i y)^n; on rings R^n P_n(x / R) with the distance R from the origin.
    """
    z = x[:, 0] + 1j * x[:, 1]
    if not ring:
        slope = n * z ** (n - 1)
        return np.real(z**n), np.real(slope), -np.imag(slope)
    R = np.abs(z)
    value, lower = (R**k * eval_legendre(k, x[:, 0] / R) for k in (n, n - 1))
    return value, n * lower, n * (value - x[:, 0] * lower) / x[:, 1]


CASES = [(p, ring) for ring in (False, True) for p in range(1, 7)]
QUICK = [(3, False), (6, True)]


@pytest.mark.parametrize(
    ("order", "ring"),
    [pytest.param(*c, marks=[] if c in QUICK else [pytest.mark.slow]) for c in CASES],
)
def test_fluxes_and_masses_of_a_study(order: int, ring: bool) -> None:
    """A harmonic polynomial of the order by its fluxes; the mass of the page and that by rho."""
    mesh = Mesh.rectangle(1.2, 1.0, cells=(2, 1), order=order).map(lambda x: x + 0.2 * np.eye(2)[1])
    study = Study(mesh, geometry="axisymmetric" if ring else None)
    study.add("body", membrane)
    study.fix("left", u=lambda x, t: t * harmonic(order, x, ring=ring)[0])
    study.load("right", u=lambda x, t: t * harmonic(order, x, ring=ring)[1])
    study.load("top", u=lambda x, t: t * harmonic(order, x, ring=ring)[2])
    study.load("bottom", u=lambda x, t: -t * harmonic(order, x, ring=ring)[2])
    want = harmonic(order, mesh.points, ring=ring)[0]
    np.testing.assert_allclose(study.solve().values("u"), want, atol=1e-11)
    system = study.system()
    given = system, system.resting(), system.at_rest()
    own = mass_matrix(*given, None).toarray()
    both = mass_matrix(*given, {"body": {"rho": 2.0, "of": ["u"]}}).toarray()
    assert own.sum() == pytest.approx(1.2 * (2 * np.pi * 0.7 if ring else 1.0), rel=1e-12)
    np.testing.assert_allclose(both, 3.0 * own, atol=1e-13)


def test_a_cell_that_folds_between_the_corners_is_refused() -> None:
    """A node inside moved over its neighbour: 2 points a direction do not see it."""
    mesh = Mesh.rectangle(1.0, 1.0, cells=(1, 1), order=6)
    points = mesh.points.copy()
    x = lobatto(6)
    middle = int(np.abs(points - 0.5 * (1 + np.array([x[3], x[3]]))).sum(axis=1).argmin())
    points[middle] += [0.2, 0.0]
    with pytest.raises(MeshError, match="1 of 1 quad49 are turned inside out"):
        Study(Mesh(points, mesh.cells))


def test_a_mass_without_shape_functions_is_refused() -> None:
    m = Model("odd", nodes=4, rule=quadrature.gauss(2, 2))
    m.coordinates("X", "Y")
    (u,) = m.nodal_unknowns("u", nodes=3)
    m.potential(m.integral("Pi", sum(v**2 for v in u)))
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1)))
    study.add("body", m.finish())
    with pytest.raises(StudyError, match="u stands at 3 nodes of quad4, neither at all nor"):
        study.solve(until=0.0).modes(1, mass={"body": {"rho": 1.0, "of": ["u"]}})


@pytest.mark.parametrize("order", [3, 6])
def test_contact_of_sides_of_high_order_is_refused(order: int) -> None:
    low = Mesh.rectangle(1.0, 1.0, cells=(1, 1), order=order)
    study = Study(Mesh.union(low=low, high=low.map(lambda x: x + np.eye(2)[1])))
    with pytest.raises(StudyError, match=f"line{order + 1} cannot touch; line2, line3 can"):
        study.contact("low:top", "high:bottom")
