"""The sections of seals: measures against closed forms, meshes of random dimensions, bad ones."""

from math import pi

import pytest

from softehl.cases.seal.sections import SECTIONS
from softehl.cases.seal.sections.rectangular import Rectangular
from softehl.cases.seal.sections.round import Round
from softehl.cases.seal.sections.x_ring import XRing
from softehl.runtime.mesh.outline_mesh import outline_mesh
from softehl.runtime.mesh.sections import corner_jacobians


@pytest.mark.parametrize("name", SECTIONS)
def test_every_section_has_a_mesh(name: str) -> None:
    shape = SECTIONS[name]().shape(50.39)
    a, b, c, d = shape.outline.box
    assert shape.name == name
    assert (b, d) == pytest.approx((25.195, 25.195 + 3.53))
    assert a == pytest.approx(-c)
    for density in (1, 2):
        mesh = outline_mesh(shape, shape.film, None, 33, density)
        assert corner_jacobians(mesh).min() >= 0.3


def test_areas() -> None:
    shape = Rectangular(height=3.0, width=4.0, corner_radius=0.5).shape(50.0)
    assert shape.outline.area == pytest.approx(12.0 - (4.0 - pi) * 0.25, rel=1e-13)
    assert Round(height=3.0).shape(50.0).outline.area == pytest.approx(pi * 2.25)


def test_an_x_ring_whose_lobes_grow_together_is_an_o_ring() -> None:
    shape = XRing(height=3.0, lobe_radius=1.5).shape(50.0)
    assert shape.outline.area == pytest.approx(pi * 2.25, rel=1e-13)
