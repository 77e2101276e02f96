"""The beginning of a motion, and the march of a study by a method of second order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from softehl.runtime.analyses.equations_of_motion import Body
from softehl.runtime.analyses.explicit_dynamics import explicit
from softehl.runtime.analyses.implicit_dynamics import Implicit, Phase
from softehl.runtime.analyses.initial_state import beginning
from softehl.runtime.analyses.motion import Motion
from softehl.runtime.analyses.time_integrators import METHODS, Backward, Scheme, scheme_of
from softehl.runtime.arrays import Array
from softehl.runtime.definition.argument_checks import datum, known
from softehl.runtime.definition.problem_definition import Datum, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.equations.system import Step, System
from softehl.runtime.results.result import Result
from softehl.runtime.solve.newton import Newton

_MOMENT = 1e-6  # of a step: how fast supports move at the start is a difference over that
_SHORT = 0.1  # of a step: shorter ones find a consistent start, but for an error of this order
_SLOW = 0.01
"""Of the time 1 / w of the fastest motion of the mesh: such short steps move places by an error of
the square of that, relative to what accelerations do. At 0.1 a slow load on a stiff body began with
1e-2 of the accelerations in error; smaller ones lose digits.
"""


@dataclass(frozen=True)
class Motions:
    """A march of second order as it was asked for; see `Study.march`."""

    method: str
    dt: float
    newton: Newton
    mass: Masses | None = None
    velocity: Mapping[str, Datum] | None = None
    rho_inf: float | None = None

    def run(self, system: System, start: Result | None, until: float) -> Iterator[Motion]:
        """Results of the steps.  Raises StudyError, NotConverged."""
        scheme = scheme_of(self.method, self.rho_inf)
        t, x, histories = beginning(system, start)
        if until <= t:
            raise StudyError(f"until = {until:g}: must be after the start, which is t = {t:g}")
        v = self._velocities(system, start)
        rest = Step(t, 1.0, x, 0.0, v, self.dt, histories)
        body = Body.of(system, self.mass, scheme, rest)
        if (
            scheme is not None
            and isinstance(start, Motion)
            and self._goes_on(system, start, scheme)
        ):
            run = Implicit(scheme, self.dt, self.newton).run
            if system.share.pieces[1] > 1:  # of which each has its own unknowns
                a = _nodal_rates(system, start, start.acceleration)
                return run(body, Phase(t, x, v, a, histories), until)
            here = Phase(t, start.x, start.v, start.a, histories)
            return run(body, here, until, system.share.part(start.problem))
        problem = body.at_end(rest, v)
        x = problem.admissible(x)
        soon = system.part(Step(t + _MOMENT * self.dt, 1.0, x, 0.0, v, self.dt, histories))
        v[problem.fixed] = (soon.values - problem.values) / (_MOMENT * self.dt)
        v[~body.heavy] = 0.0
        here = Phase(t, x, v, np.zeros_like(x), histories)
        if scheme is None:
            problem = body.at_end(here.standing(self.dt), v)
            return explicit(self.dt, body, here, problem).started(problem, until)
        if system.share.largest(float(body.constrained.any())):
            here = self._consistent(system, body, here)
        elif system.share.largest(float(body.algebraic(problem).any())):
            here = replace(here, x=self._balanced(body, problem, x))
        problem = body.at_end(here.standing(self.dt), here.v)
        begin = replace(here, a=body.started(problem, here.x))
        return Implicit(scheme, self.dt, self.newton).run(body, begin, until)

    def _goes_on(self, system: System, start: Motion, scheme: Scheme) -> bool:
        """True if the start is a motion of the same study by the same scheme, which goes on as if
        it had not stopped.
        """
        if start.scheme != scheme or self.velocity:
            return False
        before = start.system
        same = before.statement is system.statement and before.written == system.written
        if start.mass is not self.mass and repr(start.mass) != repr(self.mass):
            return False
        return same and system.statement is not None

    def _consistent(self, system: System, body: Body, here: Phase) -> Phase:
        """The beginning that supports, ties and contacts admit, with the unknowns without mass.

        Of three short steps of backward Euler the first finds the places, the second, again with
        the given velocities, the velocities, and the third the forces.
        """
        h = min(_SHORT * self.dt, _SLOW / body.fastest(here.standing(self.dt)))
        short = Body.of(system, self.mass, Backward(), here.standing(self.dt))
        place, _ = self._short(short, here, h)
        second, v = self._short(short, replace(place, v=here.v), h)
        third, after = self._short(short, replace(second, v=v), h)
        x = np.where(body.heavy, place.x - h * v, third.x)
        return replace(here, x=x, v=2.0 * v - after)

    def _balanced(self, body: Body, problem: Problem, x: Array) -> Array:
        """Unknowns x, (n,), in which those without mass satisfy their equations."""
        moving = np.flatnonzero(body.heavy)
        fixed = np.union1d(problem.fixed, moving)
        asked = replace(problem, fixed=fixed, values=x[fixed])
        with np.errstate(all="ignore"):
            solution = self.newton.solve(body.share.posed(asked), x)
        return solution.x if solution.converged else x

    def _short(self, body: Body, here: Phase, h: float) -> tuple[Phase, Array]:
        """The end of a step of length h, and the velocities there.  Raises StudyError."""
        state = (h, here.x, here.v, here.a)
        rate, inertial = Backward().rate(*state), body.masked(Backward().inertial(*state))
        step = replace(
            here.step(here.t + h),
            rate=rate.c,
            rest=rate.rest,
            acceleration=inertial.c,
            remainder=inertial.rest,
        )
        problem = body.moving.share.posed(body.problem(step, 1.0, 0.0 * here.x))
        with np.errstate(all="ignore"):
            solution = self.newton.solve(problem, here.x)
        if not solution.converged:
            raise StudyError(
                f"t = {here.t:.6g}: no accelerations at the start go with its supports, ties and "
                f"contacts: {solution.message}"
            )
        v = np.where(body.heavy, rate.at(solution.x), 0.0)
        return replace(here, t=here.t + h, x=solution.x), v

    def _velocities(self, system: System, start: Result | None) -> Array:
        """Velocities at the start, (n,): those of `start`, and those that are given."""
        found, nodal = np.zeros(system.size), system.numbering.nodal
        if isinstance(start, Motion):
            found = _nodal_rates(system, start, start.velocity)
        given = self.velocity or {}
        known("unknown", given, nodal, "velocity")
        for name, numbers in nodal.items():
            there = numbers >= 0
            if name in given:
                places = system.mesh.points[there]
                found[numbers[there]] = datum("velocity", name, given[name], places)
        return found


def _nodal_rates(system: System, start: Motion, rates: Callable[[str], Array]) -> Array:
    """Rates (n,) of the unknowns of a system, by their names at the nodes of a motion."""
    found = np.zeros(system.size)
    for name, numbers in system.numbering.nodal.items():
        if name in start.system.numbering.nodal:
            there = numbers >= 0
            found[numbers[there]] = np.nan_to_num(rates(name)[there])
    return found


def require_no_inertia(method: str, system: System) -> None:
    """Raise StudyError where a page has accelerations."""
    for block in system.blocks.values():
        if block.accelerations:
            raise StudyError(
                f'{block.name!r} has accelerations, method = "{method}" has none: allowed are '
                + ", ".join(f'"{name}"' for name in METHODS)
            )
