"""Paths of a study: load steps, marches in time, arc length; cells of materials, buckling."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal, cast

import numpy as np

from softehl.runtime.analyses.bifurcation import Bifurcation, require_detect
from softehl.runtime.analyses.buckling import Buckling, linear_buckling
from softehl.runtime.analyses.callbacks import Series, Telling, Watch, watched
from softehl.runtime.analyses.dynamics import Motions, require_no_inertia
from softehl.runtime.analyses.homogenisation import Cell, periodic
from softehl.runtime.analyses.initial_state import beginning
from softehl.runtime.analyses.load_stepping import ArcSteps, LoadPath, LoadSteps
from softehl.runtime.analyses.time_integrators import METHODS, require_method, require_none
from softehl.runtime.analyses.time_integrators import Method as Dynamic
from softehl.runtime.analyses.time_stepping import Clock, March, Method
from softehl.runtime.arrays import count_of
from softehl.runtime.definition import argument_checks as read
from softehl.runtime.definition.problem_definition import Datum, Statement, StudyError, Where
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.equations.system import System
from softehl.runtime.equations.system_builder import equations
from softehl.runtime.parallel.engine import AnyEngine, engine_of, note_of
from softehl.runtime.parallel.linear_solver_choice import Linear
from softehl.runtime.results.result import Modes, Result
from softehl.runtime.sensitivity.tape import continued
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point, Solution, Status

_BALANCED = 1e-6
"""Of the forces: a state whose residuals are smaller is one of equilibrium."""


class Paths:
    """Base of `Study`: what can be solved once it is written down."""

    _statement: Statement

    def system(self, fields: Mapping[str, Sequence[str]] | None = None) -> System:
        """Return the discrete equations of the study.

        Parameters
        ----------
        fields : mapping of str to sequence of str, optional
            Name of a field -> its unknowns, which are numbered node by node, the fields in this
            order and before all other unknowns. Left out, each unknown is a field.

        Returns
        -------
        System
            Equations with their numbering of unknowns.

        Raises
        ------
        StudyError
            Statements contradict each other.
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
        """Return the solution at load factor `until`, reached in load steps.

        Parameters
        ----------
        steps : int
            Number of load steps. They are cut where Newton's method fails, and grow again.
        until : float
            Load factor at the end.
        start : Result, optional
            A result of this or another study on the same mesh, which gives initial values, history
            and load factor; the equations are those of this study. If `until` is its load factor,
            the equations are solved there once.
        newton : Newton, optional
            Settings of Newton's method.
        on_step : callable, optional
            Called with the Result of each converged step.
        engine : str or object, optional
            "serial", "petsc" (all processes of mpirun), or an engine with settings.
        linear : str
            Linear solver. "direct", "superlu" and "pardiso" factorise; "amg" is algebraic multigrid
            (pyamg) for displacements or one scalar; "matrix-free" assembles no matrix; "auto"
            selects by the size of the problem.
        write : str or Path, optional
            A .pvd file; each converged step is written as a .vtu beside it.
        progress : bool, optional
            Report each step on stderr. Left out: in one line, if stderr is a terminal.
        record : bool
            Keep the previous steps, which derivatives need if pages have history, and the last
            factors of large problems.

        Returns
        -------
        Result
            The state at the end.

        Raises
        ------
        StudyError
            An argument is not allowed, or nothing prevents a rigid motion.
        NotConverged
            The end is not reached; its `reached` is the last Result, or None.
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
        """Yield the results of time steps up to `until`.

        Parameters
        ----------
        dt : float
            Length of a step, of the first one if steps adapt to `tolerance` [s].
        until : float
            Time at the end [s].
        method : str
            "euler" (backward) or "bdf2". With inertia: "generalised-alpha", "newmark" (trapezoidal
            rule), "midpoint" (conserves energy) or "explicit" (central differences, with as many
            stable steps as a result needs); results are then `Motion`.
        mass : mapping, optional
            Densities by block, as of `Result.modes`; for methods with inertia.
        velocity : mapping of str to float or callable, optional
            Unknown -> initial velocity, a number or a function of coordinates (n, dim); for methods
            with inertia.
        rho_inf : float, optional
            Spectral radius of generalised-alpha at infinite frequency, in [0, 1]; 0.8 if left out.
        tolerance : float, optional
            Largest local error of a step, relative to the largest value of each unknown (of those
            with a rate, if there are any). Steps adapt to it. Left out, they are `dt`, or shorter
            where Newton's method fails.
        start : Result, optional
            State at the beginning, as in `solve`.
        checkpoint : str or Path, optional
            File that is rewritten after each step.
        restart : str or Path, optional
            A checkpoint of the same mesh, pages and unknowns. The march continues bitwise as if it
            had not stopped, with engine "petsc" on any number of processes. Another `dt` than
            before is the length of the next step.
        newton : Newton, optional
            Settings of Newton's method.
        engine : str or object, optional
            As in `solve`.
        linear : str
            As in `solve`.
        write : str or Path, optional
            As in `solve`; with `start` or `restart` the series continues.
        progress : bool, optional
            As in `solve`.
        record : bool
            As in `solve`.

        Yields
        ------
        Result
            State after each step; a `Motion` with inertia.

        Raises
        ------
        StudyError
            An argument is not allowed, or belongs to another method.
        NotConverged
            As in `solve`.

        Notes
        -----
        After each converged step history is committed, and values of the previous step (data u_old,
        `Model.rates`) are renewed.
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
        """Return the path from load factor 0 on by arc length; it passes limit points of the load.

        Parameters
        ----------
        step : float
            Longest arc length of a step; the first is a hundredth of it.
        until : callable
            Called with each Result; the path ends where it returns True.
        start : Result or Bifurcation, optional
            A result to begin with, as in `solve`; or a bifurcation, whose other branch is followed
            (`start.reversed`: to its other side).
        detect : str, optional
            "bifurcation": locate bifurcations, at the cost of a factorisation for each point. They
            are in `bifurcations` of the path.
        newton : Newton, optional
            Settings of Newton's method.
        most : int
            Largest number of points.
        linear : str
            A linear solver that factorises.
        write : str or Path, optional
            As in `solve`.
        progress : bool, optional
            As in `solve`.

        Returns
        -------
        LoadPath
            Results in order, limit points and bifurcations.

        Raises
        ------
        StudyError
            An argument is not allowed.
        NotConverged
            The end is not reached; its `reached` is the last Result, or None.

        Notes
        -----
        The arc length counts the load factor, and the unknowns in units of their initial change per
        load factor; from a bifurcation on, the load factor relative to that of the bifurcation and
        displacements relative to the size of the mesh. Steps are cut where the path bends, so that
        the path does not depend on `step` (docs/study.md). History is committed after each point.
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
        """Return the study as a unit cell of a periodic material.

        Parameters
        ----------
        *pairs : tuple of two sides
            Opposite sides, a pair for each direction.
        tolerance : float
            Largest distance of partner nodes after a shift, relative to the size of the sides.

        Returns
        -------
        Cell
            `solve(F)` of it gives the mean stress P and its tangent A.

        Raises
        ------
        StudyError
            Sides of a pair have different nodes.
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
        """Return natural modes at rest, or about a state, the lowest first.

        Parameters
        ----------
        count : int
            Number of modes.
        mass : mapping, optional
            Densities by block, as of `Result.modes`.
        start : Result, optional
            State about which the modes are; at rest if left out.
        engine : str or object, optional
            As in `solve`.
        linear : str
            As in `solve`.

        Returns
        -------
        Modes
            Frequencies and shapes. An unconstrained body has its rigid motions first, of frequency
            zero: three in 2-D, six in 3-D.

        Raises
        ------
        StudyError
            The state is not in equilibrium, or the body has no mass.
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
        """Return the smallest load factors of linear buckling, with their modes.

        Parameters
        ----------
        count : int
            Number of factors.
        start : Result, optional
            State at which the tangent is linearised; at rest if left out. Factors are more exact
            for a state near them.
        newton : Newton, optional
            Settings of Newton's method.
        engine : str or object, optional
            As in `solve`.

        Returns
        -------
        Buckling
            Load factors, rising, and their modes.

        Raises
        ------
        StudyError
            An argument is not allowed, or nothing prevents a rigid motion.
        NotConverged
            The linear response is not found.

        Notes
        -----
        The tangent changes as along the linear response to loads and prescribed values that grow in
        proportion; a factor is where it becomes singular.
        """
        where = engine_of(engine)
        system = where.spread(self.system())
        return linear_buckling(
            system, beginning(system, start), count, where.newton(system, newton)
        )
