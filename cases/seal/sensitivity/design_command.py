"""`softehl design`: the value of one key that gives a film a wanted change."""

from __future__ import annotations

from collections.abc import Sequence

import click
from pydantic import ValidationError

from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import keys_of
from softehl.cases.seal.gland.derived import BASES, derived
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.varied import NUMBERS, PRESSURE_KEY
from softehl.cases.seal.sensitivity.design import Change, NoDesignError, Step, Target, designed
from softehl.cases.seal.sensitivity.held import HeldFilm
from softehl.cases.seal.sensitivity.sensitivity import differentiation
from softehl.cases.seal.solve.method import run
from softehl.cases.seal.states.state import FilmState, Silent
from softehl.runtime.names import meant

_OF_PISTON = {"bore": "rod_diameter", "groove_diameter": "housing_diameter"}
SAME = {"rod": "rod_diameter", **_OF_PISTON}
"""Names of a key."""

_SPEED = "not by the speed: sensitivity.csv has U, and each of `speeds` is a row of a run"
_MODULUS = "the modulus follows from it: use mu, or mu_1 and mu_2"
INSTEAD = {
    **dict.fromkeys(("U", "speed", "speeds", "rod_speed"), _SPEED),
    **dict.fromkeys(("shore_A", "shore", "hardness", "modulus"), _MODULUS),
    "gap": "housing_diameter decides it",
    "gland": "housing_diameter and groove_width make it",
    "ring": "section_diameter and inner_diameter make it",
    "oil": "viscosity and pressure_viscosity make it",
    "temperature": "viscosity follows from it",
}
"""Keys that cannot be chosen freely: what to do instead."""


def design_case(p: Seal, target: str, key: str) -> int:
    """Print the way to the target; exit code 0, or 3 where it is not reached.  Raises BadInput."""
    asked = SAME.get(key, key)
    key = BASES.get(asked, asked)
    known = [k for k in (*NUMBERS, PRESSURE_KEY) if isinstance(getattr(p, k), float)]
    if key not in known:
        hint = f" ({INSTEAD[key]})" if key in INSTEAD else meant(key, known)
        raise BadInput(f"--by {key}{hint}: allowed: {', '.join([*known, *BASES])}")
    p = _one_film(p)
    try:
        wanted = Target.of(target)
        steps = designed(p, wanted, key, _solve, lambda q: _hold(q, wanted.quantity, key))
    except NoDesignError as error:
        raise BadInput(str(error)) from None
    except ValidationError as error:
        wrong = f"the target needs a {key} that a case cannot have: {_reason(error)}"
        raise BadInput(wrong) from None
    _tell(p, wanted, key, steps)
    if asked != key:
        first, last = (
            derived(p.model_copy(update={key: step.value}), asked) for step in (steps[0], steps[-1])
        )
        click.echo(f"{asked} from {first:.5g} to {last:.5g} {_unit(asked)}")
    return 0


def _unit(key: str) -> str:
    return next(one.unit for one in keys_of(Seal) if one.name == key)


def _one_film(p: Seal) -> Seal:
    """The case of its first speed, at outstroke unless it has one stroke.  Raises BadInput."""
    stroke = "out" if p.stroke == "both" else p.stroke
    given = {"speeds": p.speeds[:1], "stroke": stroke, "error_estimate": False}
    try:
        return Seal(**{**p.settled(), **given, "sensitivity": True})
    except ValidationError as error:
        raise BadInput(f"a design needs the sensitivities: {_reason(error)}") from None


def _reason(error: ValidationError) -> str:
    return error.errors()[0]["msg"].removeprefix("Value error, ")


def _solve(p: Seal) -> FilmState | None:
    states = run(p, Silent(), differentiate=differentiation(p)).states
    return states[0] if states else None


def _hold(p: Seal, quantity: str, key: str) -> Change | None:
    held = HeldFilm.of(p)
    return None if held is None else lambda factor: held.change(quantity, key, factor)


def _tell(p: Seal, target: Target, key: str, steps: Sequence[Step]) -> None:
    first, last = steps[0], steps[-1]
    sign = 1.0 if p.stroke == "out" else -1.0
    name = {of: said for said, of in _OF_PISTON.items()}.get(key, key) if p.piston else key
    values = [abs(step.value) if name != key else step.value for step in steps]
    click.echo(f"p_s = {p.sealed_pressure:g} MPa, U = {sign * p.speeds[0]:+g} mm/s")
    for step, value in zip(steps, values, strict=True):
        click.echo(f"  {name} = {value:.8g}: {target.quantity} = {step.quantity:.5g}")
    change = 100.0 * (last.quantity / first.quantity - 1.0)
    moved = 100.0 * (last.value / first.value - 1.0)
    click.echo(
        f"{target.quantity} {change:+.2f} % (wanted {100.0 * (target.factor - 1.0):+g} %) by "
        f"{name} = {values[-1]:.8g} ({moved:+.3f} %); by the first sensitivity alone: "
        f"{values[1]:.8g}, which gives {100 * (steps[1].quantity / first.quantity - 1):+.2f} %"
    )
