"""Integrals of expressions over bodies, groups and sides."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Mesh, Result, Study, StudyError
from softehl.runtime.arrays import Array

BODY = Path(__file__).parents[2] / "docs" / "models" / "heat_fields.py"


@softehl.page
def rubber(m: softehl.Fields) -> None:
    """Neo-Hooke, with the stress P_xx as a field."""
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    F = m.deformation_gradient(m.vector("u"))
    J = m.define("J", F.det())
    I1 = m.define("I1", (F.T * F).trace())
    W = m.define("W", mu / 2 * (I1 - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2)
    m.minimise(W)
    P = m.derivative("P", W, F[0, 0])
    m.fields(P_xx=P)


def bent(**kind: Any) -> Result:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 2), **kind))
    study.add("body", rubber, mu=0.4, lame=0.6)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.05, u_y=0.01)
    return study.solve(steps=2)


def shoelace(corners: Array) -> float:
    x, y = corners.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def outline(mesh: Mesh) -> list[int]:
    """Nodes around a rectangle of quad4, counterclockwise."""
    x, y = mesh.points.T
    sides = [(y == 0, x), (x == 2, y), (y == 1, -x), (x == 0, -y)]
    nodes = [np.flatnonzero(on)[np.argsort(by[on])][:-1] for on, by in sides]
    return [int(n) for n in np.concatenate(nodes)]


def test_the_change_of_volume_is_that_of_the_outline() -> None:
    result = bent()
    nodes = outline(result.system.mesh)
    before, after = (p[nodes] for p in (result.system.mesh.points, result.deformed(("u_x", "u_y"))))
    change = shoelace(after) - shoelace(before)
    assert abs(change) > 1e-2
    assert result.integral("J - 1") == pytest.approx(change, rel=1e-12)
    assert result.integral("u_x * n_x", "right") != pytest.approx(change, rel=1e-2)


def test_energies_are_those_of_the_study() -> None:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 2)))
    study.add("body", rubber, mu=0.4, lame=0.6)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=lambda x, t: np.full(len(x), 0.01 * t))
    *_, motion = study.march(dt=0.5, until=2, method="newmark", mass={"body": {"rho": 0.1}})
    stored = motion.energy["internal"]  # type: ignore[attr-defined]
    assert motion.integral("energy") == pytest.approx(stored, rel=1e-12)
    text = "mu / 2 * (I1 - 3 - 2 * log(J)) + lame / 2 * log(J)**2"
    assert motion.integral(text) == pytest.approx(stored, rel=1e-12)
    assert motion.integral("W", block="body") == pytest.approx(stored, rel=1e-12)


@pytest.mark.parametrize("kind", [{}, {"order": 2}, {"shape": "triangle", "order": 2}])
def test_the_mean_stress_balances_loads(kind: Any) -> None:
    """Virtual work of the displacement x: the integral of P_xx is force times length."""
    result = bent(**kind)
    assert result.integral("P_xx") == pytest.approx(0.05 * 1.0 * 2.0, rel=1e-9)
    assert result.reaction("left")["u_x"] == pytest.approx(-0.05, rel=1e-9)


def test_volumes_areas_and_moments() -> None:
    box = Study(Mesh.box((2, 1, 3), cells=(2, 1, 2), shape="tetrahedron"))
    box.add("body", rubber, mu=0.4, lame=0.6)
    assert box.integral("1") == pytest.approx(6.0)
    assert box.integral("x * y", "top") == pytest.approx(2.0 * 0.5)
    assert box.integral("x * n_x + y * n_y + z * n_z", "boundary") == pytest.approx(3 * 6.0)
    outer = Mesh.rectangle(2, 1, cells=(2, 2)).map(lambda x: x + np.array([0, 3]))
    ring = Study(outer, "axisymmetric")
    ring.add("body", rubber, mu=0.4, lame=0.6)
    assert ring.integral("1") == pytest.approx(np.pi * (4**2 - 3**2) * 2)
    assert ring.integral("J") == pytest.approx(np.pi * (4**2 - 3**2) * 2)
    assert ring.integral("1", "top") == pytest.approx(2 * np.pi * 4 * 2)


def test_groups_add_up_to_the_body() -> None:
    mesh = Mesh.rectangle(2, 1, cells=(4, 2)).with_group("a", lambda x: x[:, 0] < 1)
    study = Study(mesh.with_group("b", lambda x: x[:, 0] > 1))
    for name, mu in (("a", 0.4), ("b", 0.8)):
        study.add(f"body {name}", rubber, cells=name, mu=mu, lame=0.6)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.05)
    result = study.solve()
    assert result.integral("mu") == pytest.approx(0.4 + 0.8)
    assert result.integral("P_xx") == pytest.approx(0.1)
    parts = [result.integral("W", name, block=f"body {name}") for name in "ab"]
    assert sum(parts) == pytest.approx(result.integral("energy"))
    with pytest.raises(StudyError, match="no element of 'body a' lies in 'b'"):
        result.integral("mu", "b", block="body a")


def test_means_are_of_volumes_and_areas() -> None:
    """Cells of unequal size, a body of two groups, a ring, a side and its force."""
    mesh = Mesh.rectangle(2, 1, cells=(4, 2)).map(
        lambda x: x * np.stack([x[:, 0], 1 + 0 * x[:, 0]], 1)
    )
    mesh = mesh.with_group("a", lambda x: x[:, 0] < 1).with_group("b", lambda x: x[:, 0] > 1)
    study = Study(mesh, geometry="axisymmetric")
    for name, mu in (("a", 0.4), ("b", 0.8)):
        study.add(f"body {name}", material="neo_hooke", cells=name, mu=mu, kappa=2.0)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    study.fix("right", u_x=0.1)
    result = study.solve()
    assert result.mean("x") == pytest.approx(2.0)  # of 0 to 4
    assert result.mean("y") == pytest.approx(2 / 3)  # of discs
    assert result.mean("mu") == pytest.approx((0.4 * 1 + 0.8 * 3) / 4)
    assert result.mean("mu", "b") == result.mean("mu", block="body b") == pytest.approx(0.8)
    assert result.mean("u_x", "right") == pytest.approx(0.1)
    assert result.mean("y", "top") == pytest.approx(1.0)
    volumes = result.integral("y", "right") / result.integral("1", "right")
    assert result.mean("y", "right") == pytest.approx(volumes, rel=1e-14)
    with pytest.raises(StudyError, match="'energy' alone has no values at points"):
        result.mean("energy")
    with pytest.raises(StudyError, match=r"^mean\('nu'\): no page has all of nu"):
        result.mean("nu")


def test_the_mean_strain_of_a_bar_is_that_of_its_ends() -> None:
    result = bent(order=2)
    assert result.mean("P_xx") == pytest.approx(0.05, rel=1e-9)
    assert result.mean("u_x", "right") * 1.0 == pytest.approx(result.integral("u_x", "right"))


def test_heat_content() -> None:
    study = Study(Mesh.rectangle(1.0, 0.5, cells=(6, 3), shape="triangle"))
    study.add("plate", str(BODY), k=1.0, c=2.0)
    study.initial(T=lambda x: 293 + 10 * x[:, 0])
    content = study.integral("c * T")
    assert content == pytest.approx(2.0 * (293 + 5) * 0.5)
    for result in study.march(dt=0.02, until=0.1):
        assert result.integral("c * T") == pytest.approx(content, rel=1e-12)
    assert result.integral("T") == pytest.approx(content / 2)
    assert result.integral("(T - 298)**2") < study.integral("(T - 298)**2")


def test_history_after_the_step() -> None:
    study = Study(Mesh.box((1, 1, 1), cells=(1, 1, 1)))
    study.add("bar", material="j2", E=100.0, nu=0.3, sy=1.0, H=2.0, H_kin=0.0)
    study.fix("left", u_x=0)
    study.fix("bottom", u_z=0)
    study.fix("front", u_y=0)
    study.fix("right", u_x=0.03)
    result = study.solve(steps=3)
    strain = (3.0 - 1.0) / (100.0 + 2.0)
    assert result.integral("alpha") == pytest.approx(strain, rel=1e-6)
    assert result.integral("sigma_xx") == pytest.approx(result.reaction("right")["u_x"], rel=1e-9)
    trial = 1.0 + 2.0 * strain + 3 * 100 / 2.6 * 0.01 * 100 / 102
    assert result.integral("q") == pytest.approx(trial, rel=1e-6)  # that the page names


def test_a_result_from_a_pickle_knows_what_its_page_names_if_that_is_a_file() -> None:
    study = Study(Mesh.rectangle(1.0, 0.5, cells=(2, 1)))
    study.add("plate", str(BODY), k=1.0, c=2.0)
    study.initial(T=lambda x: 3 * x[:, 0])
    assert study.integral("grad_T_0") == pytest.approx(1.5)
    again: Study = pickle.loads(pickle.dumps(study))
    assert again.integral("grad_T_0") == pytest.approx(1.5)


def test_mistakes_are_named() -> None:
    result = bent()
    for text, message in (
        ("J +", "invalid syntax"),
        ("J if J else 1", "is not allowed; an expression has names"),
        ("__import__('os')", "is not allowed"),
        ("min(J)", "is not allowed.*min and max of two values"),
        ("", "an expression is a text"),
        ("log(u_x - 9)", "has no finite value"),
        ("I2", "has no value 'I2'; it names u_x.*I1.*arguments: P_xx"),
    ):
        with pytest.raises(StudyError, match=message):
            result.integral(text)
    with pytest.raises(StudyError, match=r"no block 'bod' .did you mean 'body'"):
        result.integral("J", block="bod")
    with pytest.raises(softehl.MeshError, match="lef"):
        result.integral("1", "lef")
    with pytest.raises(StudyError, match="a group of cells or a side is named"):
        result.integral("1", lambda x: x[:, 0] > 1)  # type: ignore[arg-type]


def test_several_pages_with_a_name_are_refused() -> None:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 2)))
    study.add("one", rubber, mu=0.4, lame=0.6)
    study.add("two", rubber, mu=0.4, lame=0.6)
    with pytest.raises(StudyError, match=r"several pages have mu: say block=.*, one of one, two"):
        study.integral("mu")
    assert study.integral("mu", block="one") == pytest.approx(0.8)
    with pytest.raises(StudyError, match=r"no page has all of K; name its block.*one has P_xx"):
        study.integral("K")


def test_bars_have_no_volume() -> None:
    line = Mesh.line(2.0, cells=4)
    study = Study(Mesh(np.pad(line.points, ((0, 0), (0, 2))), dict(line.cells)))
    study.add("bar", element="truss", E=1.0, A=1.0)
    with pytest.raises(StudyError, match=r"quadrature of 'bar' .truss. is not that of its cells"):
        study.integral("stretch")
    assert study.integral("1") == pytest.approx(2.0)


def test_t_of_a_sheet_is_not_taken_for_the_time() -> None:
    study = Study(Mesh.rectangle(10, 1, cells=(2, 1)))
    study.add("sheet", element="plane_stress", E=1e3, nu=0.3, t=2.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=1.0)
    result = study.solve()
    with pytest.raises(StudyError, match="'t' is the time or load factor, and of block 'sheet'"):
        result.integral("t*sigma_xx")
    assert result.integral("t", block="sheet") == pytest.approx(20.0)
