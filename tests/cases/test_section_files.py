"""Sections from drawings, points and meshes: exact arcs, names, and what is refused."""

import re
from collections.abc import Callable
from itertools import pairwise
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from ezdxf.filemanagement import new

from softehl.cases.harness.row import OK
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sections.section_files import (
    finer,
    outline_of,
    read_mesh,
    read_outline,
)
from softehl.cases.seal.gland.sections.section_keys import lobes
from softehl.cases.seal.gland.sections.shapes import SECTIONS
from softehl.cases.seal.meshing.outline import Arc, Shape
from softehl.cases.seal.meshing.outline_mesh import outline_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.cases.shipped import solve_cases

DRAWN = {name: kind().shape(50.39) for name, kind in SECTIONS.items()}


def layer_of(shape: Shape, s: float) -> str:
    length = shape.outline.length
    for name, (a, b) in (("FILM", shape.film), ("PRESSURE", shape.pressure)):
        if (s - a) % length < (b - a) % length:
            return name
    return "0"


def pieces_of(shape: Shape) -> list[tuple[Any, float, float, str]]:
    """The pieces of a shape, parted where film and pressure begin and end, with their layers."""
    outline, found = shape.outline, []
    ends = np.mod([*shape.film, *shape.pressure], outline.length)
    cuts = np.unique(np.round(np.concatenate([outline.starts, ends]), 9))
    for a, b in pairwise(cuts):
        if b - a > 1e-6:
            k = int(np.searchsorted(outline.starts, 0.5 * (a + b))) - 1
            found.append((outline.pieces[k], a, b, layer_of(shape, 0.5 * (a + b))))
    return found


def draw(shape: Shape, path: Path, unit: int = 4, mirror: float = 1.0, swap: bool = False) -> Path:
    """A drawing of a shape, in lines and arcs, in any order."""
    document = new(units=unit)
    space, scale = document.modelspace(), {1: 1 / 25.4, 4: 1.0, 6: 1e-3}[unit]
    for piece, a, b, layer in reversed(pieces_of(shape)):
        start, end = shape.outline.at(np.array([a, b])) * [mirror, 1.0] * scale
        options = {"layer": layer.lower() if swap else layer}
        if isinstance(piece, Arc):
            centre = np.array(piece.centre) * [mirror, 1.0] * scale
            angles = [np.degrees(np.arctan2(*(p - centre)[::-1])) for p in (start, end)]
            ordered = angles if piece.ccw == (mirror > 0) else angles[::-1]
            space.add_arc(centre, piece.radius * scale, ordered[0], ordered[1], dxfattribs=options)
        else:
            first, last = (end, start) if swap else (start, end)
            space.add_line(first, last, dxfattribs=options)
    document.saveas(path)
    return path


def assert_same(found: Shape, drawn: Shape, within: float = 1e-12) -> None:
    for name in ("length", "area", "polar_moment"):
        here, there = getattr(found.outline, name), getattr(drawn.outline, name)
        assert here == pytest.approx(there, rel=within)
    for here, there in ((found.film, drawn.film), (found.pressure, drawn.pressure)):
        a, b = found.outline.at(np.array(here)), drawn.outline.at(np.array(there))
        assert a == pytest.approx(b, abs=2e-9)


@pytest.mark.parametrize("name", SECTIONS)
def test_a_drawing_of_a_section_is_that_section(name: str, tmp_path: Path) -> None:
    drawn = DRAWN[name]
    assert_same(read_outline(draw(drawn, tmp_path / "seal.dxf")), drawn, 1e-9)
    found = read_outline(draw(drawn, tmp_path / "seal.dxf"), inner_diameter=80.0)
    assert found.outline.box[1] == pytest.approx(40.0)
    assert found.name == "seal"
    mirrored = read_outline(draw(drawn, tmp_path / "seal.dxf", mirror=-1.0))
    assert lobes(found) == lobes(mirrored) == lobes(drawn)  # also where the film passes the start


def stadium(path: Path, change: Callable[[Any], None] | None = None) -> Path:
    """A stadium of polylines with bulges: half circles of radius 1 at z = -2 and 2, r = 25."""
    document = new(units=4)
    space = document.modelspace()
    q = np.tan(pi / 8)
    film = [(-3, 25, q), (-2, 24, 0), (2, 24, q), (3, 25, 0)]
    space.add_lwpolyline(film, format="xyb", dxfattribs={"layer": "FILM"})
    back = [(3, 25, q), (2, 26, 0), (0, 26, 0)]
    space.add_lwpolyline(back, format="xyb", dxfattribs={"layer": "free"})
    sealed = [(0, 26, 0), (-2, 26, q), (-3, 25, 0)]
    space.add_lwpolyline(sealed, format="xyb", dxfattribs={"layer": "PRESSURE"})
    space.add_text("a seal", dxfattribs={"layer": "notes"})
    if change:
        change(space)
    document.saveas(path)
    return path


def test_bulges_are_converted_exactly(tmp_path: Path) -> None:
    shape = read_outline(stadium(tmp_path / "seal.dxf"))
    assert shape.outline.area == pytest.approx(pi + 8.0, rel=1e-12)
    assert shape.outline.length == pytest.approx(2 * pi + 8.0, rel=1e-12)
    assert shape.film[1] - shape.film[0] == pytest.approx(pi + 4.0, rel=1e-12)
    for angle in (0.3, 2.0, 4.0):
        side = 2.0 if cos(angle) > 0 else -2.0
        there = np.array([[side + cos(angle), 25.0 + sin(angle)]])
        assert shape.outline.at(shape.outline.position(there)) == pytest.approx(there, abs=1e-12)


def turn(space: Any) -> None:
    """The film drawn from behind: x is -x, and its arcs run clockwise."""
    film = next(e for e in space if e.dxf.layer == "FILM")
    film.dxf.extrusion = (0, 0, -1)
    film.set_points([(-x, y, -b) for x, y, b in film.get_points("xyb")], format="xyb")


def test_a_polyline_may_be_drawn_from_behind(tmp_path: Path) -> None:
    shape = read_outline(stadium(tmp_path / "seal.dxf", turn))
    assert shape.outline.area == pytest.approx(pi + 8.0, rel=1e-12)
    assert shape.film[1] - shape.film[0] == pytest.approx(pi + 4.0, rel=1e-12)


def remove(space: Any, layer: str) -> None:
    space.delete_entity(next(e for e in space if e.dxf.layer == layer))


def bad_spline(space: Any) -> None:
    space.add_spline([(0, 0), (1, 1), (2, 0)])


def rename(space: Any) -> None:
    next(e for e in space if e.dxf.layer == "FILM").dxf.layer = "PRESSURE"


BAD: dict[str, Callable[[Any], Any]] = {
    "seal.dxf: there is more than one contour, such as at (0.2, 25)": lambda s: s.add_circle(
        (0, 25), 0.2
    ),
    "seal.dxf: SPLINE on layer '0' is no line": bad_spline,
    "seal.dxf: the contour is open: a gap of 3.162 mm at (3, 25)": lambda s: remove(s, "free"),
    "seal.dxf: nothing is named FILM": rename,
}


@pytest.mark.parametrize("words", BAD)
def test_a_drawing_that_is_no_section_is_refused(words: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        read_outline(stadium(tmp_path / "seal.dxf", BAD[words]))
    assert "\n" not in str(error.value)


def test_files_that_are_no_drawings_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.dxf").write_text("no drawing", encoding="utf-8")
    for name, words in {
        "text.dxf": "text.dxf: .* not a DXF file",
        "none.dxf": "none.dxf: .*No such file",
        "none.csv": "none.csv: it cannot be read: No such file",
    }.items():
        with pytest.raises(ValueError, match=words):
            read_outline(tmp_path / name)


BOX = [(-2.0, 24.0), (2.0, 24.0), (2.0, 27.0), (0.0, 27.0), (-2.0, 27.0)]
PARTS = ["FILM", "", "", "PRESSURE", "PRESSURE"]


def test_points_make_a_section() -> None:
    for points, parts in (
        (BOX, PARTS),
        (BOX[::-1], [PARTS[3], *PARTS[2::-1], PARTS[4]]),
        ([(-z, r) for z, r in BOX], PARTS),
        ([*BOX, BOX[0]], [*PARTS, ""]),
    ):
        shape = outline_of(points, 50.0, parts)
        assert shape.outline.area == pytest.approx(12.0)
        ends = shape.outline.at(np.array([*shape.film, *shape.pressure]))
        expected = [(-2.0, 25.0), (2.0, 25.0), (0.0, 28.0), (-2.0, 25.0)]
        assert ends == pytest.approx(np.array(expected))
    free = outline_of(BOX)
    assert free.outline.at(np.array(free.film)) == pytest.approx(np.array(BOX[:2]))


def test_a_film_away_from_the_rod_is_refused() -> None:
    with pytest.raises(ValueError, match="FILM does not hold the lowest point"):
        outline_of(BOX, 50.0, ["", "PRESSURE", "FILM", "FILM", ""])
    with pytest.raises(ValueError, match="PRESSURE does not begin where FILM ends"):
        outline_of(BOX, 50.0, ["FILM", "", "PRESSURE", "", ""])
    with pytest.raises(ValueError, match="FILM is 2 parts"):
        outline_of(BOX, 50.0, ["FILM", "", "FILM", "", "PRESSURE"])


def save(mesh: SectionMesh, shape: Shape, path: Path, **changes: Any) -> Path:
    """A Gmsh file of a mesh with named lines."""
    segments, places = mesh.segments, mesh.positions + 1e-9
    layers = np.array([layer_of(shape, float(s)) for s in places])
    lines = [("line", segments[layers == name]) for name in ("FILM", "PRESSURE")]
    cells = [("quad", changes.get("quads", mesh.quads)), *lines, *changes.get("more", [])]
    tags = [np.full(len(c), k + 1) for k, (_, c) in enumerate(cells)]
    names = changes.get("names", ("rubber", "FILM", "PRESSURE"))
    field = {name: np.array([k + 1, 2 if k == 0 else 1]) for k, name in enumerate(names)}
    points = np.pad(changes.get("points", mesh.points), ((0, 0), (0, 1)))
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    found = meshio.Mesh(points, cells, cell_data=data, field_data=field)
    meshio.write(path, found, file_format="gmsh22", binary=False)
    return path


def meshed(name: str = "d_ring", density: int = 1) -> tuple[SectionMesh, Shape]:
    return outline_mesh(DRAWN[name], DRAWN[name].film, None, 33, density), DRAWN[name]


@pytest.mark.parametrize("name", ["d_ring", "u_cup"])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_mesh_from_a_file_is_that_mesh(name: str, mirror: float, tmp_path: Path) -> None:
    mesh, shape = meshed(name)
    points = mesh.points * [mirror, 1.0]
    path = save(mesh, shape, tmp_path / "seal.msh", points=points)
    found_shape, found = read_mesh(path, 60.0)
    assert found.arc == mesh.arc
    here, there = found.points[found.boundary], mesh.points[mesh.boundary]
    assert here - here[0] == pytest.approx(there - there[0], abs=1e-12)
    assert here[:, 1].min() == pytest.approx(30.0)
    assert np.sort(corner_jacobians(found)) == pytest.approx(np.sort(corner_jacobians(mesh)))
    assert found.length == pytest.approx(mesh.length, rel=2e-3)
    assert found.points[found.boundary] == pytest.approx(
        found_shape.outline.at(found.positions), abs=1e-9
    )
    assert found_shape.film[0] == 0.0
    assert found_shape.film[1] == pytest.approx(found.positions[found.arc])
    assert len(found.regions["rubber"]) == len(mesh.quads)
    fine = finer(found, 3)
    assert corner_jacobians(fine).min() > 0.9 * corner_jacobians(found).min()
    assert fine.positions[::3] == pytest.approx(found.positions)
    assert len(fine.regions["rubber"]) == 9 * len(found.quads)
    assert fine.points[fine.boundary[::3]] == pytest.approx(found.points[found.boundary])


def test_meshes_that_are_no_sections_are_refused(tmp_path: Path) -> None:
    (mesh, shape), path = meshed(), tmp_path / "seal.msh"
    inside = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    hole = np.flatnonzero(~np.isin(mesh.quads, mesh.boundary).any(axis=1))[-1]
    folded = mesh.points.copy()
    folded[inside[-1]] += [0.9, 0.9]
    wrong: dict[str, dict[str, Any]] = {
        "quadrilaterals of four nodes alone": {"more": [("triangle", mesh.quads[:1, :3])]},
        "more than one loop": {"quads": np.delete(mesh.quads, hole, axis=0)},
        "nothing is named FILM": {"names": ("rubber", "film2", "PRESSURE")},
        "an element at .* is folded": {"points": folded},
    }
    for words, changes in wrong.items():
        with pytest.raises(ValueError, match=f"seal.msh: .*{words}") as error:
            read_mesh(save(mesh, shape, path, **changes))
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="no mesh file"):
        read_mesh(tmp_path / "none.msh")


@pytest.mark.slow
def test_an_o_ring_from_a_drawing_has_the_film_of_the_built_in_one(tmp_path: Path) -> None:
    """A drawn circle is a circle: it has the same mesh."""
    given: dict[str, Any] = {"speeds": (800.0,), "error_estimate": False}
    cases = {
        "drawn": Seal(outline=str(draw(DRAWN["round"], tmp_path / "ring.dxf")), **given),
        "built_in": Seal(**given),
    }
    drawn, built_in = solve_cases(cases, tmp_path / "runs")
    for a, b in zip(drawn.rows, built_in.rows, strict=True):
        assert a.h_star_um == pytest.approx(b.h_star_um, rel=5e-4)
        assert a.verdict == b.verdict


def saved_as_it_is(p: Seal, path: Path) -> tuple[Seal, FilmState]:
    """A case with the mesh that a graded run came to as its file, and what that run found."""
    route = ContactMeshes(ContactSolver(PathDriver(Silent())))
    found = route.contact(p)
    section = found[0].section
    mesh, pressed = section.mesh, section.elements["sealed_side"]
    cells = [(name, mesh.quads[mesh.regions[name]]) for name in p.materials]
    cells.append(("rubber", section.elements["body"]))
    named = [("quad", q) for _, q in cells] + [("line", mesh.arc_segments), ("line", pressed)]
    tags = [np.full(len(c), k + 1) for k, (_, c) in enumerate(named)]
    names = [*(name for name, _ in cells), "film", "pressure"]
    dims = [2] * len(cells) + [1, 1]
    numbers = range(1, len(names) + 1)
    groups = {n: np.array([k, d]) for n, k, d in zip(names, numbers, dims, strict=True)}
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    points = np.pad(mesh.points, ((0, 0), (0, 1)))
    kept = meshio.Mesh(points, named, cell_data=data, field_data=groups)
    meshio.write(path, kept, file_format="gmsh22", binary=False)
    (state,) = run(p, Silent()).states
    changes = {"section": "round", "corner_radius": None, "cap_thickness": None, "density": 1}
    own = {"outline": str(path), "mesh": "file", "inner_diameter": 2.0 * mesh.points[:, 1].min()}
    given = {**p.model_dump(), **changes, **own}
    del given["section_diameter"]
    return Seal(**given), state


ONE_FILM: dict[str, Any] = {"speeds": (800.0,), "stroke": "out", "error_estimate": False}


def test_a_mesh_file_as_it_is_has_the_film_of_that_mesh(tmp_path: Path) -> None:
    p, expected = saved_as_it_is(Seal(density=1, **ONE_FILM), tmp_path / "ring.msh")
    (found,) = run(p, Silent()).states
    assert found.h_star_um == pytest.approx(expected.h_star_um, rel=1e-4)
    assert found.verdict == expected.verdict == OK
    finer = Seal(**{**p.model_dump(), "density": 2})
    assert len(build_system(finer).mesh.quads) == 4 * len(build_system(p).mesh.quads)
