"""What seal engineers type: understood, or answered with what to write."""

from __future__ import annotations

import pytest

from softehl.cases.harness.case_file import read_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.shipped import SHIPPED

GLAND = ("rod=36", "squeeze=15", "groove_width=5.4")


def typed(*assignments: str) -> ORing:
    parameters = read_case("oring", SHIPPED, assignments).parameters
    assert isinstance(parameters, ORing)
    return parameters


@pytest.mark.parametrize(
    "name", ["36x4", "36x4 ISO 3601", "DIN 3771 36x4", "DIN 3771 36 x 4", "O-ring 36x4 ISO 3601-1"]
)
def test_a_metric_ring_with_its_standard_before_or_behind(name: str) -> None:
    p = typed(f"ring={name}", *GLAND)
    assert (p.inner_diameter, p.section_diameter) == (36.0, 4.0)


@pytest.mark.parametrize("key", ["shore_A", "material"])
def test_a_rubber_by_polymer_and_hardness(key: str) -> None:
    p = typed(f"{key}=NBR 70")
    assert (p.shore_A, p.material) == (70.0, "neo-hooke")
    assert p.shear_modulus == pytest.approx(1.84017, rel=1e-5)
    assert typed(f"{key}=70 Shore A") == p


def test_an_oil_by_its_din_name_and_a_viscosity_in_one_word() -> None:
    assert typed("oil=HLP 46", "temperature=50").viscosity == pytest.approx(
        typed("oil=ISO VG 46", "temperature=50").viscosity, rel=1e-12
    )
    assert typed("viscosity=100 mPas").viscosity == pytest.approx(1e-7, rel=1e-12)


@pytest.mark.parametrize(
    ("assignments", "answer"),
    [
        (("rod=36 f7",), 'which is not read; write the size alone, "36 mm"'),
        (("roughness=Ra 0.2",), "1.25 times as much where heights are distributed normally"),
        (("roughness=Ra 0.2",), "distributed normally: 0.251"),
        (("roughness=Rz 1",), "write the rms height Rq"),
        (("shore_A=PU 95",), "a hardness gives a modulus from 20 to 90 Shore A"),
        (("material=PU 95",), 'material = "neo-hooke" and mu = "15 MPa"'),
        (("shore_A=95",), 'material = "neo-hooke" and mu = "15 MPa"'),
        (("material=NBR",), 'needs its hardness in Shore A: write "NBR 70"'),
        (("material=NBR 70", "shore_A=80"), "leave one of them out"),
        (("shore_A=soft",), 'write shore_A = 70 or "NBR 70"'),
        (("oil=HVLP 46", "temperature=50"), "write both viscosities of its data sheet"),
        (("oil=100 mPas", "temperature=50"), 'write viscosity = "100 mPa s"'),
        (("oil=hydraulic oil 68", "temperature=50"), 'allowed: "ISO VG 68"'),
        (("ring=OR 36-4", "rod=36"), 'did you mean "36x4"?'),
        (("ring=36x4", "rod=36"), "squeeze = 12.9 and groove_width = 5.32"),
    ],
)
def test_what_is_not_read_is_answered_with_what_to_write(
    assignments: tuple[str, ...], answer: str
) -> None:
    with pytest.raises(BadInput) as caught:
        typed(*assignments)
    assert answer in str(caught.value)


@pytest.mark.parametrize("gland", ["", "gland=dynamic"])
def test_a_section_in_the_gland_of_an_o_ring_is_told(gland: str) -> None:
    given = ["ring=AS568-210", "rod=19", "section=x_ring", *([gland] if gland else [])]
    run = read_case("oring", SHIPPED, given)
    words = run.case.assumed(run.parameters, run.given)
    assert "the gland of an O-ring, as none is known for this X-ring" in " ".join(words)
