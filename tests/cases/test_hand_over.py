"""Friction and leakage handed over to simulations of systems."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report.system_export import (
    BLOCKS,
    FILES,
    FrictionLaw,
    SealMap,
    modelica,
    write_hand_over,
)
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import read_csv
from tests.cases.oring_cases import film_values

SPEEDS = (-300.0, -100.0, -30.0, -10.0, 10.0, 30.0, 100.0, 300.0)
LAWS = {
    block: FrictionLaw(block, 8.0, 1.5, 3.0, rate, 0.01, 0.0)
    for block, rate in zip(BLOCKS, (0.04, 0.02), strict=True)
}


def run(pressure: float, law: FrictionLaw, speeds: tuple[float, ...] = SPEEDS) -> FinishedRun:
    """A run whose films have the friction of a law, and leak 0.1 mm^3 for a mm/s and a MPa."""
    rows = [
        FilmRow(
            **film_values(
                sealed_pressure_MPa=pressure,
                rod_speed_mm_s=u,
                rod_friction_N=float(law.friction(np.array(u), np.array(pressure))),
                leak_rate_mm3_s=0.1 * u * pressure,
                verdict="ok",
            )
        )
        for u in speeds
    ]
    case = SimpleNamespace(titled=lambda _: "a seal", selection=CASE.selection)
    return FinishedRun(Path("run"), case, Seal(sealed_pressure=pressure), rows)


@pytest.mark.parametrize("block", BLOCKS)
def test_a_law_is_found_again(block: str) -> None:
    law = LAWS[block]
    found = FrictionLaw.fitted(SealMap.of([run(p, law) for p in (1.0, 5.0)]), block)
    assert found is not None
    assert found.misfit < 1e-4
    for name in ("preload", "coulomb", "breakaway", "rate", "viscous"):
        assert getattr(found, name) == pytest.approx(getattr(law, name), rel=1e-2)


def test_a_misfit_is_told() -> None:
    """Films that are no law of that kind: one differs by half."""
    runs = [run(p, LAWS["Cylinder Friction"]) for p in (1.0, 5.0)]
    rows = cast("list[Any]", runs[0].rows)
    rows[3] = replace(rows[3], rod_friction_N=1.5 * rows[3].rod_friction_N)
    found = FrictionLaw.fitted(SealMap.of(runs), "Cylinder Friction")
    assert found is not None
    assert found.misfit > 0.05


def test_modelica_reads_friction_between_films() -> None:
    """The table read by the rule of CombiTable2Ds, in SI units."""
    seal = SealMap.of([run(p, LAWS["Cylinder Friction"]) for p in (1.0, 5.0)])
    lines = modelica(seal).splitlines()
    assert lines[0] == "#1"
    assert lines[1].startswith("double friction(9,3) ")
    table = np.array([[float(v) for v in line.split()] for line in lines[2:11]])
    look_up = RegularGridInterpolator((table[1:, 0], table[0, 1:]), table[1:, 1:])
    assert float(look_up((0.1, 1e6))) == pytest.approx(seal.friction[6, 0])
    assert float(look_up((0.2, 3e6))) == pytest.approx(float(seal.friction[6:, :].mean()))
    assert lines[11].startswith("double leakage(9,3) ")
    last = [float(v) for v in lines[20].split()]
    assert last == pytest.approx([0.3, 30e-9, 150e-9])


def test_files_of_a_hand_over(tmp_path: Path) -> None:
    law = LAWS["Cylinder Friction"]
    one = write_hand_over(tmp_path / "seal", [run(1.0, law)])
    assert one[0] == f"8 speeds at 1 pressure written to {tmp_path / 'seal'}"
    said = write_hand_over(tmp_path / "seal", [run(1.0, law), run(5.0, law, SPEEDS[1:])])
    assert sorted(path.name for path in (tmp_path / "seal").iterdir()) == sorted(FILES)
    header = ("sealed_pressure_MPa", "rod_speed_mm_s", "friction_N", "leakage_mm3_s")
    assert len(read_csv(tmp_path / "seal" / FILES[0], header)) == 14
    assert "left out, as not every pressure has them: -300 mm/s" in said
    text = (tmp_path / "seal" / FILES[2]).read_text()
    assert "Preload force = 8 N" in text
    assert "Coulomb friction coefficient = 1.5e-06 N/Pa" in text
    assert "Transition coefficient = 40 s/m" in text


def test_what_is_not_one_seal_is_refused() -> None:
    one, other = run(1.0, LAWS["Cylinder Friction"]), run(5.0, LAWS["Cylinder Friction"])
    harder = Seal(sealed_pressure=5.0, mu_1=4.0)
    with pytest.raises(BadInput, match="differ in mu_1"):
        SealMap.of([one, replace(other, parameters=harder)])
    with pytest.raises(BadInput, match="no speed has a film at every sealed pressure"):
        SealMap.of([one, replace(other, rows=run(5.0, LAWS["Cylinder Friction"], (50.0,)).rows)])
