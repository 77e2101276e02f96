"""Sections: shapes and dimensions, drawings and meshes from files, the mesh of any outline."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from ezdxf.filemanagement import new

from softehl.cases.document import DOCS
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
from softehl.cases.seal.gland.sections.shapes import (
    SECTIONS,
    DRing,
    Rectangular,
    Round,
    Section,
    Trapezoid,
    UCup,
    XRing,
    parts_of,
)
from softehl.cases.seal.meshing.outline import Arc, Outline, Shape
from softehl.cases.seal.meshing.outline_mesh import outline_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians
from softehl.cases.seal.meshing.section_mesher import Sizes, section_mesh
from softehl.cases.seal.meshing.spacing import Spot, graded
from softehl.cases.seal.section.layout import Layout, uniform_layout
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.solve.load_stages import PathDriver
from softehl.cases.seal.states.state import OSCILLATING, UNDER_RESOLVED, FilmState, Silent
from softehl.cases.shipped import solve_cases
from tests.cases.gland_matrix import SPEEDS, solved
from tests.cases.section_matrix import NAMES
from tests.cases.section_matrix import drawn as section_drawn
from tests.cases.test_meshing import imbalance

# --- The sections of seals: measures against closed forms, meshes of random dimensions, bad -------


def shoelace(outline: Outline) -> float:
    """The area once more, from very many points."""
    z, r = (outline.at(np.linspace(0.0, outline.length, 40000, endpoint=False)) - [0.0, 25.0]).T
    return float(0.5 * (z * np.roll(r, -1) - r * np.roll(z, -1)).sum())


@pytest.mark.parametrize("name", SECTIONS)
def test_every_section_has_a_place_a_height_and_an_area(name: str) -> None:
    shape = SECTIONS[name]().shape(50.39)
    a, b, c, d = shape.outline.box
    assert shape.name == name
    assert (b, d) == pytest.approx((25.195, 25.195 + 3.53))
    assert a == pytest.approx(-c)
    assert shape.outline.area == pytest.approx(shoelace(shape.outline), rel=1e-6)
    assert shape.outline.centroid[0] == pytest.approx(0.0, abs=1e-9 if name != "u_cup" else 1.0)
    start, end, crown, foot = shape.outline.at(np.array([*shape.film, *shape.pressure]))
    assert start[0] < 0.0 < end[0]
    assert foot == pytest.approx(start)
    assert crown[1] == pytest.approx(d, abs=1e-3)


def test_areas_of_the_simple_ones() -> None:
    cut = (4.0 - pi) / 4.0  # of a square over the radius that a corner loses
    assert Round(height=3.0).shape(50.0).outline.area == pytest.approx(pi * 2.25, rel=1e-13)
    shape = Rectangular(height=3.0, width=4.0, corner_radius=0.5).shape(50.0)
    assert shape.outline.area == pytest.approx(12.0 - 4 * cut * 0.25, rel=1e-13)
    shape = DRing(height=3.0, width=2.0, nose_radius=1.0, corner_radius=0.2).shape(50.0)
    expected = 2.0 * 2.0 + 0.5 * pi - 2 * cut * 0.04
    assert shape.outline.area == pytest.approx(expected, rel=1e-13)
    shape = Trapezoid(height=3.0, width=4.0, rod_width=2.0, corner_radius=0.0).shape(50.0)
    assert shape.outline.area == pytest.approx(9.0, rel=1e-13)


def test_dimensions_that_are_left_out_are_parts_of_the_height() -> None:
    for kind in SECTIONS.values():
        section = kind(height=7.0)
        for name, share in parts_of(kind).items():
            assert getattr(section, name) == pytest.approx(7.0 * share)


def test_an_x_ring_whose_lobes_grow_together_is_an_o_ring() -> None:
    circle = pi * 1.5**2
    areas = [
        XRing(height=3.0, lobe_radius=lobe).shape(50.0).outline.area for lobe in (1.45, 1.499, 1.5)
    ]
    assert areas[2] == pytest.approx(circle, rel=1e-13)
    assert areas[1] == pytest.approx(circle, rel=3e-3)
    assert abs(areas[0] - circle) > abs(areas[1] - circle) > abs(areas[2] - circle)


def drawn(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Random dimensions within what the documentation of a section names."""

    def u(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    h = u(1.5, 8.0)
    w = h * u(0.7, 1.6)
    smaller, foot = min(h, w), w * u(0.4, 1.3)
    found: dict[str, dict[str, float]] = {
        "round": {},
        "rectangular": {"width": w, "corner_radius": smaller * u(0.0, 0.5)},
        "x_ring": {
            "width": h * u(0.9, 1.2),
            "lobe_radius": h * u(0.2, 0.4),
            "fillet_radius": h * u(0.2, 0.6),
        },
        "d_ring": {
            "width": w,
            "nose_radius": w * u(0.5, 2.0),
            "corner_radius": smaller * u(0.02, 0.25),
        },
        "trapezoid": {
            "width": w,
            "rod_width": foot,
            "corner_radius": min(smaller, foot) * u(0.0, 0.33),
        },
        "u_cup": {
            "width": h * u(1.0, 1.8),
            "heel_height": h * u(0.7, 1.0),
            "mouth_depth": h * u(0.4, 0.8),
            "mouth_opening": h * u(0.3, 0.5),
            "mouth_root": h * u(0.1, 0.3),
            "bevel": h * u(0.1, 0.2),
            "edge_radius": h * u(0.01, 0.04),
            "corner_radius": h * u(0.02, 0.1),
        },
    }
    return {"height": h, **found[name]}


def require_sound_meshes(name: str, seeds: range, densities: tuple[int, ...]) -> None:
    for seed in seeds:
        rng = np.random.default_rng(seed)
        sizes = drawn(name, rng)
        shape = SECTIONS[name](**sizes).shape(float(rng.uniform(10.0, 200.0)))
        length = shape.film[1] - shape.film[0]
        spots = [Spot(length * float(x)) for x in rng.uniform(0.1, 0.9, 2)]
        fine = graded(length, spots, 66, coarsest=length / 12, rate=0.3)
        for density, spacing in product(densities, (None, fine)):
            mesh = outline_mesh(shape, shape.film, spacing, 33, density)
            # segments of the film that are longer than a fillet on it cost up to this much
            least = 0.3 if spacing is None else 0.1
            assert corner_jacobians(mesh).min() >= least, (seed, sizes)


@pytest.mark.parametrize("name", SECTIONS)
def test_sections_of_random_dimensions_have_sound_meshes(name: str) -> None:
    require_sound_meshes(name, range(2), (1,))


@pytest.mark.slow
@pytest.mark.parametrize("name", SECTIONS)
def test_many_sections_of_random_dimensions_have_sound_meshes(name: str) -> None:
    require_sound_meshes(name, range(2, 22), (1, 2))


def test_a_strip_that_folds_only_in_the_finer_mesh_is_made_thinner() -> None:
    require_sound_meshes("u_cup", range(14, 15), (4,))


@pytest.mark.parametrize("name", ["rectangular", "x_ring", "d_ring", "trapezoid", "u_cup"])
def test_the_patch_test_is_passed(name: str) -> None:
    shape = SECTIONS[name]().shape(50.39)
    mesh = outline_mesh(shape, shape.film, None, 33, 1)
    assert imbalance(mesh, (0.2, -0.1)) < 1e-11
    assert imbalance(mesh, (0.2, -0.1), bow=1e-3) > 1e-5


BAD: list[tuple[type[Section], dict[str, Any], str]] = [
    (Rectangular, {"corner_radius": 2.0}, "corner_radius = 2 mm; at most half of the smaller side"),
    (XRing, {"lobe_radius": 2.0}, "lobe_radius = 2 mm; at most half of the smaller side"),
    (XRing, {"lobe_radius": 0.5, "fillet_radius": 0.5}, "does not reach from lobe to lobe"),
    (XRing, {"lobe_radius": 0.05, "fillet_radius": 1.67}, "leave no rubber between the grooves"),
    (DRing, {"nose_radius": 1.0}, "nose_radius = 1 mm; half the width to ten widths"),
    (DRing, {"height": 2.0, "width": 4.0, "nose_radius": 2.0}, "make the section higher"),
    (Trapezoid, {"rod_width": 9.0}, "rod_width = 9 mm; at most twice the width"),
    (UCup, {"mouth_root": 3.0}, "mouth_root = 3 mm; at most the mouth_opening"),
    (UCup, {"mouth_opening": 3.0}, "the tips of the lips are"),
    (UCup, {"mouth_depth": 4.5}, "leave no heel"),
    (UCup, {"heel_height": 4.0}, "heel_height = 4 mm; at most the height over the lips"),
]


@pytest.mark.parametrize(("kind", "sizes", "words"), BAD, ids=lambda x: str(x)[:30])
def test_dimensions_that_bound_no_section_are_named(
    kind: type[Section], sizes: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        kind(**sizes).shape(50.0)
    assert "\n" not in str(error.value)


def test_every_section_is_on_its_page() -> None:
    text = (DOCS / "sections.md").read_text(encoding="utf-8")
    for name in SECTIONS:
        assert text.count(f"\n## {name}\n") == 1
        assert f"(pictures/section_{name}.png)" in text
        assert parts_of(SECTIONS[name]) == {} or f"<!-- section {name} -->" in text


# --- Sections from drawings, points and meshes: exact arcs, names, and what is refused ------------


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


UNSOUND: dict[str, Callable[[Any], Any]] = {
    "seal.dxf: there is more than one contour, such as at (0.2, 25)": lambda s: s.add_circle(
        (0, 25), 0.2
    ),
    "seal.dxf: SPLINE on layer '0' is no line": bad_spline,
    "seal.dxf: the contour is open: a gap of 3.162 mm at (3, 25)": lambda s: remove(s, "free"),
    "seal.dxf: nothing is named FILM": rename,
}


@pytest.mark.parametrize("words", UNSOUND)
def test_a_drawing_that_is_no_section_is_refused(words: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        read_outline(stadium(tmp_path / "seal.dxf", UNSOUND[words]))
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


# --- Meshes of outlines drawn at random: sound elements, the area, the patch test -----------------


SOUND = 0.1  # least share of a corner in its element


def layout_of(number: int) -> Layout:
    """A layout with segments that are fine at two places, of any section or of a circle."""
    rng = np.random.default_rng([3, number])
    if number % 6 == 5:
        radius, inner = rng.uniform(0.9, 3.5), rng.uniform(5.0, 100.0)
        circle = Outline.circle((0.0, inner + radius), radius)
        shape = Shape.facing(circle, (0.0, inner + 2.0 * radius), "ring")
        layout = Layout(shape, shape.film, Sizes())
    else:
        layout = uniform_layout(section_drawn(number))
    begin, end = layout.film
    length = end - begin
    ends = rng.uniform(0.0, 0.15) * length, rng.uniform(0.85, 1.0) * length
    length, long = ends[1] - ends[0], 33 + 3 * int(rng.integers(0, 9))
    spots = [Spot(share * length) for share in rng.uniform(0.05, 0.95, 2)]
    spacing = graded(length, spots, 2 * long, coarsest=length / 12, rate=0.3)
    return layout.between(layout, ends).graded(spacing, long, 0.01)


@pytest.mark.parametrize(
    "number", [pytest.param(n, marks=[pytest.mark.slow] * (n > 3)) for n in range(10)]
)
def test_the_mesh_of_any_outline_is_sound_and_passes_the_patch_test(number: int) -> None:
    layout = layout_of(number)
    mesh, outline = layout.mesh(2), layout.shape.outline
    assert corner_jacobians(mesh).min() >= SOUND
    x, after = mesh.points[mesh.segments].transpose(1, 0, 2)
    area = 0.5 * float((x[:, 0] * after[:, 1] - after[:, 0] * x[:, 1]).sum())
    assert area == pytest.approx(outline.area, rel=3e-3)
    assert mesh.points[mesh.boundary] == pytest.approx(outline.at(mesh.positions), abs=1e-11)
    assert mesh.positions[[0, mesh.arc]] == pytest.approx(layout.film)
    assert imbalance(mesh, (0.2, -0.1)) < 1e-10


def test_a_moved_node_fails_what_the_meshes_pass() -> None:
    mesh = layout_of(5).mesh(1)
    assert imbalance(mesh, (0.2, -0.1), bow=1e-3) > 1e-5
    inside = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)[0]
    points = mesh.points.copy()
    points[inside] += 10.0
    assert corner_jacobians(replace(mesh, points=points)).min() < 0.0


@pytest.mark.parametrize("begin", [0.0, 1.0, 4.0])
def test_a_circle_has_the_same_mesh_wherever_its_outline_begins(begin: float) -> None:
    circle = Outline.circle((0.5, 26.0), 1.7)
    turned = Outline(circle.part(begin, begin + circle.length - 1e-13))
    film = -1.0, 1.2
    shapes = [Shape(outline, film, (5.0, -1.0)) for outline in (circle, turned)]
    mesh = section_mesh(shapes[0], film, Sizes(33, None, 0.02), 1)
    moved = section_mesh(shapes[1], (film[0] - begin, film[1] - begin), Sizes(33, None, 0.02), 1)
    assert moved.points == pytest.approx(mesh.points, abs=1e-12)
    assert moved.positions + begin == pytest.approx(mesh.positions, abs=1e-12)


def test_a_density_that_has_no_mesh_is_refused() -> None:
    for number in (0, 5):
        with pytest.raises(ValueError, match="at least 2/3"):
            layout_of(number).mesh(0)


# --- Glands of the sample of sections: what is drawn makes sense, and some are solved whole -------


WHOLE = {"trapezoid": 3, "rectangular": 5, "d_ring": 7}
"""One gland of a section each, by number, that is solved within half a minute of a processor."""


def test_what_is_drawn_fits_its_groove() -> None:
    for number in range(2 * len(NAMES)):
        p = section_drawn(number)
        depth = 0.5 * (p.housing_diameter - p.rod_diameter)
        assert p.section == NAMES[number % len(NAMES)]
        assert p.free_section.outline.area <= 0.95 * depth * p.groove_width
        assert 1.03 * p.axial_width <= p.groove_width + 1e-3
        assert 0.0 <= p.sealed_pressure <= 2.0 * p.shear_modulus + 1e-3
        assert section_drawn(number) == p


@pytest.mark.slow
def test_oil_gets_below_a_lip_that_lies_flat() -> None:
    found = solved(
        29, 150.0, section_drawn, stroke="out"
    )  # a U-cup: 3 mm of lip under 0.3 MPa, and a heel
    assert {s["verdict"] for s in found["states"]} <= {OK, OSCILLATING, UNDER_RESOLVED}
    h = [s["h_star_um"] for s in found["states"]]
    assert h == pytest.approx([9.37, 2.73, 0.833], rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("section", WHOLE)
def test_a_gland_of_the_sample_is_solved_whole(section: str) -> None:
    found = solved(WHOLE[section], 120.0, section_drawn)
    assert found["section"] == section
    assert found["message"] == ""
    assert [s["verdict"] for s in found["states"]] == 2 * len(SPEEDS) * [OK]
    for stroke in (found["states"][:3], found["states"][3:]):
        h = [s["h_star_um"] for s in stroke]
        # the inlet alone decides: h* rises with U^0.6 where viscosity does not rise with pressure
        assert h[0] / h[1] == pytest.approx(10.0**0.6, rel=0.05)
        assert h[1] / h[2] == pytest.approx(10.0**0.6, rel=0.05)
