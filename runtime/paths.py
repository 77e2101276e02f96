"""Paths of a study: load steps, marches in time, arc length; cells of materials, buckling."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal, cast

import numpy as np

from softehl.runtime.arrays import count_of
from softehl.runtime.begin import beginning
from softehl.runtime.bifurcation import Bifurcation, require_detect
from softehl.runtime.buckling import Buckling, linear_buckling
from softehl.runtime.derivatives.trail import continued
from softehl.runtime.dynamics.schemes import METHODS, require_method, require_none
from softehl.runtime.dynamics.schemes import Method as Dynamic
from softehl.runtime.dynamics.start import Motions, require_no_inertia
from softehl.runtime.engines.engine import AnyEngine, engine_of, note_of
from softehl.runtime.engines.sizes import Linear
from softehl.runtime.equations import equations
from softehl.runtime.load import ArcSteps, LoadPath, LoadSteps
from softehl.runtime.march import Clock, March, Method
from softehl.runtime.mass import Masses
from softehl.runtime.periodic import Cell, periodic
from softehl.runtime.result import Modes, Result
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point, Solution, Status
from softehl.runtime.statement import given as read
from softehl.runtime.statement.records import Datum, Statement, StudyError, Where
from softehl.runtime.system import System
from softehl.runtime.watch import Series, Telling, Watch, watched

_BALANCED = 1e-6
"""Of the forces: a state whose residuals are smaller is one of equilibrium."""


class Paths:
    """Base of `Study`: what can be solved once it is written down."""

    _statement: Statement

    def system(self, fields: Mapping[str, Sequence[str]] | None = None) -> System:
        """Equations of the study.  Raises StudyError for what does not fit together.

        fields: name of a field -> its unknowns, which are then numbered node by node, the fields in
        this order and before all other unknowns; left out, each unknown is a field.
        """
        return equations(self._statement, fields)

    def solve(
        self,
        *,
        steps: int = 1,
        until: float = 1.0,
        start: Result | None = None,
        newton: Newton | None = None,
        on_step: Callable[[Result], object] | None = None,
        engine: AnyEngine = None,
        linear: Linear = "auto",
        write: str | Path | Series | None = None,
        progress: bool | None = None,
        record: bool = False,
    ) -> Result:
        """The solution at load factor `until`, from 0 (or from `start`) in `steps` steps.

        start: a result of this or another study on the same mesh, whose values, history and load
        factor the path begins with; the equations are those of this study. If `until` is the
        load factor of the start, they are solved there once. Steps are cut where Newton's method
        fails and grow again; history is committed after each. on_step is given the result of every
        converged step, write: a .pvd file that names them all. progress: tell of each step on
        stderr; None: in one line, on a terminal only. engine: "serial", "petsc" (on all processes
        that mpirun started) or an engine with settings. linear: "direct", "superlu" and "pardiso"
        factorise; "amg" is algebraic multigrid (pyamg) for displacements or one scalar; "auto"
        takes it for large problems; "matrix-free" needs no matrix (docs/matrix-free.md). record:
        results keep the steps before them, which derivatives need where pages have history, and
        the last factors of large problems, which saves time.
        Raises StudyError; NotConverged if the end is not reached: its `reached` is the last Result,
        or None.
        """
        count = count_of(steps)
        if count is None:
            raise StudyError(f"steps = {steps!r}: a whole number of at least 1 is needed")
        until = read.finite("until", until)
        if on_step is not None:
            read.function("on_step", on_step, "result")
        where = engine_of(engine, linear)
        system = where.spread(self.system())
        begin, before = beginning(system, start), continued(system, start.trail if start else None)
        newton = where.newton(system, newton)
        told = Telling(progress, system.share.first, "load factor", begin[0], note_of(where))
        with Watch(told.until(until), write, on_step) as watch:
            path = LoadSteps(count, newton, watch, record, before)
            return path.run(system, begin, until)

    def march(
        self,
        *,
        dt: float,
        until: float,
        method: Method | Dynamic = "euler",
        mass: Masses | None = None,
        velocity: Mapping[str, Datum] | None = None,
        rho_inf: float | None = None,
        tolerance: float | None = None,
        start: Result | None = None,
        checkpoint: str | Path | None = None,
        restart: str | Path | None = None,
        newton: Newton | None = None,
        engine: AnyEngine = None,
        linear: Linear = "auto",
        write: str | Path | None = None,
        progress: bool | None = None,
        record: bool = False,
    ) -> Iterator[Result]:
        """Results of the steps in time up to `until`, from 0 or where `start` or `restart` stands.

        dt: length of the (first) step. start: a result, as in `solve`. method: "euler" (backward)
        or "bdf2"; with inertia "generalised-alpha", "newmark" (trapezoidal rule), "midpoint"
        (conserves energy) or "explicit" (central differences, as many steps from result to result
        as are stable): results are then `Motion`, with velocities, accelerations and energies.
        mass: densities by block, as of `Result.modes`; velocity: unknown -> at the start, a number
        or a function of places; rho_inf: see generalised-alpha, 0.8 if left out. tolerance: largest
        local error of a step, relative to the largest value of each unknown (of those with a rate,
        where there are any); steps then adapt, else they are dt, but for those that Newton's method
        needs shorter. History is committed and values of steps before (data u_old, `Model.rates`)
        are renewed after every converged step.
        checkpoint: file that is rewritten after each step; restart: such a file of the same mesh,
        pages and unknowns, from which the march goes on bitwise as if it had not stopped, with
        `engine` "petsc" on any number of processes; another `dt` than then is the next step.
        write: a .pvd file that names the results of all steps (with start or restart, it
        goes on). linear, progress, record: as in `solve`. Raises StudyError, and NotConverged as
        `solve` does.
        """
        require_method(method, ("euler", "bdf2"))
        for name, value in (("dt", dt), ("until", until), ("tolerance", tolerance)):
            if value is not None and read.finite(name, value) <= 0.0:
                raise StudyError(f"{name} = {value}: must be positive")
        if start is not None and restart is not None:
            raise StudyError("start and restart: give one of them, a result or a checkpoint")
        if method in METHODS:
            refused = {"tolerance": tolerance, "checkpoint": checkpoint, "restart": restart}
            require_none(method, refused)
        where = engine_of(engine, linear)
        if method in METHODS:
            system = where.spread(self.system())
            motions = Motions(method, dt, where.newton(system, newton), mass, velocity, rho_inf)
            begin = 0.0 if start is None else start.t
            told = Telling(progress, system.share.first, "t", begin, note_of(where))
            found = motions.run(system, start, until)
            return watched(found, Watch(told.until(until), write))
        require_none(method, {"mass": mass, "velocity": velocity, "rho_inf": rho_inf})
        system = where.spread(self.system())
        if checkpoint is not None or restart is not None:
            system.mesh.require_whole("checkpoint and restart")
        require_no_inertia(method, system)
        if restart is None:
            clock = Clock.begin(system, start, dt)
        else:
            clock = Clock.load(Path(restart), system, dt)
        clock.require_before(until)
        before, newton = (
            continued(system, start.trail if start else None),
            where.newton(system, newton),
        )
        settings = March(cast(Method, method), tolerance, dt, newton, record, before)
        file = None
        if checkpoint is not None:
            file = read.writable(f"checkpoint = {str(checkpoint)!r}", Path(checkpoint))
        series = None if write is None else Series(Path(write), clock.t if clock.t > 0.0 else None)
        told = Telling(progress, system.share.first, "t", clock.t, note_of(where))
        return watched(settings.run(system, clock, until, file), Watch(told.until(until), series))

    def follow(
        self,
        *,
        step: float,
        until: Callable[[Result], bool],
        start: Result | Bifurcation | None = None,
        detect: Literal["bifurcation"] | None = None,
        newton: Newton | None = None,
        most: int = 1000,
        linear: Linear = "auto",
        write: str | Path | None = None,
        progress: bool | None = None,
    ) -> LoadPath:
        """The path from load factor 0 on, by arc length: it passes limit points of the load.

        start: a result to begin with, as in `solve`, or a bifurcation, whose other branch is
        followed; `start.reversed` is the other side of it. detect="bifurcation": look for them, at
        the cost of a factorisation a point; the path has `bifurcations`. step: length of the
        longest step, the first is a hundredth of it. Steps are cut where the path bends, so that it
        does not depend on them: see docs/study.md. A length counts the load factor, and the
        unknowns in units of what they change by per load factor in the beginning; from a
        bifurcation the load factor relative to
        that, and displacements relative to the size of the mesh. until: is given each result; the
        path ends where it says True. most: points at most. History is committed after each point.
        linear: one that factorises. write, progress: as in `solve`. Raises StudyError; NotConverged
        if the end is not reached: its `reached` is the last Result, or None.
        """
        if read.finite("step", step) <= 0.0:
            raise StudyError(f"step = {step}: must be positive")
        read.function("until", until, "result")
        require_detect(detect)
        if linear in ("amg", "matrix-free"):  # these need a tangent that is positive definite
            raise StudyError(f'follow takes no linear = "{linear}", it factorises; leave it out')
        where = engine_of(None, "direct" if linear == "auto" and newton is None else linear)
        other = start if isinstance(start, Bifurcation) else None
        system = where.spread(self.system())
        begin = beginning(system, start.state if isinstance(start, Bifurcation) else start)
        newton = where.newton(system, newton)
        told = Telling(progress, True, "load factor", begin[0], note_of(where))
        with Watch(told.until(None), write) as watch:
            path = ArcSteps(step, newton, most, watch, detect is not None)
            if other is not None:
                return path.leave(system, begin, other, until)
            return path.run(system, begin, until)

    def periodic(self, *pairs: tuple[Where, Where], tolerance: float = 1e-6) -> Cell:
        """The study as a cell of a periodic material: opposite sides, a pair for each direction.

        `solve(F)` of it gives the mean stress P and its tangent A. Sides of a pair must have the
        same nodes but for a shift; `tolerance` is relative to their size. Raises StudyError.
        """
        return periodic(self._statement, self.system(), pairs, tolerance)

    def modes(
        self,
        count: int = 6,
        *,
        mass: Masses | None = None,
        start: Result | None = None,
        engine: AnyEngine = None,
        linear: Linear = "auto",
    ) -> Modes:
        """Natural modes at rest, or about `start` (a result), the lowest first.

        A body that nothing holds has its rigid motions first, of frequency zero: three in the
        plane, six in space. mass: as of `Result.modes`. engine, linear: as in `solve`. Raises
        StudyError, also where the study is not in equilibrium at rest.
        """
        where = engine_of(engine, linear)
        where.newton(system := where.spread(self.system()), None)
        t, x, histories = beginning(system, start)
        problem = system.problem(system.still(t, x, histories))
        with np.errstate(all="ignore"):
            off = problem.measure(x, problem.linearise(x)[1], rounded=True)
        if not off <= _BALANCED:
            raise StudyError(
                f"modes({count}): loads or prescribed values are not zero at load factor {t:g}; "
                "solve for the state first, study.solve(until=...).modes(...)"
            )
        solution = Solution(x, Status.CONVERGED, "", (), 0, 0)
        return Result(system, problem, Point(t, solution), histories).modes(count, mass=mass)

    def buckling(
        self,
        count: int = 1,
        *,
        start: Result | None = None,
        newton: Newton | None = None,
        engine: AnyEngine = None,
    ) -> Buckling:
        """The smallest load factors of linear buckling, and their modes.

        The tangent at rest, or at the load of `start` (a result), changes as along the linear
        response to loads and prescribed values that grow in proportion; where it becomes singular
        is a factor. Closer to the truth from a start near by. engine: as in `solve`. Raises
        StudyError, NotConverged.
        """
        where = engine_of(engine)
        system = where.spread(self.system())
        return linear_buckling(
            system, beginning(system, start), count, where.newton(system, newton)
        )
