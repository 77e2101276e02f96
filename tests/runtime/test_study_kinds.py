"""Every element, heat or solid, under random supports and loads: the patch's solution or an error.

A linear field is prescribed on some sides, its exact tractions or fluxes act on the others; or one
thing is wrong, and must be refused in one line.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softehl import Definition, Mesh, Model, Study, element, kinematics
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.study import StudyError
from tests.runtime.test_study_elements import bent, straightened, unit_mesh

REFUSED = (StudyError, MeshError, NotConverged, ProblemError)
G, LAME, K = 1.3, 0.7, 2.5
NORMALS = {"left": (0, -1), "right": (0, 1), "bottom": (1, -1), "top": (1, 1)}
BOX = {"left": (0, -1), "right": (0, 1), "front": (1, -1), "back": (1, 1)}
BOX |= {"bottom": (2, -1), "top": (2, 1)}
SIDES = {1: {"left": (0, -1), "right": (0, 1)}, 2: NORMALS, 3: BOX}
QUICK = ["line3", "tri3", "quad4", "quad8", "tet4"]
LONG = ["line2", "tri6", "quad9", "tet10", "wedge6", "hex8", "hex20", "hex27"]
MISTAKES = ["", "", "", "no support", "twice", "unknown", "side", "kind", "not finite"]


@cache
def page(kind: str, physics: str) -> Definition:
    """Hooke's or Fourier's law in the dimension of the element."""
    cell = element(kind)
    m = Model(f"{physics}_{kind}", nodes=len(cell.nodes), rule=cell.rule)
    X = m.coordinates(*"XYZ"[: cell.dimension])
    names = ["T"] if physics == "heat" else [f"u_{c}" for c in "xyz"[: cell.dimension]]
    u = m.nodal_unknowns(*names)
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    grad = m.define("grad", sp.Matrix(u) * sp.Matrix(e.dN))
    if physics == "heat":
        (k,) = m.parameters(k="conductivity")
        density = k / 2 * (grad * grad.T).trace()
    else:
        shear, lame = m.parameters(G="shear modulus", lame="Lame's first parameter")
        strain = (grad + grad.T) / 2
        density = shear * (strain * strain).trace() + lame / 2 * strain.trace() ** 2
    m.potential(m.integral("Pi", density * e.detJ))
    m.offer(tasks=["residual", "tangent"])
    return m.finish()


def mesh_of(kind: str) -> Mesh:
    mesh = unit_mesh(kind, 2).map(bent)
    return straightened(mesh, kind) if kind == "tet10" else mesh


def flux_of(slope: Array, physics: str) -> Array:
    """Heat flux or stress of the linear field."""
    if physics == "heat":
        return K * slope
    return np.asarray(G * (slope + slope.T) + LAME * np.trace(slope) * np.eye(len(slope)))


def solved(kind: str, physics: str, slope: Array, held: set[str], wrong: str) -> tuple[Any, Any]:
    """The study's mesh and result, with the field slope x + 0.1 on the sides held."""
    mesh = mesh_of(kind)
    study = Study(mesh)
    given: dict[str, Any] = {"k": K} if physics == "heat" else {"G": G, "lame": LAME}
    other = "quad4" if kind != "quad4" else "tri3"
    study.add("body", page(other if wrong == "kind" else kind, physics), **given)
    flux = flux_of(slope, physics)
    names = ["T"] if physics == "heat" else [f"u_{c}" for c in "xyz"[: mesh.dimension]]
    for side, (axis, sign) in SIDES[mesh.dimension].items():
        for i, name in enumerate(names):
            if side in held:
                study.fix(side, **{name: lambda x, t, i=i: t * (x @ slope[i] + 0.1)})
            else:
                study.load(side, **{name: float(sign * flux[i, axis])})
    if wrong == "twice":
        study.fix(sorted(held)[0], **{names[0]: 0.7})
    elif wrong == "unknown":
        study.fix("left", u_q=0.0)
    elif wrong == "side":
        study.load("outside", **{names[0]: 1.0})
    elif wrong == "not finite":
        study.fix("left", **{names[0]: lambda x, t: np.full(len(x), np.nan)})
    return mesh, study.solve()


def check(kind: str, physics: str, numbers: list[float], held: set[str], wrong: str) -> None:
    d = CELLS[kind].dimension
    if physics == "solid" and d == 1:
        physics = "heat"
    slope = np.array(numbers)[: d * d].reshape(d, d)[: 1 if physics == "heat" else d]
    held = {side for side in held if side in SIDES[d]} or {"left"}
    if wrong == "no support":
        assume(np.any(flux_of(slope, physics)))  # without loads, rest is a solution
        held = set()
    complaint, found = "", None
    try:
        found = solved(kind, physics, slope, held, wrong)
    except REFUSED as error:
        complaint = str(error)
    if found is None:
        assert wrong, f"refused: {complaint}"
        assert "\n" not in complaint
        return
    mesh, result = found
    assert not wrong, f"{wrong} was not seen"
    for i, name in enumerate(result.system.numbering.layout.names):
        exact = mesh.points @ slope[i] + 0.1
        np.testing.assert_allclose(result.values(name), exact, atol=1e-11)


NUMBERS = st.lists(st.integers(-20, 20).map(lambda k: k / 50), min_size=9, max_size=9)
HELD = st.sets(st.sampled_from(sorted(BOX)), min_size=1, max_size=4)
CASES = st.tuples(st.sampled_from(["solid", "heat"]), NUMBERS, HELD, st.sampled_from(MISTAKES))


@pytest.mark.parametrize("kind", QUICK)
@settings(max_examples=8, deadline=None, derandomize=True)
@given(case=CASES)
def test_a_linear_field_or_an_error(
    kind: str, case: tuple[str, list[float], set[str], str]
) -> None:
    physics, numbers, held, wrong = case
    check(kind, physics, numbers, held, wrong)


@pytest.mark.slow
@pytest.mark.parametrize("kind", LONG)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(case=CASES)
def test_a_linear_field_or_an_error_of_more_elements(
    kind: str, case: tuple[str, list[float], set[str], str]
) -> None:
    physics, numbers, held, wrong = case
    check(kind, physics, numbers, held, wrong)


def test_a_wrong_patch_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The oracle's own test: with another modulus in its tractions, it fails."""
    numbers, held = [0.1, 0.2, 0.3, 0.1, 0.0, 0.2, 0.1, 0.1, 0.1], {"left"}
    check("quad4", "solid", numbers, held, "")
    right = flux_of
    monkeypatch.setitem(globals(), "flux_of", lambda slope, physics: 1.01 * right(slope, physics))
    with pytest.raises(AssertionError, match="Not equal"):
        check("quad4", "solid", numbers, held, "")
