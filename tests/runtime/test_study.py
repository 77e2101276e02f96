"""Studies: results, mistakes and their messages, corners of what can be asked."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Definition, Model, Newton, SoftehlError, quadrature
from softehl.codegen.language.errors import ModelError
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.results.result import Result
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.study import Study, StudyError
from tests.runtime import solid_page as pages

# --- Studies: what a user writes down is what is solved, and what cannot be is refused by name ----


MU, LAME = 0.4, 2.0
SOLID: dict[str, Any] = {"mu": MU, "lame": LAME, "thickness": 1.0}


def block_of(width: float = 2.0, height: float = 1.0, cells: tuple[int, int] = (4, 2)) -> Study:
    """A rectangle of rubber."""
    study = Study(Mesh.rectangle(width, height, cells=cells))
    study.add("body", pages.solid(), **SOLID)
    return study


def wobbled(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """The mesh with its inner nodes moved at random."""
    inner = np.setdiff1d(np.arange(len(mesh.points)), mesh.nodes("boundary"))
    moved = mesh.points.copy()
    moved[inner] += rng.uniform(-0.08, 0.08, (len(inner), 2))
    return mesh.map(lambda x: moved)


def test_patch(rng: np.random.Generator) -> None:
    """A linear displacement of the boundary is the solution everywhere."""
    study = Study(wobbled(Mesh.rectangle(2.0, 1.0, cells=(4, 3)), rng))
    study.add("body", pages.solid(), **SOLID)
    A = np.array([[0.2, 0.3], [-0.1, 0.1]])
    study.fix("boundary", u_x=lambda x, t: t * x @ A[0], u_y=lambda x, t: t * x @ A[1])
    result = study.solve()
    np.testing.assert_allclose(result.values("u_x"), study.mesh.points @ A[0], atol=1e-12)
    np.testing.assert_allclose(result.values("u_y"), study.mesh.points @ A[1], atol=1e-12)
    stress = result.fields("body")["sigma_xx"]
    np.testing.assert_allclose(stress, stress[0, 0], rtol=1e-10)


def test_uniaxial_stress_and_reactions() -> None:
    """A block pulled along x with free sides: the lateral stretch makes the lateral stress zero."""
    study = block_of()
    study.fix("left", u_x=0.0)
    study.fix("bottom", u_y=0.0)
    study.load("right", u_x=0.3)
    result = study.solve(steps=3)
    stretch = 1.0 + result.at((2.0, 0.5))["u_x"] / 2.0
    lateral = 1.0 + result.at((1.0, 1.0))["u_y"]
    log_J = np.log(stretch * lateral)

    def stress(a: float) -> float:
        return float(MU * (a - 1.0 / a) + LAME * log_J / a)

    assert stress(stretch) == pytest.approx(0.3, rel=1e-9)
    assert stress(lateral) == pytest.approx(0.0, abs=1e-9)
    assert result.reaction("left")["u_x"] == pytest.approx(-0.3, rel=1e-9)
    assert result.reaction("left")["u_x"] != pytest.approx(-0.3001, rel=1e-9)
    assert result.reaction("right")["u_x"] == pytest.approx(0.0, abs=1e-9)


def test_loads_are_per_length_and_follow_functions() -> None:
    for value in (0.01, lambda x, t: np.full(len(x), 0.01 * t)):
        study = block_of(height=3.0)
        study.fix("left", u_x=0.0, u_y=0.0)
        study.load("right", u_y=value)
        assert study.solve().reaction("left")["u_y"] == pytest.approx(-0.03, rel=1e-9)
    study = block_of()
    study.fix("left", u_x=0.0, u_y=0.0)
    study.load((2.0, 1.0), u_y=0.01)
    result = study.solve()
    assert result.reaction("left")["u_y"] == pytest.approx(-0.01, rel=1e-9)
    linear = block_of()
    linear.fix("left", u_x=0.0, u_y=0.0)
    linear.load("right", u_y=lambda x, t: 0.02 * t * x[:, 1])
    assert linear.solve().reaction("left")["u_y"] == pytest.approx(-0.01, rel=1e-9)


def test_a_parameter_that_follows_the_load_factor_and_a_follower_load() -> None:
    """A square under pressure from all sides shrinks as the closed form says."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(2, 2)))
    study.add("body", pages.solid(), **SOLID)
    study.add("pressure", pages.follower(), on="boundary", pressure=lambda t: 0.5 * t)
    study.fix("left", u_x=0.0)
    study.fix("bottom", u_y=0.0)
    stretch = 1.0 + study.solve(steps=2).at((1.0, 0.3))["u_x"]
    cauchy = (MU * (stretch - 1 / stretch) + 2 * LAME * np.log(stretch) / stretch) / stretch
    assert cauchy == pytest.approx(-0.5, rel=1e-9)


def test_reactions_of_ties_and_springs_are_those_of_all_nodes() -> None:
    """Simple shear between periodic sides: P_yx = mu g on the whole of each, not at its corners."""
    study = block_of()
    study.fix("bottom", u_x=0.0, u_y=0.0)
    study.fix("top", u_x=0.2, u_y=0.0)
    study.tie("right", "left", "u_x", "u_y")
    result = study.solve()
    shear = 0.2 * MU
    assert result.reaction("right") == pytest.approx({"u_x": 0.0, "u_y": shear}, abs=1e-9)
    assert result.reaction("left") == pytest.approx({"u_x": 0.0, "u_y": -shear}, abs=1e-9)
    held = block_of()
    held.spring("left", u_x=2.0)
    held.fix("bottom", u_y=0.0)
    held.load("right", u_x=1e-4)
    assert held.solve().reaction("left")["u_x"] == pytest.approx(-1e-4, rel=1e-6)


def test_a_tie_between_prescribed_sides_is_checked() -> None:
    study = block_of()
    study.fix("left", u_x=0.0, u_y=0.0)
    study.fix("right", u_x=0.1, u_y=0.0)
    study.tie("right", "left", "u_x", offset=0.1)
    assert study.solve().at((2.0, 0.5))["u_x"] == pytest.approx(0.1)
    study.tie("right", "left", "u_y", offset=0.2)
    with pytest.raises(StudyError, match=r"both sides are prescribed, and -0\.2 apart"):
        study.solve()


def test_results_at_places_lines_nodes_and_files(tmp_path: Path) -> None:
    study = block_of()
    study.fix("left", u_x=0.0)
    study.fix("bottom", u_y=0.0)
    study.fix("right", u_x=0.5)
    result = study.solve()
    assert result.at((1.3, 0.4))["u_x"] == pytest.approx(0.5 * 1.3 / 2.0, rel=1e-9)
    line = result.along((0.0, 0.2), (2.0, 0.2), 5)
    np.testing.assert_allclose(line["u_x"], 0.25 * line["s"], atol=1e-12)
    nodal = result.at_nodes("body")["sigma_xx"]
    np.testing.assert_allclose(nodal, result.fields("body")["sigma_xx"][0, 0], rtol=1e-9)
    assert result.norm() == pytest.approx(np.linalg.norm(result.x))
    result.write(tmp_path / "part.vtu")
    read = meshio.read(tmp_path / "part.vtu")
    assert read.point_data["u"].shape == (15, 3)
    assert read.cell_data["body.J"][0].shape == (8,)
    with pytest.raises(ValueError, match=r"as \.vtu"):
        result.write(tmp_path / "part.vtk")
    with pytest.raises(MeshError, match="outside the mesh"):
        result.at((5.0, 0.0))
    with pytest.raises(KeyError, match="did you mean 'u_x'"):
        result.values("ux")
    with pytest.raises(KeyError, match=r"no block 'boby'.*did you mean 'body'"):
        result.fields("boby")


def test_steps_and_what_is_told_of_them() -> None:
    study = block_of()
    study.fix("left", u_x=0.0, u_y=0.0)
    study.fix("right", u_x=1.0)
    told: list[Result] = []
    result = study.solve(steps=4, on_step=told.append)
    np.testing.assert_allclose([r.t for r in told], [0.0, 0.25, 0.5, 0.75, 1.0], atol=1e-12)
    again = study.solve(start=told[2], steps=2)
    np.testing.assert_allclose(again.x, result.x, atol=1e-10)
    norms = result.residual_norms
    assert norms[-1] < 1e-3 * norms[-2], "the tail is quadratic"


def test_a_path_that_ends_says_how_far_it_came() -> None:
    study = block_of()
    study.fix("left", u_x=0.0, u_y=0.0)
    study.fix("right", u_x=-2.5)  # would turn the block inside out
    with pytest.raises(NotConverged) as error:
        study.solve(steps=5)
    reached = error.value.reached
    assert 0.0 < reached.t < 1.0


MISTAKES: list[tuple[str, Callable[[Any], object], str]] = [
    ("block twice", lambda s: s.add("body", pages.solid(), **SOLID), "block 'body' is there"),
    (
        "parameter",
        lambda s: s.add("b", pages.solid(), **SOLID, nu=0.3),
        "no argument 'nu'; it has mu, lame, thickness",
    ),
    (
        "missing",
        lambda s: s.add("b", pages.solid(), mu=1.0, thickness=1.0),
        "'b': solid needs lame",
    ),
    (
        "text",
        lambda s: s.add("b", pages.solid(), **{**SOLID, "mu": "0.4"}),
        "mu = '0.4': a real number is needed",
    ),
    ("side", lambda s: s.fix("lef", u_x=0.0), "no side 'lef' (did you mean 'left'?)"),
    ("group", lambda s: s.add("b", pages.solid(), cells="x", **SOLID), "no group 'x'"),
    (
        "kind",
        lambda s: s.add("b", pages.follower(), pressure=1.0),
        "follower has 2 nodes, the mesh has 8 quad4",
    ),
    ("nothing", lambda s: s.fix("left"), "name an unknown, as in u_x=0"),
    ("not finite", lambda s: s.fix("left", u_x=float("nan")), "must be finite"),
    ("place", lambda s: s.load((0.1, 0.1), u_x=1.0), "no node at (0.1, 0.1); the nearest"),
    (
        "shared",
        lambda s: s.add("b", pages.solid(), shared=["p"], **SOLID),
        "no unknown 'p'; it has none",
    ),
    (
        "data",
        lambda s: s.add("b", pages.solid(), **{**SOLID, "thickness": np.ones(3)}),
        "thickness: one real number, or (8,) of them is needed; given float64 of shape (3,)",
    ),
    (
        "predicate",
        lambda s: s.fix(lambda x: x[:, 0] > 9.0, u_x=0.0),
        "predicate chooses no node",
    ),
    ("tie", lambda s: s.tie("left", "top", "u_x"), "3 and 5 nodes"),
    ("load of nothing", lambda s: s.load("left"), "load('left'): name an unknown"),
    ("spring of nothing", lambda s: s.spring("left"), "spring('left'): name an unknown"),
    ("tie of nothing", lambda s: s.tie("left", "right"), "tie('left', 'right'): name an unknown"),
    ("start of nothing", lambda s: s.initial("left"), "initial(): name an unknown"),
    ("load of nan", lambda s: s.load("left", u_x=float("nan")), "u_x = nan: the number must be"),
    ("tie of nan", lambda s: s.tie("left", "right", "u_x", offset=float("inf")), "offset = inf"),
    ("complex", lambda s: s.fix("left", u_x=np.complex128(1 + 2j)), "a real number is needed"),
    (
        "complex start",
        lambda s: s.start(u_x=lambda x: x[:, 0] * 1j),
        "u_x: one real number, or (15,) of them is needed; given complex128",
    ),
    (
        "nan start",
        lambda s: s.start("left", u_x=lambda x: np.where(x[:, 1] == 0.5, np.nan, 0.0)),
        "u_x is nan at (0, 0.5): numbers must be finite",
    ),
    (
        "arguments of a value",
        lambda s: s.load("left", u_x=lambda x: x[:, 0]),
        "load('left'): a function of (x, t) is needed, this one takes (x)",
    ),
    (
        "arguments of a parameter",
        lambda s: s.add("b", pages.solid(), **{**SOLID, "mu": lambda x, t: 1.0}),
        "'b': mu: a function of (t) is needed, this one takes (x, t)",
    ),
    (
        "a parameter of places",
        lambda s: [s.add("b", pages.solid(), **{**SOLID, "mu": lambda x: x[:, 0]}), s.solve()],
        "is not subscriptable; a parameter is a number or a function of the load factor or time",
    ),
    (
        "arguments of a predicate",
        lambda s: s.fix(lambda x, y: x == 0, u_x=0.0),
        "a function of (x) is needed, this one takes (x, y)",
    ),
    ("a function for a page", lambda s: s.add("b", pages.solid, **SOLID), "what solid returns"),
    (
        "a model for a page",
        lambda s: s.add("b", softehl.Model("m", nodes=1, rule=quadrature.point_rule())),
        "m.finish()",
    ),
    ("a number for a page", lambda s: s.add("b", 3), "int is no page: give a model file"),
    ("a node twice", lambda s: s.load([3, 3], u_x=1.0), "a node number stands twice"),
    ("until", lambda s: s.solve(until=float("nan")), "until = nan: the number must be finite"),
    ("start", lambda s: s.solve(start=s), "a result is needed"),
    ("on_step", lambda s: s.solve(on_step=lambda: None), "on_step: a function of (result) is"),
    ("end of a path", lambda s: s.follow(step=0.1, until=2.0), "until: a function of (result) is"),
]


@pytest.mark.parametrize(
    ("mistake", "words"), [m[1:] for m in MISTAKES], ids=[m[0] for m in MISTAKES]
)
def test_mistakes_are_named(mistake: Callable[[Study], object], words: str) -> None:
    study = block_of()
    with pytest.raises((StudyError, MeshError), match=re.escape(words)):
        mistake(study)


LATE: list[tuple[str, Callable[[Any], object], str]] = [
    ("unknown", lambda s: s.fix("left", u_z=0.0), "no unknown 'u_z' (did you mean 'u_"),
    ("load", lambda s: s.load("left", w=1.0), "no unknown 'w'; at nodes: u_x, u_y"),
    (
        "contradiction",
        lambda s: s.fix("bottom", u_x=1.0),
        "u_x at node 0 (0, 0) is prescribed twice: 0 by fix('left', u_x=...), 1 by fix('bottom'",
    ),
    (
        "nan",
        lambda s: s.load("right", u_x=lambda x, t: np.where(x[:, 1] > 0.5, np.nan, t)),
        "load('right') at t = 1 is nan at (2, ",
    ),
    (
        "complex",
        lambda s: s.fix("right", u_x=lambda x, t: 1j * t),
        "fix('right') at t = 1: one real number, or (3,) of them is needed; given complex128",
    ),
]


@pytest.mark.parametrize(("mistake", "words"), [m[1:] for m in LATE], ids=[m[0] for m in LATE])
def test_mistakes_that_show_when_solving(mistake: Callable[[Study], object], words: str) -> None:
    study = block_of()
    study.fix("left", u_x=0.0, u_y=0.0)
    mistake(study)
    with pytest.raises(StudyError, match=re.escape(words)):
        study.solve()


def test_nothing_to_solve_and_a_mesh_inside_out() -> None:
    with pytest.raises(StudyError, match="there are no elements"):
        Study(Mesh.rectangle(1, 1, cells=(1, 1))).solve()
    mesh = Mesh.rectangle(1, 1, cells=(2, 2))
    with pytest.raises(MeshError, match="turned inside out"):
        Study(Mesh(mesh.points, {"quad4": mesh.cells["quad4"][:, ::-1]}))


# --- Rare combinations of a study: groups of one kind of cells, ties to a place, one cell alone ---


MODELS = Path(__file__).parents[2] / "docs" / "models"


def two_kinds() -> Mesh:
    """A square cell beside two triangles."""
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1.0]])
    cells = {"quad4": np.array([[0, 1, 4, 3]]), "tri3": np.array([[1, 2, 5], [1, 5, 4]])}
    mesh = Mesh(points, cells).with_group("square", lambda x: x[:, 0] < 1)
    return mesh.with_group("triangles", lambda x: x[:, 0] > 1)


def test_a_group_of_one_kind_of_cells_in_a_mesh_of_two_kinds() -> None:
    """Under uniform tension both kinds have the same exact solution."""
    study = Study(two_kinds())
    study.add("a", MODELS / "mean_pressure.py", cells="square", mu=0.5, K=1e-9)
    study.add("b", material="hooke", cells="triangles", E=1.0, nu=0.0)
    study.fix(lambda x: x[:, 0] == 0, u_x=0)
    study.fix((0.0, 0.0), u_y=0)
    study.load(lambda x: x[:, 0] == 2, u_x=1e-6)
    result = study.solve()
    assert list(study.system().blocks) == ["a", "b"]
    np.testing.assert_allclose(result.values("u_x"), 1e-6 * study.mesh.points[:, 0], rtol=1e-4)
    assert result.fields("a")["p"].shape[0] == 1


def plate() -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 4)))
    study.add("body", material="hooke", E=1.0, nu=0.3)
    study.fix("left", u_x=0, u_y=0)
    return study


def test_a_side_that_is_tied_to_a_place_moves_as_one() -> None:
    tied, prescribed = plate(), plate()
    tied.tie("right", (2.0, 0.5), "u_x")
    tied.load((2.0, 0.5), u_x=0.01)
    result = tied.solve()
    moved = result.values("u_x")[tied.mesh.nodes("right")]
    assert np.ptp(moved) < 1e-15
    prescribed.fix("right", u_x=lambda x, t: t * moved[0])
    other = prescribed.solve()
    assert other.reaction("right")["u_x"] == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_allclose(result.values("u_y"), other.values("u_y"), atol=1e-15)
    tied.tie("top", (0.0, 0.0), "u_y", offset=0.1)  # a place elsewhere may be apart
    with pytest.raises(StudyError, match="the place is a node of the side: offset must be 0"):
        tied.tie("right", (2.0, 0.0), "u_x", offset=0.1)
    with pytest.raises(StudyError, match=r"9 and 5 nodes; sides of equal nodes .* or a side to"):
        tied.tie(np.arange(9), "left", "u_x")


@softehl.page
def bare(m: Any) -> None:
    """A linear spring of a body, without fields."""
    u = m.vector("u")
    (E,) = m.parameters(E="modulus")
    m.weak(E * (m.grad(u) + m.grad(u).T) / 2, m.grad(u))


def test_a_page_without_fields_has_none(tmp_path: Path) -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(2, 1)))
    study.add("body", bare, E=1.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    result = study.solve()
    assert result.fields("body") == result.at_nodes("body") == {}
    result.write(tmp_path / "bare.vtu")
    with pytest.raises(KeyError, match="no block 'bodi'"):
        result.fields("bodi")


@pytest.mark.parametrize(("dimension", "kind"), [(2, "point1"), (3, "line2"), (3, "point1")])
def test_a_side_without_faces_is_named(dimension: int, kind: str) -> None:
    box = Mesh.box((1, 1, 1), cells=(1, 1, 1))
    mesh = box if dimension == 3 else Mesh.rectangle(1, 1, cells=(1, 1))
    nodes = np.arange(2 if kind == "line2" else 1)[None]
    study = Study(Mesh(mesh.points, mesh.cells, sides={**mesh.sides, "rim": {kind: nodes}}))
    words = {"point1": "nodes", "line2": "lines"}[kind]
    needed = {2: "lines", 3: "faces"}[dimension]
    message = rf"side 'rim' is of {words} \({kind}\); in {dimension}-D .* {needed} .* such as left"
    with pytest.raises(MeshError, match=message):
        study.pressure("rim", 1.0)
    with pytest.raises(MeshError, match=message):
        study.contact("left", "rim")


# --- What once gave wrong numbers without a word, asked of Study: each is right, or a named -------


def nodal(law: Callable[[Model, Any, Any], Any], name: str) -> Definition:
    """One unknown at a node, whose equation is what `law` makes of it and of a load f."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (f,) = m.parameters(f="load")
    m.weak_form([(law(m, u, f), u)])
    return m.finish()


def solution(page: Definition, f: float, start: float = 0.0) -> float:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("law", page, on="right", f=f)
    study.add("rest", nodal(lambda m, u, f: u - f, "rest"), on="left", f=0.0)
    study.start(u=start)
    return float(study.solve().at((1.0,))["u"])


def test_a_side_that_is_not_taken_needs_no_value() -> None:
    """log(u) sqrt(u - 1) is nowhere below 1, where the path may start."""

    def law(m: Model, u: Any, f: Any) -> Any:
        beyond = u + sp.log(u) * sp.sqrt(u - 1)
        s = m.implicit("s", lambda s: s - sp.Piecewise((u, u < 1), (beyond, True)), start=0)
        return s - f

    page = nodal(law, "sides")
    assert solution(page, 0.5) == pytest.approx(0.5, rel=1e-12)
    found = solution(page, 2.0, start=1.5)
    assert found + np.log(found) * np.sqrt(found - 1) == pytest.approx(2.0, rel=1e-9)


def test_a_value_that_is_no_number_is_named() -> None:
    def law(m: Model, u: Any, f: Any) -> Any:
        return m.define("inside", sp.log(u - 1)) - f

    with pytest.raises(NotConverged, match=r"not finite.*block 'law'") as error:
        solution(nodal(law, "logarithm"), 1.0)
    assert "\n" not in str(error.value)


ILLEGAL: dict[str, Callable[[Model, Any, Any], Any]] = {
    "division by zero": lambda m, u, f: u / sp.Integer(0) - f,
    "a branch of Python": lambda m, u, f: u if u > 0 else f,
    "no last side": lambda m, u, f: sp.Piecewise((u, u > 0)) - f,
}


@pytest.mark.parametrize("name", ILLEGAL)
def test_pages_that_say_what_no_kernel_can_hold(name: str) -> None:
    with pytest.raises((ModelError, TypeError)) as error:
        solution(nodal(ILLEGAL[name], "illegal"), 1.0)
    assert "\n" not in str(error.value)


def test_another_law_has_another_solution() -> None:
    assert solution(nodal(lambda m, u, f: 2 * u - f, "twice"), 1.0) == pytest.approx(0.5)


# --- Numbers as scripts have them, of NumPy and SymPy, lists for arrays; and what is refused ------


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


def held(mesh: Mesh, mu: Any = 0.4) -> Study:
    """A body that stands on its lower side."""
    study = Study(mesh)
    study.add("body", pages.solid(), mu=mu, lame=2.0, thickness=1.0)
    study.fix(lambda x: x[:, 1] == 0, u_x=0, u_y=0)
    return study


def test_numbers_of_numpy_and_sympy_are_numbers() -> None:
    usual = held(Mesh.rectangle(1, 1, cells=(2, 2)))
    usual.load("top", u_y=-0.01)
    tenth = held(Mesh.rectangle(1, 1, cells=np.array([2, 2])), np.array(0.4))  # type: ignore[arg-type]
    tenth.load("top", u_y=-sp.Rational(1, 100))
    found = tenth.solve(steps=np.int64(1)).at((1, 1))  # type: ignore[arg-type]
    assert found == usual.solve().at((1, 1))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.solve(steps=2.0), r"steps = 2.0: a whole number of at least 1 is needed"),
        (lambda s: s.load("top", u_y=np.array([1.0])), r"u_y = array\(\[1.\]\): a real number"),
        (lambda s: held(s.mesh, [1.0, 2.0]), r"mu has 2 values: .* as data, m.data\(mu=...\)"),
        (
            lambda s: (s.load("top", u_y=lambda x, t: x[0]), s.solve()),
            r"given float64 of shape \(2,\); x has all places, \(9, 2\), in columns: x\[:, 0\]",
        ),
        (
            lambda s: Mesh.rectangle(1, 1, cells=(2.0, 2)),  # type: ignore[arg-type]
            "2 whole numbers of at least 1",
        ),
        (lambda s: Mesh(np.array(SQUARE), [("quad4", [])]), "by their kinds, {"),  # type: ignore[arg-type]
        (
            lambda s: Mesh(np.array(SQUARE), {"quad4": np.array([[1, 2, 3, 4]])}),
            "quad4: node numbers from 1 to 4, must be from 0 to 3",
        ),
        (
            lambda s: Mesh(np.array(SQUARE), {"quad4": np.array([[0, 1, 2, 3.0]])}),
            "quad4 has nodes of float64, must be integers",
        ),
    ],
)
def test_what_is_no_number_here_is_told(call: Callable[[Study], Any], words: str) -> None:
    with pytest.raises((StudyError, MeshError), match=words):
        call(held(Mesh.rectangle(1, 1, cells=(3, 1))))


# --- Files of a study: places that cannot be written to are named before anything is solved -------


def bar() -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("bar", material="hooke", E=10.0, nu=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    return study


MASS = {"bar": {"rho": 1.0}}
PATHS: dict[str, Callable[..., Any]] = {
    "solve": lambda s, **a: s.solve(**a),
    "march": lambda s, **a: list(s.march(dt=1.0, until=1.0, **a)),
    "motion": lambda s, **a: list(s.march(dt=1.0, until=1.0, method="newmark", mass=MASS, **a)),
    "follow": lambda s, **a: s.follow(step=1.0, until=lambda r: True, **a),
}


@pytest.mark.parametrize("path", PATHS)
def test_folders_of_results_are_made(path: str, tmp_path: Path) -> None:
    PATHS[path](bar(), write=tmp_path / "new" / path / "part.pvd")
    assert len(list((tmp_path / "new" / path).glob("part_*.vtu"))) >= 1
    assert (tmp_path / "new" / path / "part.pvd").is_file()


@pytest.mark.parametrize(
    ("path", "word", "name", "message"),
    [
        *((path, "write", "file/part.pvd", "file'?: Not a directory") for path in PATHS),
        ("solve", "write", "folder.pvd", "folder.pvd'?: Is a directory"),
        ("solve", "write", "part.vtu", "a series of results is written as .pvd"),
        ("march", "checkpoint", "file/last.npz", "file'?: Not a directory"),
        ("march", "checkpoint", "folder.pvd", "folder.pvd'?: Is a directory"),
        ("march", "restart", "none.npz", "none.npz' is missing or damaged"),
        ("march", "restart", "folder.pvd", "folder.pvd' is missing or damaged"),
    ],
)
def test_nothing_is_solved_for_a_place_that_cannot_be_written(
    path: str,
    word: str,
    name: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.pvd").mkdir()
    monkeypatch.setattr(Newton, "solve", lambda *a: pytest.fail("it was solved"))
    with pytest.raises(StudyError, match=message) as caught:
        PATHS[path](bar(), **{word: tmp_path / name})
    assert str(caught.value).startswith(f"{word} = ") or word == "restart"
    assert "\n" not in str(caught.value)


def test_folders_of_checkpoints_and_single_results_are_made(tmp_path: Path) -> None:
    (result,) = PATHS["march"](bar(), checkpoint=tmp_path / "a" / "b" / "last.npz")
    assert (tmp_path / "a" / "b" / "last.npz").is_file()
    for name in ("one.vtu", "all.pvtu"):
        result.write(tmp_path / name[:3] / name)
        assert (tmp_path / name[:3] / name).is_file()


# --- Names that a result does not have: one line with those that it has ---------------------------


@pytest.fixture(scope="module")
def result() -> Any:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("rubber", material="hooke", E=10.0, nu=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    return next(study.march(dt=1.0, until=1.0, method="newmark", mass={"rubber": {"rho": 1.0}}))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda r: r.at_nodes("ruber"),
            "no block 'ruber' (did you mean 'rubber'?); there are rubber",
        ),
        (lambda r: r.fields("steel"), "no block 'steel'; there are rubber"),
        (
            lambda r: r.values("u_z"),
            "no unknown 'u_z' (did you mean 'u_x' or 'u_y'?); there are u_x, u_y",
        ),
        (
            lambda r: r.values("sigma_xx"),
            "no unknown 'sigma_xx', but a field: fields('rubber')['sigma_xx'] has it at the "
            "points, at_nodes('rubber')['sigma_xx'] at the nodes",
        ),
        (lambda r: r.gathered("p"), "no unknown 'p' at nodes; there are u_x, u_y"),
        (lambda r: r.velocity("p"), "no unknown 'p'; at nodes: u_x, u_y"),
        (lambda r: r.problem.assembler.block("a"), "no block 'a'; there are rubber, "),
    ],
)
def test_a_name_that_is_not_there(result: Any, ask: Callable[[Any], object], message: str) -> None:
    with pytest.raises(KeyError) as caught:
        ask(result)
    assert isinstance(caught.value, SoftehlError)
    assert str(caught.value).startswith(message)
