"""The answer of a run in words, reports of cycles, titles, and text in sheets."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from pathlib import Path

import pytest

from softehl.cases import cycle, oring
from softehl.cases.harness.report.page import parts_of, render, write_xlsx
from softehl.cases.harness.report.part import FinishedRun, Part, Table
from softehl.cases.harness.row import OK
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.states.answer import answer
from softehl.cases.seal.states.state import UNCERTAIN, FilmRow
from tests.cases.test_leakage import row


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([row(400.0, 1.4), row(-400.0, 1.1)], "400 mm/s: leaks 2.36 mm3; friction 3 N out, 3 N in"),
        ([row(400.0, 1.1), row(-400.0, 1.4)], "400 mm/s: returns what it takes out; friction"),
        ([row(400.0, 1.1), row(-400.0, 1.11)], "out and back the same within 2 %: no net leakage"),
        ([row(400.0, 1.1)], "400 mm/s: leakage needs both strokes; friction 3 N out"),
        (
            [row(-400.0, 1.1, UNCERTAIN)],
            "leakage needs both strokes; friction 3 N in (in uncertain)",
        ),
    ],
)
def test_whether_a_seal_leaks_and_what_friction_it_has(rows: Sequence[FilmRow], said: str) -> None:
    head, line = answer(rows)
    assert head == "in a cycle of 100 mm out and 100 mm back:"
    assert said in line


def cycles() -> FinishedRun:
    last = cycle.CycleRow(
        cycle=3.0,
        leak_mm3=0.51,
        leak_sealed_mm3=0.5,
        friction_out_N=12.0,
        friction_in_N=-10.0,
        energy_mJ=425.0,
        h_min_um=0.3,
        p_max_MPa=4.0,
        asperity_load_percent=1.0,
        change_percent=0.2,
        mass_error=0.0,
        steps=100,
        newton_iterations=300,
        verdict=OK,
    )
    return FinishedRun(Path("results/cycle"), cycle.CASE, cycle.Cycle(), [last], content={})


def test_a_report_of_cycles_has_their_numbers() -> None:
    run = cycles()
    said = "cycle 3: leaks 0.51 mm3; friction 12 N out, 10 N in at most; its work 425 mJ"
    assert run.case.answer(run.parameters, run.rows) == [said]
    page = render([run], parts_of([run]))
    assert said in page
    assert "work of friction on the rod [mJ]" in page
    assert "every speed is a steady state" not in page


def test_a_report_is_titled_by_its_seal() -> None:
    titles = [
        oring.CASE.titled(ORing()),
        oring.CASE.titled(ORing(section="x_ring", groove_width=4.3)),
        cycle.CASE.titled(cycle.Cycle(section="u_cup", groove_width=6.0)),
    ]
    for title, name in zip(titles, ("O-ring", "X-ring", "U-cup"), strict=True):
        assert title.startswith(f"reciprocating {name}, a rod seal")


def test_no_text_of_a_sheet_is_a_formula(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    texts = ("=1+1", "+1+1", "-1+1", "@A1")
    table = Table("=1+1", texts, [texts, (1.0, 2, nan, "ok")])
    write_xlsx([Part("x", tables=[table])], tmp_path / "a.xlsx")
    book = openpyxl.load_workbook(tmp_path / "a.xlsx")
    cells = [cell for line in book.worksheets[0].iter_rows() for cell in line]
    given = [cell for cell in cells if str(cell.value)[0] in "=+-@"]
    assert len(given) == 9
    assert {(cell.data_type, cell.quotePrefix) for cell in given} == {("s", True)}
    assert [cell.value for cell in book.worksheets[0][4]] == [1, 2, None, "ok"]
