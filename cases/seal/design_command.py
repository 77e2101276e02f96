"""`softehl design`: the value of one key that gives a film a wanted change."""

from __future__ import annotations

from collections.abc import Sequence

import click
from pydantic import ValidationError

from softehl.cases.harness.errors import BadInput
from softehl.cases.seal.design import Change, NoDesignError, Step, Target, designed
from softehl.cases.seal.held import HeldFilm
from softehl.cases.seal.method import run
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.state import FilmState, Silent
from softehl.cases.seal.variation import NUMBERS, PRESSURE_KEY
from softehl.runtime.names import meant


def design_case(p: ORing, target: str, key: str) -> int:
    """Print the way to the target; exit code 0, or 3 where it is not reached.  Raises BadInput."""
    if key not in (*NUMBERS, PRESSURE_KEY) or not isinstance(getattr(p, key), float):
        known = [k for k in (*NUMBERS, PRESSURE_KEY) if isinstance(getattr(p, k), float)]
        raise BadInput(f"--by {key}{meant(key, known)}: allowed: {', '.join(known)}")
    if len(p.speeds) > 1 or p.stroke == "both":
        p = p.model_copy(update={"speeds": p.speeds[:1], "stroke": _one(p.stroke)})
    p = p.model_copy(update={"sensitivity": True, "error_estimate": False})
    try:
        wanted = Target.of(target)
        steps = designed(p, wanted, key, _solve, lambda q: _hold(q, wanted.quantity, key))
    except NoDesignError as error:
        raise BadInput(str(error)) from None
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise BadInput(f"the target needs a {key} that a case cannot have: {reason}") from None
    _tell(p, wanted, key, steps)
    return 0


def _one(stroke: str) -> str:
    return "out" if stroke == "both" else stroke


def _solve(p: ORing) -> FilmState | None:
    states = run(p, Silent()).states
    return states[0] if states else None


def _hold(p: ORing, quantity: str, key: str) -> Change | None:
    held = HeldFilm.of(p)
    return None if held is None else lambda factor: held.change(quantity, key, factor)


def _tell(p: ORing, target: Target, key: str, steps: Sequence[Step]) -> None:
    first, last = steps[0], steps[-1]
    sign = 1.0 if p.stroke == "out" else -1.0
    click.echo(f"p_s = {p.sealed_pressure:g} MPa, U = {sign * p.speeds[0]:+g} mm/s")
    for step in steps:
        click.echo(f"  {key} = {step.value:.8g}: {target.quantity} = {step.quantity:.5g}")
    change = 100.0 * (last.quantity / first.quantity - 1.0)
    moved = 100.0 * (last.value / first.value - 1.0)
    click.echo(
        f"{target.quantity} {change:+.2f} % (wanted {100.0 * (target.factor - 1.0):+g} %) by "
        f"{key} = {last.value:.8g} ({moved:+.3f} %); by the first sensitivity alone: "
        f"{steps[1].value:.8g}, which gives {100 * (steps[1].quantity / first.quantity - 1):+.2f} %"
    )
