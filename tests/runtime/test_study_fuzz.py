"""Studies at random: the right result or an error of one line, never a wrong number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softehl import Mesh, Study
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.study import StudyError
from tests.runtime import solid_page as pages

REFUSED = (StudyError, MeshError, NotConverged, ProblemError)
SIDES = ["left", "right", "bottom", "top", "boundary", "lid", ""]
UNKNOWNS = ["u_x", "u_y", "u_z", "u"]
VALUES = st.one_of(st.floats(-0.2, 0.2), st.sampled_from([float("nan"), float("inf"), 1e30]))


@pytest.mark.filterwarnings(
    "ignore::softehl.runtime.equations.stability.UnstableState"
)  # stretched by 1e30
@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    rises=st.lists(st.tuples(st.sampled_from(SIDES), st.sampled_from(UNKNOWNS)), max_size=5),
    slopes=st.tuples(VALUES, VALUES),
    steps=st.integers(-1, 3),
)
def test_linear_boundary_values(
    rises: list[tuple[str, str]], slopes: tuple[float, float], steps: int
) -> None:
    """What is prescribed is the linear field of a patch: it is the solution where it is solved."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(3, 2)))
    study.add("body", pages.solid(), mu=0.4, lame=2.0, thickness=1.0)
    a, b = slopes
    fields: dict[str, Any] = {
        "u_x": lambda x, t: t * a * x[:, 1],
        "u_y": lambda x, t: t * b * x[:, 1],
    }
    complaint, result = "", None
    try:
        study.fix("boundary", **fields)
        for side, name in rises:
            study.fix(side, **{name: fields.get(name, 0.0)})
        result = study.solve(steps=steps)
    except REFUSED as error:
        complaint = str(error)
    assert "\n" not in complaint
    if result is None:
        return
    points = study.mesh.points
    # forces of a component of 1e30 are rounded to more than all those of one of 0.1
    atol = 1e-9 * max(1.0, abs(a), abs(b))
    np.testing.assert_allclose(result.values("u_x"), a * points[:, 1], atol=atol)
    np.testing.assert_allclose(result.values("u_y"), b * points[:, 1], atol=atol)


def test_a_body_that_nothing_holds_is_an_error() -> None:
    """It rests on a floor that pushes only once it is pressed: rounding must not decide."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", pages.solid(), mu=0.4, lame=2.0, thickness=1.0)
    study.add("floor", pages.floor(), on="bottom", k=10.0)
    study.fix("left", u_x=0.0)
    study.load("top", u_y=0.01)  # upwards
    with pytest.raises(REFUSED):
        study.solve()
