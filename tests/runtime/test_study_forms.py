"""How pages stand on elements: by nodes, by other names, along lines, by other rules."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl import Definition, Mesh, Model, Study, element, kinematics, load_kernel, quadrature
from softehl.runtime.analyses.initial_state import initial_state
from softehl.runtime.analyses.motion import stored_energy
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.matrix_free_products import NoProductError, require_product
from softehl.runtime.discretisation.quadrature import film_rule


@cache
def diffusion() -> Definition:
    """-p'' + c p = f along a line, f such that p = x^2 (3 - 2 x) where c = 1; p is interpolated."""
    m = Model("diffusion", nodes=2, rule=quadrature.gauss(2, 1), unroll=False)
    X = m.coordinates("X")
    (c,) = m.parameters(c="reaction")
    (xi,) = m.point()
    p, p_xi = m.interpolated("p")
    kind = element("line2")
    e = kinematics.isoparametric(m, X, kind.gradient(xi))
    N = kind.shape(xi)
    x = m.define("x", sum(a * b for a, b in zip(N, X[0], strict=True)))
    f = 12 * x - 6 + 3 * x**2 - 2 * x**3
    density = (p_xi / e.detJ) ** 2 / 2 + c * (p**2 / 2 - f * p)
    m.potential(m.integral("Pi", density * e.detJ))
    m.fields(x=x, p=p)
    return m.finish()


@cache
def tank() -> Definition:
    """A tank of level a behind a resistance 1 / k, at one place of a line."""
    m = Model("tank", nodes=1, rule=quadrature.point_rule())
    (k, a) = m.parameters(k="conductance", a="level")
    q = m.unknown("q")
    m.potential(k * (q - a) ** 2 / 2)
    return m.finish()


@cache
def rope() -> Definition:
    """A linear spring of stiffness k between two nodes, along x."""
    m = Model("rope", nodes=2, rule=quadrature.point_rule())
    (u,) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness")
    m.potential(k * (u[1] - u[0]) ** 2 / 2)
    return m.finish()


def line(cells: int = 2) -> Study:
    return Study(Mesh.line(1.0, cells=cells))


@pytest.mark.parametrize("places", [3, np.array([[0, 1, 2, 3], [3, 4, 5, 6]])])
def test_a_field_along_lines_of_order_3_is_exact_for_a_cubic(places: Any) -> None:
    study = line()
    study.add("line", diffusion(), along={"p": places}, c=1.0)
    found = study.solve().fields("line")
    x = found["x"]
    assert found["p"] == pytest.approx(x**2 * (3 - 2 * x), abs=1e-12)
    coarse = line()
    coarse.add("line", diffusion(), along={"p": 2}, c=1.0)
    assert abs(coarse.solve().fields("line")["p"][:, 0] - found["p"][:, 0]).max() > 1e-4


def test_ends_of_a_field_along_lines_are_unknowns_of_nodes() -> None:
    """p'' = 0 between 2 and 5, in a chain of lines whose numbers do not follow each other."""
    points = np.array([[0.0], [3.0], [1.0]])
    study = Study(Mesh(points, {"line2": np.array([[2, 1], [0, 2]])}))
    study.add("pipe", diffusion(), along={"p": 3}, c=0.0)
    study.fix((0.0,), p=2.0)
    study.fix((3.0,), p=5.0)
    result = study.solve()
    assert result.values("p") == pytest.approx([2.0, 5.0, 3.0], rel=1e-12)
    assert result.fields("pipe")["p"] == pytest.approx(2.0 + result.fields("pipe")["x"], rel=1e-12)
    assert initial_state(study.system(), result).x.tolist() == result.x.tolist()


def test_elements_stand_at_places_of_a_field_of_others() -> None:
    """Two tanks and a pipe of resistance 1: flux (a - b) / (1 / k + 1 + 1 / k)."""
    study = line(1)
    study.add("pipe", diffusion(), along={"p": np.array([[0, 1, 2]])}, c=0.0)
    nowhere = np.empty((1, 0), dtype=np.int64)  # the page knows of no node
    for name, on, place, level in (("in", "left", 0, 7.0), ("out", nowhere, 2, 0.0)):
        along = {"p": np.array([[place]])}
        study.add(name, tank(), on=on, called={"q": "p"}, along=along, k=0.4, a=level)
    result = study.solve()
    q = 7.0 / (1 / 0.4 + 1.0 + 1 / 0.4)
    assert result.values("p") == pytest.approx([7.0 - q / 0.4, 3.5, q / 0.4], rel=1e-12)
    assert initial_state(study.system(), result).x.tolist() == result.x.tolist()


def test_derivatives_and_energies_know_the_rule_of_a_block() -> None:
    """Of p at an end by c: against central differences. With 2 points they would be others."""

    def solved(c: float) -> Any:
        study = line()
        study.add("line", diffusion(), along={"p": 4}, rule=film_rule(4, "gauss", 3), c=c)
        return study.solve()

    result, step = solved(1.0), 1e-4
    found = result.sensitivity("p", at=(1.0,), by={"line": ["c"]})["line", "c"]
    ends = [solved(1.0 + sign * step).values("p")[-1] for sign in (1, -1)]
    assert found == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6)
    assert stored_energy(result.problem, result.x) == pytest.approx(
        load_kernel(diffusion())
        .energy(
            np.array([[0.0, 0.5], [0.5, 1.0]]),
            result.x[result.system.numbering.dofs["line"]],
            parameters={"c": 1.0},
            rule=film_rule(4, "gauss", 3),
        )
        .sum(),
        rel=1e-12,
    )


def test_products_without_a_matrix_refuse_a_rule() -> None:
    study = line()
    study.add("line", diffusion(), along={"p": 4}, c=1.0)
    with pytest.raises(NoProductError, match="'line' has a rule of its own"):
        require_product(study.system().assembler.block("line"))


def test_elements_by_their_nodes_have_no_mass_by_density() -> None:
    study = line()
    study.add("rope", rope(), on=np.array([[0, 2]]), called={"u": "u_x"}, k=3.0)
    study.fix("left", u_x=0.0)
    with pytest.raises(StudyError, match="'rope': its elements are given by their nodes and have"):
        study.solve().modes(1, mass={"rope": {"rho": 1.0}})


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, r"'line': along = none; diffusion has p along its elements, as in along=\{'p': 2"),
        (
            {"along": {"p": 2}, "called": {"p": "q"}, "rule": film_rule(2)},
            r"'line': along has no field 'q'; it has p",
        ),
        ({"along": {"q": 2}}, r"diffusion has no field 'q'; it has p"),
        ({"along": 2}, r"along = 2: a dict is needed, as in along="),
        ({"along": {"p": 2}, "rule": 4}, r"rule = 4: a rule is needed, as in rule=softehl.quad"),
        ({"along": {"p": 2}, "rule": quadrature.gauss(2, 2)}, r"the rule has points of 2"),
        ({"along": {"p": 2}, "called": {"p": 3}}, r"names are text"),
        ({"along": {"p": 2}, "on": [[0, 1], [1]]}, r"elements have the same number of nodes"),
        ({"along": {"p": 0}}, r"along 'p': order 0, must be at least 1"),
        ({"along": {"p": np.array([[0, 1], [1, -1]])}}, r"along 'p': places are counted from 0"),
        ({"along": {"p": 2, "q": np.eye(2)}}, r"along = p, q: orders for all of them, on lines"),
        ({"along": {"p": 2, "q": 2}}, r"interpolates p: give an order for each of them, or the"),
        ({"along": {"p": np.array([[0, 1]])}}, r"numbers of places \(2, m\); given int"),
        ({"along": {"p": np.array([[0], [1]])}}, r"give an order for each of them, or the rule"),
        ({"along": {"p": 2}, "rule": film_rule(3)}, r"has 3 unknowns along it, the rule 4"),
        ({"along": {"p": 2}, "called": {"r": "p"}}, r"diffusion has no unknown 'r'"),
        (
            {"along": {"p": 2}, "on": np.array([[0, 1, 2]])},
            r"given as node numbers \(n, 2\); given",
        ),
        ({"along": {"p": 2}, "on": np.array([[0, 7]])}, r"node numbers go from 0 to 2"),
    ],
)
def test_what_does_not_fit_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(StudyError, match=words):
        line().add("line", diffusion(), c=1.0, **given)


def test_two_blocks_share_a_field_along_lines_by_its_places() -> None:
    """c = 1 in two halves on the same lines; by their orders they would not share p within them."""
    study = line()
    study.add("half", diffusion(), along={"p": 2}, c=0.5)
    with pytest.raises(StudyError, match="'other': 'half' has p along the same lines: give both"):
        study.add("other", diffusion(), along={"p": 2}, c=0.5)
    both, whole = line(), line()
    places = np.array([[0, 1, 2], [2, 3, 4]])
    for name in ("half", "other"):
        both.add(name, diffusion(), along={"p": places}, c=0.5)
    whole.add("line", diffusion(), along={"p": places}, c=0.5)
    assert both.solve().values("p") == pytest.approx(whole.solve().values("p"), rel=1e-12)
    apart = line()  # one block a line
    for cell in ([[0, 1]], [[1, 2]]):
        apart.add(str(cell), diffusion(), on=np.array(cell), along={"p": 2}, c=0.5)
    ends = whole.solve().values("p")[[0, 2, 4]]
    assert apart.solve().values("p") == pytest.approx(ends, rel=1e-12)


SPRINGS = """
from softehl import Definition, Model, quadrature

def spring() -> Definition:
    m = Model("spring", nodes=2, rule=quadrature.point_rule())
    (X,) = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    (k,) = m.nodal_data("k")
    m.potential((k[0] + k[1]) / 2 * (u[1] - u[0])**2 / (X[1] - X[0]) / 2)
    return m.finish()
"""


def test_data_at_nodes_are_given_by_their_name(tmp_path: Path) -> None:
    page = tmp_path / "springs.py"
    page.write_text(SPRINGS)
    stiffness = np.array([1.0, 3.0, 2.0])  # nodes at 0, 1/2, 1: springs of (1 + 3), (3 + 2)

    def pulled(**given: Any) -> float:
        study = Study(Mesh.line(1, cells=2))
        study.add("springs", page, **given)
        study.fix("left", u=0)
        study.load("right", u=1.0)
        return study.solve().at((1,))["u"]

    order = np.argsort(np.argsort(Mesh.line(1, cells=2).points[:, 0]))
    want = 1 / 4 + 1 / 5
    np.testing.assert_allclose(pulled(k=stiffness[order]), want, rtol=1e-14)
    by_place = pulled(k=lambda x: np.interp(x[:, 0], [0, 0.5, 1], stiffness))
    np.testing.assert_allclose(by_place, want, rtol=1e-14)
    np.testing.assert_allclose(pulled(k=2.0), 1 / 2, rtol=1e-14)
    np.testing.assert_allclose(pulled(k1=2.0, k2=np.array([2.0, 2.0])), 1 / 2, rtol=1e-14)
    for given, message in (
        ({}, r"spring needs k$"),
        ({"k1": 1.0}, r"spring needs k2"),
        ({"k": 1.0, "k1": 2.0}, r"'k' and 'k1': the same data twice"),
        ({"k": np.ones(2)}, r"k: one real number, or \(3,\) of them is needed"),
        ({"q": 1.0}, r"no argument 'q'; it has k, k1, k2"),
    ):
        with pytest.raises(StudyError, match=message):
            pulled(**given)
