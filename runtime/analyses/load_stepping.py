"""Paths of a study in its load factor: load steps, and arc length where the load may turn back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.runtime.analyses.bifurcation import Bifurcation, Detector
from softehl.runtime.analyses.initial_state import SMALLEST, Beginning
from softehl.runtime.arrays import Array, Flags
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.rigid_body_modes import require_held
from softehl.runtime.equations.stability import warn_unstable
from softehl.runtime.equations.system import Step, System
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.tape import Trail
from softehl.runtime.solve.arclength import Arclength
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.linear.factorisation_cache import iterating
from softehl.runtime.solve.linear.linear_solver import LinearSolver, SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.singularity_check import LastFactorisation, SupportCheck
from softehl.runtime.solve.solution import Branch, LimitPoint, NotConverged, Point, Status

_NAME = "load factor"
_KEPT = 100_000
"""Unknowns: the factors of fewer take some 200 MB at most, and an adjoint then costs an eighth of a
nonlinear solution instead of a third."""


@dataclass(frozen=True, eq=False)
class LoadPath:
    """Path of `Study.follow`: converged results in order, limit points, bifurcations.

    Attributes
    ----------
    results : tuple of Result
        The points of the path.
    limits : tuple
        Points at which the load factor turns, each with `t` (the load factor), `kind` ("maximum"
        or "minimum") and `x`.
    bifurcations : tuple of Bifurcation
        In order, if `detect="bifurcation"`.
    """

    results: tuple[Result, ...]
    limits: tuple[LimitPoint, ...]
    bifurcations: tuple[Bifurcation, ...] = ()

    def __repr__(self) -> str:
        """Summary in one line."""
        ends = [result.t for result in (*self.results[:1], *self.results[-1:])]
        return (
            f"<LoadPath: {len(self.results)} results, {_NAME} "
            f"{' to '.join(f'{t:.6g}' for t in ends)}; {len(self.limits)} limits, "
            f"{len(self.bifurcations)} bifurcations>"
        )


@dataclass(eq=False)
class _Reached:
    """A study on its path: after each point history is committed, and `on_step` is told.

    x, histories: after the last point. results: all of them, or the last one. kept: the
    linear solver, whose last factors are kept. before: what the first step goes on from. record:
    results know the steps before them.
    """

    system: System
    x: Array
    histories: dict[str, Array]
    on_step: Callable[[Result], object]
    keep_all: bool = False
    kept: LastFactorisation | None = None
    before: Trail | None = None
    record: bool = False
    linear: LinearSolver | None = None
    results: list[Result] = field(default_factory=list)

    def problem_at(self, t: float) -> Problem:
        """The problem at a load factor."""
        return self.system.problem(self._step(t))

    def keep(self, point: Point) -> None:
        """Go on from a converged point."""
        step = self._step(point.parameter)
        problem = self.system.problem(step)
        before = self.results[-1].trail if self.results else self.before
        self.x = point.solution.x
        self.histories = self.system.committed(problem, self.x, self.histories)
        problem = problem.at(self.x)
        earlier = before if self.record else None
        known = earlier, self.kept, None if self.linear is None else iterating(self.linear)
        trail = Trail(self.system, step, problem, self.x, *known)
        result = Result(self.system, problem, point, self.histories, trail)
        if not self.keep_all:
            self.results.clear()
        self.results.append(result)
        self.on_step(result)

    def _step(self, t: float) -> Step:
        return self.system.still(t, self.x, self.histories)

    def require_end(self, branch: Branch) -> None:
        """Raise NotConverged where the path did not reach its end."""
        if not branch.converged:
            raise NotConverged(branch, self.results[-1] if self.results else None)


@dataclass(frozen=True, eq=False)
class LoadSteps:
    """Settings of load steps: their number; each result is handed to `on_step`.

    record: whether results keep the steps before them. before: what the first goes on from.
    """

    steps: int
    newton: Newton
    on_step: Callable[[Result], object]
    record: bool = False
    before: Trail | None = None

    def run(self, system: System, start: Beginning, until: float) -> Result:
        """The result at load factor `until`.  Raises NotConverged."""
        begin, x0, histories = start
        first_step = SupportCheck(self.newton)
        kept = first_step.memory if self.record or system.size <= _KEPT else None
        kinds = kept, self.before, self.record, self.newton.linear
        at = _Reached(system, x0, histories, self.on_step, False, *kinds)

        def keep(point: Point) -> None:
            first_step.check(at.problem_at(point.parameter), point.solution)
            at.keep(point)

        first = abs(until - begin) / self.steps or 1.0  # nowhere to go: one solution there
        with np.errstate(all="ignore"):
            require_held(system, at.problem_at(begin + (until - begin) / self.steps), x0)
        rule = StepRule(first, min(SMALLEST, first), first)
        path = Continuation(first_step.newton, rule, name=_NAME)
        at.require_end(path.follow(at.problem_at, begin, until, x0, on_point=keep))
        end = at.results[-1]
        words = f"{_NAME} {end.t:.4g}"
        near = first_step.last if end.iterations else None  # else they are of a step before
        if near is not None or system.size <= _KEPT:  # factors for this alone may be too large
            warn_unstable(end.problem, end.point.solution.x, near, words)
        return end


@dataclass(frozen=True, eq=False)
class Arc:
    """Beginning of a path by arc length: load factor, unknowns (n,), and how it leaves (n + 1,)."""

    begin: float
    x: Array
    leave: Array | None = None


@dataclass(frozen=True, eq=False)
class ArcSteps:
    """Settings of a path by arc length: longest step, points at most; each result is handed to
    `on_step`. detect: look for bifurcations.
    """

    step: float
    newton: Newton
    most: int
    on_step: Callable[[Result], object]
    detect: bool = False

    def run(self, system: System, start: Beginning, until: Callable[[Result], bool]) -> LoadPath:
        """Path of `Study.follow`.  Raises NotConverged."""
        begin, x0, histories = start
        at, first_step = (
            _Reached(system, x0, histories, self.on_step, True),
            SupportCheck(self.newton),
        )
        problem = at.problem_at(begin)
        with np.errstate(all="ignore"):
            require_held(system, problem, x0)
            first = first_step.newton.solve(problem, x0)
        if not first.converged:
            raise NotConverged(first)
        try:
            probe = replace(self._path(1.0), newton=first_step.newton)
            response = probe.response(at.problem_at, begin, first.x)
        except SingularMatrix as error:
            words = f"at the start of the path: {error}"
            raise NotConverged(replace(first, status=Status.SINGULAR, message=words)) from None
        first_step.check(problem, first)
        counted = _counted(system)
        scale = float(np.sqrt(np.mean(response[counted] ** 2))) or 1.0
        return self._followed(at, self._path(_scales(counted, scale)), Arc(begin, first.x), until)

    def leave(
        self, system: System, start: Beginning, other: Bifurcation, until: Callable[[Result], bool]
    ) -> LoadPath:
        """The branch that leaves a bifurcation.  Raises NotConverged."""
        begin, x0, histories = start
        at = _Reached(system, x0, histories, self.on_step, True)
        size = float(np.ptp(system.mesh.points, axis=0).max())
        mode = other.mode.x
        counted = _counted(system)
        scale = size * float(np.sqrt(np.mean(mode[counted] ** 2)))
        path = self._path(_scales(counted, scale), abs(begin) or 1.0)
        return self._followed(at, path, Arc(begin, x0, np.append(mode, 0.0)), until)

    def _path(self, x_scale: Array | float, parameter_scale: float = 1.0) -> Arclength:
        rule = StepRule(1e-2 * self.step, 1e-6 * self.step, self.step)
        return Arclength(
            *(self.newton, rule, x_scale, parameter_scale), max_points=self.most, name=_NAME
        )

    def _followed(
        self, at: _Reached, path: Arclength, arc: Arc, until: Callable[[Result], bool]
    ) -> LoadPath:
        detector = Detector(at.system, self.newton, skip=arc.leave is not None)

        def ends(branch: Branch) -> bool:
            if self.detect:
                detector.look(at.results, branch)
            return until(at.results[-1])

        branch = path.follow(
            at.problem_at, arc.begin, arc.x, until=ends, leave=arc.leave, on_point=at.keep
        )
        at.require_end(branch)
        return LoadPath((*at.results,), branch.limit_points, (*detector.found,))


def _counted(system: System) -> Flags:
    """Unknowns (n,) that count in the length of a path: all but the forces of ties."""
    found: Flags = np.ones(system.size, dtype=bool)
    for block in system.assembler.blocks:
        if isinstance(block.kernel, Tie):
            found[block.dofs[:, 2]] = False
    return found


def _scales(counted: Flags, scale: float) -> Array | float:
    """The scale of each unknown (n,), infinite for those that do not count."""
    return scale if counted.all() else np.where(counted, scale, np.inf)
