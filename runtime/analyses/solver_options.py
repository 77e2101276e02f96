"""Options of the solvers that all analyses have, and the equations that are solved with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from softehl.runtime.analyses.callbacks import Callbacks, Progress, Series
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.equations.system import System
from softehl.runtime.equations.system_builder import build_system
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.parallel.engine import AnyEngine, Engine, Serial, engine_of, note_of
from softehl.runtime.parallel.linear_solver_choice import Linear
from softehl.runtime.results.result import Result
from softehl.runtime.solve.newton import Newton


@dataclass(frozen=True)
class SolverOptions:
    """Options of `Study.solve`, `march` and other analyses that travel together.

    A keyword argument of the analysis has precedence over the options.

    Parameters
    ----------
    newton : Newton, optional
        Settings of Newton's method.
    engine : str or object, optional
        "serial", "petsc" (all processes of mpirun), or an engine with settings.
    linear : str
        Linear solver, as in `Study.solve`.
    device : str, optional
        "cuda" or "emulated", with linear="matrix-free".
    write : str or Path, optional
        A .pvd file; each converged step is written as a .vtu beside it.
    progress : bool, optional
        Report each step on stderr. Left out: in one line, if stderr is a terminal.
    record : bool
        Keep the previous steps, which derivatives need if pages have history.
    """

    newton: Newton | None = None
    engine: AnyEngine = None
    linear: Linear = "auto"
    device: str | None = None
    write: str | Path | Series | None = None
    progress: bool | None = None
    record: bool = False

    @classmethod
    def merged(cls, options: SolverOptions | None, **keywords: Any) -> SolverOptions:
        """Return options, with the keywords that differ from their default."""
        default = cls()
        values = {n: v for n, v in keywords.items() if v is not getattr(default, n)}
        return replace(options or default, **values)

    @classmethod
    def split(cls, arguments: Mapping[str, Any]) -> tuple[SolverOptions, dict[str, Any]]:
        """Return the options among the arguments of an analysis, and the other arguments."""
        others = dict(arguments)
        names = [field.name for field in fields(cls)]
        keywords = {name: others.pop(name) for name in names if name in others}
        return cls.merged(others.pop("options", None), **keywords), others

    def prepare(self, definition: ProblemDefinition) -> PreparedSystem:
        """Return the equations of a definition, distributed, with Newton's method for them.

        Raises StudyError.
        """
        engine = engine_of(self.engine, self.linear, self.device)
        if not isinstance(engine, Serial):
            _require_no_unit_cells(definition, engine)
        system = engine.distribute(build_system(definition))
        return PreparedSystem(system, engine.newton(system, self.newton), note_of(engine), self)


def _require_no_unit_cells(definition: ProblemDefinition, engine: Engine) -> None:
    """Raise StudyError for unit cells, which other engines do not have."""
    for block in definition.blocks.values():
        if isinstance(block.kernel, ModelKernel):
            raise StudyError(
                f"{block.name!r} has unit cells, which {type(engine).__name__} does not solve: "
                'leave engine out, and linear is "auto", "direct" or "amg"; processes=... of '
                "study.add shares the cells"
            )


@dataclass(frozen=True, eq=False)
class PreparedSystem:
    """Equations of a definition, distributed over processes, and how they are solved.

    solver_note: words on the linear solver, for the progress line.
    """

    system: System
    newton: Newton
    solver_note: Callable[[], str]
    options: SolverOptions

    def callbacks(
        self,
        parameter: str,
        begin: float,
        until: float | None,
        on_step: Callable[[Result], object] | None = None,
        *,
        series: Series | None = None,
    ) -> Callbacks:
        """Return the callbacks of a path.

        parameter: what grows along it, from begin to until (None: unknown). series: files of the
        results, if not those of `options.write`.
        """
        progress = None
        if self.system.comm.is_root:
            progress = Progress.on_stderr(
                self.options.progress, parameter, begin, until, note=self.solver_note
            )
        return Callbacks(progress, series or self.options.write, on_step)
