"""The tables of docs/materials.md and docs/oils.md are what the code says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from softehl.cases.seal.gland.grooves import gland
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.rubbers.hardness import shore_band, youngs_modulus
from softehl.cases.seal.gland.rubbers.materials import MATERIALS, shear_modulus
from softehl.cases.seal.gland.rubbers.rubber_fit import fit, read_data
from softehl.cases.seal.gland.trade.oil_names import FAMILIES, GRADES
from softehl.cases.seal.gland.trade.rubber_names import GLASS, RANGES, read_rubber
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import Silent

DOCS = Path(__file__).parents[2] / "docs"


def rows(page: str, table: str) -> list[list[str]]:
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.search(rf"<!-- {table} -->\n(.*?)<!-- end -->", text, re.DOTALL)
    assert found
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in found[1].split("\n")]
    return [cells for cells in lines if len(cells) > 1 and cells[0] not in ("material", "---")]


def test_moduli_by_hardness() -> None:
    table = rows("materials.md", "shore")
    assert len(table) == 5
    for shore, E, mu, low, high in table:
        assert f"{youngs_modulus(float(shore)):.3f}" == E
        assert mu == f"{youngs_modulus(float(shore)) / 3.0:.3f}"
        below, above = shore_band(float(shore))
        assert (low, high) == (f"{below:.0f} %", f"{above:+.0f} %")


def test_fits_of_treloars_rubber() -> None:
    data, table = read_data(DOCS / "treloar.csv"), rows("materials.md", "treloar")
    assert {row[0].split(",")[0] for row in table} == {*MATERIALS, "Ogden 1972"}
    for name, _, modulus, error in table[:-1]:
        found = fit(name.split(",")[0], data)
        assert float(error) == pytest.approx(found.error, abs=6e-4)
        mine = shear_modulus(MATERIALS[found.material], found.values)
        assert float(modulus) == pytest.approx(mine, abs=6e-4)


def test_polymers() -> None:
    known = {f"`{name}`": ends for name, ends in RANGES.items() if ends}
    table = rows("materials.md", "polymers")
    assert {name: (degC, glass) for name, _, degC, glass in table} == {
        name: (f"{low:g} to {high:g}", f"{GLASS[name[1:-1]]:g}" if name[1:-1] in GLASS else "-")
        for name, (low, high) in known.items()
    }
    for name, also, *_ in table:
        for word in filter(None, also.split(", ")):
            read = read_rubber("material", f"{word} 70")
            assert read is not None
            assert f"`{read.polymer}`" == name


def test_glands() -> None:
    for section, *sizes in rows("glands.md", "glands")[1:]:
        hydraulic, pneumatic = gland(float(section)), gland(float(section), "pneumatic")
        found = [size for g in (hydraulic, pneumatic) for size in (g.depth, g.width)]
        assert list(map(float, sizes)) == found


def test_grades() -> None:
    table = rows("oils.md", "grades")
    assert {int(n.split()[-1]): float(hot) for n, _, hot in table} == GRADES


def test_families_of_fluids() -> None:
    for name, kind, rho, index, share in rows("oils.md", "families"):
        family = FAMILIES[name[1:-1]]
        assert (kind, float(rho), float(share)) == (
            family.kind,
            family.density,
            family.pressure_share,
        )
        assert index == ("-" if family.index is None else f"{family.index:g}")


@pytest.mark.slow
def test_what_thinning_does_to_an_o_ring() -> None:
    """A line of docs/validation/films.md, computed again: h* and friction, 800 mm/s, both ways."""
    text = (DOCS / "validation" / "films.md").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("|")]
    at = next(i for i, line in enumerate(lines) if line.startswith("| Carreau, 1e5 1/s"))
    h, friction = ([float(v) for v in line.split("|")[2:6]] for line in lines[at : at + 2])
    p = Seal(carreau_rate=1e5, carreau_exponent=0.6, carreau_plateau=0.6, speeds=(800.0,))
    for row in run(p, Silent()).states:
        column = 0 if row.rod_speed_mm_s > 0.0 else 2
        assert row.h_star_um == pytest.approx(h[column], rel=1e-3)
        assert abs(row.rod_friction_N) == pytest.approx(friction[column], rel=1e-3)
