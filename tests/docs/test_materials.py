"""The tables of docs/materials.md and docs/oils.md are what the code says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from softehl.cases.seal.materials import MATERIALS, shear_modulus
from softehl.cases.seal.oils import GRADES
from softehl.cases.seal.rubber import shore_band, youngs_modulus
from softehl.cases.seal.rubber_data import fit, read_data

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


def test_grades() -> None:
    table = rows("oils.md", "grades")
    assert {int(n.split()[-1]): float(hot) for n, _, hot in table} == GRADES
