"""When Newton's method has converged: every equation by itself, and each field as a whole."""

from __future__ import annotations

import itertools

import pytest

from softehl import Definition, Mesh, Model, Study, quadrature
from tests.runtime.enhanced_page import enhanced


def bar() -> Definition:
    """Conduction between two nodes."""
    m = Model("bar", nodes=2, rule=quadrature.point_rule(), unroll=True)
    (X,) = m.coordinates("X")
    (T,) = m.nodal_unknowns("T")
    (k,) = m.parameters(k="conductivity")
    m.potential(k / 2 * (T[1] - T[0]) ** 2 / (X[1] - X[0]))
    return m.finish()


def cooled() -> Definition:
    """T + 100 T^3 at a node."""
    m = Model("cooled", nodes=1, rule=quadrature.point_rule(), unroll=True)
    m.coordinates("X")
    ((T,),) = m.nodal_unknowns("T")
    m.potential(T**2 / 2 + 25 * T**4)
    return m.finish()


@pytest.mark.filterwarnings("ignore:1 of 3 cells of the mesh have no elements")
@pytest.mark.parametrize("conductivity", [1.0, 1e9, 1e12])
def test_an_equation_is_solved_however_large_forces_are_elsewhere(conductivity: float) -> None:
    """T + 100 T^3 = 1 at one end; at the other a flux of `conductivity` between two supports."""
    mesh = Mesh.line(3.0, cells=3).with_group("conductor", lambda x: x[:, 0] < 1.1)
    study = Study(mesh.with_group("end", lambda x: x[:, 0] > 1.9))
    study.add("conductor", bar(), cells="conductor", k=conductivity)
    study.add("link", bar(), cells="end", k=1e-9)
    study.add("cooled", cooled(), on=lambda x: x[:, 0] > 2.9)
    study.fix((0.0,), T=0)
    study.fix((1.0,), T=1)
    study.fix((2.0,), T=0)
    study.load((3.0,), T=1)
    for steps in (1, 3):
        result = study.solve(steps=steps)
        assert result.at((3.0,))["T"] == pytest.approx(0.2, rel=1e-8)
    tail = [n for n in result.residual_norms if n > 1e-14]
    assert all(after < before for before, after in itertools.pairwise(tail))


@pytest.mark.parametrize("cells", [2, 6, 20])
def test_a_linear_problem_with_unknowns_of_elements_takes_one_iteration(cells: int) -> None:
    """Nothing but their own residual measures the equations of the enhanced strains."""
    study = Study(Mesh.rectangle(10.0, 1.0, cells=(cells, cells)))
    study.add("body", enhanced(), lame=1.5, mu=1.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=1e-4)
    result = study.solve()
    assert result.residual_norms[0] == pytest.approx(1.0)
    assert result.iterations == 1
    assert result.residual_norms[-1] < 1e-9


def test_a_body_at_rest_has_nothing_to_solve() -> None:
    study = Study(Mesh.rectangle(10.0, 1.0, cells=(4, 2)))
    study.add("body", enhanced(), lame=1.5, mu=1.0)
    study.fix("left", u_x=0, u_y=0)
    assert study.solve().norm() == 0.0
