"""One target by one key: steps, the nonlinear check, and what is out of reach."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from softehl.__main__ import main
from softehl.cases.seal.design import NoDesignError, Step, Target, designed
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.state import FilmState
from tests.cases.oring_cases import film_values

P = ORing()
POWER = -3.0


def power_law(p: ORing, slope: float = POWER, **given: Any) -> FilmState:
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


def test_a_power_law_is_met_in_one_step() -> None:
    steps = designed(P, Target.of("friction -3%"), "rod_diameter", power_law)
    assert isinstance(steps[0], Step)
    assert (steps[0].value, steps[0].quantity) == (50.0, 5.0)
    assert math.isnan(steps[0].predicted)
    assert len(steps) == 2
    assert steps[1].value == pytest.approx(50.0 * 0.97 ** (1.0 / POWER))
    assert steps[1].quantity == pytest.approx(0.97 * 5.0)


def test_a_wrong_slope_needs_more_steps_and_a_wrong_sign_never_ends() -> None:
    target = Target.of("friction -6 %")
    steps = designed(P, target, "rod_diameter", lambda p: power_law(p, 1.5 * POWER))
    assert len(steps) > 2
    assert steps[-1].quantity == pytest.approx(0.94 * 5.0, rel=0.01)
    with pytest.raises((NoDesignError, ValueError)):
        designed(P, target, "rod_diameter", lambda p: power_law(p, -POWER))


def test_what_is_out_of_reach_is_said() -> None:
    with pytest.raises(NoDesignError, match="too little for this target; choose another key"):
        designed(P, Target.of("friction -50%"), "rod_diameter", lambda p: power_law(p, slope=-0.01))
    with pytest.raises(NoDesignError, match="has the verdict under-resolved"):
        designed(
            P,
            Target.of("friction -5%"),
            "rod_diameter",
            lambda p: power_law(p, verdict="under-resolved"),
        )
    for wrong in ("friction", "colour -3%", "friction -100%", "friction 3"):
        with pytest.raises(NoDesignError, match="is not understood"):
            Target.of(wrong)


def test_a_key_that_is_no_number_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "oring", "friction -3%", "--by", "density"]) == 2
    assert "--by density: allowed: section_diameter" in capsys.readouterr().err
    assert main(["design", "slider", "friction -3%", "--by", "density"]) == 2
    assert "slider has no sensitivities" in capsys.readouterr().err


@pytest.mark.slow
def test_ten_per_cent_less_friction_by_the_rod(capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--by", "rod_diameter", "--set", "speeds=[400]"]
    assert main(["design", "oring", "friction -10%", *given]) == 0
    printed = capsys.readouterr().out
    value = float(printed.split("friction ")[-1].split(" %")[0])
    assert value == pytest.approx(-10.0, abs=0.95)
