"""The benchmark of lanes compares results before it tells times."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks import lanes
from softehl.codegen.tools import build


@pytest.mark.slow
def test_two_targets_are_compared_and_timed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, now, wrong = (tmp_path / name for name in ("before", "now", "wrong"))
    lanes.made(["maxwell"], before, "scalar", None)
    operations, _ = lanes.made(["maxwell"], now, "simd", None)
    assert operations == {"maxwell": 23}
    # a loaded machine may take any time, also less for the elements than for none: times are given
    times = iter([1.0, 8e-9, 2e-9, 9e-9, 3e-9, 6e-9, 1e-9])
    monkeypatch.setattr(lanes, "seconds", lambda call, repeats: next(times))
    (a, b), ratios = lanes.measure("maxwell", [before, now], 3)
    assert (a, b) == pytest.approx((8, 2))
    assert ratios == pytest.approx([4, 6])
    shutil.copytree(before, wrong)
    source = wrong / "maxwell.c"
    source.write_text(source.read_text().replace("3.0 *", "3.001 *"))
    build.build(wrong)
    with pytest.raises(SystemExit, match="maxwell: the results differ by"):
        lanes.measure("maxwell", [before, wrong], 1)
