"""Piston seals: the groove is in the piston, and the seal slides on the bore."""

import math
from functools import cache
from typing import Any

import pytest

from softehl.cases.oring import run_oring
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmState, Silent

LARGE = 4900.0
"""Diameter at which curvature has nearly vanished, mm; terms of first order are as 1 / diameter."""


class Kept(Silent):
    """Keeps the films that are reported."""

    def __init__(self) -> None:
        self.films: list[FilmState] = []

    def film_state(self, state: FilmState) -> None:
        self.films.append(state)


@cache
def film(side: str, diameter: float, stroke: str = "out", section: str = "round") -> FilmState:
    """A film of a rod or a piston seal whose free ring just touches what it slides on."""
    sizes: dict[str, Any] = {"squeeze": 12.0, "groove_width": 5.0, "section": section}
    if section == "u_cup":
        sizes = {"section": section, "squeeze": 10.0, "groove_width": 7.0}
    sizes |= {"rod": diameter, "inner_diameter": diameter} if side == "rod" else {"bore": diameter}
    sizes |= {"speeds": (400.0,), "stroke": stroke, "density": 1, "error_estimate": False}
    kept = Kept()
    run_oring(Seal(**sizes), kept)
    return kept.films[-1]


def apart(diameter: float, *which: str) -> dict[str, float]:
    """How far a piston seal is from the rod seal of its diameter, in parts of the latter."""
    rod, piston = (film(side, diameter, *which) for side in ("rod", "bore"))
    names = ("h_star_um", "h_min_um", "p_max_MPa", "rod_friction_N", "leak_rate_mm3_s")
    return {name: getattr(piston, name) / getattr(rod, name) - 1.0 for name in names}


@pytest.mark.parametrize("stroke", ["out", "in"])
def test_piston_and_rod_are_one_where_curvature_vanishes(stroke: str) -> None:
    assert max(map(abs, apart(LARGE, stroke).values())) < 1e-3


@pytest.mark.slow
def test_so_are_those_of_a_cup() -> None:
    """Its lips are soft: at this diameter 0.3 % are left, besides 1 % that two meshes differ by."""
    far, near = (apart(d, "out", "u_cup") for d in (LARGE, 0.5 * LARGE))
    assert max(abs(2.0 * far[name] - near[name]) for name in far) < 0.015


@pytest.mark.slow
def test_both_differ_by_their_curvature() -> None:
    """The difference is odd in the curvature: a quarter of the diameter makes it four times."""
    far, near = apart(LARGE), apart(0.25 * LARGE)
    assert near["h_star_um"] == pytest.approx(4.0 * far["h_star_um"], rel=0.05)
    assert near["rod_friction_N"] == pytest.approx(4.0 * far["rod_friction_N"], rel=0.05)
    assert abs(apart(50.0)["h_star_um"]) > 0.01


def test_signs_of_the_strokes_are_those_of_a_rod_seal() -> None:
    """Out: the bore goes to the air side, so that the oil does; friction is that on the bore."""
    for stroke, sign in (("out", 1.0), ("in", -1.0)):
        state = film("bore", LARGE, stroke)
        for value in (state.rod_speed_mm_s, state.leak_rate_mm3_s, state.rod_friction_N):
            assert math.copysign(1.0, value) == sign


def test_sizes_are_those_of_the_trade() -> None:
    p = Seal.model_validate({"bore": "40 H8", "ring": "32x4"})
    assert p.piston
    assert p.ring_diameter == pytest.approx(32.0)
    assert p.rod_diameter == pytest.approx(-40.0195)
    assert p.housing_diameter == pytest.approx(-33.0)  # by the nominal bore of the chart
    assert p.volume / Seal(ring="32x4", rod=33).volume == pytest.approx(-1.0)
    assert Seal(**p.settled()).rod_diameter == p.rod_diameter


@pytest.mark.parametrize(
    "given",
    [
        {"bore": 40, "groove_diameter": 33, "ring": "32x4", "groove_width": 5.2},
        {"bore": 40, "groove_depth": 3.5, "ring": "32x4", "groove_width": 5.2},
        {
            "bore": 40,
            "groove_depth": 3.5,
            "ring": "32x4",
            "groove_width": 5.2,
            "inner_diameter": 32,
        },
        {"bore": 40, "groove_diameter": 33, "housing_diameter": 33, "ring": "32x4"},
        {"bore": 40, "inner_diameter": 32, "section_diameter": 4.0, "squeeze": 12.5},
        {"bore": 40, "housing_diameter": 33, "ring": "32x4", "groove_width": 5.2},
    ],
)
def test_grooves_of_a_piston(given: dict[str, Any]) -> None:
    p = Seal(**given)
    assert (p.rod_diameter, p.inner_diameter) == (-40.0, -40.0)
    assert p.housing_diameter == pytest.approx(-33.0)


def test_a_cup_is_named_by_bore_groove_and_width() -> None:
    p = Seal(bore=40, ring="U-cup 40x30x8")
    assert (p.rod_diameter, p.housing_diameter, p.groove_width) == (-40.0, -30.0, 8.0)
    assert p.inner_diameter < -40.0  # free lips are wider than the bore
