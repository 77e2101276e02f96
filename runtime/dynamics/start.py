"""The beginning of a motion, and the march of a study by a method of second order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.begin import beginning
from softehl.runtime.dynamics.body import Body
from softehl.runtime.dynamics.explicit import explicit
from softehl.runtime.dynamics.implicit import Implicit, Phase
from softehl.runtime.dynamics.motion import Motion
from softehl.runtime.dynamics.schemes import METHODS, scheme_of
from softehl.runtime.mass import Masses
from softehl.runtime.result import Result
from softehl.runtime.solve.newton import Newton
from softehl.runtime.statement.given import datum, known
from softehl.runtime.statement.records import Datum, StudyError
from softehl.runtime.system import Step, System

_MOMENT = 1e-6  # of a step: how fast supports move at the start is a difference over that


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
        problem = body.at_end(rest, v)
        x = problem.admissible(x)
        soon = system.part(Step(t + _MOMENT * self.dt, 1.0, x, 0.0, v, self.dt, histories))
        v[problem.fixed] = (soon.values - problem.values) / (_MOMENT * self.dt)
        v[~body.heavy] = 0.0
        problem = body.at_end(Step(t, 1.0, x, 0.0, v, self.dt, histories), v)
        if scheme is None:
            here = Phase(t, x, v, np.zeros_like(x), histories)
            return explicit(self.dt, body, here, problem).started(problem, until)
        begin = Phase(t, x, v, body.started(problem, x), histories)
        return Implicit(scheme, self.dt, self.newton).run(body, begin, until)

    def _velocities(self, system: System, start: Result | None) -> Array:
        """Velocities at the start, (n,): those of `start`, and those that are given."""
        found, nodal = np.zeros(system.size), system.numbering.nodal
        given = self.velocity or {}
        known("unknown", given, nodal, "velocity")
        for name, numbers in nodal.items():
            there = numbers >= 0
            if isinstance(start, Motion) and name in start.system.numbering.nodal:
                found[numbers[there]] = np.nan_to_num(start.velocity(name)[there])
            if name in given:
                places = system.mesh.points[there]
                found[numbers[there]] = datum("velocity", name, given[name], places)
        return found


def require_no_inertia(method: str, system: System) -> None:
    """Raise StudyError where a page has accelerations."""
    for block in system.blocks.values():
        if block.accelerations:
            raise StudyError(
                f'{block.name!r} has accelerations, method = "{method}" has none: allowed are '
                + ", ".join(f'"{name}"' for name in METHODS)
            )
