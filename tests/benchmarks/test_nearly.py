"""The benchmark of nearly incompressible blocks."""

from __future__ import annotations

import pytest

from benchmarks import nearly


@pytest.mark.slow
def test_solvers_find_the_same_answer(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyamg")
    rows = []
    for solver in ("matrix-free", "amg"):
        assert nearly.main([solver, "2"]) == 0
        rows.append(capsys.readouterr().out.split("|"))
    assert rows[0][1].strip() == "375"
    assert float(rows[0][8]) == pytest.approx(float(rows[1][8]), rel=1e-5)
