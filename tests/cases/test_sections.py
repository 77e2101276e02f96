"""The sections of seals: measures against closed forms, meshes of random dimensions, bad ones."""

import re
from itertools import product
from math import pi
from typing import Any

import numpy as np
import pytest

from softehl.cases.document import DOCS
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
from softehl.cases.seal.meshing.outline import Outline
from softehl.cases.seal.meshing.outline_mesh import outline_mesh
from softehl.cases.seal.meshing.section_mesh import corner_jacobians
from softehl.cases.seal.meshing.spacing import Spot, graded
from tests.runtime.test_outline_mesh import imbalance


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
