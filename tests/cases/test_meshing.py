"""Outlines of sections and their meshes; transfer between meshes."""

import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from math import cos, pi, sin

import numpy as np
import pytest

from softehl.cases.seal.meshing.o_grid import Disc, disc_mesh
from softehl.cases.seal.meshing.outline import (
    Arc,
    Line,
    Outline,
    OutlineError,
    Piece,
    Shape,
    rounded,
)
from softehl.cases.seal.meshing.outline_checks import crossing
from softehl.cases.seal.meshing.outline_mesh import outline_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians
from softehl.cases.seal.meshing.section_mesher import Sizes, section_mesh
from softehl.cases.seal.meshing.spacing import Spacing, Spot, graded
from softehl.cases.seal.meshing.two_region_mesh import BODY, CAP, parted_mesh
from softehl.cases.seal.solve.transfer import (
    places_of,
    transfer_boundary,
    transfer_chain,
    transfer_elements,
    transfer_nodes,
)
from softehl.runtime.mesh.mesh import MeshError
from tests.reference.calling import Part

# --- The O-grid: counts, orientation, exact boundary, refinement, nesting -------------------------


ARCS = [(-34.0, 43.0), (-45.0, 45.0), (-60.0, 70.0)]
DENSITIES = [1, 2, 4, 8, 16]


def _disc(arc: tuple[float, float] = ARCS[0]) -> Disc:
    return Disc(0.0, 26.96, 1.765, *arc)


def _edges(mesh: SectionMesh) -> np.ndarray:
    x = mesh.points[mesh.quads]
    return np.asarray(np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2))


@pytest.mark.parametrize("d", DENSITIES)
def test_counts(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    assert mesh.quads.shape == (360 * d**2, 4)
    assert len(mesh.boundary) == 66 * d
    assert len(mesh.points) == 360 * d**2 + 33 * d + 1  # Euler's formula for a disc of quads
    assert mesh.arc_segments.shape == (27 * d, 2)
    assert len(mesh.outer_nodes) == 39 * d + 1
    assert len(mesh.outer_segments) == 39 * d


@pytest.mark.parametrize("d", DENSITIES)
@pytest.mark.parametrize("arc", ARCS)
def test_no_element_is_folded(d: int, arc: tuple[float, float]) -> None:
    assert corner_jacobians(disc_mesh(_disc(arc), d)).min() > 0.5


def test_jacobians_see_a_folded_element() -> None:
    mesh = disc_mesh(_disc(), 1)
    points = mesh.points.copy()
    points[mesh.quads[100, 0]] = points[mesh.quads[100, 2]] + [1e-3, 1e-3]
    folded = replace(mesh, points=points)
    assert corner_jacobians(folded).min() < 0.0


@pytest.mark.parametrize("d", DENSITIES)
def test_boundary_lies_on_the_circle_and_runs_counterclockwise(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    boundary = mesh.points[mesh.boundary] - [0.0, 26.96]
    assert np.hypot(*boundary.T) == pytest.approx(1.765, abs=1e-13)
    a, b = boundary, np.roll(boundary, -1, axis=0)
    assert np.all(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0.0)


def test_boundary_is_the_boundary() -> None:
    mesh = disc_mesh(_disc(), 2)
    edges = np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    directed = {(int(a), int(b)) for a, b in edges}
    free = {edge for edge in directed if edge[::-1] not in directed}
    assert free == {(int(a), int(b)) for a, b in mesh.segments}


@pytest.mark.parametrize("d", DENSITIES)
def test_arc_segments_are_equal_and_span_the_arc(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    arc = mesh.points[mesh.arc_segments]
    lengths = np.linalg.norm(arc[:, 1] - arc[:, 0], axis=1)
    assert lengths == pytest.approx(lengths[0], rel=1e-10)
    ends = mesh.points[mesh.arc_nodes[[0, -1]]]
    angles = np.degrees(np.arctan2(ends[:, 0], 26.96 - ends[:, 1]))
    assert angles == pytest.approx([-34.0, 43.0])


@pytest.mark.parametrize("d", DENSITIES)
def test_elements_on_the_arc_are_about_as_tall_as_wide_and_the_smallest(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    edges = _edges(mesh)
    on_arc = edges[: mesh.arc]
    ratio = on_arc[:, 1] / on_arc[:, 0]
    assert ratio.min() > 0.4
    assert ratio.max() < 1.5
    assert on_arc[:, 1].max() < 0.5 * edges[:, 1].max()


def test_area_converges_to_the_circle_with_second_order() -> None:
    errors = []
    for d in (2, 4, 8):
        mesh = disc_mesh(_disc(), d)
        a, b = mesh.points[mesh.segments[:, 0]], mesh.points[mesh.segments[:, 1]]
        area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        errors.append(np.pi * 1.765**2 - area)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_density_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 2/3"):
        disc_mesh(_disc(), 0)


# --- Outlines: measures against closed forms, places, and what is no outline ----------------------


SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
RING = Outline.circle((0.3, 26.0), 1.7)


def stadium(a: float, r: float) -> Outline:
    """A rectangle 2 a by 2 r between half circles, its lower side first."""
    return Outline(
        [
            Line((-a, -r), (a, -r)),
            Arc((a, -r), (a, r), (a, 0.0)),
            Line((a, r), (-a, r)),
            Arc((-a, r), (-a, -r), (-a, 0.0)),
        ]
    )


def test_measures_of_a_circle() -> None:
    assert RING.length == pytest.approx(2 * pi * 1.7, rel=1e-15)
    assert RING.area == pytest.approx(pi * 1.7**2, rel=1e-14)
    assert RING.centroid == pytest.approx((0.3, 26.0), rel=1e-14)
    assert RING.polar_moment == pytest.approx(0.5 * pi * 1.7**4, rel=1e-13)


def test_measures_of_a_stadium_and_a_triangle() -> None:
    a, r = 0.7, 0.4
    shape = stadium(a, r).moved(shift=(5.0, 30.0))
    half, offset = 0.5 * pi * r**2, 4 * r / (3 * pi)
    moment = 4 * a * r * ((2 * a) ** 2 + (2 * r) ** 2) / 12
    # a half circle about its own centroid, then moved to where it is
    moment += 2 * (0.25 * pi * r**4 - half * offset**2 + half * (a + offset) ** 2)
    assert shape.area == pytest.approx(4 * a * r + pi * r**2, rel=1e-14)
    assert shape.centroid == pytest.approx((5.0, 30.0), rel=1e-14)
    assert shape.polar_moment == pytest.approx(moment, rel=1e-12)
    triangle = Outline.polygon([(0.0, 10.0), (3.0, 10.0), (0.0, 12.0)])
    assert triangle.area == pytest.approx(3.0, rel=1e-14)
    assert triangle.centroid == pytest.approx((1.0, 10.0 + 2.0 / 3.0), rel=1e-14)
    assert triangle.polar_moment == pytest.approx(3.0 * (9.0 + 4.0) / 18.0, rel=1e-12)


def test_places_and_points_belong_together() -> None:
    for shape in (RING, stadium(0.7, 0.4), Outline(rounded(SQUARE, [0.0, 0.3, 0.5, 0.1]))):
        s = np.linspace(0.0, shape.length, 333, endpoint=False)
        assert shape.position(shape.at(s)) == pytest.approx(s, abs=1e-12)
        step = 1e-6
        slope = (shape.at(s + 0.5 * step) - shape.at(s - 0.5 * step)) / step
        smooth = np.abs((s[:, None] - shape.kinks + 1e-5) % shape.length).min(initial=1, axis=1)
        assert slope[smooth > 1e-4] == pytest.approx(shape.tangent(s)[smooth > 1e-4], abs=1e-5)
        assert shape.at(s + shape.length) == pytest.approx(shape.at(s), abs=1e-12)


def test_a_point_beside_the_outline_gets_the_nearest_place() -> None:
    places = stadium(0.7, 0.4).position(np.array([[0.0, -5.0], [0.2, -0.3], [9.0, 0.0]]))
    assert places == pytest.approx([0.7, 0.9, 1.4 + 0.2 * pi])


def test_corners() -> None:
    assert Outline.polygon(SQUARE).kinks == pytest.approx([0.0, 2.0, 4.0, 6.0])
    assert len(Outline(rounded(SQUARE, 0.2)).kinks) == 0
    assert len(Outline(rounded(SQUARE, [0.0, 0.2, 0.2, 0.2])).kinks) == 1


def test_a_clockwise_outline_is_turned_round() -> None:
    turned = Outline.polygon(SQUARE[::-1])
    assert turned.area == pytest.approx(4.0)
    assert turned.at(np.array([0.0])) == pytest.approx(np.array([SQUARE[3]]))


def test_a_rounded_square() -> None:
    shape, r = Outline(rounded(SQUARE, 0.25)), 0.25
    assert shape.area == pytest.approx(4.0 - (4.0 - pi) * r**2, rel=1e-14)
    assert shape.length == pytest.approx(8.0 - (8.0 - 2.0 * pi) * r, rel=1e-14)
    full = Outline(rounded(SQUARE, 1.0))
    assert full.area == pytest.approx(pi, rel=1e-14)
    assert len(full.pieces) == 4


BAD: dict[str, Callable[[], object]] = {
    "a gap of 0.05 mm at (2, 1.95)": lambda: Outline(
        [Line((0, 0), (2, 0)), Line((2, 0), (2, 1.95)), Line((2, 2), (0, 0))]
    ),
    "crosses or touches itself at (1, 1)": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]
    ),
    "touches itself at (1, 0)": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.0), (0.0, 2.0)]
    ),
    "piece 2 of the outline, at (2, 0), has no length": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 0.0), (2.0, 2.0)]
    ),
    "turns back upon itself at (2, 2)": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (2.0, 1.0), (0.0, 1.0)]
    ),
    "2 points make no outline": lambda: Outline.polygon([(0.0, 0.0), (1.0, 0.0)]),
    "take 2.4 of its 2 mm": lambda: rounded(SQUARE, 1.2),
}


@pytest.mark.parametrize("words", BAD)
def test_what_is_no_outline_is_named(words: str) -> None:
    with pytest.raises(OutlineError, match=re.escape(words)) as error:
        BAD[words]()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0])
def test_a_line_through_an_arc_is_seen(angle: float) -> None:
    """A half disc whose straight side bulges through its round one."""
    tip = -1.01 * np.array([-sin(angle), cos(angle)])
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    a, b = (tuple(turn @ p) for p in ([-1.0, 0.0], [1.0, 0.0]))
    pieces: list[Piece] = [Arc(a, b, (0.0, 0.0)), Line(b, tuple(-tip)), Line(tuple(-tip), a)]
    assert Outline(pieces).area > 0.5 * pi
    with pytest.raises(OutlineError, match="crosses"):
        Outline([pieces[0], Line(b, tuple(tip)), Line(tuple(tip), a)])


def test_the_film_may_be_where_the_section_faces_the_rod() -> None:
    shape = Shape.facing(RING, (0.3, 27.7), "round")
    assert np.degrees(np.array(shape.film) / 1.7) == pytest.approx([-75.0, 75.0])
    assert shape.pressure == pytest.approx((pi * 1.7, shape.film[0]))
    flat = Shape.facing(Outline(rounded(SQUARE, 0.3)), (1.0, 2.0), "square", steepest=60.0)
    ends = flat.outline.at(np.array(flat.film))
    assert ends[0] == pytest.approx([0.3 - 0.3 * sin(pi / 3), 0.15])
    assert ends[1] == pytest.approx([1.7 + 0.3 * sin(pi / 3), 0.15])
    sharp = Shape.facing(Outline.polygon(SQUARE), (1.0, 2.0), "square")
    assert sharp.film == pytest.approx((0.0, 2.0))


def test_a_polygon_that_runs_into_itself_is_seen() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert crossing(square) is None
    assert crossing(square[[0, 2, 1, 3]]) == pytest.approx([1.0, 1.0])


# --- Meshes of outlines: sound elements, exact boundaries, families of one density ----------------


OUTLINE_DENSITIES = [
    *(Fraction(2, 3), 1, Fraction(5, 3)),
    *(pytest.param(d, marks=pytest.mark.slow) for d in (2, 3, 4)),
]
WEDGE = [(-1.0, 25.0), (1.2, 25.0), (1.7, 27.6), (0.4, 26.8), (-1.1, 28.5)]


def ring() -> Shape:
    return Shape.facing(Outline.circle((0.0, 26.0), 1.765), (0.0, 27.765), "round")


def horn() -> Shape:
    """Convex and concave, a sharp corner and round ones."""
    return Shape.facing(Outline(rounded(WEDGE, [0.2, 0.1, 0.0, 0.3, 0.05])), (-1.1, 28.4), "horn")


SHAPES = {"ring": ring(), "horn": horn()}


def mesh_of(shape: Shape, density: int | Fraction) -> SectionMesh:
    return outline_mesh(shape, shape.film, None, 33, density)


def area(mesh: SectionMesh) -> float:
    x = mesh.points[mesh.quads]
    a, b = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    return float(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


@pytest.mark.parametrize("density", OUTLINE_DENSITIES)
@pytest.mark.parametrize("name", SHAPES)
def test_elements_are_sound_and_fill_the_section(name: str, density: int | Fraction) -> None:
    shape = SHAPES[name]
    mesh = mesh_of(shape, density)
    assert corner_jacobians(mesh).min() >= 0.3
    assert area(mesh) == pytest.approx(shape.outline.area, rel=0.01 / density**2)
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], 2).reshape(-1, 2), 1)
    kinds, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    assert {tuple(e) for e in kinds[count == 1]} == {tuple(sorted(s)) for s in mesh.segments}
    assert len(mesh.points) == len(np.unique(mesh.quads))


@pytest.mark.parametrize("name", SHAPES)
def test_the_boundary_lies_on_the_outline_at_its_places(name: str) -> None:
    shape = SHAPES[name]
    mesh = mesh_of(shape, 2)
    assert mesh.arc == 66
    assert mesh.length == shape.outline.length
    assert mesh.points[mesh.boundary] == pytest.approx(shape.outline.at(mesh.positions), abs=1e-12)
    assert mesh.positions[[0, mesh.arc]] == pytest.approx(shape.film)
    assert (np.diff(mesh.positions) > 0.0).all()
    for corner in shape.outline.kinks:
        away = (mesh.positions - corner + 1e-9) % mesh.length
        assert away.min() < 1e-8


def test_the_nodes_of_the_film_are_where_the_spacing_has_them() -> None:
    shape = SHAPES["ring"]
    length = shape.film[1] - shape.film[0]
    spacing = graded(length, (Spot(1.0), Spot(3.0)), 2 * 33, coarsest=length / 12, rate=0.3)
    mesh = outline_mesh(shape, shape.film, spacing, 33, 2)
    expected = shape.film[0] + length * spacing(np.arange(67) / 66)
    assert mesh.positions[:67] == pytest.approx(expected, abs=1e-12)
    assert corner_jacobians(mesh).min() >= 0.3


def test_a_mesh_of_twice_the_density_is_of_the_same_family() -> None:
    coarse, fine = mesh_of(SHAPES["horn"], 2), mesh_of(SHAPES["horn"], 4)
    assert len(fine.quads) == 4 * len(coarse.quads)
    assert fine.positions[::2] == pytest.approx(coarse.positions, abs=1e-12)


def test_a_density_that_does_not_divide_the_segments_is_named() -> None:
    with pytest.raises(MeshError, match="density 4/3 is not allowed with 32 segments"):
        outline_mesh(ring(), (-1.0, 1.0), None, 32, Fraction(4, 3))
    with pytest.raises(MeshError, match="density 1/3 is not allowed"):
        mesh_of(ring(), Fraction(1, 3))


def imbalance(mesh: SectionMesh, stretch: tuple[float, float], bow: float = 0.0) -> float:
    """Largest force at a node inside under u = (a Z, b R) + bow Z^2 over that on an element."""
    maps = (2 * mesh.quads[:, :, None] + np.arange(2)).reshape(-1, 8)
    x = mesh.points[mesh.quads].reshape(-1, 8)
    part = Part("solid_taylor_mean", x, maps, (3.04, 0.62, 500.0))
    u = mesh.points * stretch
    u[:, 1] += bow * mesh.points[:, 0] ** 2
    forces = part.elements(u.ravel())[0]
    total = np.bincount(maps.ravel(), forces.ravel(), u.size)
    inside = np.ones(len(mesh.points), dtype=np.bool_)
    inside[mesh.boundary] = False
    return float(np.abs(total.reshape(-1, 2)[inside]).max() / np.abs(forces).max())


@pytest.mark.parametrize("name", SHAPES)
def test_the_patch_test_is_passed(name: str) -> None:
    mesh = mesh_of(SHAPES[name], 1)
    assert imbalance(mesh, (0.2, -0.1)) < 1e-11
    assert imbalance(mesh, (0.2, -0.1), bow=1e-3) > 1e-5


# --- Meshes of sections that a cut parts into two regions -----------------------------------------


PARTED_DENSITIES = [Fraction(5, 3), 1, *(pytest.param(d, marks=pytest.mark.slow) for d in (2, 4))]


def capped() -> Shape:
    """A trapezoid, 3.5 mm high, with a cut 0.7 mm above its foot."""
    corners = [(-1.2, 25.0), (1.4, 25.0), (1.8, 28.5), (-1.6, 28.5)]
    shape = Shape.facing(Outline(rounded(corners, 0.3)), (0.0, 28.5), "capped")
    begin, end = shape.outline.level(25.7)
    return replace(shape, chord=(float(begin), float(end)))


SHAPE = capped()
LENGTH = SHAPE.film[1] - SHAPE.film[0]
FINE = graded(LENGTH, [Spot(0.2 * LENGTH), Spot(0.8 * LENGTH)], 66, coarsest=0.2, rate=0.3)


def parted_mesh_of(density: int | Fraction, spacing: Spacing | None = None) -> SectionMesh:
    return parted_mesh(SHAPE, SHAPE.film, spacing, 33, density)


def parted_area(mesh: SectionMesh, region: str) -> float:
    x = mesh.points[mesh.quads[mesh.regions[region]]]
    a, b = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    return float(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


@pytest.mark.parametrize("density", PARTED_DENSITIES)
def test_both_regions_are_filled_and_joined(density: int | Fraction) -> None:
    mesh = parted_mesh_of(density, FINE)
    assert corner_jacobians(mesh).min() >= 0.2  # segments of the film are longer than its fillets
    for region, part in zip((CAP, BODY), SHAPE.parts, strict=True):
        assert parted_area(mesh, region) == pytest.approx(part.area, rel=0.01 / density**2)
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], 2).reshape(-1, 2), 1)
    kinds, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    assert {tuple(e) for e in kinds[count == 1]} == {tuple(sorted(s)) for s in mesh.segments}
    assert len(mesh.points) == len(np.unique(mesh.quads))


@pytest.mark.parametrize("density", PARTED_DENSITIES)
def test_its_boundary_is_the_outline_and_its_cut_is_straight(density: int | Fraction) -> None:
    mesh, outline = parted_mesh_of(density), SHAPE.outline
    assert mesh.points[mesh.boundary] == pytest.approx(outline.at(mesh.positions), abs=1e-12)
    assert mesh.positions[0] == SHAPE.film[0]
    assert np.diff(mesh.positions).min() > 0.0
    assert mesh.positions[-1] < mesh.positions[0] + mesh.length
    shared = np.intersect1d(mesh.quads[mesh.regions[CAP]], mesh.quads[mesh.regions[BODY]])
    assert mesh.points[shared, 1] == pytest.approx(25.7, abs=1e-9)
    below = mesh.quads[mesh.regions[CAP]]
    assert mesh.points[below, 1].max() <= 25.7 + 1e-9


def test_meshes_of_doubled_density_share_the_nodes_of_the_cut() -> None:
    shared = []
    for mesh in (parted_mesh_of(1), parted_mesh_of(2)):
        nodes = np.unique(mesh.quads[mesh.regions[CAP]])
        z, r = mesh.points[nodes].T
        shared.append(z[np.abs(r - 25.7) < 1e-9].round(9))
    assert len(shared[0]) > 5
    assert np.isin(shared[0], shared[1]).all()


def test_the_patch_test_is_passed_by_two_regions() -> None:
    assert imbalance(parted_mesh_of(1), (0.2, -0.1)) < 1e-11


def test_the_level_of_an_outline() -> None:
    circle = Outline.circle((0.5, 26.0), 2.0)
    assert circle.at(circle.level(26.0)) == pytest.approx(np.array([[-1.5, 26.0], [2.5, 26.0]]))
    assert len(circle.level(28.5)) == 0
    assert len(SHAPE.outline.level(25.7)) == 2


def test_a_part_of_an_outline_has_its_length_and_ends() -> None:
    outline = SHAPE.outline
    for begin, end in ((0.3, 4.0), (4.0, 0.3), (9.0, 2.5)):
        pieces = outline.part(begin, end)
        assert sum(p.length for p in pieces) == pytest.approx((end - begin) % outline.length)
        assert pieces[0].start == pytest.approx(outline.at(np.array([begin]))[0])
        assert pieces[-1].end == pytest.approx(outline.at(np.array([end]))[0])


# --- Graded lines: the size function is obeyed, meshes are nested, bad requests are refused -------


LINE_LENGTH, SPOTS, COUNT = 2.4, (0.4, 1.8), 54
TWO = tuple(Spot(place) for place in SPOTS)


def _sizes(count: int = COUNT, **changes: float) -> tuple[np.ndarray, np.ndarray]:
    given = {"coarsest": 0.1, "rate": 0.25, **changes}
    spacing = graded(LINE_LENGTH, TWO, COUNT, **given)
    nodes = LINE_LENGTH * spacing(np.arange(count + 1) / count)
    return np.diff(nodes), 0.5 * (nodes[1:] + nodes[:-1])


def test_a_segment_is_as_long_as_the_size_function_says() -> None:
    sizes, middle = _sizes(8 * COUNT)
    finest = 8 * sizes.min()
    distance = np.abs(middle[:, None] - SPOTS).min(axis=1)
    assert 8 * sizes == pytest.approx(np.minimum(0.1, finest + 0.25 * distance), rel=0.02)
    assert sizes.sum() == pytest.approx(LINE_LENGTH, rel=1e-12)


def test_the_finest_segments_lie_at_the_spots() -> None:
    sizes, middle = _sizes()
    for spot in SPOTS:
        assert sizes[np.abs(middle - spot).argmin()] == pytest.approx(sizes.min(), rel=0.15)
    assert sizes.max() <= 0.1 * (1 + 1e-6)
    assert sizes.min() < 0.1 * LINE_LENGTH / COUNT * 2.0


def test_twice_the_density_has_the_same_nodes() -> None:
    spacing = graded(LINE_LENGTH, TWO, COUNT, coarsest=0.1, rate=0.25)
    coarse, fine = (spacing(np.arange(n + 1) / n) for n in (COUNT, 2 * COUNT))
    assert fine[::2].tolist() == coarse.tolist()


def test_a_larger_rate_makes_the_finest_segment_finer() -> None:
    assert _sizes(rate=0.35)[0].min() < _sizes(rate=0.25)[0].min() < _sizes(rate=0.2)[0].min()


def test_a_spot_may_be_given_finer_segments() -> None:
    spots = (Spot(0.4, 3.0), Spot(1.8))
    nodes = LINE_LENGTH * graded(LINE_LENGTH, spots, COUNT, coarsest=0.1, rate=0.25)(
        np.arange(865) / 864
    )
    at = [np.diff(nodes)[np.abs(nodes[1:] - spot.position).argmin()] for spot in spots]
    assert at[0] / at[1] == pytest.approx(3.0, rel=0.1)


def test_segments_that_cannot_fill_the_line_are_refused() -> None:
    with pytest.raises(ValueError, match=r"must be larger than 0\.0444"):
        graded(LINE_LENGTH, TWO, COUNT, coarsest=0.04, rate=0.25)
    with pytest.raises(ValueError, match="at least one"):
        graded(LINE_LENGTH, (), COUNT, coarsest=0.1, rate=0.25)


# --- From mesh to mesh: linear fields exactly, nothing across a mouth, chains keep their bounds ---


FORK = [(0, 0), (4, 0), (4, 1.0), (0.5, 1.0), (0.5, 1.3), (4, 1.3), (4, 2.3), (0, 2.3)]


def meshes(name: str) -> tuple[SectionMesh, SectionMesh]:
    """One of equal segments, and one of other segments on another part of the outline."""
    shape = SHAPES[name]
    film = shape.film[0] + 0.1, shape.film[1] - 0.2
    length = film[1] - film[0]
    fine = graded(length, (Spot(0.5), Spot(1.5)), 84, coarsest=0.1 * length, rate=0.3)
    old = section_mesh(shape, shape.film, Sizes(33), 2)
    return old, section_mesh(shape, film, Sizes(42, fine, 0.01), 2)


@pytest.mark.parametrize("name", ["ring", pytest.param("horn", marks=pytest.mark.slow)])
def test_linear_fields_are_exact_and_quadratic_ones_nearly(name: str) -> None:
    old, new = meshes(name)
    sag = 0.006  # of the old boundary: what is outside gets what is nearest
    assert transfer_nodes(old, new, old.points) == pytest.approx(new.points, abs=sag)
    inside = np.setdiff1d(np.arange(len(new.points)), np.unique(new.quads[: len(new.boundary)]))
    moved = transfer_nodes(old, new, old.points)[inside]
    away = np.abs(moved - new.points[inside]).max(axis=1)
    assert np.quantile(away, 0.9) < 1e-12
    z = old.points[:, :1]
    error = np.abs(transfer_nodes(old, new, z**2) - new.points[:, :1] ** 2).max()
    assert 1e-6 < error < 0.05
    same = transfer_nodes(old, old, np.sin(old.points))
    assert same == pytest.approx(np.sin(old.points), abs=1e-12)


@pytest.mark.parametrize("name", ["ring", pytest.param("horn", marks=pytest.mark.slow)])
def test_values_of_elements_are_those_at_their_middles(name: str) -> None:
    old, new = meshes(name)
    values = old.points[old.quads].mean(axis=1)[:, 0]
    moved = transfer_elements(old, new, values)
    sides = np.ptp(old.points[old.quads], axis=1).max()
    assert np.abs(moved - new.points[new.quads].mean(axis=1)[:, 0]).max() < sides
    assert (transfer_elements(old, old, values) == values).all()


def test_nothing_is_carried_across_a_mouth() -> None:
    """Two arms 0.3 mm apart, one of which has moved."""
    shape = Shape(Outline(rounded(FORK, 0.1)), (0.0, 4.0), (12.0, 0.0), "fork")
    old, new = (section_mesh(shape, shape.film, Sizes(33), d) for d in (1, Fraction(4, 3)))

    def moved(mesh: SectionMesh) -> np.ndarray:
        z, r = mesh.points.T
        return np.where(r > 1.15, np.maximum(z - 0.5, 0.0) ** 2, 0.0)[:, None]

    assert transfer_nodes(old, new, moved(old)) == pytest.approx(moved(new), abs=0.05)


@pytest.mark.parametrize("name", SHAPES)
def test_places_carry_the_boundary(name: str) -> None:
    old, new = meshes(name)

    def wave(mesh: SectionMesh) -> np.ndarray:
        return np.asarray(np.cos(2.0 * np.pi * mesh.positions / mesh.length))

    assert transfer_boundary(old, new, wave(old)) == pytest.approx(wave(new), abs=0.01)
    for part in ("arc_nodes", "outer_nodes"):
        nodes, new_nodes = getattr(old, part), getattr(new, part)
        values = np.zeros(len(nodes))
        values[5:9] = -3.0
        chain = transfer_chain(old, new, nodes, new_nodes, values)
        assert -3.0 <= chain.min() < -2.5
        assert chain.max() <= 0.0
    ends = places_of(old, old.outer_nodes)
    outer = transfer_chain(old, new, old.outer_nodes, new.outer_nodes, ends)
    expected = np.clip(places_of(new, new.outer_nodes), *ends[[0, -1]])
    assert outer == pytest.approx(expected, abs=1e-12)
