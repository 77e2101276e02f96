"""Parameters that differ from element to element, node to node or point to point."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import softehl
from softehl import ArgumentError, Mesh, Study, StudyError
from softehl.runtime.arrays import Array


def graded(x: Array) -> Array:
    """A shear modulus that grows along the bar."""
    return np.asarray(0.4 + 0.1 * x[:, 0])


@softehl.page
def rubber(m: softehl.Fields) -> None:
    """Neo-Hooke, compressible."""
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    m.require(mu > 0)
    _body(m, mu, lame)


@softehl.page
def rubber_of_position(m: softehl.Fields) -> None:
    """The same with a modulus of the place."""
    (lame,) = m.parameters(lame="first Lame parameter")
    _body(m, m.define("mu", 0.4 + 0.1 * m.position[0]), lame)


def _body(m: softehl.Fields, mu: Any, lame: Any) -> None:
    import sympy as sp

    F = m.deformation_gradient(m.vector("u"))
    ln_J = m.define("ln_J", sp.log(F.det()))
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * ln_J) + lame / 2 * ln_J**2)


def study_of(mesh: Mesh, page: Any = rubber, **parameters: Any) -> Study:
    study = Study(mesh)
    study.add("body", page, lame=0.6, **parameters)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=0.02)
    return study


MESH = Mesh.rectangle(2, 1, cells=(4, 2))


@pytest.mark.parametrize("kind", [{}, {"shape": "triangle", "order": 2}])
def test_values_at_points_are_those_of_a_page_that_knows_the_place(kind: Any) -> None:
    mesh = Mesh.rectangle(2, 1, cells=(4, 2), **kind)
    known = study_of(mesh, rubber_of_position).solve(steps=2)
    by_function = study_of(mesh, mu=graded).solve(steps=2)
    by_node = study_of(mesh, mu=graded(mesh.points)).solve(steps=2)
    assert np.allclose(by_function.x, known.x, rtol=0, atol=1e-12)
    assert np.allclose(by_node.x, known.x, rtol=0, atol=1e-12)
    other = study_of(mesh, mu=lambda x: 1.001 * graded(x)).solve(steps=2)
    assert np.abs(other.x - known.x).max() > 1e-5


def test_an_array_by_element_is_a_block_for_each_modulus() -> None:
    halves = MESH.with_group("soft", lambda x: x[:, 0] < 1).with_group(
        "hard", lambda x: x[:, 0] > 1
    )
    two = Study(halves)
    for name, mu in (("soft", 0.3), ("hard", 0.7)):
        two.add(name, rubber, cells=name, mu=mu, lame=0.6)
    two.fix("left", u_x=0, u_y=0)
    two.load("right", u_y=0.02)
    centres = MESH.points[MESH.cells["quad4"]].mean(axis=1)[:, 0]
    moduli = np.where(centres < 1, 0.3, 0.7)
    expected = two.solve().at((2, 1))["u_y"]
    for given in (moduli, moduli[:, None], np.repeat(moduli[:, None], 4, axis=1)):
        assert study_of(MESH, mu=given).solve().at((2, 1))["u_y"] == pytest.approx(expected, 1e-12)


@pytest.mark.parametrize("given", [np.full(8, 0.4), np.full((8, 4), 0.4)])
def test_derivatives_add_up_to_those_by_one_number(given: Array) -> None:
    one = study_of(MESH, mu=0.4).solve(steps=2)
    many = study_of(MESH, mu=given).solve(steps=2)
    by: Any = {"body": ["mu", "lame"]}
    slope, slopes = (r.sensitivity("u_y", at=(2, 1), by=by) for r in (one, many))
    assert np.shape(slopes["body", "mu"]) == (given.size,)
    assert np.sum(slopes["body", "mu"]) == pytest.approx(slope["body", "mu"], 1e-10)
    direct = many.derivative(by={"body": ["mu"]}).sum(axis=1)
    assert np.allclose(direct, one.derivative(by={"body": ["mu"]})[:, 0], rtol=1e-9)
    mu = ("body", "mu")
    curved, curves = (r.hessian("u_y", at=(2, 1), by=by) for r in (one, many))
    assert np.sum(curves[mu, mu]) == pytest.approx(curved[mu, mu], 1e-9)
    assert np.sum(curves[mu, ("body", "lame")]) == pytest.approx(curved[mu, ("body", "lame")], 1e-9)


def test_a_fit_finds_the_moduli_of_points() -> None:
    mesh = Mesh.rectangle(1, 1, cells=(1, 1))
    moduli = np.array([[0.4, 0.5, 0.6, 0.7]])
    study = study_of(mesh, mu=moduli)
    half = study.solve(until=0.5)
    whole = study.solve(start=half)
    measured: Any = {
        place: {n: [half.at(place)[n], whole.at(place)[n]] for n in ("u_x", "u_y")}
        for place in ((1.0, 0.0), (1.0, 1.0))
    }
    fit = study_of(mesh, mu=np.full((1, 4), 0.5)).fit(measured, by={"body": ["mu"]}, steps=2)
    assert np.allclose(fit.values["body", "mu"], moduli[0], rtol=1e-6)


def test_a_study_with_values_at_points_can_be_copied_and_pickled() -> None:
    study = study_of(MESH, mu=graded(MESH.points))
    expected = study.solve().x
    assert np.array_equal(copy.copy(study).solve().x, expected)
    assert np.array_equal(pickle.loads(pickle.dumps(study)).solve().x, expected)


def test_other_shapes_are_refused_with_those_that_are_allowed() -> None:
    allowed = r"\(8,\) or \(8, 1\) by element, \(8, 4\) by integration point, \(15,\) by node"
    for wrong in (np.ones(7), np.ones((8, 3)), np.ones((15, 1)), np.ones((8, 4, 1))):
        with pytest.raises(
            StudyError, match=rf"mu: given .*{wrong.ndim and wrong.shape[0]}.*{allowed}"
        ):
            study_of(MESH, mu=wrong)
    with pytest.raises(StudyError, match="nan at \\(3, 0\\): numbers must be finite"):
        study_of(MESH, mu=np.where(np.arange(8)[:, None] == 3, np.nan, np.ones((8, 4))))
    with pytest.raises(StudyError, match=r"\(32,\) of them is needed; given .* \(32, 2\)"):
        study_of(MESH, mu=lambda x: x)


def test_as_many_elements_as_nodes_are_refused() -> None:
    angles = 2 * np.pi / 3 * np.arange(3)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    ring = [[k, 3 + k, 3 + (k + 1) % 3] for k in range(3)]
    ring += [[k, 3 + (k + 1) % 3, (k + 1) % 3] for k in range(3)]
    study = Study(Mesh(np.vstack([circle, 2 * circle]), {"tri3": np.array(ring)}))
    with pytest.raises(StudyError, match=r"one by element or one by node, there are 6 of both"):
        study.add("body", rubber, mu=np.ones(6), lame=0.6)
    study.add("body", rubber, mu=np.ones((6, 1)), lame=0.6)


def test_conditions_of_the_page_hold_at_every_point() -> None:
    for wrong in (np.full(8, -1.0), np.full((8, 4), -1.0)):
        with pytest.raises(ArgumentError, match="mu = -1, must be > 0"):
            study_of(MESH, mu=wrong).solve()


def test_an_element_of_the_library_takes_arrays_by_element() -> None:
    line = Mesh.line(2.0, cells=4)
    mesh = Mesh(np.pad(line.points, ((0, 0), (0, 2))), dict(line.cells))

    def end(E: Any) -> float:
        study = Study(mesh)
        study.add("bar", element="truss", E=E, A=1.0)
        study.fix(np.arange(len(mesh.points)), u_y=0, u_z=0)
        study.fix((0.0, 0.0, 0.0), u_x=0)
        study.load((2.0, 0.0, 0.0), u_x=1e-6)
        return float(study.solve().at((2.0, 0.0, 0.0))["u_x"])

    moduli = np.array([10.0, 20.0, 30.0, 40.0])
    assert end(moduli) == pytest.approx(1e-6 * 0.5 * np.sum(1 / moduli), 1e-5)
    with pytest.raises(StudyError, match="outside of an integral; give an array by element"):
        end(np.full(5, 10.0))


def test_a_definition_keeps_one_number_for_all_elements() -> None:
    with pytest.raises(StudyError, match="one number for all elements; declare"):
        study_of(MESH, rubber.definition("quad4"), mu=np.full(8, 0.4))
