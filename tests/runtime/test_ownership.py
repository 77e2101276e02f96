"""Public objects keep what they were made of, whatever happens to it, and can be copied."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softehl
from softehl import Mesh, Result, Study
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.mesh.mesh import MeshError

QUAD = np.array([[0, 1, 2, 3]])
E = 10.0


def square() -> Any:
    return np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def stretch(x: np.ndarray, t: float) -> np.ndarray:
    return 0.1 * t * np.ones(len(x))


def bar(mesh: Mesh | None = None, load: Any = stretch) -> Study:
    study = Study(mesh or Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("bar", material="hooke", E=E, nu=0.0)
    study.fix("left", u_x=0)
    study.fix("bottom", u_y=0)
    study.load("right", u_x=load)
    return study


# ------------------------------------------------------------------------------------------ meshes


def test_a_mesh_keeps_its_own_arrays() -> None:
    points, cells, numbers = square(), QUAD.copy(), np.arange(4)
    group, side = np.array([0]), np.array([[1, 2]])
    kinds = {"quad4": cells}
    mesh = Mesh(points, kinds, {"all": {"quad4": group}}, {"right": {"line2": side}}, numbers)
    points *= 3.0
    for array in (cells, numbers, group, side):
        array += 1
    kinds["tri3"] = cells[:, :3]
    np.testing.assert_array_equal(mesh.points, square())
    np.testing.assert_array_equal(mesh.cells_of("all")["quad4"], QUAD)
    np.testing.assert_array_equal(mesh.sides["right"]["line2"], [[1, 2]])
    assert list(mesh.cells) == ["quad4"]
    out = [mesh.points, mesh.cells["quad4"], mesh.groups["all"]["quad4"], mesh.origin]
    out += [*mesh.sides["right"].values(), *mesh.boundary.values()]
    for array in out:
        with pytest.raises(ValueError, match="read-only"):
            array += 1
    for held in (mesh.cells, mesh.groups, mesh.groups["all"], mesh.sides, mesh.sides["right"]):
        with pytest.raises(TypeError):
            held["new"] = cells  # type: ignore[index]
    with pytest.raises(FrozenInstanceError):
        mesh.points = points  # type: ignore[misc]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"points": np.ma.masked_array(square(), square() > 0.5)}, "points are a masked array"),
        ({"cells": {"quad4": np.ma.masked_array(QUAD, QUAD > 2)}}, "quad4 are a masked array"),
        ({"cells": {"quad4": QUAD > 0}}, "quad4 has nodes of bool, must be integers"),
        ({"groups": {"a": {"quad4": np.array([True])}}}, "group 'a': whole numbers below 1"),
        ({"groups": {"a": {"quad4": np.ma.array([0])}}}, "group 'a': quad4 are a masked array"),
        ({"numbers": np.array([True] * 4)}, "numbers.*bool.*integers"),
        ({"numbers": np.arange(3)}, r"numbers.*\(3,\).*\(4,\)"),
    ],
)
def test_arrays_that_say_less_than_numbers_are_refused(given: Any, message: str) -> None:
    whole = {"points": square(), "cells": {"quad4": QUAD}}
    with pytest.raises(MeshError, match=message) as caught:
        Mesh(**{**whole, **given}).check()
    assert "\n" not in str(caught.value)


# ----------------------------------------------------------------------------------------- studies


YES = np.array([True, False])


@pytest.mark.parametrize(
    ("say", "message"),
    [
        (lambda s: s.start(u_x=np.ma.zeros(6)), "masked array"),
        (lambda s: s.start(u_x=np.array([True] * 6)), "bool"),
        (lambda s: s.start(u_x=True), "bool"),
        (lambda s: s.fix(np.ma.masked_array([0, 1], YES), u_x=0), "masked array"),
        (lambda s: s.fix(np.array([True] * 6), u_x=0), "node numbers are a list of integers"),
        (lambda s: s.load("right", u_x=lambda x, t: x[:, 0] > 0), "bool"),
        (lambda s: s.load("right", u_x=lambda x, t: np.ma.masked_less(x[:, 0], 9)), "masked"),
        (lambda s: s.fix((True, False), u_x=0), "place"),
    ],
)
def test_masks_and_booleans_are_no_numbers(say: Callable[[Study], None], message: str) -> None:
    study = bar()

    def solved() -> None:
        say(study)
        study.solve()

    with pytest.raises((StudyError, MeshError), match=message):
        solved()


# ----------------------------------------------------------------------------------------- results


def test_what_a_result_hands_out_does_not_change_it() -> None:
    result = bar().solve()
    modes = result.modes(1, mass={"bar": {"rho": 1.0}})
    for array in (result.x, modes.squares, modes[0].x):
        with pytest.raises(ValueError, match="read-only"):
            array *= 2.0
    before = result.x.copy()
    for array in (result.values("u_x"), result.gathered("u_x"), result.fields("bar")["sigma_xx"]):
        array += 1.0
    np.testing.assert_array_equal(result.x, before)
    assert result.fields("bar")["sigma_xx"].max() < 1.0
    for name in ("x", "t", "problem"):
        with pytest.raises(AttributeError):
            setattr(result, name, before)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, "pickle"])
def test_mesh_study_and_result_are_copied_and_pickled(copied: Any) -> None:
    if copied == "pickle":
        copied = lambda x: pickle.loads(pickle.dumps(x))  # noqa: E731
    mesh = Mesh.rectangle(2, 1, cells=(2, 1)).with_group("all", lambda x: x[:, 0] > -1).split()
    other = copied(mesh)
    for name in ("cells", "boundary"):
        np.testing.assert_equal(dict(getattr(other, name)), dict(getattr(mesh, name)))
    np.testing.assert_equal(dict(other.groups["all"]), dict(mesh.groups["all"]))
    np.testing.assert_array_equal(other.points, mesh.points)
    np.testing.assert_array_equal(other.origin, mesh.origin)
    assert not other.points.flags.writeable
    study = bar()
    result = study.solve()
    again, state = copied((study, result)) if copied is not copy.copy else (copied(study), result)
    state = copied(state)
    assert isinstance(state, Result)
    np.testing.assert_array_equal(again.solve().x, result.x)
    np.testing.assert_array_equal(state.x, result.x)
    assert state.at((1, 0.5)) == result.at((1, 0.5))
    assert state.reaction("left") == result.reaction("left")
    np.testing.assert_equal(state.fields("bar"), result.fields("bar"))
    by = {"bar": ["E"], "load:right": ["u_x"]}
    slopes = [r.sensitivity("u_x", by=by, at=(2, 0)) for r in (state, result)]
    assert slopes[0] == slopes[1]
    objective = copied(again.objective("u_x", by=by, at=(2, 0)))
    assert objective(objective.start)[0] == result.at((2, 0))["u_x"]
    end = study.solve(start=result, until=2.0)
    # the copy of a result has no path behind it: its start is solved for again
    np.testing.assert_allclose(again.solve(start=state, until=2.0).x, end.x, atol=1e-16)


LATER = """
import pickle, sys
study, results = pickle.load(open(sys.argv[1], "rb"))
assert "sympy" not in sys.modules
print(repr(float(study.solve(steps=3).values("u_x").max())), len(results))
print(repr(float(results[-1].values("u_x").max())), results[-1].fields("bar")["sigma_xx"].shape)
"""


def test_another_process_reads_a_study_and_its_results(tmp_path: Path) -> None:
    study = bar(load=1.0)
    steps: list[Result] = []
    end = study.solve(steps=3, record=True, on_step=steps.append)
    (tmp_path / "all.pickle").write_bytes(pickle.dumps((study, steps)))
    command = [sys.executable, "-c", LATER, str(tmp_path / "all.pickle")]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    most = repr(float(end.values("u_x").max()))
    assert told == [f"{most} {len(steps)}", f"{most} (2, 4)"]


def test_what_cannot_be_pickled_says_what_to_do() -> None:
    study = bar(load=lambda x, t: t)
    for thing in (study, study.solve()):
        with pytest.raises(StudyError, match=r"load\('right'\).*<lambda>.*a module") as caught:
            pickle.dumps(thing)
        assert "\n" not in str(caught.value)
    copy.deepcopy(study).solve()


PAGE = """
import softehl

@softehl.page
def rod(m):
    u = m.scalar("u")
    (k,) = m.parameters(k="stiffness")
    m.minimise({} * k * m.grad(u)[0] ** 2)
"""


def test_derivatives_are_those_of_the_page_that_was_solved(tmp_path: Path) -> None:
    page = tmp_path / "rod.py"
    page.write_text(PAGE.format(1))
    study = Study(Mesh.line(1, cells=1))
    study.add("rod", page, k=1.0)
    study.fix("left", u=0)
    study.load("right", u=1.0)
    result = study.solve()
    page.write_text(PAGE.format(2))
    with pytest.raises(StudyError, match="page of rod_line2 is another one than the study"):
        result.sensitivity("u", by={"rod": ["k"]}, at=(1,))
    page.write_text(PAGE.format(1))
    # u = 1 / (2 k), of the energy k u^2 - u
    assert result.sensitivity("u", by={"rod": ["k"]}, at=(1,)) == {("rod", "k"): -0.5}


@softehl.page
def rod(m: Any) -> None:
    """A page of this module."""
    (k,) = m.parameters(k="stiffness")
    m.minimise(k * m.grad(m.scalar("u"))[0] ** 2)


def test_a_page_of_a_script_is_pickled_as_its_kernel() -> None:
    study = Study(Mesh.line(1, cells=1))
    study.add("rod", rod, k=1.0)
    study.fix("left", u=0)
    study.load("right", u=1.0)
    result = pickle.loads(pickle.dumps(study)).solve()
    assert result.at((1,)) == {"u": 0.5}
    with pytest.raises(StudyError, match="need the page of rod_line2: add it from a model file"):
        result.sensitivity("u", by={"rod": ["k"]}, at=(1,))
