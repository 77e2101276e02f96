"""The benchmark of products by sum factorisation runs and tells what it measures."""

from __future__ import annotations

import pytest

from benchmarks import products


def test_rates_are_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(products, "SAMPLES", 2)
    assert products.main(["2", "--unknowns", "3e3"]) == 0
    memory, head, row = capsys.readouterr().out.splitlines()
    assert memory.startswith("memory: ")
    order, unknowns, _, rate, kept, memory, cached, share = row.split()
    assert (order, unknowns) == ("2", "3993")
    assert float(kept) > 19 * 27 * 8 * 5**3 / 3993 - 1, "19 numbers at 27 points of each element"
    part = float(rate) / min(float(memory), float(cached))
    assert float(share.rstrip("%")) == pytest.approx(100 * part, abs=2)
    assert head.split()[:2] == ["order", "unknowns"]
