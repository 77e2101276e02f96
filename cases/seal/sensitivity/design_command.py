"""`softehl design`: the value of one key that gives a film a wanted change."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from softehl.cases.harness.errors import BadInput
from softehl.cases.seal.gland.fitting import DIAMETERS
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.varied import BASES, NUMBERS, PRESSURE_KEY
from softehl.cases.seal.sensitivity.design import (
    SETTLED,
    Film,
    Lever,
    Step,
    Target,
    changed,
    designed,
)
from softehl.cases.seal.sensitivity.quantities import quantities
from softehl.cases.seal.sensitivity.sensitivity import differentiation
from softehl.cases.seal.sensitivity.variation import FilmCase
from softehl.cases.seal.solve.films import NoFilm
from softehl.cases.seal.solve.method import DryContact, Judge, verdict_of_contact
from softehl.cases.seal.solve.path import StageError
from softehl.cases.seal.states.state import FilmState, Observer
from softehl.runtime.arrays import Array
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.newton import Newton, NonlinearProblem
from softehl.runtime.suggestions import meant

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
    steps: Sequence[Step]

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
    asked = DIAMETERS.get(key, key)
    base, _ = BASES.get(asked, (asked, asked))
    known = [k for k in (*NUMBERS, PRESSURE_KEY) if isinstance(getattr(p, k), float)]
    if base not in known:
        hint = f" ({INSTEAD[base]})" if base in INSTEAD else meant(base, known)
        raise BadInput(f"--by {base}{hint}: allowed: {', '.join([*known, *BASES])}")
    p = _one_film(p)
    by, wanted = Lever(asked if asked in BASES else p.called(base), base), Target.of(target)

    def solve(q: Seal) -> Film | None:
        film = HeldFilm.of(q, observer)
        return (film.state, partial(film.change, wanted.quantity, base)) if film else None

    return Design(p, wanted, by, designed(p, wanted, by, solve))


def _one_film(p: Seal) -> Seal:
    """The case of its first speed, at outstroke unless it has one stroke.  Raises BadInput."""
    stroke = "out" if p.stroke == "both" else p.stroke
    given = {"speeds": p.speeds[:1], "stroke": stroke, "error_estimate": False}
    return changed(p, "a design needs the sensitivities", **given, sensitivity=True)


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
        found = contact.adapted(p.stroke, p.speeds[0])
        if isinstance(found, NoFilm):
            return None
        judge = Judge(verdict_of_contact(contact.system, contact.x), differentiation(p))
        film, state = found.film, judge.state(found, None)
        observer.film_state(state)
        return cls(FilmCase(film.system, film.loads), film.x, contact.newton, state)

    def change(self, quantity: str, key: str, factor: float) -> float | None:
        """A quantity over its value here, where a key is `factor` times as large; None if that film
        is not reached from this one.
        """

        def problem_at(logarithm: float) -> NonlinearProblem:
            return self.case.scaled(key, math.expm1(logarithm)).problem

        # a hundredth of a millimetre is many films; the least step moves a quantity that follows
        # tenfold by `SETTLED`
        way, least = math.log(factor), 0.1 * SETTLED
        path = Continuation(self.newton, StepRule(max(abs(way), least), least), name=key)
        branch = path.follow(problem_at, 0.0, way, self.x)
        if not branch.converged:
            return None
        there = quantities(self.case.scaled(key, factor - 1.0), branch.last.x)
        return there[quantity].value / quantities(self.case, self.x)[quantity].value


def told(design: Design) -> list[str]:
    """A design in words: its steps, and what it comes to."""
    p, target, steps = design.parameters, design.target, design.steps
    first, last = steps[0], steps[-1]
    sign = 1.0 if p.stroke == "out" else -1.0
    name, unit = design.by.name, f" {design.by.unit}".rstrip()
    values = [design.measure(step.value) for step in steps]
    lines = [f"p_s = {p.sealed_pressure:g} MPa, U = {sign * p.speeds[0]:+g} mm/s"]
    lines += [
        f"  {name} = {value:.8g}{unit}: {target.told(step.quantity)}"
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
        before, after = (decided.value(design.at(step.value)) for step in (first, last))
        lines.append(f"{decided.name} from {before:.5g} to {after:.5g} mm")
    return lines
