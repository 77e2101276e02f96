"""One target by one key: steps, the nonlinear check, and what is out of reach."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from softehl.__main__ import main
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.sensitivity import design
from softehl.cases.seal.sensitivity.design import (
    Change,
    DesignStep,
    Film,
    HeldFilm,
    Lever,
    NoDesignError,
    Target,
    designed,
    settled,
)
from softehl.cases.seal.sensitivity.quantities import quantities
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.solve.newton import Newton
from tests.cases.oring_cases import film_values

P = Seal()
POWER = -3.0
BY = Lever("rod_diameter", "rod_diameter")


def power_law(p: Seal, slope: float = POWER, **given: Any) -> FilmState:
    """A made-up film whose friction is a power of the rod diameter."""
    values = film_values(verdict="ok", inlet_ratio=1.0)
    values["rod_friction_N"] = -5.0 * (p.rod_diameter / 50.0) ** POWER
    nothing: Any = None
    state = FilmState(
        **values,
        advice="",
        profile=nothing,
        section=nothing,
        sensitivity={"friction": {"rod_diameter": slope}},
    )
    return replace(state, **given)


def held(p: Seal) -> Change:
    """How the same friction changes where the mesh is held: not quite as from mesh to mesh."""
    return lambda factor: factor ** (1.01 * POWER)


def steps(target: Target, solve: Callable[[Seal], FilmState | None]) -> list[DesignStep]:
    def with_mesh(p: Seal) -> Film | None:
        state = solve(p)
        return (state, held(p)) if state else None

    return designed(P, target, BY, with_mesh)


def test_a_power_law_is_met_in_one_step() -> None:
    found = steps(Target.of("friction -3%"), power_law)
    assert isinstance(found[0], DesignStep)
    assert (found[0].value, found[0].quantity) == (50.0, 5.0)
    assert len(found) == 2
    assert found[1].value == pytest.approx(50.0 * 0.97 ** (1.0 / POWER))
    assert found[1].quantity == pytest.approx(0.97 * 5.0)


def test_a_wrong_slope_needs_more_steps_and_a_wrong_sign_never_ends() -> None:
    target = Target.of("friction -6 %")
    found = steps(target, lambda p: power_law(p, 1.5 * POWER))
    assert len(found) > 2
    assert found[-1].quantity == pytest.approx(0.94 * 5.0, rel=1e-4)
    with pytest.raises((NoDesignError, ValueError)):
        steps(target, lambda p: power_law(p, -POWER))


def test_the_last_steps_settle_on_a_mesh_that_is_held() -> None:
    """A first step within one per cent is not the end; a film that is lost there is said."""
    near, wanted = DesignStep(50.0, 5.03), 5.0
    found = settled(near, wanted, POWER, lambda factor: factor ** (1.3 * POWER), "missed")
    assert len(found) >= 2
    assert found[-1].quantity == pytest.approx(wanted, rel=1e-4)
    assert 5.03 * (found[-1].value / 50.0) ** (1.3 * POWER) == pytest.approx(wanted, rel=1e-4)
    at_end: tuple[tuple[Change, str], ...] = (
        (lambda _: None, "missed: no film is found on the way"),
        (lambda _: 1.001, "missed: the film is at a kink"),
    )
    for change, words in at_end:
        with pytest.raises(NoDesignError, match=words):
            settled(near, wanted, POWER, change, "missed")


def test_what_is_out_of_reach_is_said() -> None:
    with pytest.raises(NoDesignError, match="too little for this target; choose another key"):
        steps(Target.of("friction -50%"), lambda p: power_law(p, slope=-0.01))
    with pytest.raises(NoDesignError, match="has the verdict under-resolved"):
        steps(Target.of("friction -5%"), lambda p: power_law(p, verdict="under-resolved"))
    for wrong in ("friction", "colour -3%", "friction -100%", "friction 3"):
        with pytest.raises(NoDesignError, match="is not understood"):
            Target.of(wrong)


def test_a_key_that_is_no_number_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "oring", "friction -3%", "--by", "density"]) == 2
    assert "--by density: allowed: section_diameter" in capsys.readouterr().err
    for case in ("slider", "cycle"):
        assert main(["design", case, "friction -3%", "--by", "rod_diameter"]) == 2
        assert f"{case} has no sensitivities" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("measure", "key", "ends"),
    [
        ("groove_depth", "housing_diameter", (3.15, 3.2)),
        ("squeeze", "housing_diameter", (10.765, 9.348)),
        ("fill", "groove_width", (84.28, 78.80)),
    ],
)
def test_a_measure_of_the_gland_is_designed_by_the_key_that_it_decides(
    measure: str,
    key: str,
    ends: tuple[float, float],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def found(p: Seal, _target: Target, by: Lever, *_: object) -> list[DesignStep]:
        first, last = {"housing_diameter": (56.3, 56.4), "groove_width": (3.74, 4.0)}[by.key]
        return [DesignStep(first, 5.0), DesignStep(last, 4.5)]

    monkeypatch.setattr(design, "designed", found)
    assert main(["design", "oring", "friction -10%", "--by", measure]) == 0
    _, first, *_, summary, told = capsys.readouterr().out.splitlines()
    given = re.fullmatch(rf"  {measure} = (\S+) (mm|%): friction = 5 N", first)
    met = re.search(rf" by {measure} = (\S+) (mm|%) \(", summary)
    assert given
    assert met
    assert (float(given[1]), float(met[1])) == pytest.approx(ends, rel=1e-3)
    assert re.fullmatch(rf"{key} from (\S+) to (\S+) mm", told)


@pytest.mark.slow
def test_ten_per_cent_less_friction_by_the_rod(capsys: pytest.CaptureFixture[str]) -> None:
    """On one mesh to 1e-4; a run of its own, on its own mesh, agrees as well as two meshes do."""
    wanted = ["design", "oring", "friction -10%", "--by", "rod_diameter", "--set", "speeds=[400]"]
    assert main(wanted) == 0
    printed = capsys.readouterr().out
    assert re.search(r"friction -(10\.00|9\.99|10\.01) % \(wanted -10 %\)", printed)
    rod = float(printed.split("by rod_diameter = ")[-1].split()[0])
    given = [P.model_copy(update={**ONE, "rod_diameter": d}) for d in (50.0, rod)]
    before, after = (run(p, Silent()).states[0] for p in given)
    assert after.rod_friction_N / before.rod_friction_N == pytest.approx(0.9, rel=0.01)


ONE = {"speeds": (400.0,), "stroke": "out", "error_estimate": False}


@pytest.mark.slow
def test_the_held_mesh_gives_what_the_run_did() -> None:
    held_film = HeldFilm.of(P.model_copy(update={**ONE, "density": 1}), Silent())
    assert held_film is not None
    assert held_film.change("friction", "rod_diameter", 1.0) == pytest.approx(1.0, abs=1e-7)
    changed = held_film.change("friction", "rod_diameter", 0.9995)
    assert changed is not None
    assert 0.95 < changed < 0.99


@pytest.mark.slow
def test_a_held_film_follows_a_key_further_than_one_solve() -> None:
    """Newton's method with more iterations than a step has finds the same film at once."""
    held_film = HeldFilm.of(P.model_copy(update={**ONE, "density": 1}), Silent())
    assert held_film is not None
    moved = held_film.case.scaled("rod_diameter", -0.003)
    problem, quantity = moved.problem, "friction"
    at_once = Newton(max_iterations=50).solve(problem, held_film.x)
    assert at_once.converged
    assert at_once.iterations > held_film.newton.max_iterations
    before = quantities(held_film.case, held_film.x)[quantity].value
    after = quantities(moved, at_once.x)[quantity].value
    changed = held_film.change(quantity, "rod_diameter", 0.997)
    assert changed == pytest.approx(after / before, rel=1e-7)


def test_a_design_is_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What to change, what a hundredth of a millimetre of it does, and all other results."""
    page = tmp_path / "design.html"
    given = ["ring=36x4", "rod=36", "material=NBR 70", "density=1", "speeds=400", "stroke=out"]
    told_to = [word for text in given for word in ("--set", text)]
    typed = ["design", "oring", "friction -5%", "--by", "groove_depth", *told_to]
    assert main([*typed, "--report", str(page)]) == 0
    printed = capsys.readouterr()
    assert "film at +400 mm/s" in printed.err  # it tells what it does meanwhile
    depth = re.search(r" by groove_depth = (\S+) mm", printed.out)
    assert depth
    text = page.read_text(encoding="utf-8")
    assert "of NBR 70, a rod seal: groove depth for friction -5\N{NO-BREAK SPACE}%</h1>" in text
    assert f"groove depth {float(depth[1]):.5g} mm instead of 3.5 mm" in text
    assert re.search(r"0\.01 mm more groove depth there: friction -[12]\.\d %", text)
    rows = re.findall(r"<td[^>]*>friction</td><td>(\S+)</td><td>(\S+)</td>", text)
    before, after = map(float, rows[-1])
    assert after / before == pytest.approx(0.95, abs=1e-3)
    outside = re.sub(r"<(script|details).*?</\1>", "", text, flags=re.DOTALL)
    assert not re.search(r"h_star|p_max|contact_width", outside)
