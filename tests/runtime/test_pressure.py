"""A pressure follows the side it acts on: closed forms, exact tangents, what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from softehl import Mesh, Study
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.weak_form import Page
from softehl.runtime.discretisation.loads import Pressure
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.study import StudyError

MU, LAME = 0.4, 2.0
BODIES: dict[str, dict[str, Any]] = {
    "quad4": {},
    "tri6": {"shape": "triangle", "order": 2},
    "quad8": {"shape": "serendipity", "order": 2},
    "hex8": {},
    "wedge6": {"shape": "wedge"},
    "tet10": {"shape": "tetrahedron", "order": 2},
    "hex27": {"order": 2},
}


def neo_hooke(m: Fields) -> None:
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2)
    m.offer(tasks=["residual", "tangent"])


rubber = Page("rubber", neo_hooke, form="point")


def body(kind: str) -> Study:
    given = BODIES[kind]
    if CELLS[kind].dimension == 2:
        mesh = Mesh.rectangle(2.0, 1.0, cells=(3, 2), **given)
    else:
        mesh = Mesh.box((2.0, 1.0, 1.0), cells=(2, 1, 1), **given)
    study = Study(mesh)
    study.add("body", rubber, mu=MU, lame=LAME)
    return study


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=[pytest.mark.slow] * (k in ("hex27", "tet10"))) for k in BODIES]
)
def test_pressure_all_around_shrinks_a_body_alike(kind: str) -> None:
    """sigma = -p: mu (s^2 - 1) + lame d ln s = -p s^d with the stretch s in each of d directions.

    A dead load would have -p s^(d-1) of the undeformed sides.
    """
    p, study = 0.5, body(kind)
    d = study.mesh.dimension
    s = brentq(lambda s: MU * (s**2 - 1) + LAME * d * np.log(s) + p * s**d, 0.5, 1.0, xtol=1e-15)
    study.pressure("boundary", p)
    names = [f"u_{a}" for a in "xyz"[:d]]
    study.fix((0.0,) * d, **dict.fromkeys(names, 0.0))
    study.fix((2.0, *(0.0,) * (d - 1)), **dict.fromkeys(names[1:], 0.0))
    if d == 3:
        study.fix((0.0, 1.0, 0.0), u_z=0.0)
    result = study.solve(steps=2)
    for k, name in enumerate(names):
        expected = (s - 1.0) * study.mesh.points[:, k]
        np.testing.assert_allclose(result.values(name), expected, atol=1e-10)
    reactions = result.reaction(lambda x: x[:, 0] >= 0.0)
    assert max(abs(reactions[n]) for n in names) < 1e-10


@pytest.mark.parametrize("kind", ["line2", "line3", "tri3", "tri6", "quad4", "quad8", "quad9"])
def test_the_tangent_is_the_derivative_of_the_residual(kind: str, rng: np.random.Generator) -> None:
    face = CELLS[kind]
    flat = np.hstack([face.nodes, np.zeros((len(face.nodes), 1))])
    X = (flat[None] + 0.1 * rng.uniform(-1, 1, (3, *flat.shape))).reshape(3, -1)
    u = 0.2 * rng.uniform(-1, 1, X.shape)
    kernel = Pressure(face, lambda x, t: 1.0 + t * x[:, 0])
    given = {"parameters": np.array([0.7, 1.0])}
    r, K = kernel.tangent(X, u, **given)
    np.testing.assert_allclose(r, kernel.residual(X, u, **given))
    h = 1e-6
    for j in range(u.shape[1]):
        step = np.zeros_like(u)
        step[:, j] = h
        rise = kernel.residual(X, u + step, **given) - kernel.residual(X, u - step, **given)
        np.testing.assert_allclose(K[:, :, j], rise / (2 * h), atol=1e-9)
    wrong = K.copy()
    wrong[0, 0, -1] += 1e-6
    assert not np.allclose(wrong, K, rtol=0.0, atol=1e-9)


def test_a_face_of_two_cells_or_of_none_has_no_outside() -> None:
    mesh = Mesh.rectangle(2.0, 1.0, cells=(2, 1))
    for name, face in (("middle", [1, 4]), ("diagonal", [0, 4])):
        sides = {name: {"line2": np.array([face])}}
        study = Study(Mesh(mesh.points, mesh.cells, sides=sides))
        with pytest.raises(MeshError, match=r"the face at \(.*0\.5\) is of two cells or of none"):
            study.pressure(name, 1.0)


def test_what_is_refused() -> None:
    study = body("quad4")
    with pytest.raises(StudyError, match=r"pressure\('top', of=\['u_x'\]\): a displacement for"):
        study.pressure("top", 1.0, of=["u_x"])
    with pytest.raises(StudyError, match="pressure = nan: the number must be finite"):
        study.pressure("top", float("nan"))
    study.pressure("top", 1.0, of=("v_x", "u_y"))
    with pytest.raises(StudyError, match=r"no unknown 'v_x' .did you mean 'u_x'"):
        study.solve()
