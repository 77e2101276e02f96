"""Design: values of one or several keys that bring a quantity of a film to a target.

Log-linear steps by exact sensitivities, each followed by a nonlinear solve on a mesh of its own;
near a target that is an equation the mesh is frozen, so that the steps settle. Several bounds are
met by the least change of the key that meets all of them. Several keys change by the least sum of
squares of their relative changes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

from pydantic import ValidationError

from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.observer import Observer
from softehl.cases.harness.parameters import keys_of
from softehl.cases.harness.units import read_quantity
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.gland.fit_geometry import DIAMETERS
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import OF_PISTON
from softehl.cases.seal.gland.sensitivity_keys import BASES, NUMBERS, PRESSURE_KEY
from softehl.cases.seal.sensitivity.frozen_mesh_map import FilmCase
from softehl.cases.seal.sensitivity.quantities import CALLED, quantities
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

CYCLE = "cycle_leakage"
"""Net leakage of a cycle out and back, which has films of both strokes."""

TARGETS = {**CALLED, CYCLE: ("leakage of a cycle", "mm3")}
"""Name of a quantity that may be a target -> what a reader calls it, and its unit."""

IN_BOTH = ("h_star", "friction", "p_max", "contact_width")
"""Quantities of which a bound holds in both strokes, unless the case has one stroke."""

_NEXT = re.compile(rf"(?:[\s,;]|\band\b)+(?=(?:h\*|{'|'.join(TARGETS)})(?!\w))")
"""Place between two targets."""

_CHANGE = re.compile(r"(?P<name>\w+)\s*=?\s*(?P<change>[-+]\d+(\.\d*)?)\s*%")
_SIDES = {
    "below": r"below|under|at most|less than|<=?|\u2264",
    "above": r"above|over|at least|more than|>=?|\u2265",
    "": r"=|to",
}
_VALUE = re.compile(
    rf"(?P<name>\w+)\s*(?:is )?(?P<side>{'|'.join(_SIDES.values())})\s*"
    r"(?P<value>\d+(?:\.\d*)?(?:e-?\d+)?)\s*(?P<unit>[^\d\s].*)?"
)
_PER_CYCLE = re.compile(r"\s*(?:/|a |per |in a )\s*cycle$")
_UNITS = {
    "N": {"": 1.0, "N": 1.0, "kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605},
    "mm3/s": {"": 1.0, "mm3/s": 1.0, "mm3/min": 1.0 / 60.0, "ml/h": 1.0 / 3.6},
    "mm3": {"": 1.0, "mm3": 1.0, "ml": 1e3, "cm3": 1e3},
}
"""Unit of a quantity that has none in `harness.units` -> units that it is read in."""


class NoDesignError(BadInput):
    """A target that cannot be reached; the text says why and what to do."""


@dataclass(frozen=True)
class DesignTarget:
    """Target of a quantity: a factor of its first value, a value, or a bound.

    side: "below" or "above" of a bound, else empty. stroke: that it is for, empty where the case
    has one.
    """

    quantity: str
    factor: float | None = None
    value: float = 0.0
    side: Literal["below", "above", ""] = ""
    stroke: Literal["out", "in", ""] = ""

    @classmethod
    def several(cls, text: str, *, both: bool) -> list[DesignTarget]:
        """From "friction below 5 N and leakage below 1 mm3 a cycle".  Raises NoDesignError.

        both: whether a bound holds in both strokes.
        """
        targets = [cls.of(part) for part in _NEXT.split(text.strip())]
        if len(targets) > 1 and not all(target.side for target in targets):
            raise NoDesignError(
                f'"{text}": several targets must be bounds, as in "friction below 5 N and leakage '
                'below 1 mm3 a cycle"'
            )
        strokes: tuple[Stroke, ...] = ("out", "in")
        return [
            each
            for target in targets
            for each in (
                [replace(target, stroke=stroke) for stroke in strokes]
                if both and target.side and target.quantity in IN_BOTH
                else [target]
            )
        ]

    @classmethod
    def of(cls, text: str) -> DesignTarget:
        """From "friction -10 %" or "friction below 5 N".  Raises NoDesignError."""
        plain = text.strip().replace("h*", "h_star").replace("\u00b3", "3")
        match = _CHANGE.fullmatch(plain)
        if match and match["name"] in TARGETS and float(match["change"]) > -100.0:
            return cls(match["name"], 1.0 + 0.01 * float(match["change"]))
        valued = _VALUE.fullmatch(plain)
        if valued and (target := cls._of_value(valued)):
            return target
        match = match or valued
        hint = did_you_mean(match["name"], TARGETS) if match else ""
        raise NoDesignError(
            f'the target "{text}" is not understood{hint}; allowed: {", ".join(TARGETS)} with a '
            'change in per cent, a value or a bound, as in "friction -10%", "friction below 5 N" '
            'and "leakage below 1 mm3 a cycle"'
        )

    @classmethod
    def _of_value(cls, match: re.Match[str]) -> DesignTarget | None:
        """A value or a bound; None for an unknown quantity or unit."""
        name, unit_text = match["name"], (match["unit"] or "").strip()
        per_cycle = _PER_CYCLE.sub("", unit_text)
        if name == "leakage" and per_cycle != unit_text:
            name = CYCLE
        if name not in TARGETS:
            return None
        unit_text = per_cycle if name == CYCLE else unit_text
        unit, number = TARGETS[name][1], float(match["value"])
        if unit in _UNITS:
            if unit_text not in _UNITS[unit]:
                return None
            value = number * _UNITS[unit][unit_text]
        else:
            try:
                value = read_quantity(f"{number:g} {unit_text or unit}", unit)
            except ValueError:
                return None
        if not value > 0.0:
            return None
        side: Literal["below", "above", ""] = ""
        if re.fullmatch(_SIDES["below"], match["side"]):
            side = "below"
        elif re.fullmatch(_SIDES["above"], match["side"]):
            side = "above"
        return cls(name, None, value, side)

    def goal(self, first: float) -> float:
        """The value or the bound, from a first value."""
        return self.value if self.factor is None else self.factor * first

    def aim(self, first: float) -> float:
        """The value to go for from a first one: a bound is passed by half the tolerance."""
        inside = {"below": -0.5, "above": 0.5, "": 0.0}[self.side] * TOLERANCE
        return self.goal(first) * (1.0 + inside)

    def within(self, value: float) -> bool:
        """True if a value is on the right side of a bound; False without one."""
        return {"below": value <= self.value, "above": value >= self.value}.get(self.side, False)

    def missed(self, value: float) -> float:
        """Logarithmic distance of a value from a bound; negative where the bound is held."""
        if self.within(value) or value <= 0.0:
            return -1.0
        return abs(math.log(self.aim(value) / value))

    @property
    def goal_text(self) -> str:
        """Change, value or bound in words."""
        if self.factor is not None:
            return f"{round(100.0 * (self.factor - 1.0), 9):+g} %"
        return f"{self.side} {self.value:.5g} {self.unit}".strip()

    @property
    def title(self) -> str:
        """Name of the quantity for readers, with its stroke."""
        at = f", {self.stroke}stroke" if self.stroke else ""
        return f"{TARGETS[self.quantity][0]}{at}"

    @property
    def label(self) -> str:
        """Name of the quantity as it is typed, with its stroke."""
        return f"{self.quantity} {self.stroke}".rstrip()

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return TARGETS[self.quantity][1]

    def value_text(self, value: float) -> str:
        """A value of the quantity as it is typed."""
        return f"{self.label} = {value:.5g} {self.unit}"


@dataclass(frozen=True)
class Lever:
    """A key or a measure of the gland that a user changes, by its name, and the key behind it.

    others: levers that change with it, each with the log change of its key for one of this key.
    """

    name: str
    key: str
    others: tuple[tuple[Lever, float], ...] = ()

    @property
    def exponents(self) -> dict[str, float]:
        """Each key that changes, and its log change for one of the first."""
        return {self.key: 1.0, **{lever.key: share for lever, share in self.others}}

    def keys_at(self, p: Seal, value: float) -> dict[str, float]:
        """All keys, where that of this lever has a value; p: the case of the first step."""
        factor = value / float(getattr(p, self.key))
        keys = {k: float(getattr(p, k)) * factor**share for k, share in self.exponents.items()}
        return {**keys, self.key: value}

    def gear(self, p: Seal) -> float:
        """Log change of the value for one of the key: not 1 of a measure of the gland.

        Rod and housing count by what they change of the depth of the gland: 1 % of a diameter is
        much more than 1 % of a viscosity.
        """
        if self.key in OF_PISTON and self.name not in BASES:
            return abs(float(getattr(p, self.key))) / (2.0 * p.depth)
        step = 1e-6
        moved = p.model_copy(update={self.key: float(getattr(p, self.key)) * (1.0 + step)})
        return math.log(abs(self.value(moved) / self.value(p))) / math.log1p(step)

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

    state: the film; None on a mesh that is held, where only the quantity is known. slope: d log
    quantity / d log key, where the film is known. values: of every target, where there are several.
    """

    value: float
    quantity: float
    state: FilmState | None = None
    slope: float = 0.0
    values: tuple[float, ...] = ()


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


def slope_of(state: FilmState, quantity: str, by: Lever) -> float:
    """Log derivative of a quantity of a film by that of the key of a lever and those with it."""
    assert state.sensitivity is not None
    log_derivatives = state.sensitivity.get(quantity, {})
    return sum(share * log_derivatives.get(key, 0.0) for key, share in by.exponents.items())


Change = Callable[[float], float | None]
"""Factor of a key -> that of the quantity on the held mesh, None where there is no film."""


@dataclass(frozen=True, eq=False)
class LinearisedFilm:
    """Film of a case with the quantity of a design and its sensitivities.

    log_derivatives: key -> log derivative of the quantity. change: on the held mesh. doubt: reason
    why the film has no sensitivities, else empty.
    """

    state: FilmState
    value: float
    log_derivatives: Mapping[str, float] = field(default_factory=dict)
    change: Change = lambda _: None
    doubt: str = ""

    @classmethod
    def of(cls, state: FilmState, quantity: str, change: Change) -> LinearisedFilm:
        """The film of one stroke."""
        if not differentiable(state) or state.sensitivity is None:
            return cls(state, value_of(state, quantity), doubt=f"has the verdict {state.verdict}")
        log_derivatives = state.sensitivity.get(quantity, {})
        return cls(state, value_of(state, quantity), log_derivatives, change)

    @classmethod
    def of_cycle(cls, out: FilmState, back: FilmState, travel: float) -> LinearisedFilm:
        """Net leakage of a cycle: what the outstroke takes out, less what the instroke takes back.

        Its log derivative is that of a difference; the films have no common mesh to be held.
        """
        rates = [abs(s.leak_rate_mm3_s / s.rod_speed_mm_s) * travel for s in (out, back)]
        net, log_derivatives = rates[0] - rates[1], dict[str, float]()
        for state, rate in ((out, rates[0]), (back, -rates[1])):
            if not differentiable(state) or state.sensitivity is None:
                return cls(
                    out, net, doubt=f"has the verdict {state.verdict} ({state.stroke}stroke)"
                )
            for key, slope in state.sensitivity.get("leakage", {}).items():
                log_derivatives[key] = log_derivatives.get(key, 0.0) + rate * slope / net
        return cls(out, net, log_derivatives)

    def slope(self, by: Lever) -> float:
        """Log derivative of the quantity by that of the key of a lever and those with it."""
        return sum(
            share * self.log_derivatives.get(key, 0.0) for key, share in by.exponents.items()
        )


Solve = Callable[[Seal], LinearisedFilm | None]
"""The film of a case, None where there is none."""

SolveAll = Callable[[Seal], list[LinearisedFilm] | None]
"""The film of each target of a case, None where one is not there."""


def changed(p: Seal, message: str, **keys: Any) -> Seal:
    """The case with other values of some keys.

    message: words of the NoDesignError where a case cannot have them.
    """
    try:
        return Seal(**{**p.settled(), **keys})
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise NoDesignError(f"{message}: {reason}") from None


def designed(p: Seal, target: DesignTarget, by: Lever, solve: Solve) -> list[DesignStep]:
    """Steps to the value of the key of a lever that meets a change or a value; the last one does.

    Raises NoDesignError.
    """
    value = float(getattr(p, by.key))
    film = _film(p, by, solve)
    steps = [DesignStep(value, film.value, film.state, film.slope(by))]
    goal = target.goal(film.value)
    for _ in range(STEPS):
        slope = film.slope(by)
        value *= math.exp(_log_change(p, target, goal, by, film))
        message = f"the target needs a {p.called(by.key)} that a case cannot have"
        changed_case = changed(p, message, **by.keys_at(p, value))
        film = _film(changed_case, by, solve)
        steps.append(DesignStep(value, film.value, film.state, film.slope(by)))
        if abs(film.value / goal - 1.0) <= TOLERANCE:
            if target.quantity == CYCLE:  # a difference of two films, each on its own mesh
                return steps
            value_near, goal_text = by.value_text(changed_case), target.value_text(goal)
            missed = f"near {value_near} no value gives {goal_text} on one mesh"
            return [*steps, *settled(steps[-1], goal, slope, film.change, missed)]
    raise NoDesignError(
        f"{target.value_text(steps[-1].quantity)} after {STEPS} solves, wanted was "
        f"{target.goal_text}: ask for a smaller change"
    )


def bounded(
    p: Seal, targets: Sequence[DesignTarget], main: int, by: Lever, solve: SolveAll
) -> list[DesignStep]:
    """Steps to the value of the key of a lever that holds every bound; the last one does.

    main: index of the target whose quantity the steps have. Bounds that hold from the start need
    one step. Each step is the least change by which all bounds hold to first order. Raises
    NoDesignError.
    """
    value, case, steps = float(getattr(p, by.key)), p, list[DesignStep]()
    for _ in range(STEPS + 1):
        films = _films(case, by, solve)
        film, values = films[main], tuple(film.value for film in films)
        steps.append(DesignStep(value, film.value, film.state, film.slope(by), values))
        if all(target.within(v) for target, v in zip(targets, values, strict=True)):
            return steps
        lower, upper = (-math.inf, targets[main]), (math.inf, targets[main])
        for target, film in zip(targets, films, strict=True):
            slope, holds = film.slope(by), target.within(film.value)
            if holds and (film.value <= 0.0 or slope == 0.0):
                continue  # the seal returns its oil, or the key does not matter
            if holds:
                limit = math.log(target.value / film.value) / slope
            else:
                limit = _log_change(case, target, target.aim(film.value), by, film)
            if (target.side == "below") == (slope > 0.0):
                upper = min(upper, (limit, target), key=lambda end: end[0])
            else:
                lower = max(lower, (limit, target), key=lambda end: end[0])
        if lower[0] > upper[0]:
            needs = [_need(p, by, value, *end, above=end is lower) for end in (upper, lower)]
            raise NoDesignError(
                f"no {by.name} holds all bounds: {' and '.join(needs)} (to first order from "
                f"{by.value_text(case)}); choose another key or several, or other bounds"
            )
        value *= math.exp(min(max(0.0, lower[0]), upper[0]))
        message = f"the targets need a {p.called(by.key)} that a case cannot have"
        case = changed(p, message, **by.keys_at(p, value))
    texts = [t.value_text(v) for t, v in zip(targets, steps[-1].values, strict=True)]
    raise NoDesignError(
        f"{', '.join(texts)} after {STEPS} solves, wanted was "
        f"{' and '.join(f'{t.label} {t.goal_text}' for t in targets)}: ask for a smaller change"
    )


def _need(
    p: Seal, by: Lever, value: float, limit: float, target: DesignTarget, *, above: bool
) -> str:
    """The bound of a lever that a target needs, in words; limit: log change of the key."""
    cases_at_limit = [
        p.model_copy(update=by.keys_at(p, value * math.exp(limit + d))) for d in (0.0, 1e-6)
    ]
    measure, more = (by.value(end) for end in cases_at_limit)
    side = "above" if above == (more > measure) else "below"
    return f"{target.label} {target.goal_text} needs it {side} {measure:.4g} {by.unit}".rstrip()


def _log_change(
    p: Seal, target: DesignTarget, goal: float, by: Lever, film: LinearisedFilm
) -> float:
    """Log change of the key of a lever to a goal, to first order.  Raises NoDesignError."""
    slope = film.slope(by)
    if film.value <= 0.0:
        raise NoDesignError(
            f"the seal returns what it takes out with {by.value_text(p)}: its leakage is "
            f"{film.value:.3g} {target.unit}, and {goal:.5g} is not reached in per cent of that"
        )
    log_change = math.log(goal / film.value)
    if abs(log_change) > 0.5 * abs(slope):  # the key would change by more than half
        raise NoDesignError(
            f"{target.label} follows {p.called(by.key)} by {slope:.2g} % for 1 %: that is too "
            "little for this target; choose another key or several (sensitivity.csv shows "
            "which have an influence)"
        )
    return log_change / slope


def joint_lever(p: Seal, levers: Sequence[Lever], film: LinearisedFilm) -> Lever:
    """Several levers as one, by the least sum of squares of the relative changes of their values.

    With log quantity = sum S_k x_k to first order, x_k the log change of the value of a lever, that
    least sum has x_k in proportion to S_k. The first of the joint lever moves the quantity most.
    """
    gears = [lever.gear(p) for lever in levers]
    by_value = [
        film.log_derivatives.get(lever.key, 0.0) / gear
        for lever, gear in zip(levers, gears, strict=True)
    ]
    main = max(range(len(levers)), key=lambda n: abs(by_value[n]))
    if by_value[main] == 0.0:
        names = " and ".join(lever.name for lever in levers)
        raise NoDesignError(f"the quantity does not depend on {names}; choose other keys")
    log_changes = [slope / gear for slope, gear in zip(by_value, gears, strict=True)]
    others = tuple(
        (lever, log_changes[n] / log_changes[main]) for n, lever in enumerate(levers) if n != main
    )
    return replace(levers[main], others=others)


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


def _film(p: Seal, by: Lever, solve: Solve) -> LinearisedFilm:
    film = solve(p)
    (result,) = _films(p, by, lambda _: None if film is None else [film])
    return result


def _films(p: Seal, by: Lever, solve: SolveAll) -> list[LinearisedFilm]:
    films = solve(p)
    doubt = "did not converge" if films is None else next((f.doubt for f in films if f.doubt), "")
    if films is None or doubt:
        raise NoDesignError(
            f"with {by.value_text(p)} the film {doubt}: no sensitivities of it; use a "
            "larger density, or ask for a smaller change"
        )
    return films


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
    """A target that is met, or several bounds.

    parameters: the case of one film that it began with. target: of several the one that was missed
    most. by: what was changed.
    """

    parameters: Seal
    target: DesignTarget
    by: Lever
    steps: Sequence[DesignStep]
    targets: Sequence[DesignTarget] = ()

    @property
    def met(self) -> Seal:
        """The case that meets the target."""
        return self.at(self.steps[-1].value)

    def at(self, value: float) -> Seal:
        """The case with another value of the key, and of those that change with it."""
        return self.parameters.model_copy(update=self.by.keys_at(self.parameters, value))

    def measure(self, value: float) -> float:
        """The value of what a user named, where the key has this one."""
        return self.by.value(self.at(value))

    @property
    def moved(self) -> list[tuple[Lever, float, float]]:
        """Each lever with its value before and after."""
        levers = [self.by, *(lever for lever, _ in self.by.others)]
        return [(lever, lever.value(self.parameters), lever.value(self.met)) for lever in levers]

    @property
    def films(self) -> list[tuple[float, FilmState]]:
        """The films on meshes of their own, each with its value of the key."""
        return [(step.value, step.state) for step in self.steps if step.state]

    @property
    def change(self) -> float:
        """Of the quantity, %."""
        return 100.0 * (self.steps[-1].quantity / self.steps[0].quantity - 1.0)


def design_case(p: Seal, target: str, keys: Sequence[str], observer: Observer) -> Design:
    """The way to a target by keys.  Raises BadInput, also where it is not reached."""
    levers = [_lever(p, key) for key in dict.fromkeys(keys)]
    lever_keys = [lever.key for lever in levers]
    if twice := [lever.name for lever in levers if lever_keys.count(lever.key) > 1]:
        raise BadInput(f"--by {' and '.join(twice)} decide one key; give one of them")
    targets = DesignTarget.several(target, both=p.stroke == "both")
    p, by = _one_film(p), levers[0]
    films = dict[Seal, HeldFilm | None]()

    def held_film(q: Seal, stroke: Stroke) -> HeldFilm | None:
        case = q if q.stroke == stroke else q.model_copy(update={"stroke": stroke})
        if case not in films:
            films[case] = HeldFilm.of(case, observer)
        return films[case]

    def solve(q: Seal) -> list[LinearisedFilm] | None:
        results = [_film_of(q, each, by, held_film) for each in targets]
        return None if None in results else [film for film in results if film]

    def solve_first(q: Seal) -> LinearisedFilm | None:
        results = solve(q)
        return results[0] if results else None

    main = 0
    if targets[0].side or len(levers) > 1:
        first = _films(p, by, solve)
        missed = [each.missed(film.value) for each, film in zip(targets, first, strict=True)]
        main = missed.index(max(missed))
        by = joint_lever(p, levers, first[main]) if len(levers) > 1 else by
    if targets[0].side:
        steps = bounded(p, targets, main, by, solve)
    else:
        steps = designed(p, targets[0], by, solve_first)
    return Design(p, targets[main], by, steps, targets)


def _lever(p: Seal, key: str) -> Lever:
    """The lever of a key that a user names.  Raises BadInput."""
    name = DIAMETERS.get(key, key)
    base, _ = BASES.get(name, (name, name))
    names = [k for k in (*NUMBERS, PRESSURE_KEY) if isinstance(getattr(p, k), float)]
    if base not in names:
        instead = INSTEAD.get(base) or Seal.hints.get(base.lower())
        hint = f" ({instead})" if instead else did_you_mean(base, names)
        raise BadInput(f"--by {base}{hint}: allowed: {', '.join([*names, *BASES])}")
    return Lever(name if name in BASES else p.called(base), base)


def _film_of(
    q: Seal, target: DesignTarget, by: Lever, held_film: Callable[[Seal, Stroke], HeldFilm | None]
) -> LinearisedFilm | None:
    """The film of a target in a case, or for a cycle those of both strokes."""
    if target.quantity == CYCLE:
        out, back = held_film(q, "out"), held_film(q, "in")
        return LinearisedFilm.of_cycle(out.state, back.state, q.travel) if out and back else None
    assert q.stroke != "both"
    film = held_film(q, target.stroke or q.stroke)
    if film is None:
        return None
    change = partial(film.change, target.quantity, by.exponents)
    return LinearisedFilm.of(film.state, target.quantity, change)


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

    def change(self, quantity: str, keys: Mapping[str, float], factor: float) -> float | None:
        """A quantity over its value here, where a key is `factor` times as large; None if that film
        is not reached from this one.

        keys: each key that changes, and its log change for one of the first.
        """

        def case_at(logarithm: float) -> FilmCase:
            case = self.case
            for key, share in keys.items():
                case = case.scaled(key, math.expm1(share * logarithm))
            return case

        def problem_at(logarithm: float) -> NonlinearProblem:
            return case_at(logarithm).problem

        # a hundredth of a millimetre is many films; the least step moves a quantity that follows
        # tenfold by `SETTLED`
        log_factor, minimum = math.log(factor), 0.1 * SETTLED
        rule = StepRule(max(abs(log_factor), minimum), minimum)
        path = Continuation(self.newton, rule, name=" ".join(keys))
        branch = path.follow(problem_at, 0.0, log_factor, self.x)
        if not branch.converged:
            return None
        changed_quantities = quantities(case_at(log_factor), branch.last.x)
        return changed_quantities[quantity].value / quantities(self.case, self.x)[quantity].value


def design_lines(design: Design) -> list[str]:
    """A design in words: its steps, and what it comes to."""
    p, target, steps = design.parameters, design.target, design.steps
    first, last = steps[0], steps[-1]
    name, unit = design.by.name, f" {design.by.unit}".rstrip()
    values = [design.measure(step.value) for step in steps]
    targets = design.targets or (target,)
    lines = [f"p_s = {p.sealed_pressure:g} MPa, U = {_strokes(design)}"]
    for step, value in zip(steps, values, strict=True):
        quantities_there = step.values or (step.quantity,)
        texts = [t.value_text(v) for t, v in zip(targets, quantities_there, strict=True)]
        lines.append(f"  {name} = {value:.8g}{unit}: {', '.join(texts)}")
    if len(steps) == 1:
        holding = [f"{each.label} is {each.goal_text}" for each in targets]
        return [*lines, f"{' and '.join(holding)} already; nothing needs to change"]
    moved = 100.0 * (values[-1] / values[0] - 1.0)
    alone = 100.0 * (steps[1].quantity / first.quantity - 1.0)
    lines.append(
        f"{target.label} {design.change:+.2f} % (wanted {target.goal_text}) by {name} = "
        f"{values[-1]:.8g}{unit} ({moved:+.3f} %); by the first sensitivity alone: "
        f"{values[1]:.8g}{unit}, which gives {alone:+.2f} %"
    )
    lines += [
        f"  and {each.value_text(value)} ({each.goal_text})"
        for each, value in zip(targets, last.values, strict=False)
        if each != target
    ]
    for lever, initial, after in design.moved[1:]:
        lines.append(
            f"  and {lever.name} = {after:.8g} {lever.unit}".rstrip()
            + f" ({100.0 * (after / initial - 1.0):+.3f} %)"
        )
    for lever, _, _ in design.moved:
        if lever.name in BASES:
            decided = Lever(p.called(lever.key), lever.key)
            previous, later = (decided.value(design.at(step.value)) for step in (first, last))
            lines.append(f"{decided.name} from {previous:.5g} to {later:.5g} mm")
    return lines


def _strokes(design: Design) -> str:
    """Speeds and strokes of a design in words."""
    p, targets = design.parameters, design.targets or (design.target,)
    speed = p.speeds[0]
    if any(target.quantity == CYCLE for target in targets):
        return f"+-{speed:g} mm/s, a cycle of {p.travel:g} mm out and back"
    if any(target.stroke for target in targets):
        return f"+-{speed:g} mm/s"
    return f"{speed if p.stroke == 'out' else -speed:+g} mm/s"
