"""Studies: what a user writes down is what is solved, and what cannot be is refused by name."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

import softehl
from softehl import quadrature
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.results.result import Result
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.study import Study, StudyError
from tests.runtime import solid_page as pages

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
    ("start of nothing", lambda s: s.start("left"), "start(): name an unknown"),
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
