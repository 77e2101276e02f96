"""Design: the value of one key that gives a quantity of a film its wanted change.

Log-linear steps by exact sensitivities, each followed by a nonlinear solve on a mesh of its own;
near the target the mesh is frozen, so that the steps settle.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pydantic import ValidationError

from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.observer import Observer
from softehl.cases.harness.parameters import keys_of
from softehl.cases.seal.gland.fit_geometry import DIAMETERS
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sensitivity_keys import BASES, NUMBERS, PRESSURE_KEY
from softehl.cases.seal.sensitivity.frozen_mesh_map import FilmCase
from softehl.cases.seal.sensitivity.quantities import CALLED, QUANTITIES, quantities
from softehl.cases.seal.sensitivity.sensitivity import differentiation
from softehl.cases.seal.solve.driver import DryContact, Judge, verdict_of_contact
from softehl.cases.seal.solve.film_solver import NoFilm
from softehl.cases.seal.solve.load_stages import StageError
from softehl.cases.seal.states.sensitivity_table import differentiable
from softehl.cases.seal.states.state import FilmState
from softehl.cases.seal.states.state_files import report_film
from softehl.runtime.arrays import Array
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.newton import Newton, NonlinearProblem
from softehl.runtime.suggestions import did_you_mean

TOLERANCE = 0.01
"""Of the quantity, relative: about what two meshes of neighbouring values differ by."""

SETTLED = 1e-4
"""Of the quantity, relative, on one mesh."""

STEPS = 6
"""Nonlinear solves after the first."""

_TARGET = re.compile(r"(?P<name>\w+)\s*=?\s*(?P<change>[-+]\d+(\.\d*)?)\s*%")


class NoDesignError(BadInput):
    """A target that cannot be reached; the text says why and what to do."""


@dataclass(frozen=True)
class Target:
    """A quantity and the factor that it is to change by."""

    quantity: str
    factor: float

    @property
    def percent(self) -> float:
        """The change in per cent."""
        return round(100.0 * (self.factor - 1.0), 9)

    @classmethod
    def of(cls, text: str) -> Target:
        """From "friction -10 %".  Raises NoDesignError."""
        match = _TARGET.fullmatch(text.strip().replace("h*", "h_star"))
        if not match or match["name"] not in QUANTITIES or float(match["change"]) <= -100.0:
            hint = did_you_mean(match["name"], QUANTITIES) if match else ""
            raise NoDesignError(
                f'the target "{text}" is not understood{hint}; allowed: a change in per cent of '
                f'{", ".join(QUANTITIES)}, as in "friction -10%"'
            )
        return cls(match["name"], 1.0 + 0.01 * float(match["change"]))

    @property
    def title(self) -> str:
        """Name of the quantity for readers."""
        return CALLED[self.quantity][0]

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return CALLED[self.quantity][1]

    def value_text(self, value: float) -> str:
        """A value of the quantity as it is typed."""
        return f"{self.quantity} = {value:.5g} {self.unit}"


@dataclass(frozen=True)
class Lever:
    """A key or a measure of the gland that a user changes, by its name, and the key behind it."""

    name: str
    key: str

    def value(self, p: Seal) -> float:
        """Its value as a user gives it: of a piston seal, too, a diameter is not negative."""
        if self.name in BASES:
            return float(getattr(p, BASES[self.name][1]))
        if self.key == "inner_diameter":
            return p.ring_diameter
        value = float(getattr(p, self.key))
        return value if p.called(self.key) == self.key else -value

    @property
    def title(self) -> str:
        """Its name for readers."""
        return self.name.replace("_", " ")

    @property
    def unit(self) -> str:
        """Of its value."""
        return next(one.unit for one in keys_of(Seal) if one.name == self.name)

    def value_text(self, p: Seal) -> str:
        """Its value in words."""
        return f"{self.name} = {self.value(p):.6g} {self.unit}".rstrip()


@dataclass(frozen=True)
class DesignStep:
    """A value of the key, and the quantity there by a nonlinear solve.

    state: the film; None on a mesh that is held, where only the quantity is known.
    """

    value: float
    quantity: float
    state: FilmState | None = None


def value_of(state: FilmState, quantity: str) -> float:
    """A quantity of a film, in the units of `curve.csv`; leakage and friction without sign."""
    values = {
        "h_star": state.h_star_um,
        "friction": state.rod_friction_N,
        "leakage": state.leak_rate_mm3_s,
        "p_max": state.p_max_MPa,
        "contact_width": state.contact_end_mm - state.contact_start_mm,
    }
    return abs(values[quantity])


def slope_of(state: FilmState, quantity: str, key: str) -> float:
    """Log derivative of a quantity of a film by a key; 0 where it does not depend on it."""
    assert state.sensitivity is not None
    return state.sensitivity.get(quantity, {}).get(key, 0.0)


def changed(p: Seal, message: str, **keys: Any) -> Seal:
    """The case with other values of some keys.

    message: words of the NoDesignError where a case cannot have them.
    """
    try:
        return Seal(**{**p.settled(), **keys})
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise NoDesignError(f"{message}: {reason}") from None


Change = Callable[[float], float | None]
"""Factor of a key -> that of the quantity on the held mesh, None where there is no film."""

Film = tuple[FilmState, Change]
"""A film with its sensitivities, and how its quantity changes with the key of a target."""

Solve = Callable[[Seal], Film | None]
"""The one film of a case, None where there is none."""


def designed(p: Seal, target: Target, by: Lever, solve: Solve) -> list[DesignStep]:
    """Steps to the value of the key of a lever that meets the target; the last one does.

    Raises NoDesignError.
    """
    called, value = p.called(by.key), float(getattr(p, by.key))
    state, _ = _film(p, by, solve)
    steps = [DesignStep(value, value_of(state, target.quantity), state)]
    target_value = target.factor * steps[0].quantity
    for _ in range(STEPS):
        slope = slope_of(state, target.quantity, by.key)
        log_change = math.log(target_value / steps[-1].quantity)
        if abs(log_change) > 0.5 * abs(slope):  # the key would change by more than half
            raise NoDesignError(
                f"{target.quantity} follows {called} by {slope:.2g} % for 1 %: that is too "
                "little for this target; choose another key (sensitivity.csv shows which have an "
                "influence)"
            )
        value *= math.exp(log_change / slope)
        message = f"the target needs a {called} that a case cannot have"
        changed_case = changed(p, message, **{by.key: value})
        state, change = _film(changed_case, by, solve)
        steps.append(DesignStep(value, value_of(state, target.quantity), state))
        if abs(steps[-1].quantity / target_value - 1.0) <= TOLERANCE:
            value_near, goal = by.value_text(changed_case), target.value_text(target_value)
            missed = f"near {value_near} no value gives {goal} on one mesh"
            return [*steps, *settled(steps[-1], target_value, slope, change, missed)]
    raise NoDesignError(
        f"{target.value_text(steps[-1].quantity)} after {STEPS} solves, wanted was "
        f"{target_value:.5g}: ask for a smaller change"
    )


def settled(
    first: DesignStep, target_value: float, slope: float, change: Change, missed: str
) -> list[DesignStep]:
    """Steps on the mesh of `first`, until the quantity is what was wanted, to `SETTLED`.

    slope: d log quantity / d log key. missed: words of the NoDesignError where it is not reached.
    """
    steps, rise = [first], slope
    advice = "use a larger density, or ask for another change"
    while abs(steps[-1].quantity / target_value - 1.0) > SETTLED:
        if rise * slope <= 0.0 or len(steps) > STEPS:
            raise NoDesignError(f"{missed}: the film is at a kink; {advice}")
        last = steps[-1]
        value = last.value * (target_value / last.quantity) ** (1.0 / rise)
        ratio = change(value / first.value)
        if ratio is None:
            raise NoDesignError(f"{missed}: no film is found on the way; {advice}")
        steps.append(DesignStep(value, first.quantity * ratio))
        rise = math.log(steps[-1].quantity / last.quantity) / math.log(value / last.value)
    return steps[1:]


def _film(p: Seal, by: Lever, solve: Solve) -> Film:
    film = solve(p)
    if film is None or not differentiable(film[0]) or film[0].sensitivity is None:
        verdict = "did not converge" if film is None else f"has the verdict {film[0].verdict}"
        raise NoDesignError(
            f"with {by.value_text(p)} the film {verdict}: no sensitivities of it; use a "
            "larger density, or ask for a smaller change"
        )
    return film


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


@dataclass(frozen=True, eq=False)
class Design:
    """A target that is met.

    parameters: the case of one film that it began with. by: what was changed.
    """

    parameters: Seal
    target: Target
    by: Lever
    steps: Sequence[DesignStep]

    @property
    def met(self) -> Seal:
        """The case that meets the target."""
        return self.at(self.steps[-1].value)

    def at(self, value: float) -> Seal:
        """The case with another value of the key."""
        return self.parameters.model_copy(update={self.by.key: value})

    def measure(self, value: float) -> float:
        """The value of what a user named, where the key has this one."""
        return self.by.value(self.at(value))

    @property
    def films(self) -> list[tuple[float, FilmState]]:
        """The films on meshes of their own, each with its value of the key."""
        return [(step.value, step.state) for step in self.steps if step.state]

    @property
    def change(self) -> float:
        """Of the quantity, %."""
        return 100.0 * (self.steps[-1].quantity / self.steps[0].quantity - 1.0)


def design_case(p: Seal, target: str, key: str, observer: Observer) -> Design:
    """The way to a target by a key.  Raises BadInput, also where it is not reached."""
    name = DIAMETERS.get(key, key)
    base, _ = BASES.get(name, (name, name))
    names = [k for k in (*NUMBERS, PRESSURE_KEY) if isinstance(getattr(p, k), float)]
    if base not in names:
        hint = f" ({INSTEAD[base]})" if base in INSTEAD else did_you_mean(base, names)
        raise BadInput(f"--by {base}{hint}: allowed: {', '.join([*names, *BASES])}")
    p = _one_film(p)
    by, goal = Lever(name if name in BASES else p.called(base), base), Target.of(target)

    def solve(q: Seal) -> Film | None:
        film = HeldFilm.of(q, observer)
        return (film.state, partial(film.change, goal.quantity, base)) if film else None

    return Design(p, goal, by, designed(p, goal, by, solve))


def _one_film(p: Seal) -> Seal:
    """The case of its first speed, at outstroke unless it has one stroke.  Raises BadInput."""
    stroke = "out" if p.stroke == "both" else p.stroke
    updates = {"speeds": p.speeds[:1], "stroke": stroke, "error_estimate": False}
    return changed(p, "a design needs the sensitivities", **updates, sensitivity=True)


@dataclass(frozen=True, eq=False)
class HeldFilm:
    """The film of a case with one stroke and one speed: its state, and its unknowns x (n,)."""

    case: FilmCase
    x: Array
    newton: Newton
    state: FilmState

    @classmethod
    def of(cls, p: Seal, observer: Observer) -> HeldFilm | None:
        """The film of a case; None where it is not reached."""
        assert p.stroke != "both"
        try:
            contact = DryContact.of(p, observer)
        except StageError:
            return None
        result = contact.adapted(p.stroke, p.speeds[0])
        if isinstance(result, NoFilm):
            return None
        judge = Judge(verdict_of_contact(contact.system, contact.x), differentiation(p))
        film, state = result.film, judge.state(result, None)
        report_film(observer, state)
        return cls(FilmCase(film.system, film.loads), film.x, contact.newton, state)

    def change(self, quantity: str, key: str, factor: float) -> float | None:
        """A quantity over its value here, where a key is `factor` times as large; None if that film
        is not reached from this one.
        """

        def problem_at(logarithm: float) -> NonlinearProblem:
            return self.case.scaled(key, math.expm1(logarithm)).problem

        # a hundredth of a millimetre is many films; the least step moves a quantity that follows
        # tenfold by `SETTLED`
        log_factor, minimum = math.log(factor), 0.1 * SETTLED
        path = Continuation(self.newton, StepRule(max(abs(log_factor), minimum), minimum), name=key)
        branch = path.follow(problem_at, 0.0, log_factor, self.x)
        if not branch.converged:
            return None
        changed_quantities = quantities(self.case.scaled(key, factor - 1.0), branch.last.x)
        return changed_quantities[quantity].value / quantities(self.case, self.x)[quantity].value


def design_lines(design: Design) -> list[str]:
    """A design in words: its steps, and what it comes to."""
    p, target, steps = design.parameters, design.target, design.steps
    first, last = steps[0], steps[-1]
    sign = 1.0 if p.stroke == "out" else -1.0
    name, unit = design.by.name, f" {design.by.unit}".rstrip()
    values = [design.measure(step.value) for step in steps]
    lines = [f"p_s = {p.sealed_pressure:g} MPa, U = {sign * p.speeds[0]:+g} mm/s"]
    lines += [
        f"  {name} = {value:.8g}{unit}: {target.value_text(step.quantity)}"
        for step, value in zip(steps, values, strict=True)
    ]
    moved = 100.0 * (values[-1] / values[0] - 1.0)
    alone = 100.0 * (steps[1].quantity / first.quantity - 1.0)
    lines.append(
        f"{target.quantity} {design.change:+.2f} % (wanted {target.percent:+g} %) by {name} = "
        f"{values[-1]:.8g}{unit} ({moved:+.3f} %); by the first sensitivity alone: "
        f"{values[1]:.8g}{unit}, which gives {alone:+.2f} %"
    )
    if name in BASES:
        decided = Lever(p.called(design.by.key), design.by.key)
        previous, after = (decided.value(design.at(step.value)) for step in (first, last))
        lines.append(f"{decided.name} from {previous:.5g} to {after:.5g} mm")
    return lines
