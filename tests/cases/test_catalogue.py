"""The catalogue of rings and glands, against published dimensions and its own order."""

from itertools import pairwise

import pytest

from softehl.cases.seal.gland.catalogue import as568, ring
from softehl.cases.seal.gland.grooves import INCH, squeeze
from softehl.cases.seal.gland.messages import handbook
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.gland.trade.normalise_text import NotUnderstoodError

SERIES = {0: (1, 50), 1: (102, 178), 2: (201, 284), 3: (309, 395), 4: (425, 475)}
# inside diameter and tolerance, inch, as makers' charts print them
PRINTED = {
    1: (0.029, 0.004),
    12: (0.364, 0.005),
    50: (5.239, 0.037),
    113: (0.549, 0.007),
    152: (3.237, 0.024),
    178: (9.737, 0.055),
    201: (0.171, 0.005),
    210: (0.734, 0.010),
    222: (1.484, 0.015),
    226: (1.984, 0.018),
    230: (2.484, 0.020),
    259: (6.234, 0.040),
    284: (17.955, 0.085),
    325: (1.475, 0.015),
    395: (25.940, 0.120),
    425: (4.475, 0.033),
    451: (10.975, 0.060),
    475: (25.940, 0.120),
}


def test_all_general_sizes_are_there() -> None:
    numbers = [n for first, last in SERIES.values() for n in range(first, last + 1)]
    assert list(as568()) == numbers
    assert len(numbers) == 349


@pytest.mark.parametrize(("number", "printed"), PRINTED.items())
def test_printed_sizes(number: int, printed: tuple[float, float]) -> None:
    found = as568()[number]
    assert found.inner_diameter == pytest.approx(printed[0] * INCH, abs=1e-4)
    assert found.inner_tolerance == pytest.approx(printed[1] * INCH, abs=1e-4)


@pytest.mark.parametrize("series", SERIES)
def test_sizes_and_tolerances_rise_in_a_series(series: int) -> None:
    first, last = SERIES[series]
    rings = [as568()[n] for n in range(first, last + 1)]
    for a, b in pairwise(rings):
        assert b.inner_diameter > a.inner_diameter
        assert a.inner_tolerance is not None
        assert b.inner_tolerance is not None
        assert b.inner_tolerance >= a.inner_tolerance


@pytest.mark.parametrize("name", ["AS568-226", "as568-226", "-226", "226", "AS 568A-226", "2-226"])
def test_names_of_one_ring(name: str) -> None:
    found = ring(name)
    assert found.name == "AS568-226"
    assert (found.inner_diameter, found.section_diameter) == pytest.approx((50.3936, 3.5306))


@pytest.mark.parametrize(
    "name", ["ISO 3601 50.4x3.55", "ISO 3601-1 50,4 x 3,55", "50.4x3.55", "50.4 mm x 3.55 mm"]
)
def test_metric_rings(name: str) -> None:
    found = ring(name)
    assert found.name == "ISO 3601 50.4x3.55"
    assert (found.inner_diameter, found.section_diameter) == (50.4, 3.55)
    assert (found.inner_tolerance, found.section_tolerance) == (0.48, 0.10)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("AS568-100", 'no general size -100; nearest: "AS568-050" and "AS568-102"'),
        ("-999", 'nearest: "AS568-475"'),
        ("000", 'nearest: "AS568-001"'),
        ("quad ring", 'write "36x4", "ISO 3601 50.4x3.55" or "AS568-226"'),
        ("U-cup 25x35x8", "is a U-cup, which is named by its groove"),
        ("ISO 3601 3.55x50.4", "write inside diameter x section in mm"),
    ],
)
def test_unknown_rings_name_the_nearest(name: str, says: str) -> None:
    with pytest.raises(NotUnderstoodError) as caught:
        ring(name)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def seated(inner: float, section: float, rod: float, housing: float, width: float) -> Gland:
    return Gland(
        inner_diameter=inner,
        section_diameter=section,
        rod_diameter=rod,
        housing_diameter=housing,
        groove_width=width,
    )


def test_stretch() -> None:
    assert seated(50.0, 4.0, 51.0, 58.0, 5.0).stretch_percent == pytest.approx(2.0)
    assert seated(50.39, 4.0, 50.0, 57.0, 5.0).stretch_percent == 0.0


def test_a_ring_is_stretched_on_the_ground_of_a_piston() -> None:
    p = seated(-40.0, 4.0, -40.0, -33.0, 5.2)  # an inside diameter of 32 mm
    assert p.stretch_percent == pytest.approx(100.0 / 32.0)
    assert p.fill_percent == pytest.approx(68.1, abs=0.1)


def test_squeeze() -> None:
    assert squeeze(3.53, 3.15) == pytest.approx(10.765, abs=1e-3)


def test_warnings_of_handbooks() -> None:
    ring_226 = 50.3936, 3.5306
    assert not [*handbook(seated(*ring_226, 50.0, 56.15, 4.7))]
    (over,) = handbook(seated(*ring_226, 50.0, 56.15, 3.3))
    assert over == "the ring fills 98 % of its gland; handbooks advise 60 to 95 %"
    (wide,) = handbook(seated(*ring_226, 50.0, 56.15, 9.0))
    assert wide.startswith("the ring fills 36 %")
    (tight,) = handbook(seated(*ring_226, 53.5, 59.65, 4.7))
    assert "stretched by 6.2 % on its rod" in tight
