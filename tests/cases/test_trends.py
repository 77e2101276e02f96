"""What is known of reciprocating seals, by runs: the table of docs/validation/films.md."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import FULL
from softehl.cases.seal.report.pictures import crossing
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import FilmState, Silent

SPEEDS = (800.0, 400.0, 200.0, 100.0)
MIXED = (2000.0, 1000.0, 500.0, 200.0, 100.0, 50.0, 20.0)
PAGE = Path(__file__).parents[2] / "docs" / "validation" / "films.md"


@cache
def solved(*given: tuple[str, Any]) -> dict[float, FilmState]:
    """States of density 1 by their signed speed."""
    keys = {"density": 1, "error_estimate": False, "speeds": SPEEDS, **dict(given)}
    outcome = run(Seal.model_validate(keys), Silent())
    assert outcome.converged, outcome.message
    return {s.rod_speed_mm_s: s for s in outcome.states}


def rough(sigma: float) -> dict[float, FilmState]:
    """Outstrokes of a rough seal."""
    return solved(("roughness", sigma), ("speeds", MIXED), ("stroke", "out"))


def exponent(values: list[float], speeds: list[float]) -> float:
    """That of a power law through the values."""
    return float(np.polyfit(np.log(speeds), np.log(values), 1)[0])


def said(trend: str) -> list[float]:
    """Numbers in the last cell of a line of the page."""
    (line,) = [x for x in PAGE.read_text(encoding="utf-8").splitlines() if x.startswith(trend)]
    return [float(v) for v in re.findall(r"-?\d+\.?\d*", line.split("|")[-2])]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_films_grow_as_those_of_soft_line_contacts_do(sign: float) -> None:
    """h* as U^(3/5), where the dry pressure begins as a root: Herrebrugh (1968), Hooke (1980)."""
    states = solved()
    found = exponent([states[sign * u].h_star_um for u in SPEEDS], [*SPEEDS])
    assert found == pytest.approx(0.6, abs=0.02)
    assert found == pytest.approx(said("| h\\* of a smooth film")[0 if sign > 0 else 1], abs=2e-3)


def test_viscous_friction_grows_as_speed_over_film() -> None:
    states = solved()
    found = exponent([-states[-u].rod_friction_N for u in SPEEDS], [*SPEEDS])
    assert found == pytest.approx(said("| friction of a full film")[0], abs=2e-3)
    assert found == pytest.approx(0.4, abs=0.03)


def test_viscosity_and_speed_count_by_their_product() -> None:
    """The penalty has a unit of time of its own: void fractions have none."""
    thin, thick = (
        solved(
            ("cavitation", "mass-conserving"),
            *(("viscosity", n * 6.59e-8), ("speeds", (800.0 / n, 200.0 / n))),
        )
        for n in (1, 2)
    )
    for speed, state in thin.items():
        assert thick[speed / 2].h_star_um == pytest.approx(state.h_star_um, rel=1e-8)
        assert thick[speed / 2].rod_friction_N == pytest.approx(state.rod_friction_N, rel=1e-8)


def test_a_seal_leaks_what_its_strokes_differ_by() -> None:
    """Without pressure both sides are the same, and nothing is left on the rod."""
    alike, pressed = solved(("sealed_pressure", 0.0)), solved()
    for speed in SPEEDS:
        out, back = (alike[s * speed].h_star_um for s in (1.0, -1.0))
        assert out == pytest.approx(back, rel=1e-12)
        assert pressed[speed].h_star_um > 1.1 * pressed[-speed].h_star_um
    shares = [pressed[u].h_star_um / pressed[-u].h_star_um for u in (800.0, 100.0)]
    assert shares == pytest.approx(said("| films of both strokes"), abs=0.01)


@pytest.mark.slow
def test_roughness_raises_the_friction_of_mixed_films_only() -> None:
    films = [rough(sigma) for sigma in (0.1, 0.2, 0.4)]
    slow, fast = ([f[u].rod_friction_N for f in films] for u in (50.0, 2000.0))
    assert slow[0] < slow[1] < slow[2]
    assert max(fast) < 1.01 * min(fast)
    assert [*slow, 2000.0, *fast] == pytest.approx(said("| friction at 50 mm/s"), rel=0.01)


@pytest.mark.slow
def test_full_films_begin_the_later_the_rougher() -> None:
    """lambda = 3 at a speed that grows as sigma^(5/3), h being as U^(3/5)."""
    p, speeds = Seal(), []
    for sigma in (0.1, 0.2, 0.4):
        rows: Any = [rough(sigma)[u] for u in sorted(MIXED)]
        found = crossing(p, rows, FULL)
        assert found is not None
        speeds.append(found)
    ratios = [b / a for a, b in pairwise(speeds)]
    assert ratios == pytest.approx([2 ** (5 / 3)] * 2, rel=0.1)
    assert ratios == pytest.approx(said("| eta U / p where lambda is 3"), abs=0.03)


@pytest.mark.slow
def test_roughness_carries_oil_with_its_own_surface() -> None:
    """Less flows than in a smooth film where the surface at rest is rough, more where the moving
    one is: Patir and Cheng (1979).
    """
    given = (("speeds", (200.0,)), ("stroke", "out"))
    smooth = solved(("cavitation", "mass-conserving"), *given)[200.0].h_star_um
    seal, rod = (
        solved(("roughness", pair), *given)[200.0].h_star_um for pair in ((0.0, 0.2), (0.2, 0.0))
    )
    assert seal < smooth < rod
    changes = [100.0 * (h / smooth - 1.0) for h in (seal, rod)]
    assert changes == pytest.approx(said("| h\\* with the seal, the rod rough"), abs=0.2)
