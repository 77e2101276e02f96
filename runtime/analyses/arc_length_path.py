"""Path by arc length: it passes limit points of the load, and locates bifurcations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from softehl.runtime.analyses.bifurcation import Bifurcation, BifurcationDetector, require_detect
from softehl.runtime.analyses.initial_state import InitialState, initial_state
from softehl.runtime.analyses.load_stepping import LOAD_FACTOR, LoadHistory
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.arrays import Array, Flags
from softehl.runtime.definition.argument_checks import finite, function
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.equations.rigid_body_modes import require_supported
from softehl.runtime.equations.system import System
from softehl.runtime.results.plotting import plot_path
from softehl.runtime.results.result import Result
from softehl.runtime.solve.arclength import Arclength
from softehl.runtime.solve.continuation import StepRule
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.singularity_check import SupportCheck
from softehl.runtime.solve.solution import Branch, LimitPoint, NotConverged, Status


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
        bounds = [result.t for result in (*self.results[:1], *self.results[-1:])]
        return (
            f"<LoadPath: {len(self.results)} results, {LOAD_FACTOR} "
            f"{' to '.join(f'{t:.6g}' for t in bounds)}; {len(self.limits)} limits, "
            f"{len(self.bifurcations)} bifurcations>"
        )

    def plot(self, name: str, at: Sequence[float], *, file: str | Path | None = None) -> None:
        """Show the load factor over an unknown, with the limit points, or write it to a file.

        Parameters
        ----------
        name : str
            Unknown.
        at : sequence of float
            Place of a node.
        file : str or Path, optional
            Picture to write, such as "path.png"; left out, it is shown.

        Raises
        ------
        StudyError
            The path has no results.
        MeshError
            There is no node.
        UnknownNameError
            There is no such unknown; a KeyError.
        PictureError
            The file has another ending.
        MissingPyvista
            PyVista is not installed.
        """
        plot_path(self.results, self.limits, name, at, file)


def follow(
    definition: ProblemDefinition,
    *,
    step: float,
    until: Callable[[Result], bool],
    start: Result | Bifurcation | None = None,
    detect: Literal["bifurcation"] | None = None,
    max_points: int = 1000,
    options: SolverOptions,
) -> LoadPath:
    """Return the path from load factor 0, or from `start`, by arc length; see `Study.follow`."""
    if finite("step", step) <= 0.0:
        raise StudyError(f"step = {step}: must be positive")
    function("until", until, "result")
    require_detect(detect)
    linear = options.linear
    if linear in ("amg", "matrix-free"):  # these need a tangent that is positive definite
        raise StudyError(f'follow takes no linear = "{linear}", it factorises; leave it out')
    if options.engine is not None:
        raise StudyError("follow takes no engine; leave it out")
    if linear == "auto" and options.newton is None:
        options = replace(options, linear="direct")
    prepared = options.prepare(definition)
    system, newton = prepared.system, prepared.newton
    other_branch = start if isinstance(start, Bifurcation) else None
    initial = initial_state(system, start.state if isinstance(start, Bifurcation) else start)
    with prepared.callbacks(LOAD_FACTOR, initial.t, None) as callbacks:
        history = LoadHistory.begin(system, initial, callbacks, keep_all=True)
        rule = StepRule(1e-2 * step, 1e-6 * step, step)
        arclength = Arclength(newton, rule, max_points=max_points, name=LOAD_FACTOR)
        if other_branch is None:
            arclength, x = _scaled_by_response(arclength, history, initial, newton)
            leave = None
        else:
            arclength, x = _scaled_by_mode(arclength, system, initial, other_branch), initial.x
            leave = np.append(other_branch.mode.x, 0.0)
        detector = BifurcationDetector(system, newton, skip=leave is not None)

        def path_ends(branch: Branch) -> bool:
            if detect is not None:
                detector.look(history.results, branch)
            return until(history.results[-1])

        branch = arclength.follow(
            history.problem_at, initial.t, x, until=path_ends, leave=leave, on_point=history.commit
        )
        history.require_end(branch)
        return LoadPath((*history.results,), branch.limit_points, (*detector.bifurcations,))


def _scaled_by_response(
    arclength: Arclength, history: LoadHistory, initial: InitialState, newton: Newton
) -> tuple[Arclength, Array]:
    """Scale unknowns by their change per load factor; also the solution (n,) at the start.

    Raises NotConverged.
    """
    system, first_step = history.system, SupportCheck(newton)
    problem = history.problem_at(initial.t)
    with np.errstate(all="ignore"):
        require_supported(system, problem, initial.x)
        first = first_step.newton.solve(problem, initial.x)
    if not first.converged:
        raise NotConverged(first)
    try:
        probe = replace(arclength, newton=first_step.newton)
        response = probe.response(history.problem_at, initial.t, first.x)
    except SingularMatrix as error:
        message = f"at the start of the path: {error}"
        raise NotConverged(replace(first, status=Status.SINGULAR, message=message)) from None
    first_step.check(problem, first)
    counted = _counted(system)
    scale = float(np.sqrt(np.mean(response[counted] ** 2))) or 1.0
    return replace(arclength, x_scale=_scales(counted, scale)), first.x


def _scaled_by_mode(
    arclength: Arclength, system: System, initial: InitialState, bifurcation: Bifurcation
) -> Arclength:
    """Scale displacements by the size of the mesh, the load factor by that of a bifurcation."""
    size = float(np.ptp(system.mesh.points, axis=0).max())
    counted = _counted(system)
    scale = size * float(np.sqrt(np.mean(bifurcation.mode.x[counted] ** 2)))
    scales = _scales(counted, scale)
    return replace(arclength, x_scale=scales, parameter_scale=abs(initial.t) or 1.0)


def _counted(system: System) -> Flags:
    """Unknowns (n,) that count in the length of a path: all but the forces of ties."""
    counted: Flags = np.ones(system.size, dtype=bool)
    for block in system.assembler.blocks:
        if isinstance(block.kernel, Tie):
            counted[block.dofs[:, 2]] = False
    return counted


def _scales(counted: Flags, scale: float) -> Array | float:
    """The scale of each unknown (n,), infinite for those that do not count."""
    return scale if counted.all() else np.where(counted, scale, np.inf)
